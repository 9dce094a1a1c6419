//! The fit, and the predictions of a record behind it.

pub(crate) mod along;
mod approach;
pub(crate) mod around;
pub(crate) mod complete;
pub(crate) mod delay;
mod descent;
pub(crate) mod estimation;
pub(crate) mod estimator;
pub(crate) mod fit;
pub(crate) mod fold;
pub(crate) mod ground;
mod joint_channels;
mod near_end;
pub(crate) mod nuisance;
pub(crate) mod outcome;
pub(crate) mod output_error;
pub(crate) mod output_options;
pub(crate) mod output_rows;
pub(crate) mod output_spans;
pub(crate) mod rda;
mod remembered;
pub mod report;
pub(crate) mod request;
pub(crate) mod row_stream;
pub(crate) mod sensor_errors;
pub(crate) mod setup;

pub use along::Direction;
pub use around::{Around, Centred};
pub use complete::{Complete, CompleteOptions};
pub use estimation::{attempt, estimate};
pub use estimator::{At, Between, Coarse, Estimator, Steps};
pub use ground::{
    Blocks, Calibrated, Elastic, Foretold, Friction, Ground, GroundEstimate, JointTerm, JointTorques, NearRest,
    TermChoice, smoothed,
};
pub use joint_channels::{RoughJoints, rough_joints, without_joints};
pub use nuisance::{NuisanceError, NuisanceFit, fit_nuisance};
pub use outcome::{Estimate, EstimateError, Estimated, Linearisation, RANK_TOLERANCE};
pub use output_error::OutputError;
pub use output_options::Options;
pub use rda::Rda;
pub use request::{FINEST, Jacobian, KEPT_BYTES, OtherStarts, Request};
pub use row_stream::{RowBlock, RowStream};
pub use setup::{Noise, SetupError};
