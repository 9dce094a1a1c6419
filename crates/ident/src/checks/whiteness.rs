//! Is the model right? Residuals of a right model are white noise of the size that was assumed.
//!
//! For every channel of whitened residuals `r_0 .. r_(N-1)`:
//!
//! * **Size**: `mean(r^2)`, with its 95 % interval under noise of one.
//! * **Whiteness**: Bartlett's test on the cumulated periodogram (M. Bartlett, *Stochastic Processes*, 1955; J. Durbin,
//!   *Biometrika* 56, 1969): `D = max |C_k - k/m|` of the m frequencies below Nyquist, and
//!   `p = 2 sum_(j>=1) (-1)^(j-1) exp(-2 j^2 m D^2)` of Kolmogorov; and the portmanteau of G. Ljung and G. Box (*Biometrika*
//!   65, 1978) over 20 lags, `Q = N (N+2) sum_k rho_k^2 / (N-k)`, chi-squared with 20 degrees of freedom.
//! * **Excess**: the same cumulated periodogram against that of white noise no larger than assumed, from either end:
//!   `D+ = max (C_k / (m max(mean, 1)) - k/m)` of periodogram ordinates over N, `p = 2 exp(-2 m D+^2)` (N. Smirnov's one-sided limit,
//!   for two ends).
//! * **Normality**: C. Jarque and A. Bera (*Economics Letters* 6, 1980), `N/6 (S^2 + (K-3)^2/4)`, chi-squared with two.
//! * **Modes**: the power of the residuals within a resolution of each natural frequency against their median power: a mode that
//!   the model describes badly stands out there.
//!
//! A fit with n parameters has used up n of the N degrees of freedom; with thousands of samples that does not matter here.

use ff_linalg::fourier::RealFft;
use ff_spectral::chi_square::chi_square_survival;
use serde::Serialize;

/// Lags of the portmanteau test.
pub const LAGS: usize = 20;

/// What the residuals of one channel look like.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChannelCheck {
    /// Channel, such as `tau.joint2`.
    pub channel: String,
    /// `mean(r^2)`: one when the noise is as assumed.
    pub mean_square: f64,
    /// Bartlett's `p`: how often white noise would look at least as coloured.
    pub white_p: f64,
    /// First autocorrelation `rho_1`.
    pub first_correlation: f64,
    /// `p` of Ljung and Box.
    pub portmanteau_p: f64,
    /// `p` of Jarque and Bera: how often normal noise would look at least as skewed or heavy-tailed.
    pub normal_p: f64,
    /// Largest `|r|`, in standard deviations.
    pub largest: f64,
    /// How often white noise no larger than assumed would show as much power in the lower or in the upper part of the spectrum: of
    /// colours those that speak against a model. A sensor that is quieter than assumed, or a channel that was smoothed, shows none.
    pub excess_p: f64,
    /// Where the power of the residuals is largest (Hz), averaged over a few lines.
    pub peak_hz: f64,
    /// What stands out at the modes.
    pub modes: Vec<ModePower>,
}

/// Power of the residuals at a mode.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ModePower {
    /// Natural frequency (Hz).
    pub frequency_hz: f64,
    /// Mean power within a resolution of it, over the median of all frequencies.
    pub over_median: f64,
    /// Whether that is more than noise would show once in a thousand.
    pub stands_out: bool,
}

/// Why residuals cannot be judged.
#[derive(Debug, thiserror::Error)]
pub enum CheckError {
    /// Too few samples.
    #[error("channel {channel}: {have} residuals, at least {need} needed; take a longer record")]
    TooShort {
        /// The channel.
        channel: String,
        /// Given.
        have: usize,
        /// Needed.
        need: usize,
    },
    /// A residual is not finite.
    #[error("channel {channel}: residual {index} is {value}")]
    NotFinite {
        /// The channel.
        channel: String,
        /// Which.
        index: usize,
        /// The value.
        value: f64,
    },
    /// The transform refused its buffers; a bug.
    #[error(transparent)]
    Transform(#[from] ff_linalg::LinalgError),
}

/// Level at which the residuals of all channels together count as coloured.
pub const LEVEL: f64 = 0.005;

/// Whitened residuals of one channel of a record.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelResiduals {
    /// Channel, such as `tau.joint2`.
    pub channel: String,
    /// Residuals over their standard deviation.
    pub residuals: Vec<f64>,
    /// Samples per second (Hz).
    pub rate_hz: f64,
    /// Draws of noise that the residuals have besides white noise of one, each as long as they: that of the encoders, which comes into
    /// the prediction.
    pub besides: Vec<Vec<f64>>,
}

/// Judges all channels of a fit at a joint level of [`LEVEL`] (Bonferroni: `LEVEL / channels` for each), with the natural
/// frequencies of the model. The flag says whether a channel is white. Channels that are too short or not finite are left
/// out, but count in the number of channels. Allocates.
pub fn check_all(channels: &[ChannelResiduals], modes_hz: &[f64]) -> Vec<(ChannelCheck, bool)> {
    let alpha = LEVEL / channels.len().max(1) as f64;
    let one = |c: &ChannelResiduals| check_beside(c, modes_hz).ok();
    channels
        .iter()
        .filter_map(one)
        .map(|c| {
            let white = c.is_white(alpha);
            (c, white)
        })
        .collect()
}

/// Judges one channel of whitened residuals sampled at `rate_hz`, with the natural frequencies of the model. Allocates.
///
/// # Errors
/// [`CheckError`]; at least 64 residuals are needed.
pub fn check(channel: &str, r: &[f64], rate_hz: f64, modes_hz: &[f64]) -> Result<ChannelCheck, CheckError> {
    let (channel, residuals) = (channel.to_owned(), r.to_vec());
    check_beside(&ChannelResiduals { channel, residuals, rate_hz, besides: Vec::new() }, modes_hz)
}

/// [`check`] of residuals with other noise in them: their periodogram is divided by `1 + E(f)`, the expectation that follows from the
/// draws, before it is judged; correlations are then those of that spectrum.
///
/// # Errors
/// As [`check`].
pub fn check_beside(c: &ChannelResiduals, modes_hz: &[f64]) -> Result<ChannelCheck, CheckError> {
    let (channel, r, rate_hz) = (&c.channel[..], &c.residuals[..], c.rate_hz);
    let n = r.len();
    if n < 64 {
        return Err(CheckError::TooShort { channel: channel.to_owned(), have: n, need: 64 });
    }
    if let Some(index) = r.iter().position(|x| !x.is_finite()) {
        return Err(CheckError::NotFinite { channel: channel.to_owned(), index, value: r[index] });
    }
    let count = n as f64;
    let mean = r.iter().sum::<f64>() / count;
    let moment = |k: i32| r.iter().map(|x| (x - mean).powi(k)).sum::<f64>() / count;
    let variance = moment(2);
    let constant = variance <= f64::MIN_POSITIVE;
    let (skew, kurtosis) =
        if constant { (0.0, 3.0) } else { (moment(3) / variance.powf(1.5), moment(4) / variance.powi(2)) };
    let jarque_bera = count / 6.0 * (skew.powi(2) + (kurtosis - 3.0).powi(2) / 4.0);
    let correlation = |lag: usize| {
        let sum: f64 = r.iter().zip(&r[lag..]).map(|(a, b)| (a - mean) * (b - mean)).sum();
        if constant { 0.0 } else { sum / (count * variance) }
    };
    let taper = is_loud(&c.besides).then(|| taper(n));
    let taper = taper.as_deref();
    let mut whole = periodogram(r, mean, taper)?;
    let besides = expected(&c.besides, n, taper)?;
    if let Some(besides) = &besides {
        whole.iter_mut().zip(besides).for_each(|(p, e)| *p /= 1.0 + e);
    }
    let total: f64 = whole.iter().sum();
    let of_spectrum = |lag: usize| {
        let turn = core::f64::consts::TAU * lag as f64 / count;
        let sum: f64 = whole.iter().enumerate().map(|(k, p)| p * (turn * (k + 1) as f64).cos()).sum();
        if total > 0.0 { sum / total } else { 0.0 }
    };
    let correlation = |lag: usize| if besides.is_some() { of_spectrum(lag) } else { correlation(lag) };
    let ljung_box: f64 =
        (1..=LAGS).map(|k| correlation(k).powi(2) / (count - k as f64)).sum::<f64>() * count * (count + 2.0);
    Ok(ChannelCheck {
        channel: channel.to_owned(),
        mean_square: r.iter().map(|x| x * x).sum::<f64>() / count,
        white_p: bartlett(&whole),
        first_correlation: correlation(1),
        portmanteau_p: chi_square_survival(ljung_box, LAGS as f64),
        normal_p: (-jarque_bera / 2.0).exp(),
        largest: r.iter().fold(0.0, |m: f64, x| m.max(x.abs())),
        excess_p: excess(&whole, count),
        peak_hz: peak(&whole) * rate_hz / count,
        modes: powers(&whole, rate_hz / n as f64, modes_hz),
    })
}

impl ChannelCheck {
    /// White at the level `alpha` (both tests; each takes half of it).
    pub fn is_white(&self, alpha: f64) -> bool {
        self.white_p.min(self.portmanteau_p) >= 0.5 * alpha
    }
    /// The noise is as large as assumed, to `factor` in standard deviation either way.
    pub fn has_size(&self, factor: f64) -> bool {
        (1.0 / factor..=factor).contains(&self.mean_square.sqrt())
    }
}

/// Mean square of the noise besides white noise of one from which on ends are tapered.
const LOUD: f64 = 0.25;
/// Part of the residuals at either end that is tapered.
const TAPERED: f64 = 0.05;

fn is_loud(draws: &[Vec<f64>]) -> bool {
    let sum: f64 = draws.iter().flatten().map(|x| x * x).sum();
    sum > LOUD * draws.iter().map(Vec::len).sum::<usize>() as f64
}

/// A taper of unit mean square, the ends of a cosine over [`TAPERED`]. Slow noise that ends elsewhere than it began leaks to all frequencies alike, and is one
/// number there, of which no average over lines is its expectation.
fn taper(n: usize) -> Vec<f64> {
    let width = TAPERED * n as f64;
    let at = |i: usize| {
        let from_end = (i.min(n - 1 - i) as f64 + 0.5) / width;
        if from_end < 1.0 { 0.5 - 0.5 * (core::f64::consts::PI * from_end).cos() } else { 1.0 }
    };
    let mut w: Vec<f64> = (0..n).map(at).collect();
    let size = (w.iter().map(|w| w * w).sum::<f64>() / n as f64).sqrt();
    w.iter_mut().for_each(|w| *w /= size);
    w
}

/// Periodogram without the mean, in any unit, from the first frequency above zero to the last below Nyquist.
fn periodogram(r: &[f64], mean: f64, taper: Option<&[f64]>) -> Result<Vec<f64>, CheckError> {
    let mut transform = RealFft::new(r.len());
    for (y, x) in transform.input().iter_mut().zip(r) {
        *y = x - mean;
    }
    if let Some(taper) = taper {
        transform.input().iter_mut().zip(taper).for_each(|(y, w)| *y *= w);
    }
    Ok(transform.run()?[1..r.len().div_ceil(2)].iter().map(|c| c.norm_sqr()).collect())
}

/// Lines over which an expected spectrum is averaged at least, and their part of all.
const SMOOTH: (usize, usize) = (4, 200);

/// The expectation of the periodogram of noise, over that of white noise of one, from draws of it; `None` without draws.
fn expected(draws: &[Vec<f64>], n: usize, taper: Option<&[f64]>) -> Result<Option<Vec<f64>>, CheckError> {
    let mut sum = vec![0.0; n.div_ceil(2).saturating_sub(1)];
    for draw in draws.iter().filter(|d| d.len() == n) {
        let mean = draw.iter().sum::<f64>() / n as f64;
        sum.iter_mut().zip(periodogram(draw, mean, taper)?).for_each(|(s, p)| *s += p / (n * draws.len()) as f64);
    }
    let half = SMOOTH.0.max(sum.len() / SMOOTH.1);
    Ok((!draws.is_empty()).then(|| smoothed(&sum, half)))
}

/// Mean over `half` lines to either side.
fn smoothed(x: &[f64], half: usize) -> Vec<f64> {
    let mut sums = vec![0.0];
    x.iter().for_each(|v| sums.push(sums[sums.len() - 1] + v));
    let mean = |i: usize| {
        let (from, to) = (i.saturating_sub(half), (i + half + 1).min(x.len()));
        (sums[to] - sums[from]) / (to - from) as f64
    };
    (0..x.len()).map(mean).collect()
}

/// Where the power is largest, in lines of the transform.
fn peak(power: &[f64]) -> f64 {
    let smooth = smoothed(power, 2);
    let best = (0..smooth.len()).max_by(|&a, &b| smooth[a].total_cmp(&smooth[b]));
    best.map_or(0.0, |k| (k + 1) as f64)
}

/// `p` of Bartlett's test.
fn bartlett(power: &[f64]) -> f64 {
    let total: f64 = power.iter().sum();
    if total <= 0.0 {
        return 1.0;
    }
    let m = power.len() as f64;
    let (mut sum, mut worst) = (0.0, 0.0f64);
    for (k, p) in power.iter().enumerate() {
        let before = sum / total - k as f64 / m;
        sum += p;
        let after = sum / total - (k + 1) as f64 / m;
        worst = worst.max(before.abs()).max(after.abs());
    }
    kolmogorov(worst * m.sqrt())
}

/// `p` of the test for power in a part of the spectrum, of `n` samples.
fn excess(power: &[f64], n: f64) -> f64 {
    let m = power.len() as f64;
    let scale = (power.iter().sum::<f64>() / (m * n)).max(1.0);
    let largest = |all: &mut dyn Iterator<Item = &f64>| {
        let (mut sum, mut worst) = (0.0, 0.0f64);
        for (k, p) in all.enumerate() {
            sum += p / n;
            worst = worst.max((sum / scale - (k + 1) as f64) / m);
        }
        worst
    };
    let d = largest(&mut power.iter()).max(largest(&mut power.iter().rev()));
    (2.0 * (-2.0 * m * d * d).exp()).min(1.0)
}

/// Survival function of Kolmogorov's distribution.
fn kolmogorov(x: f64) -> f64 {
    if x < 0.2 {
        return 1.0; // 1 - 5e-13
    }
    let term = |j: i32| (-2.0 * f64::from(j * j) * x * x).exp() * if j % 2 == 1 { 1.0 } else { -1.0 };
    (2.0 * (1..60).map(term).sum::<f64>()).clamp(0.0, 1.0)
}

fn powers(power: &[f64], resolution: f64, modes_hz: &[f64]) -> Vec<ModePower> {
    let mut sorted = power.to_vec();
    sorted.sort_by(f64::total_cmp);
    let median = sorted[sorted.len() / 2];
    // The median of chi-squared with two degrees of freedom is ln 2 of its mean.
    let floor = median / std::f64::consts::LN_2;
    let of = |&frequency_hz: &f64| {
        let centre = frequency_hz / resolution;
        // Entry k is frequency k + 1.
        let near = |k: usize| ((k + 1) as f64 - centre).abs() <= 1.5;
        let around: Vec<f64> = (0..power.len()).filter(|&k| near(k)).map(|k| power[k]).collect();
        (!around.is_empty()).then(|| {
            let mean = around.iter().sum::<f64>() / around.len() as f64;
            let over = if floor > 0.0 { mean / floor } else { 1.0 };
            let p = chi_square_survival(2.0 * over * around.len() as f64, 2.0 * around.len() as f64);
            let over_median = if median > 0.0 { mean / median } else { 1.0 };
            ModePower { frequency_hz, over_median, stands_out: p < 1e-3 }
        })
    };
    modes_hz.iter().filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ff_testkit::assert_within;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    fn noise(n: usize, seed: u64) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..n).map(|_| StandardNormal.sample(&mut rng)).collect()
    }

    #[test]
    fn white_normal_noise_passes_as_often_as_the_level_says() {
        let (mut white, mut portmanteau, mut normal, mut modes, mut excess) = (0, 0, 0, 0, 0);
        for seed in 0..400 {
            let c = check("tau", &noise(1500, seed), 100.0, &[0.23, 7.1]).unwrap();
            white += usize::from(c.white_p < 0.05);
            portmanteau += usize::from(c.portmanteau_p < 0.05);
            normal += usize::from(c.normal_p < 0.05);
            excess += usize::from(c.excess_p < 0.05);
            modes += c.modes.iter().filter(|m| m.stands_out).count();
            assert!(c.has_size(1.1), "{c:?}");
        }
        // 20 expected of 400, deviation 4.4; Bartlett's test is a little conservative.
        assert!((7..=33).contains(&white), "{white}");
        assert!((7..=33).contains(&portmanteau), "{portmanteau}");
        assert!((7..=33).contains(&normal), "{normal}");
        // Conservative: half of the records are quieter than assumed.
        assert!((2..=30).contains(&excess), "{excess}");
        assert!(modes <= 5, "{modes}");
    }

    /// A drift of random size, of which draws tell the expectation: its ends leak to all frequencies, by the square of one number.
    #[test]
    fn slow_noise_that_ends_elsewhere_than_it_began_is_no_colour_elsewhere() {
        let n = 3000;
        let drift = |by: f64| -> Vec<f64> { (0..n).map(|i| 60.0 * by * (i as f64 / n as f64 - 0.5)).collect() };
        let besides: Vec<Vec<f64>> = noise(24, 91).into_iter().map(drift).collect();
        let wrong = (0..60).filter(|&seed| {
            let white = noise(n, 200 + seed);
            let residuals = white.iter().zip(drift(noise(1, 700 + seed)[0])).map(|(a, b)| a + b);
            let c = ChannelResiduals {
                channel: "tau".into(),
                residuals: residuals.collect(),
                rate_hz: 50.0,
                besides: besides.clone(),
            };
            check_beside(&c, &[]).unwrap().excess_p < 0.005
        });
        let wrong = wrong.count();
        assert!(wrong <= 6, "{wrong} of 60");
    }

    #[test]
    fn coloured_skewed_and_ringing_residuals_are_caught() {
        let white = noise(1500, 9);
        let coloured: Vec<f64> = white.windows(2).map(|w| w[1] + 0.25 * w[0]).collect();
        let c = check("tau", &coloured, 100.0, &[]).unwrap();
        assert!(!c.is_white(0.01) && c.first_correlation > 0.15 && c.normal_p > 0.001, "{c:?}");
        let skewed: Vec<f64> = white.iter().map(|x| x + 0.2 * x * x).collect();
        assert_within!(check("tau", &skewed, 100.0, &[]).unwrap().normal_p, 1e-6);
        let rings: Vec<f64> = white.iter().enumerate().map(|(i, x)| x + 0.3 * (1.45 * 0.01 * i as f64).sin()).collect();
        let c = check("tau", &rings, 100.0, &[1.45 / std::f64::consts::TAU, 5.3]).unwrap();
        // Coloured at the size that was assumed, but not at twice that.
        assert!(check("tau", &coloured, 100.0, &[]).unwrap().excess_p < 1e-4);
        let quiet: Vec<f64> = coloured.iter().map(|x| 0.5 * x).collect();
        let c2 = check("tau", &quiet, 100.0, &[]).unwrap();
        assert!(c2.excess_p == 1.0 && !c2.is_white(0.01), "{c2:?}");
        // Too little for the tests over all frequencies, but plain at the mode.
        assert!(c.modes[0].stands_out && !c.modes[1].stands_out && c.is_white(0.01), "{c:?}");
        let loud: Vec<f64> = white.iter().map(|x| 1.4 * x).collect();
        assert!(!check("tau", &loud, 100.0, &[]).unwrap().has_size(1.2));
    }

    #[test]
    fn distributions_are_those_of_the_tables() {
        // R: pchisq(x, df, lower.tail = FALSE); Kolmogorov's 5 % point.
        assert_within!((chi_square_survival(31.41, 20.0) - 0.05).abs(), 1e-4);
        assert_within!((chi_square_survival(5.991, 2.0) - 0.05).abs(), 1e-4);
        assert_within!((kolmogorov(1.3581) - 0.05).abs(), 1e-5);
        assert_eq!(chi_square_survival(1e5, 20.0), 0.0);
    }

    #[test]
    fn degenerate_residuals_have_an_answer() {
        assert!(matches!(check("gyro.x", &[0.3; 20], 100.0, &[]), Err(CheckError::TooShort { have: 20, .. })));
        let mut r = noise(200, 2);
        r[17] = f64::NAN;
        assert!(matches!(check("gyro.x", &r, 100.0, &[]), Err(CheckError::NotFinite { index: 17, .. })));
        let c = check("gyro.x", &[0.0; 200], 100.0, &[0.3]).unwrap();
        assert!(c.mean_square == 0.0 && c.white_p == 1.0 && !c.modes[0].stands_out);
    }
}
