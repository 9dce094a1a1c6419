//! TODO-FOLDER ff-report identify

pub mod figures;
pub(crate) mod page;

pub use page::{all_figures, page, validation};
