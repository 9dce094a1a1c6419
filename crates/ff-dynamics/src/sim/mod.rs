//! TODO-FOLDER ff-dynamics sim

pub(crate) mod adaptive;
pub(crate) mod attitude;
pub(crate) mod ensemble;
pub(crate) mod flight;
pub mod inputs;
pub(crate) mod integrate;
pub(crate) mod plant;
pub(crate) mod sensors;
pub(crate) mod simulate;
pub(crate) mod trace;

pub use adaptive::{AdaptiveOptions, StepReport, simulate_adaptive};
pub use attitude::Attitude;
pub use ensemble::{EnsembleError, Keep, Run, RunTrace, simulate_ensemble, simulate_ensemble_with};
pub use integrate::{QUADRATURES, Rkmk4};
pub use sensors::{Accelerometer, Channel, Readings, SensorSuite, measure};
pub use simulate::{Drive, SimError, SimOptions, TorqueLaw, Trace, simulate, simulate_with};
pub use trace::Trace;
