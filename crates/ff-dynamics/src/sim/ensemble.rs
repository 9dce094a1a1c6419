//! Several runs of one model at once: other parameters, other start states, one joint motion.
//!
//! Monte-Carlo studies, sigma points and multi-start searches simulate the same system again and again. Here the
//! runs go through the equations together, one per lane of the widest vector the machine has: the integrator, the step
//! and the results are those of [`crate::sim::simulate::simulate()`] run by run, at a fraction of the time. The joint motion is looked up
//! once for all. There are no external inputs here.

use crate::motion::joint::JointMotion;
use crate::reduced::table::Filler;
use crate::sim::flight;
use crate::sim::flight::{Flight, Moment, Reading, Sink};
use crate::sim::integrate::Rkmk4;
use crate::sim::simulate::{SimError, SimOptions, check_state};
use crate::state::State;
use crate::tree::aba::SingularInertia;
use crate::tree::forward::hybrid_dynamics;
use crate::work::buffers::Work;
use ff_model::scalar::lanes;
use ff_model::scalar::lanes::{Isa, LaneScalar, LaneTask};
use ff_model::spatial::vec3::V3;
use ff_model::{CoordDecl, Model, Params};
use nalgebra::DMatrix;

/// One run: what differs between the lanes.
#[derive(Clone, Copy, Debug)]
pub struct Run<'a> {
    /// Parameter values.
    pub params: &'a Params<f64>,
    /// State at time zero; its joint part is overwritten by the motion.
    pub start: &'a State<f64>,
}

/// What is recorded beside joint torques and base twist.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Keep {
    /// Base acceleration.
    pub accel: bool,
    /// Base position and attitude.
    pub pose: bool,
    /// Passive coordinates and rates.
    pub passive: bool,
}

impl Keep {
    /// Everything.
    pub const ALL: Self = Self { accel: true, pose: true, passive: true };
}

/// Samples of one run, one row per sample; what was not kept has no columns.
#[derive(Clone, Debug, PartialEq)]
pub struct RunTrace {
    /// Joint torques (N m), `N x n`.
    pub tau: DMatrix<f64>,
    /// Base twist, base frame, linear first, `N x 6`; columns 3..6 are the gyro (rad/s). No columns for a fixed base.
    pub twist: DMatrix<f64>,
    /// Base acceleration (componentwise rate of `twist`), `N x 6`.
    pub accel: DMatrix<f64>,
    /// Base origin in the world (m), `N x 3`.
    pub pos: DMatrix<f64>,
    /// Base attitude `[w, x, y, z]`, `N x 4`.
    pub att: DMatrix<f64>,
    /// Passive coordinates, `N x m`.
    pub eta: DMatrix<f64>,
    /// Passive rates, `N x m`.
    pub nu: DMatrix<f64>,
    /// State at the end.
    pub last: State<f64>,
}

/// Why an ensemble stopped.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("run {first} to {last}: {source}")]
pub struct EnsembleError {
    /// First run of the group that went through the equations together.
    pub first: usize,
    /// Last run of that group.
    pub last: usize,
    /// What happened in one of them.
    pub source: SimError,
}

/// Simulates `runs` under one prescribed joint motion, as many at a time as the machine has lanes.
///
/// Every run equals [`crate::sim::simulate::simulate()`] with [`crate::sim::simulate::Drive::Prescribed`] but for rounding. Allocates results and
/// buffers.
///
/// # Errors
/// [`EnsembleError`] with the group of runs in which something went wrong; nothing is returned of the others.
///
/// # Panics
/// If a state or parameter set belongs to another model.
pub fn simulate_ensemble(
    model: &Model,
    runs: &[Run<'_>],
    motion: &dyn JointMotion,
    options: &SimOptions,
    keep: Keep,
) -> Result<Vec<RunTrace>, EnsembleError> {
    simulate_ensemble_with(Isa::detect(), model, runs, motion, options, keep)
}

/// [`simulate_ensemble`] with the lanes of a given instruction set.
///
/// # Errors
/// As [`simulate_ensemble`].
///
/// # Panics
/// As [`simulate_ensemble`], and if the machine does not have `isa`.
pub fn simulate_ensemble_with(
    isa: Isa,
    model: &Model,
    runs: &[Run<'_>],
    motion: &dyn JointMotion,
    options: &SimOptions,
    keep: Keep,
) -> Result<Vec<RunTrace>, EnsembleError> {
    let wrong = |source| EnsembleError { first: 0, last: runs.len().saturating_sub(1), source };
    options.check().map_err(wrong)?;
    if motion.dof() != model.nj() {
        return Err(wrong(SimError::Joints { got: motion.dof(), want: model.nj() }));
    }
    lanes::dispatch(isa, Ensemble { model, runs, motion, options, keep })
}

/// All runs, in groups of as many as there are lanes.
struct Ensemble<'a> {
    model: &'a Model,
    runs: &'a [Run<'a>],
    motion: &'a dyn JointMotion,
    options: &'a SimOptions,
    keep: Keep,
}

/// The runs that go through the equations together.
struct Group<L: LaneScalar> {
    params: Params<L>,
    state: State<L>,
    traces: Vec<RunTrace>,
}

impl<L: LaneScalar> Group<L> {
    fn new(model: &Model, runs: &[Run<'_>], samples: usize, keep: Keep) -> Self {
        let pack = |x: &dyn Fn(&Run<'_>) -> f64| {
            // Spare lanes repeat the last run.
            let a: [f64; 8] = std::array::from_fn(|l| x(&runs[l.min(runs.len() - 1)]));
            L::load(&a)
        };
        let values = (0..model.n_params()).map(|i| pack(&|r| r.params.values()[i])).collect();
        let mut state = State::<L>::zero(model);
        (0..3).for_each(|i| state.pos[i] = pack(&|r| r.start.pos[i]));
        (0..4).for_each(|i| state.att[i] = pack(&|r| r.start.att[i]));
        (0..model.np()).for_each(|i| state.eta[i] = pack(&|r| r.start.eta[i]));
        (0..model.nv()).for_each(|i| state.v[i] = pack(&|r| r.start.v[i]));
        let traces = runs.iter().map(|r| RunTrace::new(model, samples, keep, r.start)).collect();
        Self { params: Params::from_values(model, values), state, traces }
    }
    /// The traces, with the last state in each.
    fn finish(self) -> Vec<RunTrace> {
        let s = self.state;
        let mut traces = self.traces;
        for (l, r) in traces.iter_mut().enumerate() {
            let last = &mut r.last;
            last.pos = s.pos.map(|x| x.lane(l));
            last.att = s.att.map(|x| x.lane(l));
            let all = last.q.iter_mut().chain(&mut last.eta).chain(&mut last.v);
            all.zip(s.q.iter().chain(&s.eta).chain(&s.v)).for_each(|(to, x)| *to = x.lane(l));
        }
        traces
    }
}

/// Steps for which the joint motion is looked up ahead: enough to make it cheap, few enough to stay in the cache.
const AHEAD: usize = 256;

impl LaneTask for Ensemble<'_> {
    type Output = Result<Vec<RunTrace>, EnsembleError>;

    #[inline(always)]
    fn run<L: LaneScalar>(self) -> Self::Output {
        let Self { model, runs, motion, options, keep } = self;
        let (nb, nj) = (model.nb(), model.nj());
        let (h, per_sample, samples) = options.steps();
        if flight::applies(model) && same_arm(model, runs) {
            return fly::<L>(model, runs, motion, options, keep);
        }
        let coords = model.passive_coords();
        let mut groups: Vec<Group<L>> = runs.chunks(L::N).map(|runs| Group::new(model, runs, samples, keep)).collect();
        let mut plant = Plant::<L>::new(model);
        let mut stepper = Rkmk4::<L, 0>::new(model);
        let mut a = vec![L::zero(); model.nv()];
        let ahead = (AHEAD / per_sample).max(1);
        for block in (0..samples).step_by(ahead) {
            let until = (block + ahead).min(samples);
            // The motion once for all groups, at the stages of all steps of the block.
            let t0 = block as f64 * options.sample_s;
            plant.joints.look_up(motion, nj, t0, 0.5 * h, 2 * per_sample * (until - block) + 1);
            for (k, group) in groups.iter_mut().enumerate() {
                let last = (k * L::N + L::N).min(runs.len()) - 1;
                let fail = |source| EnsembleError { first: k * L::N, last, source };
                for i in block..until {
                    let t = i as f64 * options.sample_s;
                    let Group { params, state, traces } = group;
                    plant.accelerate(t, params, state, &mut a).map_err(fail)?;
                    let (twist, passive) = (&state.v[..nb], (&state.eta[..], &state.v[nb + nj..]));
                    let pose = (state.pos.as_slice(), state.att.as_slice());
                    write(traces, i, keep, &Sample { tau: &plant.tau, twist, accel: &a[..nb], pose, passive });
                    if i + 1 == samples {
                        break;
                    }
                    for k in 0..per_sample {
                        let ts = t + k as f64 * h;
                        // The sample has evaluated the first stage of the step that starts there.
                        let first = (k == 0).then_some((a.as_slice(), &[]));
                        stepper
                            .step_from(ts, h, state, &mut [], first, |t, s, a, _| plant.accelerate(t, params, s, a))
                            .map_err(fail)?;
                    }
                    check_state(&group.state, &coords, t, h).map_err(fail)?;
                }
            }
        }
        Ok(groups.into_iter().flat_map(Group::finish).collect())
    }
}

/// Whether the links are the same in all runs, so that one table of the arm serves them all.
fn same_arm(model: &Model, runs: &[Run<'_>]) -> bool {
    let links = |r: &Run<'_>| r.params.values()[10..10 * model.n_bodies()].to_vec();
    runs.split_first().is_some_and(|(first, rest)| {
        let first = links(first);
        rest.iter().all(|r| links(r) == first)
    })
}

/// Free flight: the arm is tabulated once for all groups.
#[inline(always)]
fn fly<L: LaneScalar>(
    model: &Model,
    runs: &[Run<'_>],
    motion: &dyn JointMotion,
    options: &SimOptions,
    keep: Keep,
) -> Result<Vec<RunTrace>, EnsembleError> {
    let (h, per_sample, samples) = options.steps();
    let (per_block, mut table) = flight::table(model, options.sample_s, per_sample, samples);
    let Some(arm) = runs.first().map(|r| r.params) else {
        return Ok(Vec::new());
    };
    let mut filler = Filler::<L>::new(model, arm);
    let mut groups: Vec<Flying<L>> = runs
        .chunks(L::N)
        .map(|runs| {
            let g = Group::<L>::new(model, runs, samples, keep);
            let s = &g.state;
            let z0: Vec<L> = s.v[..6].iter().chain(&s.eta).chain(s.nu()).copied().collect();
            let flight = Flight::new(model, s.pos, s.att, &z0);
            let record =
                Record { group: g.traces, state: g.state, coords: model.passive_coords(), options: *options, h, keep };
            Flying { params: g.params, flight, record }
        })
        .collect();
    for span in flight::spans(samples, per_block) {
        filler.fill(&mut table, motion, span.first as f64 * options.sample_s);
        for (k, g) in groups.iter_mut().enumerate() {
            let until = (k * L::N + L::N).min(runs.len()) - 1;
            let fail = |source| EnsembleError { first: k * L::N, last: until, source };
            g.flight.block(model, &g.params, &table, span, &mut g.record).map_err(fail)?;
        }
    }
    Ok(groups
        .into_iter()
        .flat_map(|g| Group { params: g.params, state: g.record.state, traces: g.record.group }.finish())
        .collect())
}

struct Flying<L: LaneScalar> {
    params: Params<L>,
    flight: Flight<L>,
    record: Record<L>,
}

/// Writes the lanes of a flight into their traces.
struct Record<L: LaneScalar> {
    group: Vec<RunTrace>,
    state: State<L>,
    coords: Vec<(String, CoordDecl)>,
    options: SimOptions,
    h: f64,
    keep: Keep,
}

impl<L: LaneScalar> Sink<L> for Record<L> {
    type Error = SimError;
    #[inline(always)]
    fn sample(&mut self, i: usize, at: &Moment<'_, L>, now: &Reading<'_, L>) {
        let m = self.coords.len();
        let (v, w) = (V3::from_slice(at.z), V3::from_slice(&at.z[3..]));
        let mut accel = [now.u[0], now.u[1], now.u[2], now.u[3], now.u[4], now.u[5]];
        (V3::from_slice(now.u) - w.cross(&v)).write_to(&mut accel);
        let (twist, passive) = (&at.z[..6], (&at.z[6..6 + m], &at.z[6 + m..]));
        let pose = (at.pos.as_slice(), at.att.as_slice());
        write(&mut self.group, i, self.keep, &Sample { tau: now.tau, twist, accel: &accel, pose, passive });
        let n = self.state.q.len();
        let splat = |to: &mut [L], x: &[f64]| to.iter_mut().zip(x).for_each(|(to, &x)| *to = L::splat(x));
        splat(&mut self.state.q, &now.joints[..n]);
        splat(self.state.qd_mut(), &now.joints[n..2 * n]);
    }
    #[inline(always)]
    fn check(&mut self, i: usize, at: &Moment<'_, L>) -> Result<(), SimError> {
        let (s, m, t) = (&mut self.state, self.coords.len(), i as f64 * self.options.sample_s);
        (s.pos, s.att) = (*at.pos, *at.att);
        s.v[..6].copy_from_slice(&at.z[..6]);
        s.eta.copy_from_slice(&at.z[6..6 + m]);
        s.nu_mut().copy_from_slice(&at.z[6 + m..]);
        check_state(s, &self.coords, t, self.h)
    }
    #[cold]
    fn singular(&mut self, i: usize, node: usize, z: &[L], source: SingularInertia) -> SimError {
        let t = i as f64 * self.options.sample_s + 0.5 * self.h * node as f64;
        SimError::singular(t, self.h, z.iter().all(|x| x.is_finite()), source)
    }
}

/// What is recorded at a sample.
struct Sample<'s, L> {
    tau: &'s [L],
    twist: &'s [L],
    accel: &'s [L],
    /// Position and attitude.
    pose: (&'s [L], &'s [L]),
    /// Coordinates and rates.
    passive: (&'s [L], &'s [L]),
}

/// Writes sample `i`, each lane into its trace.
#[inline(always)]
fn write<L: LaneScalar>(traces: &mut [RunTrace], i: usize, keep: Keep, s: &Sample<'_, L>) {
    for (l, r) in traces.iter_mut().enumerate() {
        put(&mut r.tau, i, s.tau, l);
        put(&mut r.twist, i, s.twist, l);
        if keep.accel {
            put(&mut r.accel, i, s.accel, l);
        }
        if keep.pose {
            put(&mut r.pos, i, s.pose.0, l);
            put(&mut r.att, i, s.pose.1, l);
        }
        if keep.passive {
            put(&mut r.eta, i, s.passive.0, l);
            put(&mut r.nu, i, s.passive.1, l);
        }
    }
}

/// Lane `l` of `x` into row `i`.
#[inline(always)]
fn put<L: LaneScalar>(m: &mut DMatrix<f64>, i: usize, x: &[L], l: usize) {
    let rows = m.nrows();
    let to = &mut m.as_mut_slice()[i..];
    for (k, x) in x.iter().enumerate() {
        to[k * rows] = x.lane(l);
    }
}

impl RunTrace {
    fn new(model: &Model, samples: usize, keep: Keep, start: &State<f64>) -> Self {
        let z = |columns: usize, kept: bool| DMatrix::zeros(samples, if kept { columns } else { 0 });
        let np = model.np();
        Self {
            tau: z(model.nj(), true),
            twist: z(model.nb(), true),
            accel: z(model.nb(), keep.accel),
            pos: z(3, keep.pose),
            att: z(4, keep.pose),
            eta: z(np, keep.passive),
            nu: z(np, keep.passive),
            last: start.clone(),
        }
    }
}

/// A joint motion looked up at equal distances.
#[derive(Default)]
struct Joints {
    start: f64,
    apart: f64,
    /// `[q | qd | qdd]` per time.
    rows: Vec<f64>,
}

impl Joints {
    /// At `rows` times from `start`, `apart` from each other (s). Allocates in the first call with so many rows.
    fn look_up(&mut self, motion: &dyn JointMotion, nj: usize, start: f64, apart: f64, rows: usize) {
        (self.start, self.apart) = (start, apart);
        self.rows.resize(3 * nj * rows, 0.0);
        for k in 0..rows {
            let (q, rest) = self.rows[3 * nj * k..3 * nj * (k + 1)].split_at_mut(nj);
            let (qd, qdd) = rest.split_at_mut(nj);
            motion.eval(start + k as f64 * apart, q, qd, qdd);
        }
    }
    /// The row of time `t`.
    #[inline(always)]
    fn at(&self, t: f64, nj: usize) -> &[f64] {
        let k = ((t - self.start) / self.apart).round() as usize;
        &self.rows[3 * nj * k..3 * nj * (k + 1)]
    }
}

/// The right-hand side: one joint motion for all lanes.
struct Plant<'a, L: LaneScalar> {
    model: &'a Model,
    joints: Joints,
    work: Work<L>,
    tau: Vec<L>,
    acc: Vec<L>,
}

impl<'a, L: LaneScalar> Plant<'a, L> {
    fn new(model: &'a Model) -> Self {
        let z = vec![L::zero(); model.nj()];
        Self { model, joints: Joints::default(), work: Work::new(model), tau: z.clone(), acc: z }
    }
    #[inline(always)]
    fn accelerate(&mut self, t: f64, params: &Params<L>, state: &mut State<L>, a: &mut [L]) -> Result<(), SimError> {
        let nj = self.acc.len();
        let row = self.joints.at(t, nj);
        let splat = |to: &mut [L], x: &[f64]| to.iter_mut().zip(x).for_each(|(to, &x)| *to = L::splat(x));
        splat(&mut state.q, &row[..nj]);
        splat(state.qd_mut(), &row[nj..2 * nj]);
        splat(&mut self.acc, &row[2 * nj..]);
        hybrid_dynamics(self.model, params, state, &self.acc, &mut self.work, a, &mut self.tau)
            .map_err(|source| SimError::singular(t, 2.0 * self.joints.apart, state.is_finite(), source))
    }
}
