//! The fit, and the predictions of a record behind it.

pub(crate) mod complete;
pub(crate) mod delay;
pub(crate) mod estimator;
pub(crate) mod fit;
pub(crate) mod ground;
mod ground_physical;
pub(crate) mod nuisance;
pub(crate) mod outcome;
pub(crate) mod output_error;
pub(crate) mod rda;
pub mod report;
pub(crate) mod setup;

pub use complete::{Complete, CompleteOptions};
pub use estimator::{Coarse, Estimator, Request, estimate};
pub use ground::{Friction, Ground, GroundEstimate, NearRest, smoothed};
pub use nuisance::{NuisanceError, NuisanceFit, fit_nuisance};
pub use outcome::{Estimate, EstimateError, Estimated, RANK_TOLERANCE};
pub use output_error::{Options, OutputError};
pub use rda::Rda;
pub use setup::{Noise, SetupError};
