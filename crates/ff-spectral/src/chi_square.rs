//! Quantiles and tails of the chi-squared distribution with any positive number of degrees of freedom.

/// `ln Gamma(x)` for `x > 0` by Lanczos' approximation (C. Lanczos, SIAM J. Numer. Anal. 1, 1964; g = 7, nine terms),
/// to about 1e-14.
fn ln_gamma(x: f64) -> f64 {
    const C: [f64; 9] = [
        0.999_999_999_999_809_9,
        676.520_368_121_885_1,
        -1_259.139_216_722_402_8,
        771.323_428_777_653_1,
        -176.615_029_162_140_6,
        12.507_343_278_686_905,
        -0.138_571_095_265_720_12,
        9.984_369_578_019_572e-6,
        1.505_632_735_149_311_6e-7,
    ];
    if x < 0.5 {
        let pi = core::f64::consts::PI;
        return (pi / (pi * x).sin()).ln() - ln_gamma(1.0 - x);
    }
    let x = x - 1.0;
    let t = x + 7.5;
    let sum = C[0] + (1..9).map(|i| C[i] / (x + i as f64)).sum::<f64>();
    0.5 * core::f64::consts::TAU.ln() + (x + 0.5) * t.ln() - t + sum.ln()
}

/// Regularised incomplete gamma functions `P(a, x)` and `Q(a, x) = 1 - P`: the series of the lower one below `a + 1`, the
/// continued fraction of the upper one above, each the complement of the other (W. Gautschi, ACM TOMS 5(4), 1979).
fn gamma_parts(a: f64, x: f64) -> (f64, f64) {
    if x <= 0.0 {
        return (0.0, 1.0);
    }
    let front = (a * x.ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        let (mut sum, mut term, mut k) = (1.0 / a, 1.0 / a, a);
        while term > 1e-17 * sum {
            k += 1.0;
            term *= x / k;
            sum += term;
        }
        return (front * sum, 1.0 - front * sum);
    }
    // Modified Lentz.
    let mut b = x + 1.0 - a;
    let (mut c, mut d) = (1e300, 1.0 / b);
    let mut h = d;
    for i in 1..10_000 {
        let an = -(i as f64) * (i as f64 - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        let step = d * c;
        h *= step;
        if (step - 1.0).abs() < 1e-16 {
            break;
        }
    }
    (1.0 - front * h, front * h)
}

/// Probability that a chi-squared number with `freedom > 0` degrees of freedom exceeds `x`.
pub(crate) fn chi_square_survival(x: f64, freedom: f64) -> f64 {
    gamma_parts(0.5 * freedom, 0.5 * x).1
}

/// `x` below which a chi-squared number with `freedom > 0` degrees of freedom lies with probability `0 < p < 1`, by
/// bisection of the logarithm.
pub(crate) fn chi_square_quantile(p: f64, freedom: f64) -> f64 {
    let a = 0.5 * freedom;
    let below = |y: f64| gamma_parts(a, 0.5 * y.exp()).0 < p;
    let (mut low, mut high) = (freedom.ln() - 1.0, freedom.ln() + 1.0);
    while !below(low) && low > -700.0 {
        low -= 4.0;
    }
    while below(high) && high < 700.0 {
        high += 4.0;
    }
    for _ in 0..80 {
        let mid = 0.5 * (low + high);
        if below(mid) { low = mid } else { high = mid }
    }
    (0.5 * (low + high)).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tails_are_those_of_the_closed_forms() {
        // Two and four degrees of freedom; far out, where one less the other would be rounding.
        for x in [0.3f64, 2.7, 18.0, 90.0, 400.0] {
            let two = (-0.5 * x).exp();
            assert!((chi_square_survival(x, 2.0) / two - 1.0).abs() < 1e-11, "{x}");
            assert!((chi_square_survival(x, 4.0) / (two * (1.0 + 0.5 * x)) - 1.0).abs() < 1e-11, "{x}");
        }
        assert_eq!((chi_square_survival(0.0, 3.0), chi_square_survival(5e3, 6.0)), (1.0, 0.0));
        assert!((chi_square_survival(18.307_0, 10.0) - 0.05).abs() < 1e-6);
    }

    #[test]
    fn quantiles_are_those_of_the_tables() {
        // Abramowitz and Stegun, table 26.8; two degrees of freedom in closed form.
        for (p, n, x) in
            [(0.95, 10.0, 18.307_0), (0.025, 10.0, 3.246_97), (0.975, 1.0, 5.023_89), (0.005, 30.0, 13.786_7)]
        {
            assert!((chi_square_quantile(p, n) / x - 1.0).abs() < 1e-5, "{p} {n}");
        }
        for p in [1e-6, 0.025, 0.5, 0.975, 0.999_9] {
            assert!((chi_square_quantile(p, 2.0) / (-2.0 * f64::ln(1.0 - p)) - 1.0).abs() < 1e-9, "{p}");
        }
        // Large numbers are normal (Wilson and Hilferty).
        let n = 5_000.0f64;
        let cube = 1.0 - 2.0 / (9.0 * n) + 1.959_964 * (2.0 / (9.0 * n)).sqrt();
        assert!((chi_square_quantile(0.975, n) / (n * cube.powi(3)) - 1.0).abs() < 1e-6);
    }
}
