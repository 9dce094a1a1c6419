//! Records in, parameters out: spectra, rigid and output-error identification with uncertainty.
//!
//! | module | what it answers |
//! |---|---|
//! | [`record`], [`record_builder`] | is this data usable at all? (the one door where non-finite numbers stop) |
//! | [`record_file`] | records as CSV, with units, read in one pass |
//! | [`motion_fit`], [`joint_motion`] | joint rates and accelerations that belong to the measured positions |
//! | [`psd`], [`peaks`] | which frequencies carry energy |
//! | [`decimate`], [`modal_fit`] | modes of the free decay, finer than a spectrum |
//! | [`selection`], [`transform`] | which parameters are estimated, and in which unconstrained coordinates |
//! | [`prior`], [`scale`], [`start`] | what is known beforehand, what "relative" means, starts for studies |
//! | [`estimator`], [`rda`], [`output_error`] | the fit; a rigid system; a system with passive states |
//! | [`complete`] | a rigid system with base accelerometer, by linear least squares |
//! | [`ground`] | the arm on the ground: link parameters and joint friction, by linear least squares |
//! | [`momentum`] | a rigid system from joint motion and gyro alone |
//! | [`linear`], [`tall_qr`] | linear least squares over a record, in memory that does not grow with it |
//! | [`project`](mod@project) | the nearest parameters that bodies and joints can have |
//! | [`sequence`] | the posterior of one identification as prior of the next |
//! | [`ties`] | parameters that are functions of fewer unknowns |
//! | [`several`] | several records in one fit, with shared parameters and their own |
//! | [`covariance`], [`report`] | how well each parameter is determined, and which combinations are not |
//! | [`identifiability`] | which of these no record could tell, which a better one would; the set that can be estimated |
//! | [`profile`] | intervals from the likelihood itself |
//! | [`starts`], [`growing`] | fits from many starts, and whether they agree; fits that do not slip a cycle |
//! | [`whiteness`], [`compare`] | is the model right: residuals against noise, models against each other |
//! | [`loss`] | what a residual costs, and what outliers may |
//! | [`linalg`], [`lm`] | factorisations that refuse bad input, and the least-squares solver |
//!
//! No type of faer or rustfft appears in a public signature.

mod affine;
pub mod compare;
pub mod complete;
pub mod covariance;
pub mod decimate;
mod delay;
pub mod estimator;
mod fit;
pub mod growing;
pub mod ground;
pub mod identifiability;
pub mod joint_motion;
pub mod linalg;
pub mod linear;
pub mod lm;
mod lm_step;
pub mod loss;
pub mod modal_fit;
mod modal_refine;
pub mod momentum;
pub mod motion_fit;
pub mod output_error;
pub mod peaks;
pub mod prior;
pub mod profile;
pub mod project;
pub mod psd;
pub mod rda;
pub mod record;
pub mod record_builder;
mod record_checks;
pub mod record_file;
mod regressor_rows;
pub mod report;
pub mod scale;
pub mod selection;
pub mod sequence;
pub mod several;
pub mod start;
pub mod starts;
mod tables;
pub mod tall_qr;
pub mod ties;
pub mod transform;
pub mod whiteness;

pub use complete::{Complete, CompleteOptions};
pub use estimator::{Estimate, Estimated, Estimator, Request, estimate};
pub use ground::{Friction, Ground, GroundEstimate};
pub use loss::Loss;
pub use output_error::{Options, OutputError};
pub use rda::{Noise, Rda};
pub use record::Record;
pub use record_builder::RecordBuilder;
