//! A result in words, for the terminal and `report.txt`.

mod budget;
mod listing;
mod verdict;

pub(crate) use budget::budget;
pub(super) use verdict::qualify;
pub(super) use verdict::shares;
pub use verdict::{harmful, next_step, verdict};
