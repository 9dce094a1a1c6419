//! TODO-FOLDER ff-spectral modal

pub(crate) mod fit;
pub(crate) mod refine;

pub use fit::{ModalError, ModalFit, ModalSettings, Mode, Unresolved, fit_modes};
