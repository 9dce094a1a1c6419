//! Modes of free decay: a realisation by ERA, refined in the time domain.

mod combination;
pub(crate) mod fit;
pub(crate) mod refine;

pub use fit::{ModalError, ModalFit, ModalSettings, Mode, Unresolved, fit_modes};
