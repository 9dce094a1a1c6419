//! Quantiles and tails of the chi-squared distribution.

use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

/// Probability that a chi-squared number with `freedom > 0` degrees of freedom exceeds `x`; NaN for other `freedom`.
pub fn chi_square_survival(x: f64, freedom: f64) -> f64 {
    ChiSquared::new(freedom).map_or(f64::NAN, |d| d.sf(x))
}

/// Chance that `x = s^T C^-1 s` or more comes out of `k` normal numbers s, where their covariance C is an estimate of `freedom` degrees of freedom
/// (H. Hotelling, *Ann. Math. Statist.* 2, 1931, 360): `x (f - k + 1) / (f k)` is distributed as F with k and `f - k + 1`. One where these
/// are none, since C then says nothing of some direction; [`chi_square_survival`] where they are very many.
pub fn hotelling_survival(x: f64, k: f64, freedom: f64) -> f64 {
    let left = freedom - k + 1.0;
    if left <= 0.0 {
        return 1.0;
    }
    if left > 1e6 {
        return chi_square_survival(x, k);
    }
    FisherSnedecor::new(k, left).map_or(f64::NAN, |d| d.sf(x * left / (freedom * k)))
}

/// `x` below which a chi-squared number with `freedom > 0` degrees of freedom lies with probability `0 < p < 1`; NaN for other
/// arguments. Relative error below 1e-8 where `x > 1e-5`; below that `statrs` ends its search too early.
pub fn chi_square_quantile(p: f64, freedom: f64) -> f64 {
    match ChiSquared::new(freedom) {
        Ok(d) if p > 0.0 && p < 1.0 => d.inverse_cdf(p),
        _ => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ff_testkit::assert_within;

    #[test]
    fn tails_are_those_of_the_closed_forms() {
        // Two and four degrees of freedom; far out, where one less the other would be rounding.
        for x in [0.3f64, 2.7, 18.0, 90.0, 400.0] {
            let two = (-0.5 * x).exp();
            assert_within!((chi_square_survival(x, 2.0) / two - 1.0).abs(), 1e-11, "{x}");
            assert_within!((chi_square_survival(x, 4.0) / (two * (1.0 + 0.5 * x)) - 1.0).abs(), 1e-11, "{x}");
        }
        assert_eq!((chi_square_survival(0.0, 3.0), chi_square_survival(5e3, 6.0)), (1.0, 0.0));
        assert_within!((chi_square_survival(18.307_0, 10.0) - 0.05).abs(), 1e-6);
    }

    #[test]
    fn quantiles_are_those_of_the_tables() {
        // Abramowitz and Stegun, table 26.8; two degrees of freedom in closed form.
        for (p, n, x) in
            [(0.95, 10.0, 18.307_0), (0.025, 10.0, 3.246_97), (0.975, 1.0, 5.023_89), (0.005, 30.0, 13.786_7)]
        {
            assert_within!((chi_square_quantile(p, n) / x - 1.0).abs(), 1e-5, "{p} {n}");
        }
        for p in [1e-6, 0.025, 0.5, 0.975, 0.999_9] {
            assert_within!((chi_square_quantile(p, 2.0) / (-2.0 * f64::ln(1.0 - p)) - 1.0).abs(), 1e-9, "{p}");
        }
        // Large numbers are normal (Wilson and Hilferty).
        let n = 5_000.0f64;
        let cube = 1.0 - 2.0 / (9.0 * n) + 1.959_964 * (2.0 / (9.0 * n)).sqrt();
        assert_within!((chi_square_quantile(0.975, n) / (n * cube.powi(3)) - 1.0).abs(), 1e-6);
    }

    #[test]
    fn a_covariance_that_was_estimated_leaves_more_to_chance() {
        // Student's t with ten degrees of freedom: 2.2281 at 5 %.
        assert_within!((hotelling_survival(2.228_139f64.powi(2), 1.0, 10.0) / 0.05 - 1.0).abs(), 1e-5);
        // F of 3 and 8 at 5 % is 4.0662.
        assert_within!((hotelling_survival(4.066_181 * 30.0 / 8.0, 3.0, 10.0) / 0.05 - 1.0).abs(), 1e-5);
        assert_eq!((hotelling_survival(1e9, 4.0, 3.0), hotelling_survival(0.0, 2.0, 9.0)), (1.0, 1.0));
        let (many, known) = (hotelling_survival(12.3, 5.0, 1e5), chi_square_survival(12.3, 5.0));
        assert_within!((many / known - 1.0).abs(), 1e-3);
        assert_eq!(hotelling_survival(12.3, 5.0, f64::INFINITY), known);
    }
}
