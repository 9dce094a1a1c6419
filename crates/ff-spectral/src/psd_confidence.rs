//! Confidence intervals of a Welch spectrum.
//!
//! A bin of one segment of Gaussian noise is exponentially distributed around the density S, one of K independent
//! segments `S chi^2(2K) / (2K)`. Segments that overlap are correlated: with window w and hop D the variance of the mean is
//! that of `K_e` independent ones (P. Welch, IEEE Trans. Audio Electroacoustics 15(2), 1967, eq. (9)),
//!
//! ```text
//! K_e = K / (1 + 2 sum_(m=1)^(K-1) (1 - m/K) rho_m^2),     rho_m = sum_i w_i w_(i+mD) / sum_i w_i^2
//! ```
//!
//! for a density smooth over the width of the window; for Hann and half overlap `rho_1 = 1/6`. With `nu = 2 K_e` (`K_e` at 0
//! and Nyquist) the interval of S at probability p is `nu S^ / chi^2_((1+p)/2)(nu) .. nu S^ / chi^2_((1-p)/2)(nu)`. A bin that
//! holds a line (a lightly damped mode) has less scatter than noise; its interval is then wider than need be. The bins at 0
//! and next to it have lost power to the removal of the mean.

use crate::chi_square::chi_square_quantile;
use crate::psd::{Psd, PsdError};

/// Number of independent averages that `segments` overlapping ones are worth.
pub fn effective_averages(window: &[f64], hop: usize, segments: usize) -> f64 {
    let k = segments as f64;
    let power: f64 = window.iter().map(|w| w * w).sum();
    let mut sum = 1.0;
    for m in 1..segments {
        if m * hop >= window.len() {
            break;
        }
        let rho = window.iter().zip(&window[m * hop..]).map(|(a, b)| a * b).sum::<f64>() / power;
        sum += 2.0 * (1.0 - m as f64 / k) * rho * rho;
    }
    k / sum
}

impl Psd {
    /// Interval of every bin that holds the density with this probability (0.95, say). Allocates the result.
    ///
    /// # Errors
    /// [`PsdError::NotPositive`] unless `0 < probability < 1`.
    pub fn confidence(&self, probability: f64) -> Result<Vec<(f64, f64)>, PsdError> {
        if !(probability > 0.0 && probability < 1.0) {
            return Err(PsdError::NotPositive { what: "probability (or one minus it)", value: probability });
        }
        let (low, high) = (0.5 * (1.0 - probability), 0.5 * (1.0 + probability));
        // Most bins share their degrees of freedom.
        let mut last: Option<(f64, (f64, f64))> = None;
        let interval = self.density.iter().zip(&self.freedom).map(|(s, &nu)| {
            let factors = match last {
                Some((n, f)) if n == nu => f,
                _ => {
                    let f = (nu / chi_square_quantile(high, nu), nu / chi_square_quantile(low, nu));
                    last = Some((nu, f));
                    f
                }
            };
            (s * factors.0, s * factors.1)
        });
        Ok(interval.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::psd::Welch;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, Normal};

    /// First-order autoregressive noise at 20 Hz, and its one-sided density.
    fn noise(seed: u64, n: usize, a: f64) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let normal = Normal::new(0.0, 1.3).unwrap();
        let mut x = 0.0;
        (0..n + 200)
            .map(|_| {
                x = a * x + normal.sample(&mut rng);
                x
            })
            .skip(200)
            .collect()
    }
    fn density(f: f64, a: f64) -> f64 {
        let w = core::f64::consts::TAU * f / 20.0;
        2.0 * 1.69 / 20.0 / (1.0 - 2.0 * a * w.cos() + a * a)
    }

    #[test]
    fn half_overlap_of_hann_windows_is_worth_what_welch_says() {
        let window: Vec<f64> =
            (0..512).map(|i| 0.5 - 0.5 * (core::f64::consts::TAU * i as f64 / 512.0).cos()).collect();
        let k = effective_averages(&window, 256, 9);
        assert!((k - 9.0 / (1.0 + 2.0 * (8.0 / 9.0) / 36.0)).abs() < 1e-9, "{k}");
        assert_eq!(effective_averages(&window, 512, 4), 4.0);
        // Three quarters of overlap: many segments, hardly more averages than at half.
        let dense = effective_averages(&window, 128, 17);
        assert!(dense > k && dense < 1.15 * k, "{dense}");
    }

    #[test]
    fn intervals_cover_the_density_as_often_as_they_say() {
        for (samples, segment, probability) in [(2048, 256, 0.95), (700, 256, 0.9), (256, 256, 0.8)] {
            let mut welch = Welch::new(segment, 20.0).unwrap();
            let (mut inside, mut all, mut sum_inside) = (0.0, 0.0, 0.0);
            for seed in 0..400 {
                let p = welch.run(&noise(seed, samples, 0.4)).unwrap();
                let q = welch.run(&noise(seed + 7000, samples, -0.3)).unwrap();
                let s = Psd::weighted_sum(&[p.clone(), q], &[0.7, 1.9]).unwrap();
                let (ci, cs) = (p.confidence(probability).unwrap(), s.confidence(probability).unwrap());
                // The bins next to 0 lose power with the mean.
                for j in 3..p.density.len() - 1 {
                    let (x, y) = (density(p.frequency[j], 0.4), density(p.frequency[j], -0.3));
                    let both = x / 0.49 + y / 3.61;
                    inside += f64::from(u8::from(ci[j].0 <= x && x <= ci[j].1));
                    sum_inside += f64::from(u8::from(cs[j].0 <= both && both <= cs[j].1));
                    all += 1.0;
                }
            }
            let (one, sum) = (inside / all, sum_inside / all);
            println!("{samples} samples in segments of {segment}: {one:.4} and {sum:.4} of {probability}");
            assert!((one - probability).abs() < 0.01, "coverage {one} of {probability}");
            // Moments of a sum are matched, its shape is not.
            assert!((sum - probability).abs() < 0.025, "coverage of the sum {sum} of {probability}");
        }
    }

    #[test]
    fn what_is_no_probability_is_refused() {
        let p = Welch::new(64, 20.0).unwrap().run(&noise(3, 200, 0.2)).unwrap();
        for x in [0.0, 1.0, f64::NAN, -0.2] {
            assert!(p.confidence(x).is_err());
        }
        let c = p.confidence(0.5).unwrap();
        assert!(c.iter().zip(&p.density).all(|((a, b), d)| a < b && *a > 0.1 * d && *b < 10.0 * d));
    }
}
