//! When the channels of a record were sampled.
//!
//! Channels that one device reads are sampled together: they are a group. A group is sampled on the uniform grid of the record, or at
//! times of its own: at another rate, with jitter, with samples that were lost. The grid is what a model is integrated on; predictions
//! are brought from it to sample times by an interpolation (`docs/theory/output-operator.md`).

pub use crate::resample::{TimeBaseError, on_grid, on_grid_across};
use std::sync::Arc;

/// Channels that are sampled together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChannelGroup {
    /// Positions, rates and accelerations of the joints.
    Motion,
    /// Joint torques.
    Torque,
    /// Base angular velocity.
    Gyro,
    /// Specific force.
    Accelerometer,
    /// Base attitude.
    Attitude,
    /// What a record carries beside ([`Carried`](crate::Carried)).
    Carried,
}

impl ChannelGroup {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Motion, Self::Torque, Self::Gyro, Self::Accelerometer, Self::Attitude, Self::Carried];

    /// What messages call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Motion => "joint motion",
            Self::Torque => "torque",
            Self::Gyro => "gyro",
            Self::Accelerometer => "accelerometer",
            Self::Attitude => "attitude",
            Self::Carried => "other channels",
        }
    }
}

/// Times since the first sample of the grid (s), ascending, of the groups that are not sampled on it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct TimeBases {
    times: [Option<Arc<[f64]>>; 6],
}

impl TimeBases {
    /// The times of a group; `None` for one on the grid.
    pub(crate) fn of(&self, group: ChannelGroup) -> Option<&Arc<[f64]>> {
        self.times[group as usize].as_ref()
    }
    pub(crate) fn set(&mut self, group: ChannelGroup, times: Vec<f64>) {
        self.times[group as usize] = Some(times.into());
    }
    /// The first group with times of its own.
    pub(crate) fn first(&self) -> Option<ChannelGroup> {
        ChannelGroup::ALL.into_iter().find(|g| self.of(*g).is_some())
    }
}
