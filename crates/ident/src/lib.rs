//! Records in, parameters out: spectra, rigid and output-error identification with uncertainty
//!
//! | module | what it answers |
//! |---|---|
//! | [`record`] | is this data usable at all? (the one door where non-finite numbers stop) |
//! | [`psd`] | which frequencies carry energy |
//! | [`selection`], [`transform`] | which parameters are estimated, and in which unconstrained coordinates |
//! | [`linalg`], [`lm`] | factorisations that refuse bad input, and the least-squares solver |
//!
//! No type of faer or rustfft appears in a public signature.

pub mod linalg;
pub mod lm;
mod lm_step;
pub mod psd;
pub mod record;
pub mod record_builder;
pub mod selection;
pub mod transform;
