//! A record cut at the gaps of its joint motion, each part with a beginning of its own; and one on an even clock whatever its gaps.

use crate::record::Record;
use crate::resample::{WIDEST_GAP, bridged, usual_interval};
use crate::time_base::{ChannelGroup, TimeBaseError};
use ff_model::Problems;

impl Record {
    /// The longest time without a sample of the joint motion (s), and how many usual intervals that is; one interval of a uniform clock.
    pub fn widest_gap(&self) -> (f64, f64) {
        let Some(times) = self.times(ChannelGroup::Motion).filter(|t| t.len() > 1) else { return (self.dt(), 1.0) };
        let widest = times.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
        (widest, widest / usual_interval(times))
    }
    /// Whether the joint motion has gaps that a polynomial through neighbouring samples does not cross.
    pub fn has_wide_gaps(&self) -> bool {
        self.widest_gap().1 > WIDEST_GAP
    }
    /// The parts between gaps of the joint motion longer than `longest` (s), in their order; the record itself where there is none.
    /// Each begins and ends with a sample of the joint motion. Parts with fewer than two samples of a channel are left out. Allocates.
    #[must_use]
    pub fn split(&self, longest: f64) -> Vec<Self> {
        let Some(times) = self.times(ChannelGroup::Motion) else { return vec![self.clone()] };
        let mut ends: Vec<usize> = (1..times.len()).filter(|&i| times[i] - times[i - 1] > longest).collect();
        if ends.is_empty() {
            return vec![self.clone()];
        }
        ends.push(times.len());
        let mut first = 0;
        let mut parts = Vec::new();
        for end in ends {
            let part: Result<Self, Problems> = self.between(times[first], times[end - 1], 0..0);
            parts.extend(part.ok().filter(|_| end - first > 1));
            first = end;
        }
        parts
    }
    /// The same without torques before `from` or after `to` (s since the first sample), which need the joint motion most. Allocates.
    #[must_use]
    pub fn with_torques_between(&self, from: f64, to: f64) -> Self {
        let own = self.times(ChannelGroup::Torque);
        let times: Vec<f64> =
            own.map_or_else(|| (0..self.tau.nrows()).map(|i| self.time(i)).collect(), <[f64]>::to_vec);
        let kept: Vec<usize> = (0..times.len()).filter(|&i| (from..=to).contains(&times[i])).collect();
        let mut out = self.clone();
        out.tau = self.tau.select_rows(&kept);
        out.bases.set(ChannelGroup::Torque, kept.iter().map(|&i| times[i]).collect());
        out
    }
    /// [`Record::resampled`], and on a straight line across gaps that it refuses, held where the clock goes on without samples. For what compares magnitudes, or takes away what is
    /// faster than the gaps are long. Allocates.
    ///
    /// # Errors
    /// [`TimeBaseError`] naming the channels: fewer than six samples.
    pub fn bridged(&self) -> Result<Self, TimeBaseError> {
        self.on_clock(&bridged)
    }
}
