//! Figures and page of an identification.

mod corner;
pub mod figures;
mod page;
mod sampled;

pub use corner::corner_figure;
pub use page::{all_figures, page, validation};
