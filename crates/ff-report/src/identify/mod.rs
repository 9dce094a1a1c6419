//! Figures and page of an identification.

mod charts;
mod corner;
pub mod figures;
mod names;
mod opening;
mod over_time;
mod page;
mod sampled;

pub use corner::corner_figure;
pub use over_time::over_time_figure;
pub use page::{all_figures, page, validation};
