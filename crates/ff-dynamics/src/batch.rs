//! Algorithms of [`crate::tree`] for many motions at once, one per vector lane: tables of numbers in, tables of numbers out.
//!
//! A table holds one motion per row. A row of positions is `[base position 3 | base attitude w x y z | joints n | passive m]`, without
//! the first seven numbers for a fixed base ([`position_width`]); rows of velocities, accelerations and forces have `nv` numbers in the
//! order `[base 6 | joints n | passive m]`. Units are SI, frames those of [`crate::tree`].

use crate::analysis::budget;
use crate::state::State;
use crate::tree::{
    Derivatives, Regressor, SingularInertia, forward_dynamics, frame_jacobian, frame_pose, hybrid_dynamics,
    mass_matrix, regressor, rnea, rnea_derivatives,
};
use crate::work::buffers::Work;
use ff_model::scalar::LaneScalar;
use ff_model::scalar::lanes::{Isa, LaneTask, dispatch, splat};
use ff_model::{BaseKind, Model, Params};
use nalgebra::DMatrix;

/// Numbers in a row of positions: `7 + n + m`, or `n + m` for a fixed base.
pub fn position_width(model: &Model) -> usize {
    let base = if model.base_kind() == BaseKind::Floating { 7 } else { 0 };
    base + model.nj() + model.np()
}

/// What is computed for every row, and what a row of the result holds; matrices stand row by row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Algorithm {
    /// [`rnea`] of accelerations: generalised forces, `nv`.
    Rnea,
    /// [`mass_matrix`]: `nv x nv`.
    MassMatrix,
    /// [`forward_dynamics`] of generalised forces: accelerations, `nv`.
    ForwardDynamics,
    /// [`hybrid_dynamics`] of joint accelerations (`n` numbers a row): accelerations, `nv`, then joint torques, `n`.
    HybridDynamics,
    /// [`regressor`] at accelerations: `nv x n_params`.
    Regressor,
    /// [`rnea_derivatives`] at accelerations: `d tau / d q`, `d tau / d v`, `d tau / d a`, `nv x nv` each.
    Derivatives,
    /// [`budget`]: linear momentum 3 and angular momentum about the origin 3, angular momentum about the centre of mass 3, centre of
    /// mass 3 (world axes), kinetic and potential energy.
    Momentum,
    /// [`frame_pose`] of a frame of the model, by index: homogeneous transform to the world, `4 x 4`.
    FramePose(usize),
    /// [`frame_jacobian`] of a frame of the model, by index: `6 x nv`.
    FrameJacobian(usize),
}

impl Algorithm {
    /// Numbers in a row of what is given beside positions and velocities: accelerations, forces, or nothing.
    pub fn given_width(self, model: &Model) -> usize {
        match self {
            Self::Rnea | Self::ForwardDynamics | Self::Regressor | Self::Derivatives => model.nv(),
            Self::HybridDynamics => model.nj(),
            _ => 0,
        }
    }
    /// Whether velocities count.
    pub fn needs_velocities(self) -> bool {
        !matches!(self, Self::MassMatrix | Self::FramePose(_) | Self::FrameJacobian(_))
    }
    /// Numbers in a row of the result.
    pub fn result_width(self, model: &Model) -> usize {
        let nv = model.nv();
        match self {
            Self::Rnea | Self::ForwardDynamics => nv,
            Self::MassMatrix => nv * nv,
            Self::HybridDynamics => nv + model.nj(),
            Self::Regressor => nv * model.n_params(),
            Self::Derivatives => 3 * nv * nv,
            Self::Momentum => 14,
            Self::FramePose(_) => 16,
            Self::FrameJacobian(_) => 6 * nv,
        }
    }
}

/// Motions as tables, row by row; see the [module](self). Velocities and what is given are empty where the algorithm takes none.
#[derive(Clone, Copy, Debug)]
pub struct Motions<'a> {
    /// Number of motions.
    pub rows: usize,
    /// Positions, `rows x` [`position_width`]; attitudes of unit norm.
    pub q: &'a [f64],
    /// Velocities, `rows x nv`.
    pub v: &'a [f64],
    /// Accelerations or forces, `rows x` [`Algorithm::given_width`].
    pub given: &'a [f64],
}

/// Why a batch stopped.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("rows {first} to {last}: {source}")]
pub struct BatchError {
    /// First of the rows that went through the equations together.
    pub first: usize,
    /// Last of them.
    pub last: usize,
    /// What happened in one of them.
    pub source: SingularInertia,
}

/// Computes `algorithm` for every row, as many rows at a time as the machine has lanes (momentum and frames one by one); `out` is `rows x`
/// [`Algorithm::result_width`], row by row.
///
/// Results equal those of the algorithm row by row but for rounding (lanes use fused multiply-adds). Allocates buffers for one group
/// of rows, whatever their number.
///
/// # Errors
/// [`BatchError`] for a mass matrix that is not positive definite; rows before it are written.
///
/// # Panics
/// If a table has the wrong length, or the model has no such frame.
pub fn batch(
    algorithm: Algorithm,
    model: &Model,
    params: &Params<f64>,
    motions: &Motions<'_>,
    out: &mut [f64],
) -> Result<(), BatchError> {
    let n = motions.rows;
    assert_eq!(motions.q.len(), n * position_width(model), "positions");
    let v = if algorithm.needs_velocities() { model.nv() } else { 0 };
    assert_eq!(motions.v.len(), n * v, "velocities");
    assert_eq!(motions.given.len(), n * algorithm.given_width(model), "accelerations or forces");
    assert_eq!(out.len(), n * algorithm.result_width(model), "results");
    let task = Batch { algorithm, model, params, motions, out };
    match algorithm {
        // Not compiled for lanes, where each of their operations would be a call.
        Algorithm::Momentum | Algorithm::FramePose(_) | Algorithm::FrameJacobian(_) => task.run::<f64>(),
        _ => dispatch(Isa::detect(), task),
    }
}

struct Batch<'a> {
    algorithm: Algorithm,
    model: &'a Model,
    params: &'a Params<f64>,
    motions: &'a Motions<'a>,
    out: &'a mut [f64],
}

impl LaneTask for Batch<'_> {
    type Output = Result<(), BatchError>;
    #[inline(always)]
    fn run<L: LaneScalar>(self) -> Self::Output {
        let Self { algorithm, model, params, motions, out } = self;
        let params = Params::from_values(model, splat::<L>(params.values()));
        let mut group = Group::<L>::new(algorithm, model);
        let (wq, width) = (position_width(model), algorithm.result_width(model));
        let wv = if algorithm.needs_velocities() { model.nv() } else { 0 };
        let wg = algorithm.given_width(model);
        let mut first = 0;
        while first < motions.rows {
            let count = L::N.min(motions.rows - first);
            load(motions.q, wq, first, count, &mut group.q);
            load(motions.v, wv, first, count, &mut group.v);
            load(motions.given, wg, first, count, &mut group.given);
            group.place(model);
            group.compute(algorithm, model, &params).map_err(|source| BatchError {
                first,
                last: first + count - 1,
                source,
            })?;
            group.store(algorithm, model, count, &mut out[first * width..(first + count) * width]);
            first += count;
        }
        Ok(())
    }
}

/// Buffers for as many motions as there are lanes.
struct Group<L: LaneScalar> {
    q: Vec<L>,
    v: Vec<L>,
    given: Vec<L>,
    state: State<L>,
    work: Work<L>,
    /// A result without rows and columns.
    flat: Vec<L>,
    /// A result column by column.
    matrix: DMatrix<L>,
    regressor: Option<Regressor<L>>,
    derivatives: Option<Derivatives<L>>,
}

impl<L: LaneScalar> Group<L> {
    fn new(algorithm: Algorithm, model: &Model) -> Self {
        let (nv, zero) = (model.nv(), L::splat(0.0));
        let shape = match algorithm {
            Algorithm::MassMatrix => (nv, nv),
            Algorithm::FrameJacobian(_) => (6, nv),
            _ => (0, 0),
        };
        let flat = match algorithm {
            Algorithm::Rnea | Algorithm::ForwardDynamics => nv,
            Algorithm::HybridDynamics => nv + model.nj(),
            Algorithm::Momentum => 14,
            Algorithm::FramePose(_) => 16,
            _ => 0,
        };
        let velocities = if algorithm.needs_velocities() { nv } else { 0 };
        Self {
            q: vec![zero; position_width(model)],
            v: vec![zero; velocities],
            given: vec![zero; algorithm.given_width(model)],
            state: State::zero(model),
            work: Work::new(model),
            flat: vec![zero; flat],
            matrix: DMatrix::from_element(shape.0, shape.1, zero),
            regressor: (algorithm == Algorithm::Regressor).then(|| Regressor::new(model)),
            derivatives: (algorithm == Algorithm::Derivatives).then(|| Derivatives::new(model)),
        }
    }
    /// The state of the positions and velocities that were loaded.
    #[inline(always)]
    fn place(&mut self, model: &Model) {
        let s = &mut self.state;
        let mut at = 0;
        if model.base_kind() == BaseKind::Floating {
            for k in 0..3 {
                s.pos[k] = self.q[k];
            }
            for k in 0..4 {
                s.att[k] = self.q[3 + k];
            }
            at = 7;
        }
        let nj = model.nj();
        s.q.copy_from_slice(&self.q[at..at + nj]);
        s.eta.copy_from_slice(&self.q[at + nj..]);
        if !self.v.is_empty() {
            s.v.copy_from_slice(&self.v);
        }
    }
    #[inline(always)]
    fn compute(&mut self, algorithm: Algorithm, model: &Model, params: &Params<L>) -> Result<(), SingularInertia> {
        let Self { given, state, work, flat, matrix, .. } = self;
        match algorithm {
            Algorithm::Rnea => rnea(model, params, state, given, work, flat),
            Algorithm::MassMatrix => mass_matrix(model, params, state, work, matrix),
            Algorithm::ForwardDynamics => forward_dynamics(model, params, state, given, work, flat)?,
            Algorithm::HybridDynamics => {
                let (a, tau) = flat.split_at_mut(model.nv());
                hybrid_dynamics(model, params, state, given, work, a, tau)?;
            }
            Algorithm::Regressor => {
                if let Some(y) = &mut self.regressor {
                    regressor(model, params, state, given, work, y);
                }
            }
            Algorithm::Derivatives => {
                if let Some(d) = &mut self.derivatives {
                    rnea_derivatives(model, params, state, given, work, d);
                }
            }
            Algorithm::Momentum => {
                let b = budget(model, params, state, work);
                for k in 0..3 {
                    flat[k] = b.momentum.lin[k];
                    flat[3 + k] = b.momentum.ang[k];
                    flat[6 + k] = b.angular_com[k];
                    flat[9 + k] = b.com[k];
                }
                (flat[12], flat[13]) = (b.kinetic, b.potential);
            }
            Algorithm::FramePose(frame) => {
                let x = frame_pose(model, state, &model.frames()[frame], work);
                for r in 0..3 {
                    for c in 0..3 {
                        flat[4 * r + c] = x.rot[(r, c)];
                    }
                    flat[4 * r + 3] = x.pos[r];
                }
                flat[15] = L::splat(1.0);
            }
            Algorithm::FrameJacobian(frame) => frame_jacobian(model, state, &model.frames()[frame], work, matrix),
        }
        Ok(())
    }
    #[inline(always)]
    fn store(&self, algorithm: Algorithm, model: &Model, count: usize, out: &mut [f64]) {
        let (nv, width) = (model.nv(), out.len() / count);
        match algorithm {
            Algorithm::MassMatrix | Algorithm::FrameJacobian(_) => {
                store(self.matrix.as_slice(), self.matrix.nrows(), count, 0, width, out);
            }
            Algorithm::Regressor => {
                if let Some(y) = &self.regressor {
                    store(y.as_slice(), nv, count, 0, width, out);
                }
            }
            Algorithm::Derivatives => {
                for (k, m) in self.derivatives.iter().flat_map(|d| [&d.dq, &d.dv, &d.da]).enumerate() {
                    store(m.as_slice(), nv, count, k * nv * nv, width, out);
                }
            }
            // One row of numbers: a matrix of one row.
            _ => store(&self.flat, 1, count, 0, width, out),
        }
    }
}

/// Rows `first..first + count` of a table into lanes; lanes without a row repeat the last one.
#[inline(always)]
fn load<L: LaneScalar>(table: &[f64], width: usize, first: usize, count: usize, to: &mut [L]) {
    if width == 0 {
        return;
    }
    let row = |l: usize| &table[(first + l.min(count - 1)) * width..][..width];
    let mut k = 0;
    while k + L::N <= width {
        let mut rows = [L::splat(0.0); ff_lanes::WIDEST];
        for (l, to) in rows[..L::N].iter_mut().enumerate() {
            *to = L::load(&row(l)[k..]);
        }
        let columns = L::transpose(&rows, 1);
        to[k..k + L::N].copy_from_slice(&columns[..L::N]);
        k += L::N;
    }
    while k < width {
        for l in 0..L::N {
            to[k].set_lane(l, row(l)[k]);
        }
        k += 1;
    }
}

/// Writes a matrix of `nrows` rows, column by column in lanes, into the first `count` rows of a table of `width` numbers a row, row
/// by row from column `at` on.
#[inline(always)]
fn store<L: LaneScalar>(matrix: &[L], nrows: usize, count: usize, at: usize, width: usize, out: &mut [f64]) {
    let ncols = matrix.len() / nrows.max(1);
    for r in 0..nrows {
        let to = at + r * ncols;
        let mut c = 0;
        while c + L::N <= ncols {
            let lanes = L::transpose(&matrix[c * nrows + r..], nrows);
            for (l, x) in lanes[..L::N].iter().take(count).enumerate() {
                x.store(&mut out[l * width + to + c..]);
            }
            c += L::N;
        }
        while c < ncols {
            let x = matrix[c * nrows + r];
            for l in 0..count {
                out[l * width + to + c] = x.lane(l);
            }
            c += 1;
        }
    }
}
