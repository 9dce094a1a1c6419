//! Checks of records and models: clocks, axes, momentum, free decay, whiteness of residuals, comparison of models.
//!
//! Types and functions over a model, a record and an estimator. The order of the checks around a fit, and the messages, belong to the
//! caller.

pub(crate) mod axes;
pub(crate) mod clock;
pub(crate) mod clock_correction;
pub mod compare;
pub(crate) mod free_decay;
pub(crate) mod momentum_change;
pub(crate) mod policy;
pub(crate) mod variants;
pub mod whiteness;

pub use axes::{AxisMismatch, REVERSED, axis_mismatches};
pub use clock::{ClockError, Predicted, estimate_clock, estimate_clocks};
pub use clock_correction::{ClockCorrection, ClockCorrectionError, CorrectedClocks, FittedModel, longest_delay};
pub use free_decay::{ALIASED, FreeDecay, FreeDecayError, free_decay, longest_rest, resolved_decay};
pub use momentum_change::{MomentumChange, momentum_change};
pub use policy::{ClockPolicy, RecordChecks};
pub use variants::ModelVariant;
