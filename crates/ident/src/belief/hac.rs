//! Standard deviations that allow for noise which is correlated in time (HAC: heteroskedasticity and autocorrelation consistent).
//!
//! White noise of the assumed size gives estimates the covariance `C = (J^T J + W)^-1`, with W what priors know. Under noise with a colour
//! of its own, the same estimates scatter with
//!
//! ```text
//! C (Omega + W) C        Omega = sum over channels of  sum_l (1 - |l| / B) sum_t g_t g_(t-l)^T        g_t = r_t J_t^T
//! ```
//!
//! (W. Newey, K. West, *Econometrica* 55, 1987, 703: Bartlett's weights keep Omega positive). The number of lags B of a channel is that of
//! D. Andrews (*Econometrica* 59, 1991, 817) for noise of first order, `1.1447 (alpha N)^(1/3)` with
//! `alpha = 4 rho^2 / ((1 - rho)^2 (1 + rho)^2)`, rho its first autocorrelation. Channels are taken to be independent of one another.
//! What a wrong model leaves in the residuals is no random noise: these deviations say nothing then.

use core::ops::Range;
use nalgebra::{DMatrix, DVector};

/// Rows of one channel in the order of time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChannelRows {
    /// First and last row.
    pub rows: Range<usize>,
    /// How far apart its samples are.
    pub every: usize,
}

impl ChannelRows {
    fn all(&self) -> impl Iterator<Item = usize> + use<> {
        self.rows.clone().step_by(self.every.max(1))
    }
}

/// Lags that are summed over, at most this part of the samples.
const MOST: f64 = 0.25;

/// Lags for a channel (Andrews), at least one.
fn lags(r: &[f64]) -> usize {
    let n = r.len() as f64;
    let squares: f64 = r.iter().map(|x| x * x).sum();
    let products: f64 = r.windows(2).map(|w| w[0] * w[1]).sum();
    let rho = if squares > 0.0 { (products / squares).clamp(-0.97, 0.97) } else { 0.0 };
    let alpha = 4.0 * rho * rho / ((1.0 - rho) * (1.0 + rho)).powi(2);
    ((1.1447 * (alpha * n).cbrt()).ceil()).clamp(1.0, (MOST * n).max(1.0)) as usize
}

/// Covariance of the unknowns `of` a fit, by their columns, under noise with a colour of its own: `covariance` is that of all unknowns under
/// white noise, `jacobian` and `residuals` are whitened, without rows of priors, and `channels` say which rows belong together. The rows are
/// brought to the unknowns `of` first, so that the time is that of these. Allocates.
///
/// ```
/// use ident::belief::{ChannelRows, coloured_covariance};
/// use nalgebra::DMatrix;
///
/// // The mean of 400 readings whose noise comes in runs of four: its deviation is twice that of white noise.
/// let noise: Vec<f64> = (0..400).map(|i| (0.7 * f64::from(i / 4).powi(2)).sin().signum()).collect();
/// let (white, rows) = (DMatrix::from_element(1, 1, 1.0 / 400.0), ChannelRows { rows: 0..400, every: 1 });
/// let c = coloured_covariance(&white, &DMatrix::from_element(400, 1, 1.0), &noise, &[rows], &[0]);
/// assert!((1.7..2.1).contains(&(c[(0, 0)] * 400.0).sqrt()));
/// ```
///
/// # Panics
/// If the sizes do not match, or a column of `of` is none of the unknowns.
pub fn coloured_covariance(
    covariance: &DMatrix<f64>,
    jacobian: &DMatrix<f64>,
    residuals: &[f64],
    channels: &[ChannelRows],
    of: &[usize],
) -> DMatrix<f64> {
    assert_eq!((jacobian.nrows(), covariance.nrows()), (residuals.len(), jacobian.ncols()), "rows and unknowns");
    // C (Omega + W) C, and W = C^-1 - J^T J: of C J^T alone, a column for each row.
    let moved = (jacobian * covariance.select_columns(of)).transpose();
    let n = of.len();
    let mut omega = DMatrix::zeros(n, n);
    for channel in channels {
        let rows: Vec<usize> = channel.all().collect();
        let r: Vec<f64> = rows.iter().map(|&i| residuals[i]).collect();
        let b = lags(&r);
        // Sums over a window of B samples, at every place where it meets the record: their products are Bartlett's weights times B.
        let mut sum = DVector::zeros(n);
        let mut windows = DMatrix::zeros(n, rows.len() + b - 1);
        for (s, mut window) in windows.column_iter_mut().enumerate() {
            if let Some(&i) = rows.get(s) {
                sum.axpy(r[s], &moved.column(i), 1.0);
            }
            if let Some(gone) = s.checked_sub(b) {
                sum.axpy(-r[gone], &moved.column(rows[gone]), 1.0);
            }
            window.copy_from(&sum);
        }
        omega.gemm(1.0 / b as f64, &windows, &windows.transpose(), 1.0);
    }
    covariance.select_rows(of).select_columns(of) + omega - &moved * moved.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    const SAMPLES: usize = 1500;

    /// Slow and fast columns of two channels, listed sample by sample.
    fn columns() -> DMatrix<f64> {
        let wave = |t: usize, f: f64, phase: f64| (core::f64::consts::TAU * f * t as f64 * 0.02 + phase).sin();
        DMatrix::from_fn(2 * SAMPLES, 3, |i, k| wave(i / 2, [0.05, 0.21, 18.0][k], 0.4 * (i % 2) as f64 + k as f64))
    }

    /// Noise of deviation one whose first channel is of first order.
    fn noise(rho: f64, seed: u64) -> DVector<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut last = 0.0;
        DVector::from_fn(2 * SAMPLES, |i, _| {
            let white: f64 = StandardNormal.sample(&mut rng);
            if i % 2 == 1 {
                return white;
            }
            last = if i == 0 { white } else { rho * last + (1.0 - rho * rho).sqrt() * white };
            last
        })
    }

    /// How often the 95 % intervals of white and of coloured noise hold each of three unknowns, of so many trials.
    fn coverage(rho: f64, trials: u64) -> [[f64; 3]; 2] {
        let j = columns();
        let white = (j.transpose() * &j).try_inverse().unwrap();
        let channels = [0, 1].map(|c| ChannelRows { rows: c..2 * SAMPLES, every: 2 });
        let mut held = [[0.0; 3]; 2];
        for seed in 0..trials {
            let y = noise(rho, seed);
            let error = &white * (j.transpose() * &y);
            let residuals = &y - &j * &error;
            let own = coloured_covariance(&white, &j, residuals.as_slice(), &channels, &[0, 1, 2]);
            for (k, covariance) in [&white, &own].into_iter().enumerate() {
                for i in 0..3 {
                    held[k][i] +=
                        f64::from(u8::from(error[i].abs() < 1.96 * covariance[(i, i)].sqrt())) / trials as f64;
                }
            }
        }
        held
    }

    #[test]
    fn intervals_hold_under_noise_of_first_order_where_those_of_white_noise_do_not() {
        let [white, own] = coverage(0.8, 300);
        // 95 % expected, deviation 1.3 %; the kernel costs a few per cent of the widths at low frequencies.
        assert!(own.iter().all(|c| (0.89..=1.0).contains(c)), "{own:?}");
        assert!(white[..2].iter().all(|c| *c < 0.8), "{white:?}");
        // Noise of that colour is quieter at 18 Hz: intervals of white noise are too wide, and these are less so.
        assert!(white[2] > 0.97 && own[2] < white[2], "{white:?} {own:?}");
    }

    #[test]
    fn white_noise_has_the_deviations_of_white_noise() {
        let [white, own] = coverage(0.0, 300);
        assert!(white.iter().chain(&own).all(|c| (0.91..=0.985).contains(c)), "{white:?} {own:?}");
    }

    #[test]
    #[ignore = "full tier: 20 s"]
    fn coverage_over_colours() {
        for rho in [-0.5, 0.3, 0.6, 0.9] {
            let [_, own] = coverage(rho, 2000);
            assert!(own.iter().all(|c| (0.90..0.97).contains(c)), "{rho}: {own:?}");
        }
    }

    #[test]
    fn what_priors_know_stays() {
        let j = columns();
        // A prior as strong as the data on the first unknown.
        let information = j.transpose() * &j;
        let mut with = information.clone();
        with[(0, 0)] += information[(0, 0)];
        let c = with.try_inverse().unwrap();
        let channels = [0, 1].map(|k| ChannelRows { rows: k..2 * SAMPLES, every: 2 });
        let noise = noise(0.0, 3);
        let own = coloured_covariance(&c, &j, noise.as_slice(), &channels, &[0, 1, 2]);
        // Each by itself is what it is among all.
        let two = coloured_covariance(&c, &j, noise.as_slice(), &channels, &[2, 0]);
        assert!(
            (two[(0, 0)] / own[(2, 2)] - 1.0).abs() < 1e-9 && (two[(0, 1)] - own[(2, 0)]).abs() < 1e-9 * two[(0, 0)]
        );
        (0..3).for_each(|i| assert!((own[(i, i)] / c[(i, i)]).sqrt() > 0.8 && (own[(i, i)] / c[(i, i)]).sqrt() < 1.2));
    }
}
