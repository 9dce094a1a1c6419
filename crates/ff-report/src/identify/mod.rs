//! Figures and page of an identification.

pub mod figures;
mod page;

pub use page::{all_figures, page, validation};
