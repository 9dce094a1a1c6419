//! Records in, parameters out: spectra, rigid and output-error identification with uncertainty.
//!
//! | module | what it answers |
//! |---|---|
//! | [`record`], [`record_builder`] | is this data usable at all? (the one door where non-finite numbers stop) |
//! | [`clock`], [`mask`] | do the clocks agree; which samples count |
//! | [`motion_fit`], [`knot_spectrum`], [`joint_motion`] | joint rates and accelerations that belong to the measured positions |
//! | [`psd`], [`psd_confidence`], [`peaks`] | which frequencies carry energy, and how surely |
//! | [`decimate`], [`era`], [`modal_fit`] | modes of the free decay, finer than a spectrum |
//! | [`modal_model`], [`mode_match`] | which of the model's modes they are, and which were not seen |
//! | [`modal_estimate`] | stiffness and damping from modes; modes on a held base and on a free one |
//! | [`selection`], [`transform`] | which parameters are estimated, and in which unconstrained coordinates |
//! | [`prior`], [`scale`], [`start`] | what is known beforehand, what "relative" means, starts for studies |
//! | [`estimator`], [`rda`], [`output_error`] | the fit; a rigid system; a system with passive states |
//! | [`staged`] | several rough starts, a thinned record, then the whole one |
//! | [`covariance`], [`report`] | how well each parameter is determined, and which combinations are not |
//! | [`linalg`], [`lm`] | factorisations that refuse bad input, and the least-squares solver |
//!
//! No type of faer or rustfft appears in a public signature.

mod affine;
mod assignment;
mod chi_square;
pub mod clock;
pub mod covariance;
pub mod decimate;
pub mod era;
pub mod estimator;
pub mod joint_motion;
pub mod knot_spectrum;
pub mod linalg;
pub mod lm;
mod lm_step;
pub mod mask;
pub mod modal_estimate;
pub mod modal_fit;
pub mod modal_model;
mod modal_refine;
pub mod mode_match;
pub mod motion_fit;
pub mod output_error;
pub mod peaks;
pub mod prior;
pub mod psd;
pub mod psd_confidence;
pub mod rda;
pub mod record;
pub mod record_builder;
pub mod report;
pub mod scale;
pub mod selection;
pub mod staged;
pub mod start;
mod tables;
mod thin;
pub mod transform;

pub use estimator::{Estimate, Estimated, Estimator, Request, estimate};
pub use output_error::{Options, OutputError};
pub use rda::{Noise, Rda};
pub use record::Record;
pub use record_builder::RecordBuilder;
