//! Exact sensitivities of the simulated record with respect to any parameters, integrated beside the states.
//!
//! Differentiating `0 = R(z, u, p)` of [`crate::reduced::system`] with `u = [a | al | nu']`:
//!
//! ```text
//! M du = -(R_z dz + R_p dp),      M = R_u,
//! ```
//!
//! so one regressor `R_p`, one derivative pass `R_z` and one inverse of `M` per stage serve all parameters
//! (`docs/theory/derivatives.md`). The trajectory does not depend on its derivatives: the stages of a step (of two, with
//! eight lanes) are integrated first, their derivatives are evaluated together, one stage per lane (`tangent.rs`), and
//! the columns `dz` are then carried through the step, several columns per vector. The discrete sensitivities are the
//! exact derivatives of the discrete (RK4) solution.

use crate::reduced::coupled;
use crate::reduced::sensitivity::carried::Carried;
use crate::reduced::sensitivity::partials::Columns;
use crate::reduced::sensitivity::propagate::Flow;
use crate::reduced::sensitivity::sink::{Samples, Sink};
use crate::reduced::sensitivity::stage::Tangent;
use crate::reduced::sensitivity::wanted::Wanted;
use crate::reduced::stages::Stages;
use crate::reduced::system::{Reduced, ReducedError, Response, Rk4, STAGE, check};
use crate::reduced::table::Prescribed;
use crate::sim::attitude::Attitude;
use core::ops::Range;
use ff_lanes::{Kernel, Lanes, WIDEST};
use ff_model::scalar::LaneScalar;
use ff_model::scalar::lanes::{Isa, LaneTask, dispatch, splat};
use ff_model::tree::Coordinates;
use ff_model::{Model, Params};
use nalgebra::DMatrix;

/// Derivatives of what is measured; row `i * n + j` is channel `j` of `n` at sample `i`, one column per entry of
/// [`Wanted`] (parameters, kinematic parameters, initial state).
///
/// ```
/// # use ff_model::Params;
/// # let robot = ff_testkit::tree::system(); // arm, two wings and a boom on springs, fuel
/// # let motion = ff_testkit::motion::Wave(robot.nj()); // every joint its own two sines
/// # let params = Params::nominal(&robot);
/// # let sampling = ff_dynamics::Sampling { samples: 51, sample_s: 0.02, substeps: 2 };
/// # let table = ff_dynamics::Prescribed::new(&robot, &params, &motion, &sampling, &[]);
/// # let rest = vec![0.0; 6 + 2 * robot.np()];
/// use ff_dynamics::{Sensitivities, Wanted, sensitivities};
///
/// // What a percent of stiffness changes in the gyro, at every sample.
/// let wanted = Wanted { params: robot.parameter_indices("*.k[0]")?, ..Wanted::default() };
/// let (response, s): (_, Sensitivities) = sensitivities(&robot, &params, &table, &rest, &wanted)?;
/// assert_eq!(s.gyro.shape(), (3 * table.samples(), wanted.len()));
/// let shift = 0.01 * params.values()[wanted.params[0]] * s.gyro.column(0);
/// assert!(shift.amax() > 0.0 && shift.amax() < response.twist.columns(3, 3).amax());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Sensitivities {
    /// d tau, `(N n) x P` (N m per unit).
    pub tau: DMatrix<f64>,
    /// d gyro, `(N 3) x P` (rad/s per unit).
    pub gyro: DMatrix<f64>,
    /// d of classical acceleration of the base origin (m/s^2) and angular acceleration (rad/s^2), both in base axes,
    /// `(N 6) x P`: what [`crate::sim::sensors::Accelerometer::derivative`] makes an accelerometer's derivatives of.
    pub accel: Option<DMatrix<f64>>,
    /// Attitude since the start, and its derivatives.
    pub attitude: Option<Attitude>,
}

/// Integrates the reduced system and its sensitivities from `z0`; see [`crate::simulate_reduced`].
///
/// The response is bit for bit that of [`crate::simulate_reduced`]. Allocates results and buffers once.
///
/// ```
/// # use ff_model::Params;
/// # let robot = ff_testkit::tree::system(); // arm, two wings and a boom on springs, fuel
/// # let motion = ff_testkit::motion::Wave(robot.nj()); // every joint its own two sines
/// # let params = Params::nominal(&robot);
/// # let sampling = ff_dynamics::Sampling { samples: 51, sample_s: 0.02, substeps: 2 };
/// # let table = ff_dynamics::Prescribed::new(&robot, &params, &motion, &sampling, &[]);
/// # let rest = vec![0.0; 6 + 2 * robot.np()];
/// use ff_dynamics::{Wanted, sensitivities, simulate_reduced};
///
/// // The mass of the base: exact derivatives against a difference.
/// let wanted = Wanted { params: robot.parameter_indices("base.mass")?, ..Wanted::default() };
/// let (response, s) = sensitivities(&robot, &params, &table, &rest, &wanted)?;
/// let mut heavier = params.clone();
/// heavier.set_matching(&robot, "base.mass", params.get(&robot, "base.mass")? + 0.01)?;
/// let moved = simulate_reduced(&robot, &heavier, &table, &rest)?;
/// let (i, j) = (table.samples() - 1, 2); // torque of the third joint in the last sample
/// let slope = (moved.tau[(i, j)] - response.tau[(i, j)]) / 0.01;
/// assert!((slope / s.tau[(i * robot.nj() + j, 0)] - 1.0).abs() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`ReducedError`].
///
/// # Panics
/// If `z0` has the wrong length, an initial state does not exist, or a wanted link or kinematic parameter is not tracked by
/// `table`.
pub fn sensitivities(
    model: &Model,
    params: &Params<f64>,
    table: &Prescribed,
    z0: &[f64],
    wanted: &Wanted,
) -> Result<(Response, Sensitivities), ReducedError> {
    sensitivities_with(Isa::detect(), model, params, table, z0, wanted)
}

/// [`sensitivities`] with the lanes of a given instruction set. The response is that of [`crate::simulate_reduced`] to rounding, and
/// bit for bit with the set that the machine would choose. Allocates results and buffers once.
///
/// # Errors
/// As [`sensitivities`].
///
/// # Panics
/// As [`sensitivities`], and if the machine does not have `isa`.
pub fn sensitivities_with(
    isa: Isa,
    model: &Model,
    params: &Params<f64>,
    table: &Prescribed,
    z0: &[f64],
    wanted: &Wanted,
) -> Result<(Response, Sensitivities), ReducedError> {
    run(isa, model, (params, table, None), 0..table.samples, &mut Carried::start(model, z0, wanted), wanted)
}

/// [`sensitivities`] along stages that have been integrated with these parameters and this table: what it gives, bit for bit, without integrating
/// again. Allocates results and buffers once.
///
/// # Errors
/// [`ReducedError`].
///
/// # Panics
/// As [`sensitivities`], and if `stages` are those of another number of steps or coordinates, or of an integration that failed.
pub fn sensitivities_over(
    model: &Model,
    params: &Params<f64>,
    table: &Prescribed,
    stages: &Stages,
    wanted: &Wanted,
) -> Result<(Response, Sensitivities), ReducedError> {
    let z0 = stages.at(0, model.np()).0;
    let carried = &mut Carried::start(model, z0, wanted);
    run(Isa::detect(), model, (params, table, Some(stages)), 0..table.samples, carried, wanted)
}

/// [`sensitivities`] over the samples `span` of the table, from what was `carried` to the first of them. `carried` becomes what is
/// handed on at the sample `span.end`; at the end of the table there is nothing to go on to, and it is of no use. The parts give what
/// the whole gives, bit for bit, and so do tables of parts ([`Prescribed::span`]) with one sample more than is asked for. Allocates
/// results of the span and buffers.
///
/// # Errors
/// [`ReducedError`]; `carried` is then of no use.
///
/// # Panics
/// If `carried` was started for another model or with other columns, the span is empty or ends beyond the table, or a wanted link is
/// not tracked by the table.
pub fn sensitivities_span(
    model: &Model,
    params: &Params<f64>,
    table: &Prescribed,
    span: Range<usize>,
    carried: &mut Carried,
    wanted: &Wanted,
) -> Result<(Response, Sensitivities), ReducedError> {
    run(Isa::detect(), model, (params, table, None), span, carried, wanted)
}

fn run(
    isa: Isa,
    model: &Model,
    (params, table, stages): (&Params<f64>, &Prescribed, Option<&Stages>),
    span: Range<usize>,
    carried: &mut Carried,
    wanted: &Wanted,
) -> Result<(Response, Sensitivities), ReducedError> {
    let own = span.clone();
    let folded = |map: &Coordinates, (r, s): (Response, Sensitivities)| {
        (Response::folded(map, r), Sensitivities { tau: coupled::rows(map, &s.tau), ..s })
    };
    let of_tree = |tree: &Model| run(isa, tree, (params, table, stages), own, carried, wanted);
    if let Some(done) = coupled::over_tree(model, of_tree, folded) {
        return done;
    }
    check(model)?;
    assert!(span.start < span.end && span.end <= table.samples, "samples of a span");
    let columns = Columns::new(model, table, wanted);
    let count = 4 * (table.samples - 1) * table.substeps + 1;
    let along = stages.and_then(|stages| Some((stages, stages.response(count, model.np())?)));
    assert_eq!(along.is_some(), stages.is_some(), "stages of an integration with this table");
    dispatch(isa, Run { model, params, table, span, carried, wanted, along, columns: &columns })
}

struct Run<'a> {
    model: &'a Model,
    params: &'a Params<f64>,
    table: &'a Prescribed,
    span: Range<usize>,
    carried: &'a mut Carried,
    wanted: &'a Wanted,
    /// What has been integrated.
    along: Option<(&'a Stages, &'a Response)>,
    columns: &'a Columns,
}

impl LaneTask for Run<'_> {
    type Output = Result<(Response, Sensitivities), ReducedError>;
    #[inline(always)]
    fn run<L: LaneScalar>(self) -> Self::Output {
        let Self { model, params, table, span, carried, wanted, along, columns } = self;
        let m = model.np();
        let lifted = params.lift::<L>(model);
        let single = params.lift::<L::One>(model);
        let mut sys = Reduced::new(model, &single, table);
        let mut rk = Rk4::new(model, &splat::<L::One>(&carried.z));
        let mut tangent = Tangent::<L>::new(model, &lifted, table, columns);
        let mut points = Points::<L>::new(m);
        let mut flow = Flow::<L>::new(model, tangent.nz, wanted, table.step, carried);
        let mut sink = Sink::<L>::new(model, params, table, wanted, columns, &span);
        sink.track.clone_from(&carried.track);
        let end = span.end == table.samples;
        let last = (span.end - usize::from(end)) * table.substeps;
        let at_once = L::N / 4;
        let mut first = span.start * table.substeps;
        // One call of `differentiate`: it is inlined, once per instruction set.
        loop {
            let steps = at_once.min(last - first);
            if steps == 0 && !end {
                carried.z.iter_mut().zip(&rk.z).for_each(|(to, z)| *to = z.lane(0));
                flow.hand_over(&mut carried.dz, &mut carried.dtheta);
                carried.track = sink.track.take();
                return Ok(together(sink.done()));
            }
            points.clear();
            // The last sample is an evaluation without a step.
            'points: for step in first..first + steps.max(1) {
                for stage in 0..4 {
                    if let Some((stages, _)) = along {
                        points.take(2 * step + STAGE[stage], stages.at(4 * step + stage, m));
                        if step == last {
                            break 'points;
                        }
                        continue;
                    }
                    one_stage(&mut rk, &mut sys, step, stage)?;
                    points.push(2 * step + STAGE[stage], &rk.zs, &rk.u);
                    if stage == 0 && step % table.substeps == 0 {
                        let (z, u) = points.point(points.count - 1);
                        sink.tau.iter_mut().zip(&rk.tau).for_each(|(x, t)| *x = t.lane(0));
                        sink.response.write(step / table.substeps - span.start, m, z, u, &sink.tau);
                    }
                    if step == last {
                        break 'points;
                    }
                    rk.rate(table.step, stage);
                }
                if along.is_none() {
                    rk.finish();
                }
            }
            if !points.differentiate(&mut tangent, &mut flow) {
                return Err(ReducedError::Singular { t: table.start_s() + first as f64 * table.step });
            }
            for step in first..first + steps.max(1) {
                let (lane, sample) = (4 * (step - first), step % table.substeps == 0);
                if sample && let Some(track) = &sink.track {
                    flow.attitude_rows(&mut sink.attitude, track, step / table.substeps - span.start);
                }
                if let Some(track) = &mut sink.track
                    && step < last
                {
                    flow.turn = Some(track.step(table.step, core::array::from_fn(|s| points.w(lane + s))));
                }
                if sample {
                    sink.begin(step / table.substeps, points.point(lane));
                }
                flow.step(lane, step < last, &points.z, if sample { Some(&mut sink) } else { None });
            }
            if first == last {
                if let Some((_, response)) = along {
                    sink.response.clone_from(response);
                }
                return Ok(together(sink.done()));
            }
            first += steps;
        }
    }
}

fn together(samples: Samples) -> (Response, Sensitivities) {
    let Samples { response, tau, gyro, accel, attitude } = samples;
    (response, Sensitivities { tau, gyro, accel, attitude })
}

/// A stage of the trajectory itself, and the joint torques where it is a sample. Not inlined: it has its own
/// instructions.
#[inline(never)]
fn one_stage<T: LaneScalar>(
    rk: &mut Rk4<T>,
    sys: &mut Reduced<'_, T>,
    step: usize,
    stage: usize,
) -> Result<(), ReducedError> {
    T::enter(OneStage { rk, sys, step, stage })
}

struct OneStage<'a, 'b, T: LaneScalar> {
    rk: &'a mut Rk4<T>,
    sys: &'a mut Reduced<'b, T>,
    step: usize,
    stage: usize,
}

impl<T: LaneScalar> Kernel for OneStage<'_, '_, T> {
    type Output = Result<(), ReducedError>;
    #[inline(always)]
    fn run(self) -> Self::Output {
        let Self { rk, sys, step, stage } = self;
        let t = sys.table.start_s() + 0.5 * sys.table.step * (2 * step + STAGE[stage]) as f64;
        rk.stage(sys, step, stage).map_err(|_| ReducedError::Singular { t })?;
        if stage == 0 && step % sys.table.substeps == 0 {
            rk.sample(sys, step / sys.table.substeps)?;
        }
        Ok(())
    }
}

/// Points of the trajectory that go through the derivatives together.
struct Points<L> {
    count: usize,
    nodes: [usize; WIDEST],
    /// By point: state and accelerations, as they were.
    z: [Vec<f64>; WIDEST],
    u: [Vec<f64>; WIDEST],
    /// The same by lane.
    zl: Vec<L>,
    ul: Vec<L>,
}

impl<L: LaneScalar> Points<L> {
    fn new(m: usize) -> Self {
        Self {
            count: 0,
            nodes: [0; WIDEST],
            z: core::array::from_fn(|_| vec![0.0; 6 + 2 * m]),
            u: core::array::from_fn(|_| vec![0.0; 6 + m]),
            zl: vec![L::zero(); 6 + 2 * m],
            ul: vec![L::zero(); 6 + m],
        }
    }
    fn clear(&mut self) {
        self.count = 0;
    }
    fn push<T: LaneScalar>(&mut self, node: usize, z: &[T], u: &[T]) {
        self.nodes[self.count] = node;
        self.z[self.count].iter_mut().zip(z).for_each(|(x, z)| *x = z.lane(0));
        self.u[self.count].iter_mut().zip(u).for_each(|(x, u)| *x = u.lane(0));
        self.count += 1;
    }
    fn take(&mut self, node: usize, (z, u): (&[f64], &[f64])) {
        self.nodes[self.count] = node;
        self.z[self.count].copy_from_slice(z);
        self.u[self.count].copy_from_slice(u);
        self.count += 1;
    }
    fn point(&self, i: usize) -> (&[f64], &[f64]) {
        (&self.z[i], &self.u[i])
    }
    fn w(&self, i: usize) -> [f64; 3] {
        [self.z[i][3], self.z[i][4], self.z[i][5]]
    }
    /// Evaluates the derivatives at all points and hands them to `flow`. A group that is not full repeats its last. False where a
    /// mass matrix is not positive definite: these points were solved for, but in other arithmetic.
    #[inline(always)]
    fn differentiate(&mut self, tangent: &mut Tangent<'_, L>, flow: &mut Flow<L>) -> bool {
        for i in self.count..L::N {
            self.nodes[i] = self.nodes[self.count - 1];
        }
        pack(&mut self.zl, &self.z, self.count);
        pack(&mut self.ul, &self.u, self.count);
        let definite = tangent.evaluate(&self.nodes[..L::N], &self.zl, &self.ul);
        flow.take(tangent);
        definite
    }
}

/// Points `from` by lane; the last of `count` is repeated.
#[inline(always)]
fn pack<L: LaneScalar>(to: &mut [L], from: &[Vec<f64>; WIDEST], count: usize) {
    for (k, to) in to.iter_mut().enumerate() {
        let mut lanes = [0.0; WIDEST];
        for (i, x) in lanes.iter_mut().enumerate() {
            *x = from[i.min(count - 1)][k];
        }
        *to = L::load(&lanes);
    }
}
