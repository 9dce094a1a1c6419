//! Can the answer be believed: clocks, whiteness of residuals, comparison of models.

pub(crate) mod clock;
pub mod compare;
pub mod whiteness;

pub use clock::{ClockError, Predicted, estimate_clock, estimate_clocks};
