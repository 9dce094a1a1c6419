//! Free-decay modal fit: frequencies, damping ratios and amplitudes from the time after a manoeuvre.
//!
//! A spectrum of T seconds resolves 1/T. A free decay is a sum of damped exponentials, `y_i = sum_k a_k z_k^i`,
//! whose poles can be fitted much more closely:
//!
//! 1. channels in units of their noise, low-passed and decimated ([`crate::decimate`]);
//! 2. a block Hankel matrix of all channels, whose singular values above the noise edge give the order; the
//!    shift of its left vectors gives the poles (eigensystem realisation: J.-N. Juang, R. Pappa, J. Guidance 8(5),
//!    1985; for one channel this is the matrix pencil);
//! 3. modes must persist at two higher orders; then
//! 4. maximum likelihood refinement over all poles with amplitudes eliminated (variable projection), whose
//!    Jacobian gives the Cramer-Rao deviations; modes that noise would explain are dropped.
//!
//! Closely spaced modes with different shapes are found; pairs that the record cannot keep apart are listed in
//! [`ModalFit::unresolved`], never merged in silence.

use crate::decimate::Decimator;
use crate::linalg::{self, LinalgError};
use crate::lm::LmError;
use crate::modal_refine::{Poles, Refined, contributions, refine};
use crate::psd::{PsdError, check_rate};
use core::f64::consts::TAU;
use nalgebra::{Complex, DMatrix};

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
}

impl ModalSettings {
    /// Automatic order for modes up to `f_max` (Hz).
    pub fn up_to(f_max: f64) -> Self {
        Self { f_max, order: None, max_order: 24, max_damping: 0.5, edge: 1.3 }
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
    /// Amplitude of each channel at the first sample, in the unit of the channel.
    pub amplitude: Vec<f64>,
    /// Phase of each channel at the first sample (rad).
    pub phase: Vec<f64>,
    /// Root-sum-square of the amplitudes in units of noise: how loud the mode is.
    pub snr: f64,
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

    // A Hankel matrix of half the record has the least variance; its size is capped, its span is not a risk.
    let blocks = (rows / 2).min((1500 / c).max(16));
    let columns = rows - blocks + 1;
    let hankel = DMatrix::from_fn(blocks * c, columns, |r, k| data[(r / c + k, r % c)]);
    let svd = linalg::svd(&hankel)?;
    // Largest singular value of unstructured noise; the Hankel structure raises it by some 10-30 %.
    let edge = noise * (((blocks * c) as f64).sqrt() + (columns as f64).sqrt());
    let tail: Vec<f64> = svd.s.iter().take(set.max_order).map(|s| s / edge).collect();
    let top = svd.s.len().min(blocks * c - c).saturating_sub(3);
    let floor = 1e-9 * tail[0];
    let counted = tail.iter().take_while(|&&s| s > set.edge && s > floor).count();
    let order = set.order.unwrap_or(counted).min(top).min(set.max_order);
    if order == 0 {
        return Err(ModalError::NoMode { snr: tail[0], f_max: set.f_max });
    }
    let up_to = |k: usize| realise(&svd.u, c, k, dt);
    let found = up_to(order)?;
    let higher = [up_to(order + 1)?, up_to(order + 2)?];
    let is_mode = |p: &Complex<f64>| {
        p.im > 0.0 && p.norm() <= TAU * set.f_max && damping(p) < set.max_damping && damping(p) > -0.05
    };
    // Without noise there is nothing left for higher orders to describe: their extra poles are rounding.
    let exact = svd.s.len() > order && svd.s[order] < 1e-9 * svd.s[0];
    let persists = |p: &Complex<f64>| {
        let near = |q: &&Complex<f64>| (*q - p).norm() < 0.05 * p.norm() + 1.0 / have_seconds;
        exact || higher.iter().all(|h| h.iter().any(|q| near(&q)))
    };
    let all = found.iter().filter(|p| is_mode(p)).count();
    let oscillating: Vec<Complex<f64>> = found.iter().filter(|p| is_mode(p) && persists(p)).copied().collect();
    if oscillating.is_empty() {
        return Err(ModalError::NoMode { snr: tail[0], f_max: set.f_max });
    }
    let Some((refined, noise_ratio)) = significant(&data, oscillating, dt, noise)? else {
        return Err(ModalError::NoMode { snr: tail[0], f_max: set.f_max });
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
            let a: Vec<Complex<f64>> = (0..c)
                .map(|j| refined.amplitudes[(k, j)] * undo * (sigma[j] / (plan.factor() as f64).sqrt()))
                .collect();
            let (w, var) = (p.norm(), refined.covariance[k]);
            // d|p| = (re dre + im dim)/|p|;  d(-re/|p|) = -(im / |p|^3)(im dre - re dim).
            let (fr, fi) = (p.re / w / TAU, p.im / w / TAU);
            let (zr, zi) = (-p.im * p.im / w.powi(3), p.im * p.re / w.powi(3));
            let form = |a: f64, b: f64| a * a * var[0] + 2.0 * a * b * var[1] + b * b * var[2];
            Mode {
                frequency: w / TAU,
                frequency_deviation: deviation(form(fr, fi)),
                damping: damping(p),
                damping_deviation: deviation(form(zr, zi)),
                snr: a.iter().zip(sigma).map(|(a, s)| a.norm_sqr() / (s * s)).sum::<f64>().sqrt(),
                amplitude: a.iter().map(|a| a.norm()).collect(),
                phase: a.iter().map(|a| a.arg()).collect(),
            }
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

/// Continuous poles (1/s) of the realisation of order k: `U_upper A = U_lower` in the least-squares sense.
fn realise(u: &DMatrix<f64>, channels: usize, k: usize, dt: f64) -> Result<Vec<Complex<f64>>, LinalgError> {
    let m = u.nrows() - channels;
    let upper = u.view((0, 0), (m, k)).into_owned();
    let lower = u.view((channels, 0), (m, k)).into_owned();
    // Columns of U are orthonormal, so this small system is close to the identity and well conditioned.
    let g = linalg::gram(&upper)?;
    let rhs = upper.tr_mul(&lower);
    let a = g.lu().solve(&rhs).ok_or(LinalgError::RankDeficient { rank: k - 1, columns: k, dependent: vec![] })?;
    let (values, _) = linalg::general_eigen(&a)?;
    Ok(values.into_iter().filter(|z| z.norm() > 1e-6).map(|z| z.ln() / dt).collect())
}

#[cfg(test)]
#[path = "modal_fit_tests.rs"]
mod tests;
