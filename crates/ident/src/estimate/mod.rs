//! TODO-FOLDER ident estimate

pub(crate) mod complete;
pub(crate) mod delay;
pub(crate) mod estimator;
pub(crate) mod fit;
pub(crate) mod ground;
pub(crate) mod momentum;
pub(crate) mod output_error;
pub(crate) mod rda;
pub mod report;

pub use complete::{Complete, CompleteOptions};
pub use estimator::{
    Coarse, Estimate, EstimateError, Estimated, Estimator, Jacobian, KEPT_BYTES, RANK_TOLERANCE, Request, RowBlock,
    RowStream,
};
pub use ground::{Friction, Ground, GroundEstimate, NearRest, smoothed};
pub use momentum::{Momentum, MomentumEstimate, MomentumOptions};
pub use output_error::{Options, OutputError};
pub use rda::{Noise, Rda, SetupError};
