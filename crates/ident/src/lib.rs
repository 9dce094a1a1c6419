//! Records in, parameters out: spectra, rigid and output-error identification with uncertainty.
//!
//! | module | what it answers |
//! |---|---|
//! | [`record`], [`record_builder`] | is this data usable at all? (the one door where non-finite numbers stop) |
//! | [`motion_fit`], [`joint_motion`] | joint rates and accelerations that belong to the measured positions |
//! | [`psd`] | which frequencies carry energy |
//! | [`selection`], [`transform`], [`prior`] | which parameters are estimated, in which coordinates, from what prior |
//! | [`estimator`], [`rda`], [`output_error`] | the fit; a rigid system; a system with passive states |
//! | [`covariance`], [`report`] | how well each parameter is known, and which combinations cannot be |
//! | [`linalg`], [`lm`] | factorisations that refuse bad input, and the least-squares solver |
//!
//! No type of faer or rustfft appears in a public signature.

pub mod covariance;
pub mod estimator;
pub mod joint_motion;
pub mod linalg;
pub mod lm;
mod lm_step;
pub mod motion_fit;
pub mod output_error;
pub mod prior;
pub mod psd;
pub mod rda;
pub mod record;
pub mod record_builder;
pub mod report;
pub mod scale;
pub mod selection;
pub mod start;
pub mod transform;

pub use estimator::{Estimate, Estimated, Estimator, Request, estimate};
pub use output_error::{Options, OutputError};
pub use rda::{Noise, Rda};
pub use record::Record;
pub use record_builder::RecordBuilder;
