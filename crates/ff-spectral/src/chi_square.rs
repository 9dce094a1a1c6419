//! Quantiles and tails of the chi-squared distribution.

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Probability that a chi-squared number with `freedom > 0` degrees of freedom exceeds `x`; NaN for other `freedom`.
pub fn chi_square_survival(x: f64, freedom: f64) -> f64 {
    ChiSquared::new(freedom).map_or(f64::NAN, |d| d.sf(x))
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
}
