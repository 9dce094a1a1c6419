//! Parameter identification of free-floating robots: estimates, standard deviations, and what the data cannot determine.
//!
//! | module | contents |
//! |---|---|
//! | [`parameters`] | which parameters are estimated, and their unconstrained coordinates and sizes |
//! | [`motion`] | joint rates and accelerations that belong to the measured positions |
//! | [`estimate`](mod@estimate) | the fit, and the predictions behind it: [`Rda`] (rigid), [`OutputError`] (passive states), linear estimators |
//! | [`solve`] | linear least squares over a record, physical projection, loss functions |
//! | [`compose`] | several records, ties between parameters, continuation from rough starts, multiple starts |
//! | [`belief`] | priors, posteriors, covariance, identifiability, likelihood profiles |
//! | [`sample`] | draws from the posterior, and whether they can be trusted |
//! | [`modal`] | measured modes against the modes of the model; stiffness and damping from modes |
//! | [`uncertain`] | what may be wrong beside the parameters, and what would explain a record |
//! | [`checks`] | clocks, axes, momentum, free decay, whiteness of residuals, comparison of models |

pub mod belief;
pub mod checks;
pub mod compose;
pub mod estimate;
pub mod modal;
pub mod motion;
pub mod parameters;
pub mod sample;
pub mod solve;
pub mod uncertain;

pub use belief::{Posterior, Priors, Uncertainty};
pub use compose::{Several, Tie, Tied};
pub use estimate::{
    Complete, CompleteOptions, EstimateError, Estimated, Estimator, Friction, Ground, GroundEstimate, Noise, Options,
    OutputError, Rda, Request, SetupError, estimate,
};
pub use parameters::Transform;
pub use solve::Loss;

/// Compiles the example of `README.md`.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
