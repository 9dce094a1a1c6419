//! White noise of a channel without a model: differences of neighbours of order k have the variance `C(2k, k) sigma^2` for white noise, while a smooth signal
//! of angular frequency w keeps `(w h)^k` of its amplitude.

use nalgebra::DVectorView;

/// Samples below which noise is not judged.
pub(in crate::workflow) const FEWEST: usize = 50;
/// Ratio of the estimates of orders four and six above which a signal, not noise, is what they measure.
pub(in crate::workflow) const LEAKS: f64 = 1.5;
/// Median of the size of a normal variable of unit deviation.
const MEDIAN: f64 = 0.674_489_75;

/// Standard deviation of white noise, from differences of order `order` (at most 6); 0 for a channel that is too short.
pub(in crate::workflow) fn by_differences(x: DVectorView<'_, f64>, order: usize) -> f64 {
    let (mut squares, variance) = differences(x, order);
    squares.iter_mut().for_each(|d| *d *= *d);
    if squares.is_empty() { 0.0 } else { (squares.iter().sum::<f64>() / squares.len() as f64 / variance).sqrt() }
}

/// Standard deviation of the white noise of a channel; `None` where it is a signal that differences measure, and not noise ([`LEAKS`]), or there are
/// too few readings ([`FEWEST`]).
pub(in crate::workflow) fn white_noise(x: DVectorView<'_, f64>) -> Option<f64> {
    let [four, six] = [4, 6].map(|order| by_differences(x, order));
    // Jumps are no noise.
    let least = six.min(typical(x, 6));
    (x.len() >= FEWEST && four < LEAKS * six && least > 0.0).then_some(least)
}

/// [`by_differences`] by the median of their sizes, on which a few jumps have no part.
pub(in crate::workflow) fn typical(x: DVectorView<'_, f64>, order: usize) -> f64 {
    let (mut all, variance) = differences(x, order);
    all.iter_mut().for_each(|d| *d = d.abs());
    all.sort_unstable_by(f64::total_cmp);
    all.get(all.len() / 2).map_or(0.0, |d| d / MEDIAN / variance.sqrt())
}

/// Differences of an order, and their variance for white noise of unit variance.
fn differences(x: DVectorView<'_, f64>, order: usize) -> (Vec<f64>, f64) {
    let mut weights = vec![1.0];
    for _ in 0..order {
        let mut next = vec![0.0; weights.len() + 1];
        for (a, w) in weights.iter().enumerate() {
            next[a] += w;
            next[a + 1] -= w;
        }
        weights = next;
    }
    let variance: f64 = weights.iter().map(|w| w * w).sum();
    let one = |i: usize| weights.iter().enumerate().map(|(a, w)| w * x[i + a]).sum::<f64>();
    // Readings that are missing tell nothing.
    ((0..x.len().saturating_sub(order)).map(one).filter(|d: &f64| d.is_finite()).collect(), variance)
}

#[cfg(test)]
pub(in crate::workflow) mod tests {
    use super::*;
    use nalgebra::DVector;

    /// Uniform noise of unit deviation.
    pub(in crate::workflow) fn uniform(k: usize, seed: f64) -> f64 {
        let a = (k as f64 * 12.9898 + seed).sin() * 43758.5453;
        (2.0 * (a - a.floor()) - 1.0) * 3f64.sqrt()
    }

    /// Uniform noise of standard deviation `sigma` on a signal.
    pub(in crate::workflow) fn noisy(sigma: f64, smooth: impl Fn(f64) -> f64) -> DVector<f64> {
        DVector::from_fn(2000, |i, _| smooth(i as f64 * 0.02) + sigma * uniform(i, 4.1))
    }

    #[test]
    fn noise_is_told_from_a_smooth_signal_a_hundred_times_as_large() {
        let x = noisy(0.01, |t| (2.0 * t).sin() + 0.3 * t);
        for order in [3, 4, 6] {
            let found = by_differences(x.as_view(), order);
            assert!((found / 0.01 - 1.0).abs() < 0.08, "order {order}: {found}");
        }
    }
}
