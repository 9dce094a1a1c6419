//! Quantiles and highest-density intervals of draws.

/// Quantile of sorted values, with linear interpolation between order statistics: `x[k] + f (x[k+1] - x[k])` with `k + f = p (n - 1)`
/// (definition 7 of R. Hyndman, Y. Fan, *Sample quantiles in statistical packages*, The American Statistician 50(4), 1996).
///
/// # Panics
/// Without values.
pub fn quantile(sorted: &[f64], p: f64) -> f64 {
    assert!(!sorted.is_empty(), "a quantile of no values");
    let at = p.clamp(0.0, 1.0) * (sorted.len() - 1) as f64;
    let k = (at.floor() as usize).min(sorted.len() - 1);
    let next = sorted[(k + 1).min(sorted.len() - 1)];
    sorted[k] + (at - k as f64) * (next - sorted[k])
}

/// The shortest interval between two of the sorted values that holds the part `mass` of them: the highest-density interval of a
/// density with one peak.
///
/// # Panics
/// Without values.
pub fn hdi(sorted: &[f64], mass: f64) -> (f64, f64) {
    assert!(!sorted.is_empty(), "an interval of no values");
    let n = sorted.len();
    let span = ((mass * n as f64).floor() as usize).min(n - 1);
    let width = |k: usize| sorted[k + span] - sorted[k];
    let best = (0..n - span).min_by(|&a, &b| width(a).total_cmp(&width(b))).unwrap_or(0);
    (sorted[best], sorted[best + span])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_interpolate_between_order_statistics() {
        let x = [1.0, 2.0, 4.0, 8.0];
        assert_eq!(quantile(&x, 0.0), 1.0);
        assert_eq!(quantile(&x, 1.0), 8.0);
        assert_eq!(quantile(&x, 0.5), 3.0);
        assert!((quantile(&x, 0.9) - (4.0 + 0.7 * 4.0)).abs() < 1e-12);
    }

    /// Of an exponential density it begins at zero, where the one between quantiles does not.
    #[test]
    fn the_highest_density_is_at_the_peak() {
        let n = 20_000;
        let x: Vec<f64> = (0..n).map(|k| -(1.0 - (f64::from(k) + 0.5) / f64::from(n)).ln()).collect();
        let (a, b) = hdi(&x, 0.95);
        assert!(a < 1e-3 && (b - 20f64.ln()).abs() < 0.01, "{a} {b}");
        assert!((quantile(&x, 0.025) - 0.02532).abs() < 1e-4);
    }
}
