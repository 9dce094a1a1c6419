//! Motion over time: integration, external inputs, sensors, ensembles in lanes.

pub(crate) mod attitude;
pub(crate) mod ensemble;
pub(crate) mod flight;
pub mod inputs;
pub(crate) mod integrate;
pub(crate) mod plant;
pub(crate) mod sensors;
pub(crate) mod simulate;
pub(crate) mod trace;

pub use attitude::Attitude;
pub use ensemble::{EnsembleError, Keep, Run, RunTrace, simulate_ensemble, simulate_ensemble_with};
pub use integrate::{QUADRATURES, Rkmk4};
pub use sensors::{Accelerometer, Channel, Readings, SensorSuite, measure};
pub use simulate::{Drive, SimError, SimOptions, TorqueLaw, simulate, simulate_with};
pub use trace::Trace;
