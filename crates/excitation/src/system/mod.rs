//! TODO-FOLDER excitation system

pub mod flexible;
pub(crate) mod modal_response;
pub mod prediction;
pub mod rigid;

pub use modal_response::{driven_modes, flexible_band, modal_targets};
