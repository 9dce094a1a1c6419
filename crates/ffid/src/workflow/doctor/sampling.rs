//! Torques and gyro as their sensors sampled them: at times of their own, or held between two readings of a slower sensor.

use ff_records::{ChannelGroup, Record};
use nalgebra::DMatrix;

/// Samples for each new reading from which readings are held, and share of the runs of equal readings that are as long as the others.
pub(super) const HELD: f64 = 1.4;
const REGULAR: f64 = 0.95;
/// Runs below which nothing is judged.
const FEWEST: usize = 30;
/// Part of the samples of the uniform clock below which a group has a rate of its own.
const SPARSE: f64 = 0.9;

/// Readings of one group of channels, each once.
pub(super) struct Sampled {
    pub(super) readings: DMatrix<f64>,
    /// Samples for each reading, where readings are held.
    pub(super) held: Option<f64>,
}

impl Sampled {
    /// Of `even`, the group's readings on the uniform clock; `record` has those at times of their own, which interpolation smooths.
    pub(super) fn of(record: &Record, group: ChannelGroup, own: &DMatrix<f64>, even: &DMatrix<f64>) -> Self {
        let sparse = record.times(group).is_some_and(|t| (t.len() as f64) < SPARSE * even.nrows() as f64);
        let readings = if sparse { own.clone() } else { even.clone() };
        let starts = starts(&readings);
        match held(&starts, readings.nrows()) {
            Some(samples) => Self { readings: readings.select_rows(&starts), held: Some(samples) },
            None => Self { readings, held: None },
        }
    }
}

/// First rows of runs of equal readings in all channels.
fn starts(m: &DMatrix<f64>) -> Vec<usize> {
    let same = |i: usize| i > 0 && m.row(i) == m.row(i - 1);
    (0..m.nrows()).filter(|&i| !same(i)).collect()
}

/// Mean length of the runs, where they are as long as one another: coarse readings stay the same for any time.
fn held(starts: &[usize], rows: usize) -> Option<f64> {
    if starts.len() < FEWEST {
        return None;
    }
    let mean = rows as f64 / starts.len() as f64;
    let usual = |w: &&[usize]| (((w[1] - w[0]) as f64) - mean).abs() < 1.0;
    let share = starts.windows(2).filter(usual).count() as f64 / (starts.len() - 1) as f64;
    (mean > HELD && share > REGULAR).then_some(mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers that do not repeat.
    fn reading(k: usize, j: usize) -> f64 {
        (k as f64 * 12.9898 + 4.1 * j as f64).sin()
    }

    #[test]
    fn held_readings_are_told_from_coarse_ones() {
        let held_for = |samples: f64| DMatrix::from_fn(400, 3, |i, j| reading((i as f64 / samples) as usize, j));
        for samples in [1.6, 2.0, 3.3] {
            let m = held_for(samples);
            let found = held(&starts(&m), 400).unwrap();
            assert!((found / samples - 1.0).abs() < 0.02, "{found}");
        }
        assert_eq!(held(&starts(&held_for(1.0)), 400), None);
        let coarse = DMatrix::from_fn(400, 3, |i, j| (0.6 * reading(i, j)).round());
        assert!(starts(&coarse).len() < 380);
        assert_eq!(held(&starts(&coarse), 400), None);
    }
}
