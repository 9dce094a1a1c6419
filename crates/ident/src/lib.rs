//! Records in, parameters out: spectra, rigid and output-error identification with uncertainty.
//!
//! | module | what it answers |
//! |---|---|
//! | [`record`], [`record_builder`] | is this data usable at all? (the one door where non-finite numbers stop) |
//! | [`record_file`] | records as CSV, with units, read in one pass |
//! | [`clock`], [`mask`] | do the clocks agree; which samples count |
//! | [`motion_fit`], [`knot_spectrum`], [`joint_motion`] | joint rates and accelerations that belong to the measured positions |
//! | [`psd`], [`psd_confidence`], [`peaks`] | which frequencies carry energy, and how surely |
//! | [`decimate`], [`era`], [`modal_fit`] | modes of the free decay, finer than a spectrum |
//! | [`modal_model`], [`mode_match`] | which of the model's modes they are, and which were not seen |
//! | [`modal_estimate`] | stiffness and damping from modes; modes on a held base and on a free one |
//! | [`selection`], [`transform`] | which parameters are estimated, and in which unconstrained coordinates |
//! | [`prior`], [`scale`], [`start`] | what is known beforehand, what "relative" means, starts for studies |
//! | [`estimator`], [`rda`], [`output_error`] | the fit; a rigid system; a system with passive states |
//! | [`staged`], [`starts`] | rough starts over beginnings and thinned records; many starts, and whether they agree |
//! | [`complete`] | a rigid system with base accelerometer, by linear least squares |
//! | [`ground`] | the arm on the ground: link parameters and joint friction, by linear least squares |
//! | [`momentum`] | a rigid system from joint motion and gyro alone |
//! | [`linear`], [`tall_qr`] | linear least squares over a record, in memory that does not grow with it |
//! | [`project`](mod@project) | the nearest parameters that bodies and joints can have |
//! | [`several`], [`ties`] | several records in one fit; parameters that are functions of fewer unknowns |
//! | [`sequence`] | the posterior of one identification as prior of the next |
//! | [`covariance`], [`report`] | how well each parameter is determined, and which combinations are not |
//! | [`identifiability`] | which of these no record could tell, which a better one would; the set that can be estimated |
//! | [`profile`] | intervals from the likelihood itself |
//! | [`whiteness`], [`compare`] | is the model right: residuals against noise, models against each other |
//! | [`loss`] | what a residual costs, and what outliers may |
//! | [`linalg`], [`lm`] | factorisations that refuse bad input, and the least-squares solver |
//!
//! No type of faer, realfft or rustfft appears in a public signature.

mod affine;
mod assignment;
mod chi_square;
pub mod clock;
pub mod compare;
pub mod complete;
pub mod covariance;
pub mod decimate;
mod delay;
pub mod era;
mod estimation;
pub mod estimator;
mod fit;
mod fold;
pub mod ground;
pub mod identifiability;
pub mod joint_motion;
mod knot_risk;
pub mod knot_spectrum;
mod knot_stake;
pub mod linear;
mod linearise;
pub mod lm;
mod lm_step;
pub mod loss;
pub mod mask;
pub mod modal_estimate;
pub mod modal_fit;
pub mod modal_model;
mod modal_refine;
pub mod mode_match;
pub mod momentum;
pub mod motion_fit;
mod outcome;
pub mod output_error;
mod output_options;
mod output_rows;
mod output_spans;
pub mod peaks;
pub mod prior;
pub mod profile;
pub mod project;
pub mod psd;
pub mod psd_confidence;
pub mod rda;
pub mod record;
pub mod record_builder;
mod record_checks;
pub mod record_file;
mod regressor_rows;
pub mod report;
mod request;
mod resample;
mod row_stream;
mod runs;
pub mod scale;
pub mod selection;
pub mod sequence;
mod setup;
pub mod several;
pub mod staged;
mod stamped_motion;
pub mod start;
pub mod starts;
mod tables;
pub mod tall_qr;
mod thin;
mod tied_rows;
pub mod ties;
mod time_base;
mod time_checks;
pub mod transform;
pub mod whiteness;
pub mod zero_phase;

pub use complete::{Complete, CompleteOptions};
pub use estimation::estimate;
pub use estimator::{Estimate, Estimated, Estimator, Request};
pub use ff_linalg as linalg;
pub use ground::{Friction, Ground, GroundEstimate};
pub use loss::Loss;
pub use output_error::{Options, OutputError};
pub use rda::{Noise, Rda};
pub use record::Record;
pub use record_builder::RecordBuilder;
pub use resample::TimeBaseError;
pub use time_base::ChannelGroup;
