//! How well one channel of a record is predicted.

use serde::{Deserialize, Serialize};

/// How one channel was predicted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Channel {
    /// Name, such as `tau.joint1`.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Root mean square of the measured signal.
    pub signal_rms: f64,
    /// Root mean square of the residual.
    pub residual_rms: f64,
    /// That over the standard deviation of the sensor: 1 when model and noise figure are right.
    pub over_noise: f64,
}
