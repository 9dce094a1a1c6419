//! Channels and modes in a result.

use serde::{Deserialize, Serialize};

/// A mode of the identified model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModeLine {
    /// Natural frequency (Hz).
    pub frequency_hz: f64,
    /// Damping ratio.
    pub damping_ratio: f64,
    /// Natural frequency at the start of the fit (Hz).
    pub start_hz: f64,
}

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
