//! Repeated trials as one number and its interval.

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// What several trials say of a positive quantity: their geometric mean with its 95 % interval, and the range they take.
///
/// With `x_i` the logarithms, `mean +- t_{0.975, n-1} s / sqrt(n)`, raised again: errors and gains spread over factors, not over
/// differences.
///
/// ```
/// use xtask::interval::Interval;
///
/// // Factors 1/2, 1, 2 about 0.03: ln 2 is the deviation of the logarithms, 4.303 is Student's t of two degrees of freedom.
/// let x = Interval::of([0.015, 0.03, 0.06]).unwrap();
/// assert!((x.mean - 0.03).abs() < 1e-12 && x.trials == 3);
/// let high = 0.03 * (4.302_653 * 2f64.ln() / 3f64.sqrt()).exp();
/// assert!((x.interval95.unwrap().1 / high - 1.0).abs() < 1e-5);
/// assert!(Interval::of([0.015, 0.03]).unwrap().interval95.is_none());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// Geometric mean.
    pub mean: f64,
    /// 95 % interval of the mean; none for fewer than three trials.
    pub interval95: Option<(f64, f64)>,
    /// Least and greatest.
    pub range: (f64, f64),
    /// Trials.
    pub trials: usize,
}

impl Interval {
    /// Of the values that are positive and finite; `None` without any.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let logs: Vec<f64> = values.into_iter().filter(|x| *x > 0.0 && x.is_finite()).map(f64::ln).collect();
        let n = logs.len();
        if n == 0 {
            return None;
        }
        let mean = logs.iter().sum::<f64>() / n as f64;
        let square: f64 = logs.iter().map(|x| (x - mean).powi(2)).sum();
        let t = if n > 2 { StudentsT::new(0.0, 1.0, (n - 1) as f64).ok() } else { None };
        let half = t.map(|t| t.inverse_cdf(0.975) * (square / ((n - 1) * n) as f64).sqrt());
        let end = |f: fn(f64, f64) -> f64, from: f64| logs.iter().copied().fold(from, f).exp();
        Some(Self {
            mean: mean.exp(),
            interval95: half.map(|h| ((mean - h).exp(), (mean + h).exp())),
            range: (end(f64::min, f64::INFINITY), end(f64::max, f64::NEG_INFINITY)),
            trials: n,
        })
    }
}
