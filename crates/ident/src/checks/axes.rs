//! Axis mismatch: a gyro whose axes are permuted or reversed, a torque of opposite sign.
//!
//! Measured and predicted signals are compared without their means. A torque is reversed when its correlation with the
//! prediction is below [`REVERSED`]. For the gyro all 48 signed permutations of the axes are tried; with residual sums of squares
//! `S_own` (axes as recorded), `S_best` (best permutation) and the sum of squares `S` of the measured signal, the axes are
//! mismatched when `S_own > S / 2` and `S_own > 3 S_best`.

use ff_records::Record;
use nalgebra::DMatrix;

/// Factor by which the best permutation must lower the residual sum of squares.
const BETTER: f64 = 3.0;
/// Share of the signal left unexplained by the axes as recorded, below which no mismatch is reported.
const UNEXPLAINED: f64 = 0.5;
/// Correlation below which the sign of a torque is reversed.
pub const REVERSED: f64 = -0.5;
/// Root mean square of a signal over its noise, below which it is not judged.
const LOUD: f64 = 5.0;

/// A mismatch between measured and predicted channels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AxisMismatch {
    /// The torque of a joint has the opposite sign.
    Torque {
        /// Index of the joint.
        joint: usize,
        /// Correlation of measured and predicted torque, below [`REVERSED`].
        correlation: f64,
    },
    /// Gyro channel `i` measures `signs[i]` times axis `axes[i]` of the base frame.
    Gyro {
        /// Base axis that each channel measures.
        axes: [usize; 3],
        /// Its sign, 1 or -1.
        signs: [f64; 3],
        /// `S_own / S_best`, at most 1e6.
        improvement: f64,
    },
}

/// Compares torques and gyro of a record with their prediction. `residuals` are whitened, `(predicted - measured) / sigma`,
/// sample after sample; `sigma` holds the standard deviation of each channel: the torques of all joints (N m or N), then for an
/// estimator that predicts it the gyro (rad/s). Allocates.
///
/// # Panics
/// If there is not one residual per sample and channel, or more channels than the record has, or channels have sample times of
/// their own ([`Record::is_uniform`]).
pub fn axis_mismatches(record: &Record, residuals: &[f64], sigma: &[f64]) -> Vec<AxisMismatch> {
    let (k, n) = (sigma.len(), record.joints());
    assert_eq!(residuals.len(), record.samples() * k, "one residual per sample and channel");
    let raw = record.responses();
    let measured = centred(&raw.columns(0, k).into_owned());
    let predicted =
        centred(&DMatrix::from_fn(record.samples(), k, |i, j| raw[(i, j)] + sigma[j] * residuals[i * k + j]));
    let mut out = Vec::new();
    for (joint, s) in sigma.iter().enumerate().take(n) {
        let (a, b) = (measured.column(joint), predicted.column(joint));
        let scale = a.norm() * b.norm();
        let loud = b.norm() > LOUD * s * (record.samples() as f64).sqrt();
        let correlation = if scale > 0.0 { a.dot(&b) / scale } else { 0.0 };
        if loud && correlation < REVERSED {
            out.push(AxisMismatch::Torque { joint, correlation });
        }
    }
    if k == n + 3 {
        out.extend(gyro(&measured.columns(n, 3).into_owned(), &predicted.columns(n, 3).into_owned(), sigma[n]));
    }
    out
}

fn centred(m: &DMatrix<f64>) -> DMatrix<f64> {
    let mut out = m.clone();
    for mut c in out.column_iter_mut() {
        let mean = c.mean();
        c.add_scalar_mut(-mean);
    }
    out
}

fn gyro(measured: &DMatrix<f64>, predicted: &DMatrix<f64>, sigma: f64) -> Option<AxisMismatch> {
    let rows = measured.nrows() as f64;
    let total = measured.norm_squared();
    if total < (LOUD * sigma).powi(2) * 3.0 * rows {
        return None;
    }
    let left = |axes: [usize; 3], signs: [f64; 3]| {
        (0..3).map(|i| (measured.column(i) - predicted.column(axes[i]) * signs[i]).norm_squared()).sum::<f64>()
    };
    let mut best = (f64::INFINITY, [0, 1, 2], [1.0; 3]);
    for axes in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
        for bits in 0..8u8 {
            let signs: [f64; 3] = std::array::from_fn(|i| if bits >> i & 1 == 1 { -1.0 } else { 1.0 });
            let l = left(axes, signs);
            if l < best.0 {
                best = (l, axes, signs);
            }
        }
    }
    let own = left([0, 1, 2], [1.0; 3]);
    let improvement = (own / best.0.max(f64::MIN_POSITIVE)).min(1e6);
    (own > UNEXPLAINED * total && own > BETTER * best.0).then_some(AxisMismatch::Gyro {
        axes: best.1,
        signs: best.2,
        improvement,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn signal(n: usize, f: impl Fn(f64, usize) -> f64) -> DMatrix<f64> {
        DMatrix::from_fn(n, 3, |i, j| f(i as f64 * 0.02, j))
    }

    #[test]
    fn a_signed_permutation_is_named() {
        let n = 700;
        let truth = signal(n, |t, j| ((1.3 + 0.7 * j as f64) * t).sin() * (0.4 + 0.1 * j as f64) + 0.05);
        // Channels read +z, -x, +y.
        let read = DMatrix::from_fn(n, 3, |i, j| [truth[(i, 2)], -truth[(i, 0)], truth[(i, 1)]][j]);
        let found = gyro(&centred(&read), &centred(&truth), 1e-3);
        match found {
            Some(AxisMismatch::Gyro { axes, signs, improvement }) => {
                assert_eq!((axes, signs), ([2, 0, 1], [1.0, -1.0, 1.0]));
                assert!(improvement > 1e5, "{improvement}");
            }
            other => panic!("{other:?}"),
        }
        assert_eq!(gyro(&centred(&truth), &centred(&truth), 1e-3), None);
        // Below five times the noise nothing is judged.
        assert_eq!(gyro(&centred(&read), &centred(&truth), 0.2), None);
    }
}
