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

use crate::linalg::rows::{RowTask, accumulate, by_rows, copy};
use crate::reduced::sensitivity::assemble::Gathered;
use crate::reduced::sensitivity::outputs::TorqueRows;
use crate::reduced::sensitivity::partials::Columns;
use crate::reduced::sensitivity::propagate::{BLOCK, Flow, initial_columns};
use crate::reduced::sensitivity::stage::Tangent;
use crate::reduced::system::{Reduced, ReducedError, Response, Rk4, STAGE, check};
use crate::reduced::table::Prescribed;
use crate::sim::attitude::{Attitude, AttitudeTrack};
use core::ops::Range;
use ff_lanes::{Kernel, Lanes, WIDEST};
use ff_model::scalar::LaneScalar;
use ff_model::scalar::lanes::{Isa, LaneTask, dispatch, splat};
use ff_model::{Model, Params};
use nalgebra::DMatrix;

/// What to differentiate, and with respect to what.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Wanted {
    /// Indices into the parameter vector (base body, tracked links, appendages).
    pub params: Vec<usize>,
    /// Indices into the initial state `z0 = [V 6 | eta m | nu m]`.
    pub initial: Vec<usize>,
    /// The acceleration of the base, too ([`Sensitivities::accel`]).
    pub accel: bool,
    /// The attitude of the base, too ([`Sensitivities::attitude`]).
    pub attitude: bool,
}

impl Wanted {
    /// Number of columns.
    pub fn len(&self) -> usize {
        self.params.len() + self.initial.len()
    }
    /// True without columns.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Bodies other than the base whose parameters are wanted: the `links` of [`Prescribed::new`].
    pub fn links(&self, model: &Model) -> Vec<usize> {
        let mut l: Vec<usize> =
            self.params.iter().filter(|&&p| p >= 10 && p < 10 * model.n_bodies()).map(|p| p / 10).collect();
        l.sort_unstable();
        l.dedup();
        l
    }
}

/// Derivatives of what is measured; row `i * n + j` is channel `j` of `n` at sample `i`, one column per entry of
/// [`Wanted`] (parameters first).
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

/// Integrates the reduced system and its sensitivities from `z0`; see [`crate::reduced::system::simulate_reduced`].
///
/// The response is bit for bit that of [`crate::reduced::system::simulate_reduced`]. Allocates results and buffers once.
///
/// # Errors
/// [`ReducedError`].
///
/// # Panics
/// If `z0` has the wrong length, an initial state does not exist or a wanted link is not tracked by `table`.
pub fn sensitivities(
    model: &Model,
    params: &Params<f64>,
    table: &Prescribed,
    z0: &[f64],
    wanted: &Wanted,
) -> Result<(Response, Sensitivities), ReducedError> {
    sensitivities_with(Isa::detect(), model, params, table, z0, wanted)
}

/// [`sensitivities`] with the lanes of a given instruction set. The response is that of [`crate::reduced::system::simulate_reduced`] to rounding, and
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
    run(isa, model, params, table, 0..table.samples, &mut Carried::start(model, z0, wanted), wanted)
}

/// What is handed from one part of a record to the next: state, its derivatives, and the attitude where it is wanted.
#[derive(Clone, Debug)]
pub struct Carried {
    z: Vec<f64>,
    /// By block of columns, as `flow.rs` keeps them.
    pub(crate) dz: Vec<f64>,
    track: Option<AttitudeTrack>,
    pub(crate) dtheta: Vec<f64>,
}

impl Carried {
    /// At the first sample of a record, with the state `z0 = [V 6 | eta m | nu m]`. Allocates.
    ///
    /// # Panics
    /// If `z0` has the wrong length or an initial state does not exist.
    pub fn start(model: &Model, z0: &[f64], wanted: &Wanted) -> Self {
        let nz = 6 + 2 * model.np();
        assert_eq!(z0.len(), nz, "initial state");
        assert!(wanted.initial.iter().all(|&i| i < nz), "index of an initial state");
        let dz = initial_columns(model, wanted);
        let width = wanted.len().next_multiple_of(BLOCK);
        let dtheta = vec![0.0; if wanted.attitude { 3 * width } else { 0 }];
        Self { z: z0.to_vec(), dz, track: wanted.attitude.then(AttitudeTrack::default), dtheta }
    }
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
    run(Isa::detect(), model, params, table, span, carried, wanted)
}

fn run(
    isa: Isa,
    model: &Model,
    params: &Params<f64>,
    table: &Prescribed,
    span: Range<usize>,
    carried: &mut Carried,
    wanted: &Wanted,
) -> Result<(Response, Sensitivities), ReducedError> {
    check(model)?;
    assert!(span.start < span.end && span.end <= table.samples, "samples of a span");
    let columns = Columns::new(model, table, &wanted.params);
    dispatch(isa, Run { model, params, table, span, carried, wanted, columns: &columns })
}

struct Run<'a> {
    model: &'a Model,
    params: &'a Params<f64>,
    table: &'a Prescribed,
    span: Range<usize>,
    carried: &'a mut Carried,
    wanted: &'a Wanted,
    columns: &'a Columns,
}

impl LaneTask for Run<'_> {
    type Output = Result<(Response, Sensitivities), ReducedError>;
    #[inline(always)]
    fn run<L: LaneScalar>(self) -> Self::Output {
        let Self { model, params, table, span, carried, wanted, columns } = self;
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
                return Ok(sink.done());
            }
            points.clear();
            // The last sample is an evaluation without a step.
            'points: for step in first..first + steps.max(1) {
                for stage in 0..4 {
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
                rk.finish();
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
                return Ok(sink.done());
            }
            first += steps;
        }
    }
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

/// Where samples go.
pub(crate) struct Sink<'a, L> {
    model: &'a Model,
    response: Response,
    /// Joint torques of the present sample.
    tau: Vec<f64>,
    d_tau: Gathered<L>,
    d_gyro: Gathered<L>,
    accel: Option<Gathered<L>>,
    rows: TorqueRows<'a>,
    /// Sample of the table that is the first here, and the present one, counted from it.
    first: usize,
    sample: usize,
    track: Option<AttitudeTrack>,
    attitude: Option<Attitude>,
}

impl<'a, L: LaneScalar> Sink<'a, L> {
    fn new(
        model: &'a Model,
        params: &'a Params<f64>,
        table: &'a Prescribed,
        wanted: &Wanted,
        columns: &'a Columns,
        span: &Range<usize>,
    ) -> Self {
        let (n, p) = (span.len(), wanted.len());
        Self {
            model,
            response: Response::new(n, model.nj(), model.np()),
            tau: vec![0.0; model.nj()],
            d_tau: Gathered::new(model.nj(), n, p),
            d_gyro: Gathered::new(3, n, p),
            accel: wanted.accel.then(|| Gathered::new(6, n, p)),
            rows: TorqueRows::new(model, params, table, columns),
            first: span.start,
            sample: 0,
            track: None,
            attitude: wanted.attitude.then(|| Attitude::new(n, p)),
        }
    }

    /// Begins a sample with state `z` and accelerations `u`.
    #[inline(always)]
    fn begin(&mut self, sample: usize, (z, u): (&[f64], &[f64])) {
        self.sample = sample - self.first;
        // One call: it is inlined.
        for gathered in [Some(&mut self.d_tau), Some(&mut self.d_gyro), self.accel.as_mut()].into_iter().flatten() {
            gathered.begin(self.sample);
        }
        self.rows.evaluate(sample, z, u);
    }

    /// Torque and gyro derivatives of a block of columns at the present sample, from `dz` and `du`.
    #[inline(always)]
    pub(crate) fn take<const W: usize>(&mut self, block: usize, dz: &[[L; W]], du: &[[L; W]]) {
        let (rows, at) = (&self.rows, self.sample);
        by_rows::<W>(0..self.model.nj(), &mut Torques { rows, block, dz, du, to: self.d_tau.rows(block, at) });
        copy::<_, 3>(dz, self.d_gyro.rows(block, at));
        if let Some(to) = &mut self.accel {
            copy::<_, 6>(du, to.rows(block, at));
        }
    }

    #[inline(always)]
    fn done(self) -> (Response, Sensitivities) {
        let Self { d_tau, d_gyro, accel, response, attitude, .. } = self;
        (response, Sensitivities { tau: d_tau.done(), gyro: d_gyro.done(), accel: accel.map(Gathered::done), attitude })
    }
}

/// Torques of a block of columns at a sample.
struct Torques<'a, L, const W: usize> {
    rows: &'a TorqueRows<'a>,
    block: usize,
    dz: &'a [[L; W]],
    du: &'a [[L; W]],
    to: &'a mut [[L; W]],
}

impl<L: LaneScalar, const W: usize> RowTask for Torques<'_, L, W> {
    #[inline(always)]
    fn rows<const R: usize>(&mut self, from: usize) {
        let TorqueRows { by_u, by_z, by_p, wide, carried, .. } = self.rows;
        let nj = self.to.len();
        let mut s = [[L::zero(); W]; R];
        let (mut du, mut dz) = (self.du, self.dz);
        if !carried {
            (du, dz) = (&du[..6], &dz[..3]);
        } else if self.block * BLOCK < *wide {
            for r in 0..R {
                let own = &by_p[(from + r) * wide + self.block * BLOCK..];
                for w in 0..W {
                    s[r][w] = L::load(&own[w * L::N..]);
                }
            }
        }
        accumulate(&mut s, L::splat, by_u, nj, from, du);
        accumulate(&mut s, L::splat, by_z, nj, from, dz);
        copy::<_, R>(&s, &mut self.to[from..]);
    }
}
