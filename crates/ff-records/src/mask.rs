//! Which samples of a record count: saturated ones, those inside gaps, and edges that a correction could not fill do not.
//!
//! A weight of 0 takes a sample out of every sum without moving the others in time, which cutting it out would; 1 is a
//! sample like any other. `ident::compose::Masked` puts the weights on the rows of an estimator.

use crate::record::Record;
use crate::runs::runs;
use core::ops::Range;
use nalgebra::DMatrix;

/// Weights of the torque and gyro channels, N x n and N x 3, each 0 to 1.
///
/// ```
/// use ff_records::Mask;
///
/// // Samples 31 to 35 of a 20 Hz record were lost and have been interpolated.
/// let stamps: Vec<f64> = (0..200).filter(|i| !(31..36).contains(i)).map(|i| 0.05 * f64::from(i)).collect();
/// let mask = Mask::of_gaps(&stamps, 0.05, 200, 3);
/// assert_eq!(mask.tau.column(2).iter().filter(|&&w| w == 0.0).count(), 5);
/// assert!((mask.lost() - 5.0 / 200.0).abs() < 1e-12);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Mask {
    /// Of the joint torques.
    pub tau: DMatrix<f64>,
    /// Of the gyro axes.
    pub gyro: DMatrix<f64>,
}

impl Mask {
    /// Everything counts. Allocates.
    pub fn all(samples: usize, joints: usize) -> Self {
        Self { tau: DMatrix::from_element(samples, joints, 1.0), gyro: DMatrix::from_element(samples, 3, 1.0) }
    }
    /// Takes out every run of at least three equal samples at the largest or smallest value of a torque or gyro channel
    /// (bad-inputs row D17), with its neighbours on both sides, which have met the limit within their interval.
    /// Runs over a whole channel are a dead sensor, not saturation, and are left to the builder. Allocates.
    pub fn of_saturation(record: &Record) -> Self {
        let mut m = Self::all(record.samples(), record.joints());
        for (from, to) in [(record.tau(), &mut m.tau), (record.gyro(), &mut m.gyro)] {
            for (x, mut w) in from.column_iter().zip(to.column_iter_mut()) {
                for (a, b) in saturated(x.as_slice()) {
                    w.rows_range_mut(a.saturating_sub(1)..(b + 1).min(x.len())).fill(0.0);
                }
            }
        }
        m
    }
    /// Takes out what was interpolated: samples at `0, dt, 2 dt, ...` that lie between time stamps (s, ascending, the first
    /// at 0) more than 1.5 intervals apart (row D13). Allocates.
    pub fn of_gaps(stamps: &[f64], dt: f64, samples: usize, joints: usize) -> Self {
        let mut m = Self::all(samples, joints);
        for w in stamps.windows(2).filter(|w| w[1] - w[0] > 1.5 * dt) {
            // A hair inside, so that a sample at a stamp stays.
            let from = ((w[0] / dt + 1e-6).floor() as usize + 1).min(samples);
            let to = ((w[1] / dt - 1e-6).ceil().max(0.0) as usize).clamp(from, samples);
            m.tau.rows_range_mut(from..to).fill(0.0);
            m.gyro.rows_range_mut(from..to).fill(0.0);
        }
        m
    }
    /// What counts in both.
    ///
    /// # Panics
    /// If the shapes differ.
    #[must_use]
    pub fn and(&self, other: &Self) -> Self {
        Self { tau: self.tau.component_mul(&other.tau), gyro: self.gyro.component_mul(&other.gyro) }
    }
    /// Part of all samples that does not count, 0 to 1.
    pub fn lost(&self) -> f64 {
        let n = (self.tau.len() + self.gyro.len()).max(1) as f64;
        1.0 - (self.tau.sum() + self.gyro.sum()) / n
    }
    /// Weights by rows of an estimator that lists, per sample, the torques and then the gyro. Allocates.
    pub fn rows(&self) -> Vec<f64> {
        let of = |i: usize| self.tau.row(i).iter().chain(self.gyro.row(i).iter()).copied().collect::<Vec<f64>>();
        (0..self.tau.nrows()).flat_map(of).collect()
    }
}

/// Runs `[a, b)` of three or more equal samples at an extreme of the channel that do not fill it.
fn saturated(x: &[f64]) -> Vec<(usize, usize)> {
    let low = x.iter().copied().fold(f64::INFINITY, f64::min);
    let high = x.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let clipped = |r: &Range<usize>| (3..x.len()).contains(&r.len()) && (x[r.start] == low || x[r.start] == high);
    runs(x).filter(clipped).map(|r| (r.start, r.end)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builder::RecordBuilder;

    fn record(clip: f64) -> Record {
        let f = |i: usize, j: usize| (0.11 * i as f64 + 0.7 * j as f64).sin() * (1.0 + 0.1 * j as f64);
        let q = DMatrix::from_fn(200, 2, f);
        let tau = q.map(|x| (3.1 * x).min(clip));
        let gyro = DMatrix::from_fn(200, 3, |i, j| 1e-3 * f(i, j + 3));
        RecordBuilder::new(["a", "b"])
            .uniform(0.0, 100.0)
            .allow("Data::Saturated")
            .q(q)
            .tau(tau)
            .gyro(gyro)
            .build()
            .unwrap()
            .0
    }

    #[test]
    fn clipped_peaks_and_their_neighbours_are_out_and_nothing_else() {
        let r = record(2.9);
        let m = Mask::of_saturation(&r);
        for j in 0..2 {
            for i in 1..199 {
                let near = (i - 1..=i + 1).any(|k| r.tau()[(k, j)] == 2.9);
                assert_eq!(m.tau[(i, j)] == 0.0, near, "{i} {j}");
            }
        }
        assert!(m.gyro.iter().all(|w| *w == 1.0) && m.lost() > 0.02 && m.lost() < 0.3);
        assert_eq!(Mask::of_saturation(&record(9.0)).lost(), 0.0);
        assert!(saturated(&[0.3; 40]).is_empty());
    }

    #[test]
    fn interpolated_samples_are_out_and_stamps_stay() {
        // Samples 3 and 4 are missing.
        let stamps = [0.0, 0.1, 0.2, 0.5, 0.6, 0.7];
        let m = Mask::of_gaps(&stamps, 0.1, 8, 1);
        assert_eq!(m.tau.as_slice(), [1.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0]);
        assert_eq!(m.gyro.column(2), m.tau.column(0));
        let both = m.and(&Mask { tau: DMatrix::from_fn(8, 1, |i, _| f64::from(u8::from(i > 0))), ..m.clone() });
        assert_eq!((both.tau[0], both.tau[1], both.tau[3]), (0.0, 1.0, 0.0));
        assert_eq!(m.rows()[4 * 4..4 * 5], [0.0; 4]);
    }
}
