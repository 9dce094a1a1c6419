//! A motion over time: prescribed joint motion or joint torques in, everything observable out.

use crate::motion::joint::JointMotion;
use crate::reduced::table::{Filler, Prescribed};
use crate::sim::flight;
use crate::sim::flight::{Flight, Moment, Reading, Sink, Span};
use crate::sim::inputs::{ExternalInput, InputError, breaks_of};
use crate::sim::integrate::{QUADRATURES, Rkmk4};
use crate::sim::plant::Plant;
use crate::sim::trace::Trace;
use crate::state::State;
use crate::tree::aba::SingularInertia;
use ff_model::scalar::LaneScalar;
use ff_model::scalar::lanes::{Isa, LaneTask, Lanes, dispatch, splat};
use ff_model::spatial::vec3::V3;
use ff_model::{CoordDecl, Model, Params};

/// What moves the joints.
///
/// ```
/// use ff_dynamics::{Drive, SimOptions, State, simulate};
/// use ff_model::Params;
/// # let robot = ff_testkit::tree::peers_arm(ff_model::BaseKind::Floating);
///
/// // Joint torques as a law of time and state: dampers, which take out energy.
/// let damping = |_t: f64, state: &State<f64>, tau: &mut [f64]| {
///     tau.iter_mut().zip(state.qd()).for_each(|(tau, rate)| *tau = -0.3 * rate);
/// };
/// let mut start = State::zero(&robot);
/// start.qd_mut()[2] = 0.2;
/// let options = SimOptions { duration_s: 2.0, step_s: 0.01, sample_s: 0.5 };
/// let params = Params::nominal(&robot);
/// let trace = simulate(&robot, &params, &start, &Drive::Torque(&damping), &options)?;
/// let [before, after] = [0, 4].map(|i| trace.budget(&robot, &params, i).kinetic);
/// assert!(after < before && (trace.work[4] - (after - before)).abs() < 1e-6);
/// # Ok::<(), ff_dynamics::SimError>(())
/// ```
pub enum Drive<'a> {
    /// A position-controlled arm: the joints follow this motion exactly.
    Prescribed(&'a dyn JointMotion),
    /// Joint torques as a function of time and state, written into the last argument (N m, length `n`).
    Torque(&'a TorqueLaw<'a>),
}

/// Joint torques as a function of time and state.
pub type TorqueLaw<'a> = dyn Fn(f64, &State<f64>, &mut [f64]) + 'a;

/// Step and sampling of a simulation.
///
/// ```
/// use ff_dynamics::{Drive, SimOptions, State, simulate};
/// use ff_model::Params;
/// # let robot = ff_testkit::tree::system(); // arm, two wings and a boom on springs, fuel
/// # let motion = ff_testkit::motion::Wave(robot.nj()); // every joint its own two sines
///
/// let options = SimOptions { duration_s: 1.0, step_s: 0.005, sample_s: 0.25 };
/// let trace = simulate(&robot, &Params::nominal(&robot), &State::zero(&robot), &Drive::Prescribed(&motion), &options)?;
/// assert_eq!(trace.times(), [0.0, 0.25, 0.5, 0.75, 1.0]);
/// # Ok::<(), ff_dynamics::SimError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimOptions {
    /// Length of the simulation (s).
    pub duration_s: f64,
    /// Integration step at most (s); shortened so that samples fall on steps.
    pub step_s: f64,
    /// Time between samples (s).
    pub sample_s: f64,
}

impl SimOptions {
    /// All times positive and finite.
    pub(crate) fn check(&self) -> Result<(), SimError> {
        let times = [("duration", self.duration_s), ("integration step", self.step_s), ("sample time", self.sample_s)];
        match times.into_iter().find(|(_, x)| !(*x > 0.0 && x.is_finite())) {
            Some((what, value)) => Err(SimError::Options { what, value, extra: "" }),
            None => Ok(()),
        }
    }
    /// Step (s), steps per sample, number of samples.
    pub(crate) fn steps(&self) -> (f64, usize, usize) {
        let per_sample = (self.sample_s / self.step_s - 1e-9).ceil().max(1.0) as usize;
        let samples = (self.duration_s / self.sample_s + 1e-9).floor() as usize + 1;
        (self.sample_s / per_sample as f64, per_sample, samples)
    }
}

/// Why a simulation stopped.
///
/// ```
/// use ff_dynamics::{Drive, SimError, SimOptions, State, simulate};
/// use ff_model::Params;
/// # let robot = ff_testkit::tree::system(); // arm, two wings and a boom on springs, fuel
/// # let motion = ff_testkit::motion::Wave(robot.nj()); // every joint its own two sines
///
/// // A wing bent far beyond what its hinge can do.
/// let mut start = State::zero(&robot);
/// start.eta[0] = 3.5;
/// let options = SimOptions { duration_s: 1.0, step_s: 0.005, sample_s: 0.25 };
/// let stopped: SimError =
///     simulate(&robot, &Params::nominal(&robot), &start, &Drive::Prescribed(&motion), &options).unwrap_err();
/// assert!(stopped.to_string().contains(&robot.passive_coords()[0].0), "{stopped}");
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SimError {
    /// Steps or lengths make no sense.
    #[error("{what} is {value} s, but must be positive and finite{extra}; correct the simulation settings")]
    Options {
        /// Which setting.
        what: &'static str,
        /// Its value (s).
        value: f64,
        /// More about the limit.
        extra: &'static str,
    },
    /// A mass matrix became singular.
    #[error("at t = {t} s: {source}")]
    Singular {
        /// Time (s).
        t: f64,
        /// Where.
        source: SingularInertia,
    },
    /// A passive coordinate left the range its model is valid in.
    #[error("at t = {t} s: coordinate {coord} is {value} {unit}, outside {lo} .. {hi}; excite less or widen the model")]
    Range {
        /// Time (s).
        t: f64,
        /// Full name.
        coord: String,
        /// Value.
        value: f64,
        /// Unit.
        unit: &'static str,
        /// Lower end of the range.
        lo: f64,
        /// Upper end of the range.
        hi: f64,
    },
    /// The state became NaN or infinite.
    #[error("at t = {t} s: the state is no longer finite; use a smaller step than {step} s")]
    NotFinite {
        /// Time (s).
        t: f64,
        /// Step used (s).
        step: f64,
    },
    /// An external input does not fit the model.
    #[error("external input {index} (from 0): {source}")]
    Input {
        /// Index in the list of inputs.
        index: usize,
        /// What is wrong.
        source: InputError,
    },
    /// The drive has another number of joints than the model.
    #[error("the joint motion has {got} joints, the model {want}; give one column per joint of the URDF")]
    Joints {
        /// In the drive.
        got: usize,
        /// In the model.
        want: usize,
    },
}

impl SimError {
    /// A mass matrix was found singular at `t` in a step of length `step` (s): a NaN in the state shows as a pivot that is
    /// not positive, too.
    #[cold]
    pub(crate) fn singular(t: f64, step: f64, finite: bool, source: SingularInertia) -> Self {
        if finite { Self::Singular { t, source } } else { Self::NotFinite { t, step } }
    }
}

/// The state is finite, and every passive coordinate inside the range its model is valid in, in every lane.
#[inline(always)]
pub(crate) fn check_state<L: LaneScalar>(
    state: &State<L>,
    coords: &[(String, CoordDecl)],
    t: f64,
    step: f64,
) -> Result<(), SimError> {
    if !state.is_finite() {
        return Err(SimError::NotFinite { t, step });
    }
    for (x, (name, c)) in state.eta.iter().zip(coords) {
        let (lo, hi) = c.range;
        if let Some(value) = (0..L::N).map(|l| x.lane(l)).find(|x| *x < lo || *x > hi) {
            return Err(SimError::Range { t, coord: name.clone(), value, unit: c.unit, lo, hi });
        }
    }
    Ok(())
}

/// What a drive and inputs must have to be simulated with `model`.
pub(crate) fn check_drive(model: &Model, drive: &Drive<'_>, inputs: &[&dyn ExternalInput]) -> Result<(), SimError> {
    if let Drive::Prescribed(m) = drive
        && m.dof() != model.nj()
    {
        return Err(SimError::Joints { got: m.dof(), want: model.nj() });
    }
    for (index, input) in inputs.iter().enumerate() {
        input.check(model).map_err(|source| SimError::Input { index, source })?;
    }
    Ok(())
}

/// Integrates `start` for `options.duration_s` and samples what can be observed.
///
/// With [`Drive::Prescribed`] the joint part of `start` is overwritten by the motion. Fixed-step
/// [`Rkmk4`]; allocates the trace and buffers once.
///
/// ```
/// use ff_dynamics::{Drive, SimOptions, State, simulate};
/// use ff_model::Params;
/// # let robot = ff_testkit::tree::system(); // arm, two wings and a boom on springs, fuel
/// # let motion = ff_testkit::motion::Wave(robot.nj()); // every joint its own two sines
///
/// let params = Params::nominal(&robot);
/// let options = SimOptions { duration_s: 1.0, step_s: 0.002, sample_s: 0.5 };
/// let trace = simulate(&robot, &params, &State::zero(&robot), &Drive::Prescribed(&motion), &options)?;
/// // Nothing acts from outside: the momentum at the end is that of the start, and the joints' work is the energy gained
/// // and dissipated.
/// let [first, last] = [0, 2].map(|i| trace.budget(&robot, &params, i));
/// assert!((last.momentum.lin - first.momentum.lin).norm() < 1e-8 * last.mass);
/// let balance = trace.work[2] - (last.energy() - first.energy()) - trace.dissipated[2];
/// assert!(balance.abs() < 1e-6 * last.energy());
/// # Ok::<(), ff_dynamics::SimError>(())
/// ```
///
/// # Errors
/// [`SimError`]; the trace up to there is dropped.
pub fn simulate(
    model: &Model,
    params: &Params<f64>,
    start: &State<f64>,
    drive: &Drive<'_>,
    options: &SimOptions,
) -> Result<Trace, SimError> {
    simulate_with(model, params, start, drive, &[], options)
}

/// [`simulate`] under external inputs.
///
/// Steps end at the breaks of the inputs, and what an input does at the end of a step is taken from inside the step, so
/// that the order of the method is kept where thrusters switch.
///
/// # Errors
/// [`SimError`]; the trace up to there is dropped.
pub fn simulate_with(
    model: &Model,
    params: &Params<f64>,
    start: &State<f64>,
    drive: &Drive<'_>,
    inputs: &[&dyn ExternalInput],
    options: &SimOptions,
) -> Result<Trace, SimError> {
    options.check()?;
    check_drive(model, drive, inputs)?;
    if let Drive::Prescribed(motion) = drive
        && inputs.is_empty()
        && flight::applies(model)
    {
        return dispatch(Isa::detect(), Fly { model, params, start, motion: *motion, options });
    }
    let (h, per_sample, samples) = options.steps();
    let mut trace = Trace::new(model, samples, options.sample_s, start);
    let coords = model.passive_coords();
    let mut plant = Plant::new(model, params, drive, inputs);
    let mut stepper: Rkmk4<f64> = Rkmk4::new(model);
    let mut state = start.clone();
    let mut quad = [0.0; QUADRATURES];
    let mut a = vec![0.0; model.nv()];
    let breaks = breaks_of(inputs, 0.0, options.duration_s, APART * h);
    let mut pieces = Pieces { breaks: &breaks, whole: (per_sample, h) };
    for i in 0..samples {
        let t = i as f64 * options.sample_s;
        let next = t + options.sample_s;
        let mut rate = [0.0; QUADRATURES];
        let mut piece = pieces.next(t, t, next);
        plant.enter_step(t, t + piece.step);
        plant.accelerate(t, &mut state, &mut a, &mut rate)?;
        trace.put(i, &state, &a, &plant.tau, &quad);
        if i + 1 == samples {
            break;
        }
        // The sample has evaluated the first stage of the step that starts there.
        let mut first = Some((a.as_slice(), &rate));
        loop {
            for k in 0..piece.steps {
                let ts = piece.from + k as f64 * piece.step;
                plant.enter_step(ts, ts + piece.step);
                stepper.step_from(ts, piece.step, &mut state, &mut quad, first.take(), |t, s, a, r| {
                    plant.accelerate(t, s, a, r)
                })?;
            }
            if piece.end >= next {
                break;
            }
            piece = pieces.next(piece.end, t, next);
        }
        check_state(&state, &coords, t, h)?;
    }
    trace.last = state;
    Ok(trace)
}

/// Free flight under a prescribed motion, which needs neither position nor attitude for its right-hand side.
struct Fly<'a> {
    model: &'a Model,
    params: &'a Params<f64>,
    start: &'a State<f64>,
    motion: &'a dyn JointMotion,
    options: &'a SimOptions,
}

impl LaneTask for Fly<'_> {
    type Output = Result<Trace, SimError>;
    #[inline(always)]
    fn run<L: LaneScalar>(self) -> Self::Output {
        let Self { model, params, start, motion, options } = self;
        let (h, per_sample, samples) = options.steps();
        let (per_block, table) = flight::table(model, options.sample_s, per_sample, samples);
        let mut table = table.with_power();
        let mut filler = Filler::<L>::new(model, params);
        let z0 = [&start.v[..6], &start.eta, start.nu()].concat();
        let lift = |x: f64| L::One::splat(x);
        let single = params.lift::<L::One>(model);
        let mut flight = Flight::new(model, start.pos.map(lift), start.att.map(lift), &splat::<L::One>(&z0));
        let mut sink = Record {
            trace: Trace::new(model, samples, options.sample_s, start),
            state: start.clone(),
            a: vec![0.0; model.nv()],
            tau: vec![0.0; model.nj()],
            coords: model.passive_coords(),
            h,
        };
        for span in flight::spans(samples, per_block) {
            filler.fill(&mut table, motion, span.first as f64 * options.sample_s);
            fly_block(&mut flight, model, &single, &table, span, &mut sink)?;
        }
        sink.trace.last = sink.state;
        Ok(sink.trace)
    }
}

/// Not inlined: it has its own instructions.
#[inline(never)]
fn fly_block<T: LaneScalar>(
    flight: &mut Flight<T>,
    model: &Model,
    params: &Params<T>,
    table: &Prescribed,
    span: Span,
    sink: &mut Record,
) -> Result<(), SimError> {
    flight.block(model, params, table, span, sink)
}

/// Writes a flight into a trace.
struct Record {
    trace: Trace,
    state: State<f64>,
    a: Vec<f64>,
    tau: Vec<f64>,
    coords: Vec<(String, CoordDecl)>,
    h: f64,
}

impl Record {
    fn place<T: LaneScalar>(&mut self, at: &Moment<'_, T>) {
        let (s, m) = (&mut self.state, self.coords.len());
        (s.pos, s.att) = (at.pos.map(|x| x.lane(0)), at.att.map(|x| x.lane(0)));
        plain(&at.z[..6], &mut s.v);
        plain(&at.z[6..6 + m], &mut s.eta);
        plain(&at.z[6 + m..], s.nu_mut());
    }
}

/// Numbers out of single lanes.
fn plain<T: LaneScalar>(from: &[T], to: &mut [f64]) {
    to.iter_mut().zip(from).for_each(|(to, x)| *to = x.lane(0));
}

impl<T: LaneScalar> Sink<T> for Record {
    type Error = SimError;
    fn sample(&mut self, i: usize, at: &Moment<'_, T>, now: &Reading<'_, T>) {
        self.place(at);
        let n = self.state.q.len();
        self.state.q.copy_from_slice(&now.joints[..n]);
        self.state.qd_mut().copy_from_slice(&now.joints[n..2 * n]);
        let (v, w) = (V3::from_slice(&self.state.v), V3::from_slice(&self.state.v[3..]));
        plain(now.u, &mut self.a[..6]);
        let a = V3::from_slice(&self.a) - w.cross(&v);
        a.write_to(&mut self.a);
        self.a[6..6 + n].copy_from_slice(&now.joints[2 * n..]);
        plain(&now.u[6..], &mut self.a[6 + n..]);
        plain(now.tau, &mut self.tau);
        let mut quad = [0.0; QUADRATURES];
        plain(now.energy, &mut quad);
        self.trace.put(i, &self.state, &self.a, &self.tau, &quad);
    }
    fn check(&mut self, i: usize, at: &Moment<'_, T>) -> Result<(), SimError> {
        self.place(at);
        check_state(&self.state, &self.coords, i as f64 * self.trace.dt, self.h)
    }
    fn singular(&mut self, i: usize, node: usize, z: &[T], source: SingularInertia) -> SimError {
        let t = i as f64 * self.trace.dt + 0.5 * self.h * node as f64;
        SimError::singular(t, self.h, z.iter().all(|x| x.is_finite()), source)
    }
}

/// Breaks closer to each other, or to a sample, than this fraction of a step are one.
const APART: f64 = 1e-6;

/// The stretches between breaks into which a sample interval falls.
struct Pieces<'a> {
    /// Breaks to come.
    breaks: &'a [f64],
    /// Steps of a sample interval without breaks, and their length (s).
    whole: (usize, f64),
}

struct Piece {
    from: f64,
    end: f64,
    steps: usize,
    step: f64,
}

impl Pieces<'_> {
    /// The piece that begins at `from` of the sample interval `t .. next`.
    fn next(&mut self, from: f64, t: f64, next: f64) -> Piece {
        let (steps, step) = self.whole;
        while let [first, rest @ ..] = self.breaks
            && *first <= from + APART * step
        {
            self.breaks = rest;
        }
        let end = self.breaks.first().copied().filter(|b| *b < next - APART * step).unwrap_or(next);
        if from == t && end == next {
            return Piece { from, end, steps, step };
        }
        let steps = ((end - from) / step - 1e-9).ceil().max(1.0) as usize;
        Piece { from, end, steps, step: (end - from) / steps as f64 }
    }
}
