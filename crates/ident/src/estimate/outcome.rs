//! What a fit gives: estimates with their uncertainty, or why there are none.

use crate::belief::covariance::Uncertainty;
use crate::parameters::transform::TransformError;
use crate::solve::loss::Loss;
use ff_least_squares::{LmError, Status};
use ff_linalg::LinalgError;

/// One estimated parameter.
///
/// ```
/// # use ff_dynamics::{Drive, SimOptions, State, motion::FnMotion, simulate};
/// # use ff_model::nalgebra::{Matrix3, Vector3};
/// # use ff_model::{BaseKind, Inertia, Joint, JointKind, Model, Params, Xform, tree::JointLimits};
/// # let hull = Inertia::from_com(60.0, &Vector3::new(0.2, 0.1, 0.3), &Matrix3::from_diagonal(&Vector3::new(15.0, 14.0, 13.0)));
/// # let mut robot = Model::new("probe", "hull", hull, BaseKind::Floating);
/// # let (kind, placement) = (JointKind::Revolute, Xform::new(Matrix3::identity(), Vector3::new(0.5, 0.1, 0.4)));
/// # let (axis, limits) = (Vector3::new(0.1, -0.2, 0.9), JointLimits::default());
/// # let link = Inertia::from_com(8.6, &Vector3::new(0.1, 0.21, -0.1), &Matrix3::from_diagonal(&Vector3::new(0.4, 0.05, 0.37)));
/// # robot.add_body(0, "arm", Joint { name: "shoulder".into(), kind, axis, placement, limits }, link);
/// # let truth = Params::<f64>::nominal(&robot);
/// # let motion = FnMotion::new(1, 10.0, |t, q, qd, qdd| {
/// #     let (sin, cos) = (0.9 * t).sin_cos();
/// #     (q[0], qd[0], qdd[0]) = (0.7 * (1.0 - cos), 0.63 * sin, 0.567 * cos);
/// # })?;
/// # let options = SimOptions { duration_s: 10.0, step_s: 0.01, sample_s: 0.01 };
/// # let trace = simulate(&robot, &truth, &State::zero(&robot), &Drive::Prescribed(&motion), &options)?;
/// # let record = ff_records::RecordBuilder::new(["shoulder"]).uniform(0.0, 100.0).q(trace.q.clone()).tau(trace.tau.clone());
/// # let (record, _) = record.gyro(trace.gyro()).build()?;
/// # let (decls, mass) = (robot.param_decls(), robot.parameter_indices("base.mass")?);
/// # let mut start = truth.values().to_vec();
/// # start[mass[0]] = 72.0;
/// use ident::{Estimated, Noise, Rda, Request, estimate};
///
/// let mut rda = Rda::new(&robot, &record, &Noise { torque: 0.01, gyro: 1e-5 })?;
/// let fit = estimate(&Request::new(&decls, &mass, &start), &mut rda)?;
/// let found: &Estimated = &fit.parameters[0];
/// assert_eq!((found.name.as_str(), found.unit.as_str(), found.start), ("base.mass", "kg", 72.0));
/// assert!((found.value - 60.0).abs() < 0.05 && found.std.is_some());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Estimated {
    /// Full name.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Where the fit started.
    pub start: f64,
    /// Estimate.
    pub value: f64,
    /// Standard deviation; `None` where the data (and priors) cannot tell.
    pub std: Option<f64>,
}

/// A linearisation on the way to an estimate.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Linearisation {
    /// What was minimised there, as [`Estimate::objective`], over the residuals of this pass.
    pub objective: f64,
    /// Residuals of the data in this pass: fewer than all of them on a decimated record or a part of it.
    pub residuals: usize,
}

/// The result of [`estimate`](fn@crate::estimate::estimate).
#[derive(Clone, Debug)]
pub struct Estimate {
    /// Full parameter vector with the estimates in place.
    pub values: Vec<f64>,
    /// The estimated parameters.
    pub parameters: Vec<Estimated>,
    /// Nuisance unknowns.
    pub nuisance: Vec<Estimated>,
    /// How the fit ended.
    pub status: Status,
    /// Whether it ran out of the few linearisations that are left where the way over less data leads nowhere ([`Request::give_up`](crate::Request::give_up)).
    pub given_up: bool,
    /// Whether that was because it crept where the data are far from explained: other starts find more in that time.
    pub crept: bool,
    /// Sum of squared whitened residuals of the data divided by the degrees of freedom; 1 when model and
    /// noise figures are right. Without the loss: outliers count in full.
    pub chi2_per_dof: f64,
    /// What was minimised: the loss of all residuals plus the squares of priors (not of anchors), twice the negative logarithm
    /// of the posterior but for a constant.
    pub objective: f64,
    /// What the data can tell: singular values, rank, null and weak directions. Priors are left out.
    pub data_only: Uncertainty,
    /// Covariance with priors included.
    pub uncertainty: Uncertainty,
    /// Linearisations used.
    pub iterations: usize,
    /// Those that led here, in order, and the end itself. What was tried and led nowhere is left out.
    pub descent: Vec<Linearisation>,
    /// Whitened residuals of the data at the estimate.
    pub residuals: Vec<f64>,
}

impl Estimate {
    /// Whether the fit has ended at a minimum, bounded or not.
    pub fn is_solution(&self) -> bool {
        matches!(self.status, Status::Converged { .. } | Status::AtBound { .. })
    }
    /// Itself, if the fit has ended.
    ///
    /// # Errors
    /// [`EstimateError::Unfinished`].
    pub fn ended(self) -> Result<Self, EstimateError> {
        if self.is_solution() { Ok(self) } else { Err(EstimateError::Unfinished(Box::new(self))) }
    }
}

/// Why there is no estimate.
///
/// ```
/// # use ff_dynamics::{Drive, SimOptions, State, motion::FnMotion, simulate};
/// # use ff_model::nalgebra::{Matrix3, Vector3};
/// # use ff_model::{BaseKind, Inertia, Joint, JointKind, Model, Params, Xform, tree::JointLimits};
/// # let hull = Inertia::from_com(60.0, &Vector3::new(0.2, 0.1, 0.3), &Matrix3::from_diagonal(&Vector3::new(15.0, 14.0, 13.0)));
/// # let mut robot = Model::new("probe", "hull", hull, BaseKind::Floating);
/// # let (kind, placement) = (JointKind::Revolute, Xform::new(Matrix3::identity(), Vector3::new(0.5, 0.1, 0.4)));
/// # let (axis, limits) = (Vector3::new(0.1, -0.2, 0.9), JointLimits::default());
/// # let link = Inertia::from_com(8.6, &Vector3::new(0.1, 0.21, -0.1), &Matrix3::from_diagonal(&Vector3::new(0.4, 0.05, 0.37)));
/// # robot.add_body(0, "arm", Joint { name: "shoulder".into(), kind, axis, placement, limits }, link);
/// # let truth = Params::<f64>::nominal(&robot);
/// # let motion = FnMotion::new(1, 10.0, |t, q, qd, qdd| {
/// #     let (sin, cos) = (0.9 * t).sin_cos();
/// #     (q[0], qd[0], qdd[0]) = (0.7 * (1.0 - cos), 0.63 * sin, 0.567 * cos);
/// # })?;
/// # let options = SimOptions { duration_s: 10.0, step_s: 0.01, sample_s: 0.01 };
/// # let trace = simulate(&robot, &truth, &State::zero(&robot), &Drive::Prescribed(&motion), &options)?;
/// # let record = ff_records::RecordBuilder::new(["shoulder"]).uniform(0.0, 100.0).q(trace.q.clone()).tau(trace.tau.clone());
/// # let (record, _) = record.gyro(trace.gyro()).build()?;
/// # let (decls, mass) = (robot.param_decls(), robot.parameter_indices("base.mass")?);
/// # let mut start = truth.values().to_vec();
/// # start[mass[0]] = 72.0;
/// use ident::{EstimateError, Loss, Noise, Rda, Request, estimate};
///
/// let mut rda = Rda::new(&robot, &record, &Noise { torque: 0.01, gyro: 1e-5 })?;
/// let request = Request { loss: Loss::Huber { k: -1.3 }, ..Request::new(&decls, &mass, &start) };
/// assert!(matches!(estimate(&request, &mut rda), Err(EstimateError::Loss(Loss::Huber { k })) if k == -1.3));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, thiserror::Error)]
pub enum EstimateError {
    /// The start values have no physical coordinates.
    #[error(transparent)]
    Transform(#[from] TransformError),
    /// A prior or anchor with a width that is not positive and finite.
    #[error("prior or anchor width {0} must be positive and finite, such as 0.3 for 30 %")]
    Width(f64),
    /// A loss whose parameter is not positive and finite.
    #[error("parameter of the loss {0:?} must be positive and finite, such as 1.345 for Huber's and 4 for Student's")]
    Loss(Loss),
    /// There is no start.
    #[error("no start was given; give at least one")]
    NoStart,
    /// The fit stalled or met its iteration limit. Where it got to is no estimate; to go on from there, start there.
    #[error("the fit has not ended at a minimum ({}) after {} linearisations, chi-squared per degree of freedom {:.4}; \
        start nearer, or allow more iterations",
        if matches!(.0.status, Status::IterationLimit) { "iteration limit" } else { "no step reduces the cost" },
        .0.iterations, .0.chi2_per_dof)]
    Unfinished(Box<Estimate>),
    /// The minimisation failed.
    #[error(transparent)]
    Minimise(#[from] LmError),
    /// A factorisation failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

/// Relative singular value below which a direction counts as one the data say nothing about.
pub const RANK_TOLERANCE: f64 = 1e-9;
