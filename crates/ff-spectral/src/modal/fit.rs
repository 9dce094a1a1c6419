//! Free-decay modal fit: frequencies, damping ratios and amplitudes from the time after a manoeuvre.
//!
//! A spectrum of T seconds resolves 1/T. A free decay is a sum of damped exponentials, `y_i = sum_k a_k z_k^i`,
//! whose poles can be fitted much more closely:
//!
//! 1. channels in units of their noise, low-passed and decimated ([`crate::decimate`]);
//! 2. eigensystem realisation ([`crate::era`]) at every order;
//! 3. the stabilisation diagram gives the order, counted from the singular values above the noise edge, and the poles that
//!    stay where they are through two higher orders; then
//! 4. maximum likelihood refinement over all poles with amplitudes eliminated (variable projection), whose
//!    Jacobian gives the Cramer-Rao deviations; modes that noise would explain are dropped.
//!
//! Closely spaced modes with different shapes are found; pairs that the record cannot keep apart are listed in
//! [`ModalFit::unresolved`], never merged in silence.

use crate::decimate::Decimator;
use crate::era::{Era, EraPole, Stabilisation, Sweep, Tolerance};
use crate::modal::refine::{Poles, Refined, contributions, refine};
use crate::psd::{PsdError, check_rate};
use core::f64::consts::TAU;
use ff_least_squares::LmError;
use ff_linalg as linalg;
use ff_linalg::LinalgError;
use nalgebra::{Complex, DMatrix, Matrix2x4};

/// Why there is no modal fit.
#[derive(Debug, thiserror::Error)]
pub enum ModalError {
    /// Rate too low, or a sample not finite.
    #[error(transparent)]
    Signal(#[from] PsdError),
    /// Too few samples after filtering.
    #[error("{have_seconds:.1} s of free motion are too short for modes up to {f_max} Hz: need {need_seconds:.1} s")]
    TooShort {
        /// Duration in hand (s).
        have_seconds: f64,
        /// Duration that would do (s).
        need_seconds: f64,
        /// Highest frequency asked for (Hz).
        f_max: f64,
    },
    /// Nothing rises above the noise, or nothing that does is an oscillation that persists with the order.
    #[error("no mode up to {f_max} Hz: the largest singular value is {snr:.2} of the noise edge; excite more strongly")]
    NoMode {
        /// Largest singular value over the noise edge.
        snr: f64,
        /// Highest frequency asked for (Hz).
        f_max: f64,
    },
    /// Sigma not positive, or another number of them than channels.
    #[error("{0}")]
    Setup(String),
    /// A factorisation failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
    /// The refinement failed.
    #[error(transparent)]
    Fit(#[from] LmError),
}

impl ModalError {
    /// Process exit code of `bad-inputs.md`.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Signal(e) => e.exit_code(),
            Self::TooShort { .. } | Self::NoMode { .. } => 13,
            Self::Setup(_) => 11,
            Self::Linalg(_) | Self::Fit(_) => 14,
        }
    }
}

/// What to look for.
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
/// use ff_spectral::{ModalSettings, fit_modes};
///
/// // A user who knows that there are two modes: four poles and one offset.
/// let settings = ModalSettings { order: Some(5), ..ModalSettings::up_to(1.0) };
/// assert_eq!(fit_modes(&y, &[1e-4], 10.0, &settings)?.order, 5);
/// # Ok::<(), ff_spectral::modal::ModalError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ModalSettings {
    /// Highest frequency of interest (Hz).
    pub f_max: f64,
    /// Order of the realisation (two per mode, one per offset or creep); by singular values when absent.
    pub order: Option<usize>,
    /// Largest order tried.
    pub max_order: usize,
    /// Poles damped more than this are creep or noise, not modes.
    pub max_damping: f64,
    /// Singular values (per noise edge) above which the order is counted.
    pub edge: f64,
    /// What counts as the same pole from one order to the next.
    pub tolerance: Tolerance,
}

impl ModalSettings {
    /// Automatic order for modes up to `f_max` (Hz).
    pub fn up_to(f_max: f64) -> Self {
        Self { f_max, order: None, max_order: 24, max_damping: 0.5, edge: 1.3, tolerance: Tolerance::default() }
    }
}

/// One damped mode `A e^(-damping w t) cos(w_d t + phase)` with `w = 2 pi frequency`.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Mode {
    /// Undamped natural frequency `|ln z| / (2 pi dt)` (Hz).
    pub frequency: f64,
    /// Its standard deviation (Hz).
    pub frequency_deviation: f64,
    /// Damping ratio.
    pub damping: f64,
    /// Its standard deviation.
    pub damping_deviation: f64,
    /// Covariance of frequency and damping ratio (Hz).
    pub covariance: f64,
    /// Amplitude of each channel at the first sample, in the unit of the channel.
    pub amplitude: Vec<f64>,
    /// Their standard deviations.
    pub amplitude_deviation: Vec<f64>,
    /// Phase of each channel at the first sample (rad).
    pub phase: Vec<f64>,
    /// Their standard deviations (rad); above about 1 the channel does not see the mode.
    pub phase_deviation: Vec<f64>,
    /// Consistent-mode indicator of the realisation it was refined from ([`crate::era`]), 0 to 1.
    pub consistency: f64,
    /// Root-sum-square of the amplitudes in units of noise: how loud the mode is.
    pub snr: f64,
}

impl Mode {
    /// The frequency at which it rings, `f sqrt(1 - zeta^2)` (Hz); zero where it does not.
    pub fn damped_frequency(&self) -> f64 {
        self.frequency * (1.0 - self.damping * self.damping).max(0.0).sqrt()
    }
    /// The rate at which it decays, `2 pi f zeta` (1/s).
    pub fn decay_rate(&self) -> f64 {
        TAU * self.frequency * self.damping
    }
    /// Complex amplitude of each channel at the first sample: `y_j = Re(a_j e^(p t))`. Allocates.
    pub fn shape(&self) -> Vec<Complex<f64>> {
        self.amplitude.iter().zip(&self.phase).map(|(a, p)| Complex::from_polar(*a, *p)).collect()
    }
    /// The continuous pole `2 pi f (-zeta + i sqrt(1 - zeta^2))` (1/s).
    pub fn pole(&self) -> Complex<f64> {
        Complex::new(-self.damping, (1.0 - self.damping * self.damping).max(0.0).sqrt()) * (TAU * self.frequency)
    }
}

/// Two modes that the record cannot keep apart (bad-inputs row D26): their frequencies and damping are
/// a joint fit and should not be read singly.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Unresolved {
    /// Lower frequency (Hz).
    pub f1: f64,
    /// Higher frequency (Hz).
    pub f2: f64,
    /// Separation that the record resolves (Hz).
    pub df: f64,
}

/// The result of [`fit_modes`].
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
/// use ff_spectral::{ModalFit, ModalSettings, fit_modes};
///
/// let fit: ModalFit = fit_modes(&y, &[1e-4], 10.0, &ModalSettings::up_to(1.0))?;
/// let found: Vec<f64> = fit.modes.iter().map(|m| (m.frequency * 1e3).round()).collect();
/// assert_eq!(found, [210.0, 470.0]); // mHz
/// assert!(fit.unresolved.is_empty() && fit.noise_ratio < 1.5);
/// # Ok::<(), ff_spectral::modal::ModalError>(())
/// ```
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ModalFit {
    /// Modes by frequency.
    pub modes: Vec<Mode>,
    /// Pairs that cannot be kept apart.
    pub unresolved: Vec<Unresolved>,
    /// Order of the realisation.
    pub order: usize,
    /// Oscillating poles in the band that were dropped: they did not persist with the order, or noise explains them.
    pub dropped: usize,
    /// Singular values of the Hankel matrix over the noise edge (the first `max_order`).
    pub singular_values: Vec<f64>,
    /// Poles of every order, and which of them stay.
    pub stabilisation: Stabilisation,
    /// Duration of the free motion (s) and its plain spectral resolution `1 / seconds` (Hz).
    pub seconds: f64,
    /// See `seconds`.
    pub df: f64,
    /// Noise found over noise declared; well above 1 means an unmodelled component or a wrong sigma.
    pub noise_ratio: f64,
}

/// Fits the free decay in `y` (N x channels, one row per sample at `rate_hz`, all joints held) with noise
/// deviations `sigma`. Static offsets (biases) are fitted as well. Allocates. A minute
/// of ten channels at 100 Hz takes 30 ms for `f_max` = 1 Hz and 0.2 s for 2 Hz; the time grows with the cube of
/// `seconds * f_max`, to seconds at 100 s and 4 Hz.
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
/// use ff_spectral::{ModalSettings, fit_modes};
///
/// let fit = fit_modes(&y, &[1e-4], 10.0, &ModalSettings::up_to(1.0))?;
/// let slow = &fit.modes[0];
/// assert!((slow.frequency - 0.21).abs() < 4.0 * slow.frequency_deviation);
/// assert!((slow.damping - 0.006).abs() < 4.0 * slow.damping_deviation);
/// # Ok::<(), ff_spectral::modal::ModalError>(())
/// ```
///
/// # Errors
/// [`ModalError`].
pub fn fit_modes(y: &DMatrix<f64>, sigma: &[f64], rate_hz: f64, set: &ModalSettings) -> Result<ModalFit, ModalError> {
    let (n, c) = y.shape();
    if c == 0 || sigma.len() != c || !sigma.iter().all(|s| s.is_finite() && *s > 0.0) {
        return Err(ModalError::Setup(format!("{c} channels need as many positive sigmas, got {sigma:?}")));
    }
    check_rate(rate_hz, set.f_max)?;
    linalg::check_finite("record", y)?;
    let plan = Decimator::new(rate_hz, set.f_max);
    let dt = plan.factor() as f64 / rate_hz;
    let have_seconds = n as f64 / rate_hz;
    let rows = plan.len(n);
    if rows < 32 {
        let need_seconds = 32.0 * dt + 2.0 * plan.margin() as f64 / rate_hz;
        return Err(ModalError::TooShort { have_seconds, need_seconds, f_max: set.f_max });
    }
    // Units of in-band noise: white noise of deviation sigma at the old rate has, in the pass band, the
    // density of white noise of deviation sigma / sqrt(factor) at the new rate.
    let mut data = plan.run(y);
    for (mut col, s) in data.column_iter_mut().zip(sigma) {
        col.scale_mut((plan.factor() as f64).sqrt() / s);
    }
    let noise = (plan.noise_gain() * plan.factor() as f64).sqrt();

    let era = Era::new(&data, dt)?;
    let edge = noise * era.noise_edge();
    let tail: Vec<f64> = era.singular_values().iter().take(set.max_order).map(|s| s / edge).collect();
    let counted = tail.iter().take_while(|&&s| s > set.edge).count().min(era.highest_order());
    let is_mode =
        |p: &EraPole| p.pole.norm() <= TAU * set.f_max && p.damping() < set.max_damping && p.damping() > -0.05;
    let no_mode = || ModalError::NoMode { snr: tail[0], f_max: set.f_max };
    let lowest = set.order.unwrap_or(counted).min(set.max_order).min(era.highest_order());
    if lowest == 0 {
        return Err(no_mode());
    }
    let sweep = Sweep::new(&era, set.max_order + 2, have_seconds, set.tolerance, is_mode)?;
    let order = if set.order.is_some() { lowest } else { sweep.choose(lowest) };
    let all = sweep.count(order);
    let lasting = sweep.lasting(order);
    let oscillating: Vec<Complex<f64>> = lasting.iter().map(|p| p.pole).collect();
    if oscillating.is_empty() {
        return Err(no_mode());
    }
    let Some((refined, noise_ratio)) = significant(&data, oscillating, dt, noise)? else {
        return Err(no_mode());
    };
    let deviation = |v: f64| v.max(0.0).sqrt() * noise_ratio;
    let mut modes: Vec<Mode> = refined
        .poles
        .iter()
        .enumerate()
        .map(|(k, p)| {
            // The fit starts `margin` samples late and went through the filter.
            let z = (p / rate_hz).exp();
            let undo = z.powi(-(plan.margin() as i32)) / plan.gain(z);
            let slope = -(plan.log_slope(z) + plan.margin() as f64) / rate_hz;
            let (w, var) = (p.norm(), refined.covariance[k][0]);
            // d|p| = (re dre + im dim)/|p|;  d(-re/|p|) = -(im / |p|^3)(im dre - re dim).
            let (fr, fi) = (p.re / w / TAU, p.im / w / TAU);
            let (zr, zi) = (-p.im * p.im / w.powi(3), p.im * p.re / w.powi(3));
            let form = |a: [f64; 2], b: [f64; 2]| {
                a[0] * b[0] * var[(2, 2)] + (a[0] * b[1] + a[1] * b[0]) * var[(2, 3)] + a[1] * b[1] * var[(3, 3)]
            };
            let mut m = Mode {
                frequency: w / TAU,
                frequency_deviation: deviation(form([fr, fi], [fr, fi])),
                damping: damping(p),
                damping_deviation: deviation(form([zr, zi], [zr, zi])),
                covariance: form([fr, fi], [zr, zi]) * noise_ratio * noise_ratio,
                snr: 0.0,
                amplitude: Vec::with_capacity(c),
                amplitude_deviation: Vec::with_capacity(c),
                phase: Vec::with_capacity(c),
                phase_deviation: Vec::with_capacity(c),
                consistency: nearest_consistency(&lasting, p),
            };
            for j in 0..c {
                let unit = undo * (sigma[j] / (plan.factor() as f64).sqrt());
                let a = refined.amplitudes[(k, j)] * unit;
                // dA = unit da + A slope dp, seen along A (change of modulus) and across it (of phase).
                let turn = Complex::from_polar(1.0, -a.arg());
                let (g, h) = (unit * turn, a * slope * turn);
                let rows = Matrix2x4::new(g.re, -g.im, h.re, -h.im, g.im, g.re, h.im, h.re);
                let spread = rows * refined.covariance[k][j] * rows.transpose();
                m.snr = m.snr.hypot(a.norm() / sigma[j]);
                m.amplitude.push(a.norm());
                m.amplitude_deviation.push(deviation(spread[(0, 0)]));
                m.phase.push(a.arg());
                m.phase_deviation.push(deviation(spread[(1, 1)]) / a.norm());
            }
            m
        })
        .collect();
    modes.sort_by(|a, b| a.frequency.total_cmp(&b.frequency));
    let df = 1.0 / have_seconds;
    let unresolved = modes.windows(2).filter_map(|w| {
        let own = 3.0 * w[0].frequency_deviation.hypot(w[1].frequency_deviation);
        let df = df.max(own);
        let (f1, f2) = (w[0].frequency, w[1].frequency);
        (f2 - f1 < df).then_some(Unresolved { f1, f2, df })
    });
    Ok(ModalFit {
        unresolved: unresolved.collect(),
        dropped: all - refined.poles.len(),
        modes,
        order,
        singular_values: tail,
        stabilisation: sweep.diagram(order),
        seconds: have_seconds,
        df,
        noise_ratio,
    })
}

/// Refines, and drops one by one the modes that noise alone would explain; none left gives `None`. Also
/// returns the ratio of the noise found to the noise declared (`noise` per filtered sample).
///
/// Fitting a mode to noise gains about the largest of M chi-squared numbers with 2c degrees of freedom, M the
/// number of frequencies to choose from. A mode must gain more than that ever does but once in a thousand
/// records (tail bound of B. Laurent, P. Massart, Ann. Statist. 28(5), 2000, lemma 1).
fn significant(
    data: &DMatrix<f64>,
    mut poles: Vec<Complex<f64>>,
    dt: f64,
    noise: f64,
) -> Result<Option<(Refined, f64)>, ModalError> {
    let (n, c) = data.shape();
    let (freedom, log) = (2.0 * c as f64, (500.0 * n as f64).ln());
    let gain = freedom + 2.0 * (freedom * log).sqrt() + 2.0 * log;
    loop {
        let refined = refine(data, &Poles { oscillating: poles, dt })?;
        let left = (data.len() as f64 - refined.parameters as f64).max(1.0);
        let ratio = (2.0 * refined.cost / left).sqrt() / noise;
        let limit = gain * ratio.max(1.0).powi(2);
        let explained = contributions(data, &refined.poles, dt)?;
        let weakest = (0..explained.len()).min_by(|&a, &b| explained[a].total_cmp(&explained[b]));
        match weakest {
            Some(k) if explained[k] < limit => {
                poles = refined.poles;
                poles.remove(k);
                if poles.is_empty() {
                    return Ok(None);
                }
            }
            _ => return Ok(Some((refined, ratio))),
        }
    }
}

/// Damping ratio of a continuous pole.
fn damping(p: &Complex<f64>) -> f64 {
    -p.re / p.norm()
}

/// Consistency of the realised pole that a refined one came from.
fn nearest_consistency(from: &[EraPole], p: &Complex<f64>) -> f64 {
    let near = from.iter().min_by(|a, b| (a.pole - p).norm().total_cmp(&(b.pole - p).norm()));
    near.map_or(0.0, |e| e.consistency)
}

#[cfg(test)]
#[path = "fit_tests.rs"]
mod tests;
