//! What reads outputs, each on one clock, and its readings put at another time.

use core::ops::Range;
use nalgebra::{DMatrix, DVector, DVectorView};

/// What reads outputs, on one clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Device {
    Gyro,
    Torques,
}

impl Device {
    /// Its columns among torques and gyro.
    pub(super) fn channels(self, joints: usize) -> Range<usize> {
        match self {
            Device::Gyro => joints..joints + 3,
            Device::Torques => 0..joints,
        }
    }
    /// The prefix of its columns.
    pub(super) fn group(self) -> &'static str {
        match self {
            Device::Gyro => "gyro",
            Device::Torques => "tau",
        }
    }
    /// In words.
    pub(super) fn name(self) -> &'static str {
        match self {
            Device::Gyro => "the gyro",
            Device::Torques => "the torques",
        }
    }
}

/// A column as it is so many samples later, by cubics through four of them; at the ends, the first or last.
pub(super) fn later(m: DVectorView<'_, f64>, samples: f64) -> DVector<f64> {
    let last = m.len() as i64 - 1;
    let whole = samples.floor();
    let u = samples - whole;
    let weights = [
        -u * (u - 1.0) * (u - 2.0) / 6.0,
        (u + 1.0) * (u - 1.0) * (u - 2.0) / 2.0,
        -(u + 1.0) * u * (u - 2.0) / 2.0,
        (u + 1.0) * u * (u - 1.0) / 6.0,
    ];
    let at = |i: i64| m[i.clamp(0, last) as usize];
    let one = |i: usize| (-1..).zip(weights).map(|(k, w)| w * at(i as i64 + whole as i64 + k)).sum();
    DVector::from_fn(m.len(), |i, _| one(i))
}

/// Puts a delay right in torques and gyro, N x (n + 3).
pub(super) fn put_earlier(m: &mut DMatrix<f64>, joints: usize, device: Device, samples: f64) {
    for k in device.channels(joints) {
        let column = later(m.column(k), samples);
        m.set_column(k, &column);
    }
}
