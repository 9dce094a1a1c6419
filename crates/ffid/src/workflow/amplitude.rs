//! How loud the channels of a group are, where a fit is asked for their shape and not for the last of their noise.

use ff_records::Record;
use nalgebra::DMatrix;

/// Part of a signal that such a fit is to follow it to, at best.
pub(in crate::workflow) const PART: f64 = 0.05;

/// Mean square of torques and gyro about their means over these deviations, one for each channel.
pub(in crate::workflow) fn loudness(record: &Record, sigma: &[f64]) -> f64 {
    let read = record.tau().column_iter().chain(record.gyro().column_iter());
    read.zip(sigma).map(|(c, sigma)| c.variance() / sigma.powi(2)).sum::<f64>() / sigma.len().max(1) as f64
}

/// Root mean square of the columns about their means: the middle one.
pub(in crate::workflow) fn amplitude(m: &DMatrix<f64>) -> f64 {
    let mut all: Vec<f64> = m.column_iter().map(|c| c.variance().sqrt()).collect();
    all.sort_unstable_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(0.0)
}
