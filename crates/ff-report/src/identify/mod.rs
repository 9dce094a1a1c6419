//! Figures and page of an identification.

mod charts;
mod corner;
pub mod figures;
mod opening;
mod page;
mod sampled;

pub use corner::corner_figure;
pub use page::{all_figures, page, validation};
