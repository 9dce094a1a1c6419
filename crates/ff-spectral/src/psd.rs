//! Power spectral density by Welch's method.
//!
//! For segments `x_k` of length L, mean removed, window w (periodic Hann, `w_i = (1 - cos(2 pi i / L)) / 2`),
//! overlapping by half, the one-sided density is
//!
//! ```text
//! S(f_j) = c_j / (fs sum(w^2)) * mean_k |FFT(w (x_k - mean x_k))_j|^2,   c_j = 2, but 1 at f = 0 and Nyquist
//! ```
//!
//! in (unit of x)^2 / Hz, so that the integral of S over f is the variance of x. The numbers are those of
//! `scipy.signal.welch` with its defaults (P. Welch, IEEE Trans. Audio Electroacoustics 15(2), 1967).

use ff_linalg::LinalgError;
use ff_linalg::fourier::RealFft;

/// Why there is no spectrum.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PsdError {
    /// The segment is longer than the record, or too short to mean anything.
    #[error("segment of {segment} samples does not fit a record of {samples} samples (need 8 <= segment <= samples)")]
    Segment {
        /// Samples per segment asked for.
        segment: usize,
        /// Samples in the record.
        samples: usize,
    },
    /// The lowest frequency of interest cannot be told from its neighbours (bad-inputs row D23).
    #[error(
        "frequency resolution {df:.4} Hz is coarser than a fifth of {f_min:.4} Hz: record at least {need_seconds:.1} s \
         (have {have_seconds:.1} s)"
    )]
    Resolution {
        /// Resolution of the record (or segment), 1 / duration (Hz).
        df: f64,
        /// Lowest frequency of interest (Hz).
        f_min: f64,
        /// Duration in hand (s).
        have_seconds: f64,
        /// Duration that would do (s).
        need_seconds: f64,
    },
    /// The sampling rate is too low for the highest frequency of interest (bad-inputs row D24).
    #[error(
        "sampling at {rate_hz} Hz cannot show {f_max} Hz: sample at {need_hz} Hz or faster, behind an anti-alias filter"
    )]
    Nyquist {
        /// Sampling rate (Hz).
        rate_hz: f64,
        /// Highest frequency of interest (Hz).
        f_max: f64,
        /// Rate that would do: 2.5 f_max (Hz).
        need_hz: f64,
    },
    /// A sample is NaN or infinite.
    #[error("sample {row} is not finite")]
    NotFinite {
        /// Index of the sample, from 0.
        row: usize,
    },
    /// Rate, weight or frequency that is not positive and finite.
    #[error("{what} is {value}, must be positive and finite")]
    NotPositive {
        /// What it is.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// Spectra to be summed have different grids, or there are none.
    #[error("{0}")]
    Mismatch(String),
    /// The transform refused its buffers; a bug.
    #[error(transparent)]
    Transform(#[from] LinalgError),
}

impl PsdError {
    /// Process exit code of `bad-inputs.md`: 13 (ill-posed) for resolution and rate, else 12 (data).
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Resolution { .. } | Self::Nyquist { .. } => 13,
            _ => 12,
        }
    }
}

/// A one-sided spectral density on a uniform grid from 0 to Nyquist.
///
/// ```
/// # // Two decaying modes of one channel, 60 s at 10 Hz, with a little noise from a fixed sequence.
/// # let mode = |t: f64, f: f64, zeta: f64, phase: f64| {
/// #     let w = std::f64::consts::TAU * f;
/// #     (-zeta * w * t).exp() * (w * (1.0 - zeta * zeta).sqrt() * t + phase).cos()
/// # };
/// # let y = nalgebra::DMatrix::from_fn(600, 1, |i, _| {
/// #     let t = 0.1 * i as f64;
/// #     let noise: f64 = (0..12u64).map(|k| ((i as u64 * 12 + k + 1) * 2654435761 % 4294967296) as f64 / 4294967296.0).sum::<f64>() - 6.0;
/// #     0.05 * mode(t, 0.21, 0.006, 0.4) + 0.02 * mode(t, 0.47, 0.004, -0.9) + 1e-4 * noise
/// # });
/// use ff_spectral::{Psd, Welch};
///
/// // The density integrates to the variance.
/// let psd: Psd = Welch::new(600, 10.0)?.run(y.as_slice())?;
/// let power: f64 = psd.density.iter().sum::<f64>() * psd.df;
/// let variance = y.as_slice().iter().map(|v| v * v).sum::<f64>() / y.len() as f64;
/// assert!((power / variance - 1.0).abs() < 0.2);
/// # Ok::<(), ff_spectral::psd::PsdError>(())
/// ```
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Psd {
    /// Frequencies (Hz), `j df`.
    pub frequency: Vec<f64>,
    /// Density ((unit of the signal)^2 / Hz; for a weighted sum 1 / Hz).
    pub density: Vec<f64>,
    /// Spacing of the grid (Hz): `rate / segment`, or less after [`Welch::padded`]. No frequency read off is known better than
    /// `rate / (2 segment)` either way.
    pub df: f64,
    /// Samples per segment.
    pub segment: usize,
    /// Number of segments averaged; the relative deviation of a bin is about `1 / sqrt(segments)`.
    pub segments: usize,
    /// Degrees of freedom of each bin, twice the effective number of averages: overlapping segments share samples, and
    /// count for less than whole ones ([`crate::psd_confidence`]).
    pub freedom: Vec<f64>,
    /// Sampling rate (Hz).
    pub rate_hz: f64,
}

/// Welch's method for one segment length. Owns every buffer, so that the transform, which refuses a
/// buffer of another length, never meets one (bad-inputs row D38).
///
/// ```
/// use ff_spectral::Welch;
///
/// let tone: Vec<f64> = (0..2000).map(|i| (std::f64::consts::TAU * 0.68 * f64::from(i) / 20.0).sin()).collect();
/// let mut welch = Welch::new(500, 20.0)?; // segments of 25 s
/// let psd = welch.run(&tone)?;
/// let top = psd.density.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap().0;
/// assert!((psd.frequency[top] - 0.68).abs() <= psd.df / 2.0 && psd.segments == 7);
/// # Ok::<(), ff_spectral::psd::PsdError>(())
/// ```
pub struct Welch {
    rate_hz: f64,
    window: Vec<f64>,
    /// `1 / (fs sum(w^2))`.
    scale: f64,
    transform: RealFft,
    /// Samples of the transform: a segment and the zeros after it.
    length: usize,
}

impl core::fmt::Debug for Welch {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Welch").field("segment", &self.window.len()).field("rate_hz", &self.rate_hz).finish()
    }
}

impl Welch {
    /// Plans segments of `segment` samples at `rate_hz`. Allocates every buffer.
    ///
    /// # Errors
    /// [`PsdError::Segment`] below 8 samples, [`PsdError::NotPositive`] for the rate.
    pub fn new(segment: usize, rate_hz: f64) -> Result<Self, PsdError> {
        positive("sampling rate", rate_hz)?;
        if segment < 8 {
            return Err(PsdError::Segment { segment, samples: segment });
        }
        let step = core::f64::consts::TAU / segment as f64;
        let window: Vec<f64> = (0..segment).map(|i| 0.5 - 0.5 * (step * i as f64).cos()).collect();
        let scale = 1.0 / (rate_hz * window.iter().map(|w| w * w).sum::<f64>());
        Ok(Self { rate_hz, window, scale, transform: RealFft::new(segment), length: segment })
    }

    /// The same windows followed by zeros, `times` as long in all: the density between the lines of the unpadded grid, for drawing the
    /// spectrum of a short record. It resolves nothing that was not resolved before. Allocates.
    #[must_use]
    pub fn padded(mut self, times: usize) -> Self {
        self.length = self.window.len() * times.max(1);
        self.transform = RealFft::new(self.length);
        self
    }

    /// The spectrum of one channel. Samples after the last whole segment are not used (as scipy does not).
    /// Allocates only the result.
    ///
    /// # Errors
    /// [`PsdError::Segment`] if `x` is shorter than one segment, [`PsdError::NotFinite`].
    pub fn run(&mut self, x: &[f64]) -> Result<Psd, PsdError> {
        let l = self.window.len();
        if x.len() < l {
            return Err(PsdError::Segment { segment: l, samples: x.len() });
        }
        if let Some(row) = x.iter().position(|v| !v.is_finite()) {
            return Err(PsdError::NotFinite { row });
        }
        let hop = l - l / 2;
        let segments = (x.len() - l) / hop + 1;
        let mut density = vec![0.0; self.transform.lines()];
        for k in 0..segments {
            let part = &x[k * hop..k * hop + l];
            let mean = part.iter().sum::<f64>() / l as f64;
            let (filled, zeros) = self.transform.input().split_at_mut(l);
            for (y, (v, w)) in filled.iter_mut().zip(part.iter().zip(&self.window)) {
                *y = (v - mean) * w;
            }
            // The transform leaves its input changed.
            zeros.fill(0.0);
            for (d, z) in density.iter_mut().zip(self.transform.run()?) {
                *d += z.norm_sqr();
            }
        }
        let last = density.len() - 1;
        for (j, d) in density.iter_mut().enumerate() {
            // Negative frequencies are folded onto positive ones; 0 and (for even L) Nyquist have no twin.
            let fold = if j == 0 || (j == last && self.length.is_multiple_of(2)) { 1.0 } else { 2.0 };
            *d *= fold * self.scale / segments as f64;
        }
        let df = self.rate_hz / self.length as f64;
        let average = crate::psd_confidence::effective_averages(&self.window, hop, segments);
        let single = |j: usize| j == 0 || (j == last && self.length.is_multiple_of(2));
        let freedom = (0..density.len()).map(|j| if single(j) { average } else { 2.0 * average }).collect();
        let frequency = (0..density.len()).map(|j| j as f64 * df).collect();
        Ok(Psd { frequency, density, df, segment: l, segments, freedom, rate_hz: self.rate_hz })
    }
}

impl Psd {
    /// The sum of channels in units of their own noise: `S = sum_i S_i / sigma_i^2` (1/Hz), so that torque
    /// (N m) and gyro (rad/s) add up. White noise alone gives `2 n / rate`.
    ///
    /// # Errors
    /// [`PsdError::Mismatch`] for different grids, none, or another number of sigmas;
    /// [`PsdError::NotPositive`] for a sigma.
    pub fn weighted_sum(channels: &[Self], sigma: &[f64]) -> Result<Self, PsdError> {
        let [first, rest @ ..] = channels else {
            return Err(PsdError::Mismatch("no channels to sum".into()));
        };
        if sigma.len() != channels.len() {
            return Err(PsdError::Mismatch(format!("{} sigmas for {} channels", sigma.len(), channels.len())));
        }
        if let Some(k) = rest.iter().position(|c| c.segment != first.segment || c.rate_hz != first.rate_hz) {
            return Err(PsdError::Mismatch(format!("channel {} has another segment length or rate", k + 1)));
        }
        let mut out = first.clone();
        out.density.fill(0.0);
        let mut spread = vec![0.0; out.density.len()];
        for (c, &s) in channels.iter().zip(sigma) {
            positive("sigma", s)?;
            for (j, (o, d)) in out.density.iter_mut().zip(&c.density).enumerate() {
                *o += d / (s * s);
                spread[j] += (d / (s * s)).powi(2) / c.freedom[j];
            }
            out.segments = out.segments.min(c.segments);
        }
        // Independent channels: the chi-squared number with the mean and variance of the sum (F. Satterthwaite 1946).
        for (j, (f, v)) in out.freedom.iter_mut().zip(&spread).enumerate() {
            if *v > 0.0 {
                *f = out.density[j].powi(2) / v;
            }
        }
        Ok(out)
    }
    /// The integral of the density (the variance of the signal, about its segment means), by rectangles.
    pub fn variance(&self) -> f64 {
        self.density.iter().sum::<f64>() * self.df
    }
}

/// Refuses a record (or segment) of `seconds` for a lowest frequency of interest `f_min` when `1/seconds`
/// exceeds a fifth of it (bad-inputs row D23; the paper read a slosh mode off bins as wide as itself).
///
/// # Errors
/// [`PsdError::Resolution`], [`PsdError::NotPositive`].
pub fn check_resolution(seconds: f64, f_min: f64) -> Result<(), PsdError> {
    positive("duration", seconds)?;
    positive("lowest frequency", f_min)?;
    let (df, need_seconds) = (1.0 / seconds, 5.0 / f_min);
    // A relative hair, so that a record of exactly the length asked for passes.
    if seconds < need_seconds * (1.0 - 1e-9) {
        return Err(PsdError::Resolution { df, f_min, have_seconds: seconds, need_seconds });
    }
    Ok(())
}

/// Refuses a sampling rate below 2.5 times the highest frequency of interest (bad-inputs row D24).
///
/// # Errors
/// [`PsdError::Nyquist`], [`PsdError::NotPositive`].
pub fn check_rate(rate_hz: f64, f_max: f64) -> Result<(), PsdError> {
    positive("sampling rate", rate_hz)?;
    positive("highest frequency", f_max)?;
    let need_hz = 2.5 * f_max;
    if rate_hz < need_hz { Err(PsdError::Nyquist { rate_hz, f_max, need_hz }) } else { Ok(()) }
}

/// Part of the energy of a signal that lies in the top tenth of the band up to half the rate, white noise of the deviation `sigma`
/// apart; zero unless there is four times what such noise has there, and more than it may have by chance. What is faster than half the
/// rate appears slower, and a signal that is not small there was not filtered before it was sampled (bad-inputs row D24).
/// Allocates.
///
/// # Errors
/// Those of [`Welch`].
pub fn energy_at_the_top(x: &[f64], rate_hz: f64, sigma: f64) -> Result<f64, PsdError> {
    const TOP: f64 = 0.1;
    let p = Welch::new(x.len().min(1024), rate_hz)?.run(x)?;
    let edge = 0.5 * (1.0 - TOP) * rate_hz;
    let first = p.frequency.partition_point(|f| *f < edge);
    let (energy, noise) = (p.variance(), sigma * sigma);
    let top: f64 = p.density[first..].iter().sum::<f64>() * p.df;
    // Each bin scatters by sqrt(2 / freedom) of itself.
    let freedom: f64 = p.freedom[first..].iter().sum();
    let by_chance = 1.0 + 4.0 * (2.0 / freedom.max(1.0)).sqrt();
    let (there, signal) = (top > TOP * noise * by_chance.max(4.0), energy - noise);
    Ok(if there && signal > 0.0 { ((top - TOP * noise) / signal).clamp(0.0, 1.0) } else { 0.0 })
}

fn positive(what: &'static str, value: f64) -> Result<(), PsdError> {
    if value.is_finite() && value > 0.0 { Ok(()) } else { Err(PsdError::NotPositive { what, value }) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use ff_testkit::scaled;

    #[test]
    fn the_integral_of_the_density_is_the_variance() {
        let x: Vec<f64> =
            (0..4096).map(|i| 1.3 * (0.11 * i as f64).sin() + 0.4 * (0.9 * i as f64).cos() + 7.0).collect();
        let p = Welch::new(1024, 50.0).unwrap().run(&x).unwrap();
        assert_relative_eq!(p.variance(), (1.3f64.powi(2) + 0.4f64.powi(2)) / 2.0, max_relative = scaled(2e-3));
        assert_eq!((p.segments, p.density.len()), (7, 513));
        let s = Psd::weighted_sum(&[p.clone(), p.clone()], &[0.5, 2.0]).unwrap();
        assert_relative_eq!(s.density[20], p.density[20] * (4.0 + 0.25), max_relative = scaled(1e-14));
    }

    #[test]
    fn bad_input_is_named() {
        let mut w = Welch::new(64, 10.0).unwrap();
        assert_eq!(w.run(&[1.0; 63]).unwrap_err(), PsdError::Segment { segment: 64, samples: 63 });
        let mut x = [0.3; 200];
        x[170] = f64::NAN;
        assert_eq!(w.run(&x).unwrap_err(), PsdError::NotFinite { row: 170 });
        assert!(Welch::new(4, 10.0).is_err() && Welch::new(64, f64::NAN).is_err());
        let p = w.run(&[0.3; 64]).unwrap();
        assert!(Psd::weighted_sum(&[], &[]).is_err());
        assert!(Psd::weighted_sum(std::slice::from_ref(&p), &[0.0]).is_err());
        let other = Welch::new(32, 10.0).unwrap().run(&[0.3; 64]).unwrap();
        assert!(Psd::weighted_sum(&[p, other], &[1.0, 1.0]).is_err());
    }

    #[test]
    fn a_short_record_says_how_long_it_should_be() {
        // Seventeen seconds for the paper's 0.06 Hz slosh mode.
        let e = check_resolution(17.0, 0.06).unwrap_err();
        assert!(matches!(e, PsdError::Resolution { need_seconds, .. } if (need_seconds - 83.333).abs() < 1e-2));
        assert_eq!(e.exit_code(), 13);
        assert!(check_resolution(5.0 / 0.06, 0.06).is_ok());
        assert!(check_rate(2.0, 0.9).is_err() && check_rate(100.0, 0.9).is_ok());
    }

    #[test]
    fn energy_at_the_top_is_told_from_noise() {
        use rand::SeedableRng;
        use rand_distr::{Distribution, StandardNormal};
        let wave = |i: usize, hz: f64| (core::f64::consts::TAU * hz * i as f64 / 50.0 + 0.4).sin();
        let mut alarms = 0;
        for seed in 0..40 {
            let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
            let mut noise = || -> f64 { StandardNormal.sample(&mut rng) };
            let calm: Vec<f64> = (0..2000).map(|i| 2.0 * wave(i, 0.7) + noise()).collect();
            alarms += u32::from(energy_at_the_top(&calm, 50.0, 1.0).unwrap() > 0.01);
            // A tone of variance 1/2 beside a slow one of variance 2.
            let fast: Vec<f64> = calm.iter().enumerate().map(|(i, x)| x + wave(i, 24.1)).collect();
            let share = energy_at_the_top(&fast, 50.0, 1.0).unwrap();
            assert!((share - 0.2).abs() < 0.06, "{share}");
        }
        assert_eq!(alarms, 0);
    }
}
