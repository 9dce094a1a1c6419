//! Figures and page of a verdict on a trajectory.

mod figures;
mod opening;
mod page;

pub use figures::figures;
pub use page::page;
