//! Checks of sample times that a group of channels has of its own, and the grid that goes with those of the joint motion.

use crate::resample::{WIDEST_GAP, usual_interval};
use crate::time_base::ChannelGroup;
use ff_model::diagnostics::Limit;
use ff_model::{Area, Problem, Problems};

/// Most problems of one kind listed one by one.
const LISTED: usize = 5;
/// Fewest samples of a joint motion with times of its own: its noise is estimated from differences of seven.
const LEAST_MOTION: usize = 8;
/// Usual interval of joint motion (s), as of a uniform clock.
const USUAL: core::ops::RangeInclusive<f64> = 1e-5..=0.5;

fn problem(group: ChannelGroup, code: &'static str, message: String) -> Problem {
    Problem::error(Area::Data, code, message).on(format!("{} times", group.name()))
}

/// A uniform grid over a joint motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Grid {
    /// First instant, on the recorder's clock, and interval (s).
    pub(crate) t0: f64,
    pub(crate) dt: f64,
    pub(crate) samples: usize,
}

impl Grid {
    /// From the first to the last of checked `times`, as near to `rate_hz` as their ends allow, or to their usual interval.
    pub(crate) fn over(times: &[f64], rate_hz: Option<f64>, bad: &mut Problems) -> Option<Self> {
        let (t0, span) = (times[0], times[times.len() - 1] - times[0]);
        let rate = rate_hz.unwrap_or_else(|| 1.0 / usual_interval(times));
        if !(rate.is_finite() && USUAL.contains(&(1.0 / rate))) {
            let what = format!("the grid has {rate} Hz, must be 2 .. 100000 Hz");
            let p = Problem::error(Area::Data, "Data::TimeScale", what).on("grid");
            bad.push(p.hint("give rates in Hz and times in seconds"));
            return None;
        }
        // No record of times has a gap per thousand samples of the grid.
        let intervals = (span * rate).round().max(1.0).min(1e3 * times.len() as f64);
        Some(Self { t0, dt: span / intervals, samples: intervals as usize + 1 })
    }
    /// Last instant, since the first (s).
    pub(crate) fn end(&self) -> f64 {
        (self.samples - 1) as f64 * self.dt
    }
}

/// Checks times by themselves: finite, strictly increasing, enough, in seconds; names gaps. False where there is no use in going on.
pub(crate) fn alone(group: ChannelGroup, times: &[f64], need: usize, long_gaps: bool, bad: &mut Problems) -> bool {
    let motion = group == ChannelGroup::Motion;
    if let Some(i) = times.iter().position(|t| !t.is_finite()) {
        let p = problem(group, "Data::NotFinite", format!("sample {i} is at {} s", times[i]));
        bad.push(p.hint("leave out samples without a time"));
        return false;
    }
    let back: Vec<usize> = (1..times.len()).filter(|&i| times[i] <= times[i - 1]).collect();
    for &i in back.iter().take(LISTED) {
        let (a, b) = (times[i - 1], times[i]);
        let what = format!("sample {i}: time goes from {a} to {b} s ({} such samples), it must increase", back.len());
        bad.push(problem(group, "Data::NonMonotone", what).hint("sort the samples, drop repeated ones"));
    }
    if !back.is_empty() {
        return false;
    }
    let least = if motion { need.max(LEAST_MOTION) } else { need };
    if times.len() < least {
        let (n, limit) = (times.len() as f64, Limit::AtLeast(least as f64));
        let p = Problem::out_of_range(Area::Data, "Data::TooShort", n, limit, "samples");
        bad.push(p.on(format!("{} times", group.name())).hint("record longer, or leave the channel out"));
        return false;
    }
    let usual = usual_interval(times);
    if usual < *USUAL.start() || (motion && usual > *USUAL.end()) {
        let what = format!("median interval {usual} s is outside {} .. {} s", USUAL.start(), USUAL.end());
        bad.push(problem(group, "Data::TimeScale", what).hint("give times in seconds"));
        return false;
    }
    let gaps: Vec<usize> = (1..times.len()).filter(|&i| times[i] - times[i - 1] > 1.5 * usual).collect();
    let lost: f64 = gaps.iter().map(|&i| ((times[i] - times[i - 1]) / usual - 1.0).round().max(1.0)).sum();
    let longest = gaps.iter().map(|&i| times[i] - times[i - 1]).fold(0.0, f64::max);
    if let Some(&first) = gaps.first() {
        // Where joint motion is not known, nothing can be predicted.
        let unknown = motion && longest > WIDEST_GAP * usual;
        let from = if unknown {
            gaps.iter().copied().find(|&i| times[i] - times[i - 1] > WIDEST_GAP * usual).unwrap_or(first)
        } else {
            first
        };
        let mut what = format!(
            "{:.6} s without samples after {:.6} s ({} gaps, {lost} samples lost, the longest {longest:.6} s, usual interval {usual:.6} s)",
            times[from] - times[from - 1],
            times[from - 1],
            gaps.len()
        );
        if unknown {
            what.push_str(&format!("; limit {WIDEST_GAP} intervals"));
        }
        let hint = match (unknown, long_gaps) {
            (true, false) => "cut the record at the gap",
            (true, true) => "gaps over which the motion cannot be told cut the record into parts",
            _ => "nothing to do: the samples that are left count",
        };
        let make = if unknown && !long_gaps { Problem::error } else { Problem::warning };
        bad.push(make(Area::Data, "Data::Gap", what).on(format!("{} times", group.name())).hint(hint));
    }
    true
}

/// Times since the beginning of the grid, all inside it; `None` where some are not.
pub(crate) fn inside(group: ChannelGroup, times: &[f64], grid: &Grid, bad: &mut Problems) -> Option<Vec<f64>> {
    // For times that were computed, or written with few digits.
    let (end, hair) = (grid.end(), 1e-6 * grid.dt);
    let since: Vec<f64> = times.iter().map(|t| t - grid.t0).collect();
    let outside: Vec<usize> = (0..since.len()).filter(|&i| !(-hair..=end + hair).contains(&since[i])).collect();
    if let Some(&i) = outside.first() {
        let (from, to) = (grid.t0, grid.t0 + end);
        let what = format!(
            "sample {i} at {} s is outside the joint motion, {from} .. {to} s ({} such samples)",
            times[i],
            outside.len()
        );
        let p = problem(group, "Data::Outside", what);
        bad.push(p.hint("give all times in seconds on one clock, and cut off what the joint motion does not cover"));
        return None;
    }
    Some(since.into_iter().map(|t| t.clamp(0.0, end)).collect())
}
