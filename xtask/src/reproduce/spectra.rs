//! Natural frequencies from the ringing: spectra, and a fit of the free decay.

use super::experiment::Experiment;
use ff_dynamics::measure;
use ff_spectral::find_peaks;
use ff_spectral::modal::Mode;
use ff_spectral::{ModalFit, ModalSettings, fit_modes};
use ff_spectral::{Psd, Welch};
use nalgebra::DMatrix;
use serde::Serialize;

/// The paper looks at frequencies up to 1.5 Hz.
const F_MAX: f64 = 1.5;

/// Spectra behind Figs. 5 and 7.
pub(super) struct Spectra {
    /// Response after the manoeuvre: torques and gyro summed, each in units of its noise.
    pub(super) response: Psd,
    /// Joint accelerations of the manoeuvre, the identification and the quiet trajectory.
    pub(super) manoeuvre: Psd,
    pub(super) identification: Psd,
    pub(super) quiet: Psd,
    pub(super) fit: ModalFit,
    pub(super) fit_noisy: Option<ModalFit>,
    pub(super) peaks: Vec<(f64, (f64, f64))>,
}

impl Spectra {
    pub(super) fn of(x: &Experiment) -> anyhow::Result<Self> {
        let rate = 1.0 / x.ringing.dt;
        let first = (x.ring_from * rate).ceil() as usize;
        let n = x.ringing.len() - first;
        let nj = x.system.model().nj();
        let sigma: Vec<f64> =
            std::iter::repeat_n(x.system.noise.torque, nj).chain(std::iter::repeat_n(x.system.noise.gyro, 3)).collect();
        let join = |tau: &DMatrix<f64>, gyro: &DMatrix<f64>| {
            let mut y = DMatrix::zeros(n, nj + 3);
            y.columns_mut(0, nj).copy_from(&tau.rows(first, n));
            y.columns_mut(nj, 3).copy_from(&gyro.rows(first, n));
            y
        };
        let y = join(&x.ringing.tau, &x.ringing.gyro());
        let response = spectrum(&y, &sigma, n, rate, PADDED)?;
        let peaks = find_peaks(&spectrum(&y, &sigma, n, rate, 1)?, 0.09, F_MAX, None)
            .map(|p| p.peaks.iter().map(|p| (p.frequency, p.interval)).collect())
            .unwrap_or_default();
        let set = ModalSettings::up_to(F_MAX);
        let fit = fit_modes(&y, &sigma, rate, &set)?;
        let noisy = measure(&x.ringing, &x.system.sensors, x.system.seed().wrapping_add(3));
        let fit_noisy = fit_modes(&join(&noisy.tau, &noisy.gyro), &sigma, rate, &set).ok();
        let unit = vec![1.0; nj];
        let of = |m: &DMatrix<f64>| spectrum(m, &unit, m.nrows(), rate, PADDED);
        Ok(Self {
            response,
            manoeuvre: of(&x.ringing.qdd.rows(0, first.min(x.ringing.len())).into_owned())?,
            identification: of(&x.trace.qdd)?,
            quiet: of(&x.rigid_trace.qdd)?,
            fit,
            fit_noisy,
            peaks,
        })
    }
}

/// A weak tone at a sum or difference of two stronger modes.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct Tone {
    /// Its frequency (Hz).
    pub(super) hz: f64,
    /// Those of the modes (Hz).
    pub(super) of_hz: (f64, f64),
}

impl Tone {
    /// `0.458 = 2 x 0.229`, `0.018 ≈ 0 = 0.106 − 0.106`.
    pub(super) fn words(&self) -> String {
        let (a, b) = self.of_hz;
        if a == b && (self.hz - 2.0 * a).abs() <= self.hz {
            return format!("{:.3} = 2 \u{d7} {a:.3}", self.hz);
        }
        if a == b {
            // The square of a decay has a part that does not ring and decays twice as fast: its line is as near to zero as the record tells.
            return format!("{:.3} \u{2248} 0 = {a:.3} \u{2212} {a:.3}", self.hz);
        }
        let sign = if (self.hz - (a + b)).abs() < (self.hz - (a - b).abs()).abs() { "+" } else { "\u{2212}" };
        format!("{:.3} = {:.3} {sign} {:.3}", self.hz, a.max(b), a.min(b))
    }
}

/// Modes of a fit, and what is left out as a combination tone ([`ModalFit::combination`]).
fn split(fit: &ModalFit) -> (Vec<&Mode>, Vec<Tone>) {
    let hz = |i: usize| fit.modes[i].frequency;
    let tone = |i: usize| fit.combination(i).map(|(a, b)| Tone { hz: hz(i), of_hz: (hz(a), hz(b)) });
    let modes = (0..fit.modes.len()).filter(|&i| tone(i).is_none()).map(|i| &fit.modes[i]).collect();
    (modes, (0..fit.modes.len()).filter_map(tone).collect())
}

/// Length with zeros behind, in lengths of the signal: the manoeuvre of 5 s has eight lines below 1.5 Hz without them.
const PADDED: usize = 8;

/// One window over the whole signal, so that the resolution is the best there is.
fn spectrum(y: &DMatrix<f64>, sigma: &[f64], segment: usize, rate: f64, padded: usize) -> anyhow::Result<Psd> {
    let mut welch = Welch::new(segment, rate)?.padded(padded);
    let each = (0..y.ncols()).map(|c| welch.run(y.column(c).as_slice())).collect::<Result<Vec<_>, _>>()?;
    Ok(Psd::weighted_sum(&each, sigma)?)
}

/// Frequencies for the summary.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Frequencies {
    /// From the free decay of the noise-free record.
    pub(super) measured_hz: Vec<f64>,
    /// Weak tones at sums and differences of stronger modes, left out above.
    pub(super) combination_tones: Vec<Tone>,
    /// Half-width of what the record resolves, `1/T` (Hz): measured and model agree within it.
    pub(super) resolution_hz: f64,
    /// Damping ratios of the measured modes.
    pub(super) measured_damping: Vec<f64>,
    /// From the noisy record, with standard deviations.
    pub(super) measured_noisy_hz: Vec<f64>,
    pub(super) measured_noisy_std_hz: Vec<f64>,
    /// Peaks of the spectrum, each with the interval it stands for.
    pub(super) psd_peaks_hz: Vec<f64>,
    pub(super) psd_intervals_hz: Vec<(f64, f64)>,
    /// Free-floating eigenvalues at the hold pose (undamped), ascending.
    pub(super) model_hz: Vec<f64>,
    pub(super) model_damping: Vec<f64>,
    /// Those that turn the base (antisymmetric ones, for panels).
    pub(super) model_turning_hz: Vec<f64>,
    /// Lowest frequency with the base held.
    pub(super) cantilever_hz: f64,
    pub(super) paper_hz: Vec<f64>,
}

impl Frequencies {
    pub(super) fn of(x: &Experiment, s: &Spectra) -> anyhow::Result<Self> {
        let turning = |m: &&ff_dynamics::Mode| {
            let (v, w) = (m.base.fixed_rows::<3>(0).norm(), m.base.fixed_rows::<3>(3).norm());
            w > 0.3 * v
        };
        let noisy = s.fit_noisy.as_ref();
        let (modes, combination_tones) = split(&s.fit);
        Ok(Self {
            measured_hz: modes.iter().map(|m| m.frequency).collect(),
            combination_tones,
            resolution_hz: s.fit.df,
            measured_damping: modes.iter().map(|m| m.damping).collect(),
            measured_noisy_hz: noisy.map(|f| split(f).0.iter().map(|m| m.frequency).collect()).unwrap_or_default(),
            measured_noisy_std_hz: noisy
                .map(|f| f.modes.iter().map(|m| m.frequency_deviation).collect())
                .unwrap_or_default(),
            psd_peaks_hz: s.peaks.iter().map(|p| p.0).collect(),
            psd_intervals_hz: s.peaks.iter().map(|p| p.1).collect(),
            model_hz: x.modes.iter().map(|m| m.frequency_hz).collect(),
            model_damping: x.modes.iter().map(|m| m.damping_ratio).collect(),
            model_turning_hz: x.modes.iter().filter(turning).map(|m| m.frequency_hz).collect(),
            cantilever_hz: x.cantilever.iter().map(|m| m.frequency_hz).fold(f64::INFINITY, f64::min),
            paper_hz: if x.system.name == "flex" { vec![0.23, 0.68] } else { vec![0.06] },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::Tone;

    #[test]
    fn a_tone_is_named_by_the_sum_or_difference_that_it_is() {
        let words = |hz, a, b| Tone { hz, of_hz: (a, b) }.words();
        assert_eq!(words(0.458, 0.229, 0.229), "0.458 = 2 \u{d7} 0.229");
        assert_eq!(words(0.018, 0.106, 0.106), "0.018 \u{2248} 0 = 0.106 \u{2212} 0.106");
        assert_eq!(words(0.45, 0.229, 0.679), "0.450 = 0.679 \u{2212} 0.229");
        assert_eq!(words(0.908, 0.229, 0.679), "0.908 = 0.679 + 0.229");
    }
}
