//! What a fit gives: estimates with their uncertainty, or why there are none.

use crate::belief::covariance::Uncertainty;
use crate::parameters::transform::TransformError;
use crate::solve::loss::Loss;
use ff_least_squares::{LmError, Status};
use ff_linalg::LinalgError;

/// One estimated parameter.
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
    /// Whitened residuals of the data at the estimate.
    pub residuals: Vec<f64>,
}

/// Why there is no estimate.
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
    /// The minimisation failed.
    #[error(transparent)]
    Minimise(#[from] LmError),
    /// A factorisation failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

/// Relative singular value below which a direction counts as one the data say nothing about.
pub const RANK_TOLERANCE: f64 = 1e-9;
