//! TODO-FOLDER ident checks

pub(crate) mod clock;
pub mod compare;
pub mod whiteness;

pub use clock::{ClockError, ClockEstimate, Clocks, Predicted, correct_clocks, estimate_clock, estimate_clocks};
