//! Exact sensitivities of the simulated record with respect to any parameters, integrated beside the states.
//!
//! Differentiating `0 = R(z, u, p)` of [`crate::reduced`] with `u = [a | al | nu']`:
//!
//! ```text
//! M du = -(R_z dz + R_p dp),      M = R_u,
//! ```
//!
//! so one regressor `R_p`, one derivative pass `R_z` and one factorisation of `M` per stage serve all parameters
//! (`docs/theory/derivatives.md`). The trajectory does not depend on its derivatives: the stages of a step (of two, with
//! eight lanes) are integrated first, their derivatives are evaluated together, one stage per lane (`tangent.rs`), and
//! the columns `dz` are then carried through the step, several columns per vector. The discrete sensitivities are the
//! exact derivatives of the discrete (RK4) solution.

use crate::attitude::{Attitude, AttitudeTrack};
use crate::prescribed::Prescribed;
use crate::reduced::{Reduced, ReducedError, Response, Rk4, STAGE, WEIGHT, check};
use crate::tangent::{Columns, Tangent, TorqueRows, fma};
use ff_lanes::{Kernel, Lanes};
use ff_model::lanes::{Isa, LaneTask, dispatch, splat};
use ff_model::{LaneScalar, Model, Params};
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
    /// `(N 6) x P`: what [`crate::Accelerometer::derivative`] makes an accelerometer's derivatives of.
    pub accel: Option<DMatrix<f64>>,
    /// Attitude since the start, and its derivatives.
    pub attitude: Option<Attitude>,
}

/// Integrates the reduced system and its sensitivities from `z0`; see [`crate::simulate_reduced`].
///
/// The response is bit for bit that of [`crate::simulate_reduced`]. Allocates results and buffers once.
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
    check(model)?;
    let nz = 6 + 2 * model.np();
    assert_eq!(z0.len(), nz, "initial state");
    assert!(wanted.initial.iter().all(|&i| i < nz), "index of an initial state");
    let columns = Columns::new(model, table, &wanted.params);
    dispatch(Isa::detect(), Run { model, params, table, z0, wanted, columns: &columns })
}

struct Run<'a> {
    model: &'a Model,
    params: &'a Params<f64>,
    table: &'a Prescribed,
    z0: &'a [f64],
    wanted: &'a Wanted,
    columns: &'a Columns,
}

impl LaneTask for Run<'_> {
    type Output = Result<(Response, Sensitivities), ReducedError>;
    #[inline(always)]
    fn run<L: LaneScalar>(self) -> Self::Output {
        let Self { model, params, table, z0, wanted, columns } = self;
        let m = model.np();
        let lifted = params.lift::<L>(model);
        let single = params.lift::<L::One>(model);
        let mut sys = Reduced::new(model, &single, table);
        let mut rk = Rk4::new(model, &splat::<L::One>(z0));
        let mut tangent = Tangent::<L>::new(model, &lifted, table, columns);
        let mut points = Points::<L>::new(m);
        let mut flow = Flow::<L>::new(model, tangent.nz, wanted, table.step);
        let mut sink = Sink::new(model, params, table, wanted, columns);
        let last = (table.samples - 1) * table.substeps;
        let at_once = L::N / 4;
        let mut first = 0;
        // One call of `differentiate`: it is inlined, once per instruction set.
        loop {
            let steps = at_once.min(last - first);
            points.clear();
            // The last sample is an evaluation without a step.
            'points: for step in first..first + steps.max(1) {
                for stage in 0..4 {
                    one_stage(&mut rk, &mut sys, step, stage)?;
                    points.push(2 * step + STAGE[stage], &rk.zs, &rk.u);
                    if stage == 0 && step % table.substeps == 0 {
                        let (z, u) = points.point(points.count - 1);
                        sink.tau.iter_mut().zip(&rk.tau).for_each(|(x, t)| *x = t.lane(0));
                        sink.response.write(step / table.substeps, m, z, u, &sink.tau);
                    }
                    if step == last {
                        break 'points;
                    }
                    rk.rate(table.step, stage);
                }
                rk.finish();
            }
            points.differentiate(&mut tangent, &mut flow);
            for step in first..first + steps.max(1) {
                let (lane, sample) = (4 * (step - first), step % table.substeps == 0);
                if sample && let Some(track) = &sink.track {
                    flow.attitude_rows(&mut sink.attitude, track, step / table.substeps);
                }
                if let Some(track) = &mut sink.track
                    && step < last
                {
                    flow.turn = Some(track.step(table.step, core::array::from_fn(|s| points.w(lane + s))));
                }
                flow.step(lane, sample, step < last, &points);
                if sample {
                    sink.take(step / table.substeps, points.point(lane), &flow);
                }
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
        let t = 0.5 * sys.table.step * (2 * step + STAGE[stage]) as f64;
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
    nodes: [usize; 8],
    /// By point: state and accelerations, as they were.
    z: [Vec<f64>; 8],
    u: [Vec<f64>; 8],
    /// The same by lane.
    zl: Vec<L>,
    ul: Vec<L>,
}

impl<L: LaneScalar> Points<L> {
    fn new(m: usize) -> Self {
        Self {
            count: 0,
            nodes: [0; 8],
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
    /// Evaluates the derivatives at all points and hands them to `flow`. A group that is not full repeats its last.
    #[inline(always)]
    fn differentiate(&mut self, tangent: &mut Tangent<'_, L>, flow: &mut Flow<L>) {
        for i in self.count..L::N {
            self.nodes[i] = self.nodes[self.count - 1];
        }
        let pack = |to: &mut [L], from: &[Vec<f64>; 8], count: usize| {
            for (k, to) in to.iter_mut().enumerate() {
                let mut lanes = [0.0; 8];
                for (i, x) in lanes.iter_mut().enumerate() {
                    *x = from[i.min(count - 1)][k];
                }
                *to = L::load(&lanes);
            }
        };
        pack(&mut self.zl, &self.z, self.count);
        pack(&mut self.ul, &self.u, self.count);
        tangent.evaluate(&self.nodes[..L::N], &self.zl, &self.ul);
        // These points were solved for, so their mass matrices are definite.
        tangent.solve();
        flow.take(tangent);
    }
}

/// The columns `dz`, and what carries them through a step.
struct Flow<L> {
    m: usize,
    /// Rows of the accelerations and of the state.
    n: usize,
    nz: usize,
    /// Wanted parameters, and columns in all, and these rounded up to whole vectors.
    np: usize,
    pub(crate) count: usize,
    width: usize,
    h: f64,
    /// Per stage: `-M^-1 R_z`, `n x nz`, and `-M^-1 R_p`, `n x width`, row-major.
    gain: Vec<f64>,
    force: Vec<f64>,
    /// `[w 3 | eta | nu | (v 3)] x width`, row-major, and accelerations `n x width` at the present sample.
    dz: Vec<f64>,
    at_sample: Vec<f64>,
    du: Vec<f64>,
    /// Derivatives of the attitude, `3 x width`, and how they go through the step.
    dtheta: Vec<f64>,
    turn: Option<crate::attitude::Turned>,
    /// One block of columns.
    x0: Vec<L>,
    x: Vec<L>,
    k: Vec<L>,
    sum: Vec<L>,
    y: Vec<L>,
}

impl<L: LaneScalar> Flow<L> {
    fn new(model: &Model, nz: usize, wanted: &Wanted, h: f64) -> Self {
        let (m, count) = (model.np(), wanted.len());
        let (n, width) = (6 + m, count.next_multiple_of(8).max(8));
        let mut dz = vec![0.0; nz * width];
        for (c, &i) in wanted.initial.iter().enumerate() {
            // The state of the record is `[v | w | eta | nu]`.
            let row = if i < 3 { 3 + 2 * m + i } else { i - 3 };
            if row < nz {
                dz[row * width + wanted.params.len() + c] = 1.0;
            }
        }
        let z = |k| vec![L::zero(); k];
        Self {
            m,
            n,
            nz,
            np: wanted.params.len(),
            count,
            width,
            h,
            gain: vec![0.0; 8 * n * nz],
            force: vec![0.0; 8 * n * width],
            at_sample: dz.clone(),
            dz,
            du: vec![0.0; n * width],
            dtheta: vec![0.0; if wanted.attitude { 3 * width } else { 0 }],
            turn: None,
            x0: z(nz),
            x: z(nz),
            k: z(nz),
            sum: z(nz),
            y: z(n),
        }
    }

    /// Turns lanes of stages into rows of parameters.
    #[inline(always)]
    fn take(&mut self, t: &Tangent<'_, L>) {
        let (n, nz, width) = (self.n, self.nz, self.width);
        let mut lane = [0.0; 8];
        for c in 0..nz {
            for r in 0..n {
                t.gz[c * n + r].store(&mut lane);
                for (i, &x) in lane[..L::N].iter().enumerate() {
                    self.gain[(i * n + r) * nz + c] = x;
                }
            }
        }
        // Eight columns at a time, so that rows are written in whole vectors; spare columns stay zero.
        let mut block = [[0.0; 8]; 8];
        for first in (0..self.np).step_by(8) {
            let columns = 8.min(self.np - first);
            for r in 0..n {
                for (k, b) in block.iter_mut().enumerate().take(columns) {
                    t.gp[(first + k) * n + r].store(b);
                }
                for i in 0..L::N {
                    let mut row = [0.0; 8];
                    for (k, x) in row.iter_mut().enumerate() {
                        *x = block[k][i];
                    }
                    let to = (i * n + r) * width + first;
                    self.force[to..to + columns].copy_from_slice(&row[..columns]);
                }
            }
        }
    }

    /// `du` of the columns in `x` from row `from` on, at a stage, into `y`.
    #[inline(always)]
    fn accelerations(&mut self, lane: usize, block: usize, from: usize) {
        let (n, nz, width) = (self.n, self.nz, self.width);
        let gain = &self.gain[lane * n * nz..(lane + 1) * n * nz];
        let force = &self.force[lane * n * width..(lane + 1) * n * width];
        let mut r = from;
        while r < n {
            let left = (n - r).min(4);
            let f = &force[r * width + block..];
            let (g, y) = (&gain[r * nz..(r + left) * nz], &mut self.y[r..r + left]);
            match left {
                4 => product::<L, 4>(g, &self.x, f, width, y),
                3 => product::<L, 3>(g, &self.x, f, width, y),
                2 => product::<L, 2>(g, &self.x, f, width, y),
                _ => product::<L, 1>(g, &self.x, f, width, y),
            }
            r += left;
        }
    }

    /// Carries all columns through the step whose stages are lanes `lane..lane + 4`; keeps `dz` and `du` at its
    /// start where that is a sample. Without `advance` there is nothing but that start.
    #[inline(always)]
    fn step(&mut self, lane: usize, sample: bool, advance: bool, points: &Points<L>) {
        let (n, nz, m, width) = (self.n, self.nz, self.m, self.width);
        let at_speed = nz > 3 + 2 * m;
        for block in (0..width).step_by(L::N) {
            for c in 0..nz {
                self.x0[c] = L::load(&self.dz[c * width + block..]);
                if sample {
                    self.x0[c].store(&mut self.at_sample[c * width + block..]);
                }
            }
            let mut theta = match &self.turn {
                Some(t) if !self.dtheta.is_empty() => Some(t.carried(&self.dtheta, width, block)),
                _ => None,
            };
            for stage in 0..4 {
                let c = L::splat(0.5 * self.h * STAGE[stage] as f64);
                for i in 0..nz {
                    self.x[i] = if stage == 0 { self.x0[i] } else { fma(c, self.k[i], self.x0[i]) };
                }
                if let (Some(theta), Some(turn)) = (&mut theta, &self.turn) {
                    turn.add(theta, stage, &self.x[..3]);
                }
                let all = at_speed || (sample && stage == 0);
                self.accelerations(lane + stage, block, if all { 0 } else { 3 });
                if sample && stage == 0 {
                    for r in 0..n {
                        self.y[r].store(&mut self.du[r * width + block..]);
                    }
                }
                if !advance {
                    break;
                }
                self.k[..3].copy_from_slice(&self.y[3..6]);
                self.k[3..3 + m].copy_from_slice(&self.x[3 + m..3 + 2 * m]);
                self.k[3 + m..3 + 2 * m].copy_from_slice(&self.y[6..]);
                if at_speed {
                    // v' = a - w x v.
                    let z = &points.z[lane + stage];
                    let s = |i: usize| L::splat(z[i]);
                    for i in 0..3 {
                        let (j, l) = ((i + 1) % 3, (i + 2) % 3);
                        let (w, v) = (&self.x[..3], &self.x[3 + 2 * m..]);
                        let turned = w[j] * s(l) - w[l] * s(j) + (s(3 + j) * v[l] - s(3 + l) * v[j]);
                        self.k[3 + 2 * m + i] = self.y[i] - turned;
                    }
                }
                let weight = L::splat(WEIGHT[stage] * self.h);
                for i in 0..nz {
                    let from = if stage == 0 { self.x0[i] } else { self.sum[i] };
                    self.sum[i] = fma(weight, self.k[i], from);
                }
            }
            if !advance {
                continue;
            }
            for c in 0..nz {
                self.sum[c].store(&mut self.dz[c * width + block..]);
            }
            if let Some(theta) = theta {
                theta.iter().enumerate().for_each(|(i, x)| x.store(&mut self.dtheta[i * width + block..]));
            }
        }
    }

    /// Writes the attitude and its derivatives at a sample.
    fn attitude_rows(&self, to: &mut Option<Attitude>, track: &AttitudeTrack, sample: usize) {
        if let Some(to) = to {
            to.write(sample, track, &self.dtheta, self.width, self.count);
        }
    }
}

/// `y = f + G x`: `R` rows of `G` and of `f`, one block of columns.
#[inline(always)]
fn product<L: LaneScalar, const R: usize>(g: &[f64], x: &[L], f: &[f64], width: usize, y: &mut [L]) {
    let nz = x.len();
    let mut rows = [g; R];
    let mut sum = [L::zero(); R];
    for r in 0..R {
        rows[r] = &g[r * nz..(r + 1) * nz];
        sum[r] = L::load(&f[r * width..]);
    }
    for (c, &x) in x.iter().enumerate() {
        for r in 0..R {
            sum[r] = fma(L::splat(rows[r][c]), x, sum[r]);
        }
    }
    y.copy_from_slice(&sum);
}

/// Where samples go.
struct Sink<'a> {
    model: &'a Model,
    response: Response,
    /// Joint torques of the present sample.
    tau: Vec<f64>,
    d_tau: Vec<f64>,
    d_gyro: Vec<f64>,
    accel: Option<Vec<f64>>,
    samples: usize,
    rows: TorqueRows<'a>,
    np: usize,
    track: Option<AttitudeTrack>,
    attitude: Option<Attitude>,
}

impl<'a> Sink<'a> {
    fn new(
        model: &'a Model,
        params: &'a Params<f64>,
        table: &'a Prescribed,
        wanted: &Wanted,
        columns: &'a Columns,
    ) -> Self {
        let (n, p) = (table.samples, wanted.len());
        Self {
            model,
            response: Response::new(n, model.nj(), model.np()),
            tau: vec![0.0; model.nj()],
            d_tau: vec![0.0; n * model.nj() * p],
            d_gyro: vec![0.0; n * 3 * p],
            accel: wanted.accel.then(|| vec![0.0; n * 6 * p]),
            samples: n,
            rows: TorqueRows::new(model, params, table, columns),
            np: columns.count,
            track: wanted.attitude.then(AttitudeTrack::default),
            attitude: wanted.attitude.then(|| Attitude::new(n, p)),
        }
    }

    /// Torque and gyro derivatives at a sample.
    #[inline(always)]
    fn take<L: LaneScalar>(&mut self, sample: usize, (z, u): (&[f64], &[f64]), flow: &Flow<L>) {
        let (n, nz, nj) = (self.samples, flow.nz, self.model.nj());
        self.rows.evaluate(sample, z, u);
        let carried = self.rows.carried;
        let (used_u, used_z) = if carried { (flow.n, nz) } else { (6, 3) };
        let mut lane = [0.0; 8];
        for block in (0..flow.count).step_by(L::N) {
            let columns = block..(block + L::N).min(flow.count);
            for j in 0..nj {
                let mut s = L::zero();
                for (r, &t) in self.rows.by_u[j * flow.n..][..used_u].iter().enumerate() {
                    s = fma(L::splat(t), L::load(&flow.du[r * flow.width + block..]), s);
                }
                for (c, &t) in self.rows.by_z[j * nz..][..used_z].iter().enumerate() {
                    s = fma(L::splat(t), L::load(&flow.at_sample[c * flow.width + block..]), s);
                }
                s.store(&mut lane);
                for c in columns.clone() {
                    let own = if carried && c < self.np { self.rows.by_p[j * self.np + c] } else { 0.0 };
                    self.d_tau[(c * n + sample) * nj + j] = lane[c - block] + own;
                }
            }
        }
        for c in 0..flow.count {
            for k in 0..3 {
                self.d_gyro[(c * n + sample) * 3 + k] = flow.at_sample[k * flow.width + c];
            }
            if let Some(a) = &mut self.accel {
                (0..6).for_each(|k| a[(c * n + sample) * 6 + k] = flow.du[k * flow.width + c]);
            }
        }
    }

    fn done(self) -> (Response, Sensitivities) {
        let (n, nj) = (self.samples, self.model.nj());
        let matrix = |rows: usize, x: Vec<f64>| {
            let columns = x.len().checked_div(rows).unwrap_or(0);
            DMatrix::from_vec(rows, columns, x)
        };
        let s = Sensitivities {
            tau: matrix(n * nj, self.d_tau),
            gyro: matrix(n * 3, self.d_gyro),
            accel: self.accel.map(|a| matrix(n * 6, a)),
            attitude: self.attitude,
        };
        (self.response, s)
    }
}
