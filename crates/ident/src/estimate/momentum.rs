//! Parameters from the conservation of angular momentum: joint motion and gyro alone, no torques, no accelerations.
//!
//! A system on which nothing acts keeps its momentum. In the inertial frame that moves with its centre of mass the linear
//! momentum is zero, so that the velocity of the base origin need not be measured: with the momentum regressor
//! `[P; L] = [Y_P; Y_L](q, v, omega, qd) phi` about the base origin in base axes, `P = 0` gives `v = -P_0 / M` (`P_0` the linear
//! momentum at `v = 0`, `M` the mass), and the angular momentum about the centre of mass `c` is `L` at that `v`. It is
//! constant in inertial axes,
//!
//! ```text
//! R_k L(phi)_k = l          R_k the attitude, l the (unknown) constant,
//! ```
//!
//! with the exact derivative `J = Y_L - [c]x Y_P` at the eliminated `v`, since `dL = Y_L + [M c]x dv/dphi` and `M dv/dphi = -Y_P`.
//! `L = J phi` (degree one), so that a Gauss-Newton step is a linear least-squares problem without remainder,
//! `J_k phi - R_k^T l = 0`: each step fits `phi` and `l` afresh, with `v` and `c` from the step before.
//!
//! The equations are homogeneous: any multiple of a solution is one. What is known, the arm as a rule, sets the scale, and
//! without anything known there is no answer ([`LinearError::NoScale`]). An error `d omega` of the gyro makes `I_c d omega` of
//! momentum, `I_c` the inertia of all about `c`; rows are therefore multiplied by `I_c^-1 / sigma`. Errors of the attitude are taken as
//! small beside that. Derivation: `docs/theory/linear-estimators.md`.

use crate::belief::covariance::Unknown;
use crate::estimate::complete::{base_rates, motion_at, trimmed};
use crate::estimate::rda::SetupError;
use crate::motion::joint_motion::joint_motion;
use crate::solve::linear;
use crate::solve::linear::{LinearError, LinearEstimate, Task, Weights};
use ff_dynamics::{Regressor, State, Work, mass_matrix, regressor};
use ff_least_squares::{TallQr, Triangle};
use ff_model::spatial::so3::{Quat, exp_so3, quat_identity, quat_mul, quat_to_rot};
use ff_model::{BaseKind, Model, Params};
use ff_records::Record;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

const NAME: &str = "the momentum estimator";
/// Relative change of every unknown at which the iteration has settled.
const SETTLED: f64 = 1e-11;
/// Part of the momentum that has to come from what is known.
const LEAST_KNOWN: f64 = 1e-6;

/// What the estimator assumes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MomentumOptions {
    /// Standard deviation of the gyro (rad/s).
    pub gyro: f64,
    /// Seconds left out at both ends.
    pub trim_s: f64,
    /// Most Gauss-Newton steps.
    pub max_steps: usize,
}

impl MomentumOptions {
    /// Given gyro noise, the whole record, 40 steps.
    pub fn new(gyro: f64) -> Self {
        Self { gyro, trim_s: 0.0, max_steps: 40 }
    }
}

/// The estimator.
#[derive(Clone, Debug)]
pub struct Momentum {
    model: Model,
    q: DMatrix<f64>,
    qd: DMatrix<f64>,
    rates: DMatrix<f64>,
    /// Base to inertial axes.
    attitude: Vec<Matrix3<f64>>,
    options: MomentumOptions,
}

/// Its result.
#[derive(Clone, Debug)]
pub struct MomentumEstimate {
    /// Parameters; `extra` holds the constant `momentum.x`, `.y`, `.z` in inertial axes (those of the recorded attitude, or of
    /// the base at the first sample).
    pub fit: LinearEstimate,
    /// Gauss-Newton steps.
    pub steps: usize,
    /// Whether the last step changed nothing any more.
    pub settled: bool,
}

impl Momentum {
    /// For a rigid, floating model and a record. The attitude is the recorded one, or else the integral of a spline through
    /// the gyro. Allocates.
    ///
    /// # Errors
    /// [`LinearError::Base`], [`LinearError::Setup`], [`LinearError::Option`].
    pub fn new(model: &Model, record: &Record, options: &MomentumOptions) -> Result<Self, LinearError> {
        if model.base_kind() != BaseKind::Floating {
            let hint = "the momentum of a robot on the ground is not conserved; use the ground calibration";
            return Err(LinearError::Base { estimator: NAME, needed: "floating", hint });
        }
        if model.np() > 0 {
            return Err(SetupError::NotRigid(model.np()).into());
        }
        if !(options.gyro.is_finite() && options.gyro > 0.0) {
            let what = "standard deviation of the gyro (rad/s)".into();
            return Err(LinearError::Option { what, value: options.gyro, needed: "positive and finite" });
        }
        let kept = trimmed(record, options.trim_s)?;
        let (q, qd, _) = motion_at(&*joint_motion(model, record)?, record, kept.clone());
        let attitude = match record.att() {
            Some(att) => kept
                .clone()
                .map(|i| quat_to_rot(&Quat::new(att[(i, 0)], att[(i, 1)], att[(i, 2)], att[(i, 3)])))
                .collect(),
            None => integrate(record)?.into_iter().skip(kept.start).take(kept.len()).collect(),
        };
        let rates = record.gyro().rows(kept.start, kept.len()).into_owned();
        let model = model.clone().with_gravity(Vector3::zeros());
        Ok(Self { model, q, qd, rates, attitude, options: *options })
    }
    /// Estimates the parameters `selected`; the others keep their value in `start` and set the scale. Allocates; memory does not
    /// grow with the record beyond its motion.
    ///
    /// # Errors
    /// [`LinearError`].
    pub fn estimate(&self, selected: &[usize], start: &[f64]) -> Result<MomentumEstimate, LinearError> {
        let decls = self.model.param_decls();
        linear::check(&decls, selected, start)?;
        let mut values = start.to_vec();
        let mut constant = [0.0; 3];
        let mut settled = false;
        let mut steps = 0;
        loop {
            let (triangle, scale) = self.rows(selected, &values)?;
            let unknown = |k: usize| {
                let name = format!("momentum.{}", ["x", "y", "z"][k]);
                (Unknown { name, unit: "kg m^2/s".into(), size: scale }, constant[k])
            };
            let task = Task {
                decls: &decls,
                selected,
                start: &values,
                extra: (0..3).map(unknown).collect(),
                weights: &Weights::Given(vec![1.0]),
            };
            let mut fit = linear::solve(&task, &[triangle])?;
            steps += 1;
            let sizes = fit.uncertainty.unknowns.iter().map(|u| u.size);
            let moves =
                fit.parameters.iter().chain(&fit.extra).zip(sizes).map(|(p, s)| ((p.value - p.start) / s).abs());
            settled |= moves.fold(0.0, f64::max) < SETTLED;
            values.clone_from(&fit.values);
            (0..3).for_each(|k| constant[k] = fit.extra[k].value);
            if settled || steps >= self.options.max_steps {
                for (p, &i) in fit.parameters.iter_mut().zip(selected) {
                    p.start = start[i];
                }
                fit.extra.iter_mut().for_each(|p| p.start = 0.0);
                return Ok(MomentumEstimate { fit, steps, settled });
            }
        }
    }
    /// The rows `I_c^-1 (J phi - R^T l) / sigma` at the present parameters, folded, and the size of the momentum.
    fn rows(&self, selected: &[usize], values: &[f64]) -> Result<(Triangle, f64), LinearError> {
        let model = &self.model;
        let (nv, nj, n, m) = (model.nv(), model.nj(), self.q.nrows(), selected.len());
        let params = Params::from_values(model, values.to_vec());
        let (mut work, mut state) = (Work::new(model), State::<f64>::zero(model));
        let (mut h, mut y) = (DMatrix::zeros(nv, nv), Regressor::new(model));
        let mut u = vec![0.0; nv];
        let mut qr = TallQr::new(m + 4);
        let mut rows = DMatrix::zeros(3, m + 4);
        let (mut known_part, mut whole, mut size) = (0.0, 0.0, 0.0f64);
        let unphysical = || LinearError::NoScale("the mass or inertia of the whole system is not positive".into());
        for i in 0..n {
            (0..nj).for_each(|j| (state.q[j], u[6 + j]) = (self.q[(i, j)], self.qd[(i, j)]));
            mass_matrix(model, &params, &state, &mut work, &mut h);
            let mass = h[(0, 0)];
            if !(mass > 0.0 && mass.is_finite()) {
                return Err(unphysical());
            }
            // The upper right block of a composite inertia is -[M c]x; the lower right one is about the base origin.
            let c = Vector3::new(h[(1, 5)], h[(2, 3)], h[(0, 4)]) / mass;
            let about_origin = h.fixed_view::<3, 3>(3, 3).into_owned();
            let inertia = about_origin - mass * (Matrix3::from_diagonal_element(c.norm_squared()) - c * c.transpose());
            let whiten = inertia.cholesky().ok_or_else(unphysical)?.inverse() / self.options.gyro;
            // Momentum is the mass matrix times the velocity: inverse dynamics of an acceleration, at rest.
            (0..3).for_each(|k| (u[k], u[3 + k]) = (0.0, self.rates[(i, k)]));
            let p0 = h.rows(0, 3) * DVector::from_column_slice(&u);
            (0..3).for_each(|k| u[k] = -p0[k] / mass);
            regressor(model, &params, &state, &u, &mut work, &mut y);
            let mut right = Vector3::zeros();
            let mut total = Vector3::zeros();
            let mut column = 0;
            for p in 0..model.n_params() {
                let linear = Vector3::new(y[(0, p)], y[(1, p)], y[(2, p)]);
                let angular = Vector3::new(y[(3, p)], y[(4, p)], y[(5, p)]);
                let j = whiten * (angular - c.cross(&linear));
                total += j * values[p];
                if selected.get(column) == Some(&p) {
                    rows.set_column(column, &j);
                    column += 1;
                } else {
                    right -= j * values[p];
                }
            }
            rows.view_mut((0, m), (3, 3)).copy_from(&(-whiten * self.attitude[i].transpose()));
            rows.set_column(m + 3, &right);
            known_part += right.norm_squared();
            whole += total.norm_squared() + (whiten * about_origin * Vector3::new(u[3], u[4], u[5])).norm_squared();
            size = size.max(inertia.trace() / 3.0 * self.rates.row(i).norm());
            qr.push(&rows)?;
        }
        if known_part <= LEAST_KNOWN * LEAST_KNOWN * whole {
            return Err(LinearError::NoScale(
                "everything that moves is unknown, and momentum equations hold for any multiple of the parameters; keep a \
                 body known that the joints move, such as the links of the arm"
                    .into(),
            ));
        }
        let (r, rows) = qr.finish()?;
        let triangle = Triangle { name: "angular momentum".into(), columns: (0..m + 3).collect(), r, rows };
        // At rest the momentum is zero; the noise then says what matters.
        Ok((triangle, size.max(f64::MIN_POSITIVE)))
    }
}

/// Attitude at every sample from the gyro: `R' = R [omega]x`, by the fourth-order Magnus step over two Gauss points (A.
/// Iserles, S. Norsett, 1999), `exp(h/2 (w1 + w2) + sqrt(3)/12 h^2 w1 x w2)` on the right.
fn integrate(record: &Record) -> Result<Vec<Matrix3<f64>>, LinearError> {
    let rates = base_rates(record)?;
    let (dt, root) = (record.dt(), 3f64.sqrt());
    let mut q = quat_identity();
    let mut out = vec![quat_to_rot(&q)];
    for i in 1..record.samples() {
        let mid = record.time(i - 1) + 0.5 * dt;
        let (w1, w2) = (rates.rate(mid - dt * root / 6.0), rates.rate(mid + dt * root / 6.0));
        q = quat_mul(&q, &exp_so3(&((w1 + w2) * (0.5 * dt) + w1.cross(&w2) * (root / 12.0 * dt * dt))));
        q /= q.norm();
        out.push(quat_to_rot(&q));
    }
    Ok(out)
}
