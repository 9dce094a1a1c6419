//! Records in, parameters out: spectra, rigid and output-error identification with uncertainty
//!
//! | module | what it answers |
//! |---|---|
//! | [`record`], [`record_builder`] | is this data usable at all? (the one door where non-finite numbers stop) |
//! | [`psd`], [`peaks`] | which frequencies carry energy |
//! | [`decimate`], [`modal_fit`] | modes of the free decay, finer than a spectrum |
//! | [`selection`], [`transform`] | which parameters are estimated, and in which unconstrained coordinates |
//! | [`prior`], [`scale`] | what is known beforehand, and what "relative" means |
//! | [`covariance`], [`report`] | how well each parameter is determined, and which combinations are not |
//! | [`linalg`], [`lm`] | factorisations that refuse bad input, and the least-squares solver |
//!
//! No type of faer or rustfft appears in a public signature.

pub mod covariance;
pub mod decimate;
pub mod linalg;
pub mod lm;
mod lm_step;
pub mod modal_fit;
mod modal_refine;
pub mod peaks;
pub mod prior;
pub mod psd;
pub mod record;
pub mod record_builder;
pub mod report;
pub mod scale;
pub mod selection;
pub mod transform;
