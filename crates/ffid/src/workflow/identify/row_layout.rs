//! Where the residuals of a channel are among the rows of the estimator of a record.

use ff_records::{ChannelGroup, Record};

/// Torques, then three axes of the gyro where the method predicts them: sample by sample on one clock, else all torque samples first.
#[derive(Clone, Copy, Debug)]
pub(super) struct RowLayout {
    joints: usize,
    channels: usize,
    torques: usize,
    gyro: usize,
    interleaved: bool,
}

impl RowLayout {
    /// Of a record with so many channels that are predicted.
    pub(super) fn of(record: &Record, channels: usize) -> Self {
        let own = |g| record.times(g).is_some();
        Self {
            joints: record.joints(),
            channels,
            torques: record.tau().nrows(),
            gyro: record.gyro().nrows(),
            interleaved: channels == record.joints() || !own(ChannelGroup::Torque) && !own(ChannelGroup::Gyro),
        }
    }
    /// Whether torques and gyro are listed sample by sample.
    pub(super) fn is_interleaved(&self) -> bool {
        self.interleaved
    }
    /// Number of rows.
    pub(super) fn rows(&self) -> usize {
        self.torques * self.joints + self.gyro * (self.channels - self.joints)
    }
    /// Samples of a channel.
    pub(super) fn samples(&self, channel: usize) -> usize {
        if channel < self.joints { self.torques } else { self.gyro }
    }
    /// Row of a sample of a channel.
    pub(super) fn row(&self, channel: usize, sample: usize) -> usize {
        if self.interleaved {
            sample * self.channels + channel
        } else if channel < self.joints {
            sample * self.joints + channel
        } else {
            self.torques * self.joints + sample * (self.channels - self.joints) + channel - self.joints
        }
    }
}
