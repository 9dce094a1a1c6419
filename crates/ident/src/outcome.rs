//! What a fit gives: values, deviations, and what the data could tell.

use crate::covariance::Uncertainty;
use crate::lm::Status;

/// Relative singular value below which a direction counts as one the data say nothing about.
pub const RANK_TOLERANCE: f64 = 1e-9;

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

/// The result of [`estimate`].
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
