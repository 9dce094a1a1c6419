//! What the trajectory excites: joint and base accelerations against the modes.

use super::error::PreflightError;
use super::question::Question;
use excitation::system::modal_targets;
use ff_dynamics::{Mode, Trace};
use ff_spectral::psd::PsdError;
use ff_spectral::{Psd, Welch};
use nalgebra::DMatrix;
use serde::Serialize;
use std::f64::consts::TAU;

/// Margin of the flexible band below its lowest and above its highest mode (relative).
const BAND: f64 = 0.2;

/// Excitation at one mode.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ModePower {
    /// Frequency of the mode (Hz).
    pub frequency_hz: f64,
    /// Density of the joint accelerations there, summed over joints (rad^2/s^4/Hz).
    pub joints: f64,
    /// Density of the base's angular acceleration there (rad^2/s^4/Hz).
    pub base_angular: f64,
    /// Density of the base's linear acceleration there (m^2/s^4/Hz).
    pub base_linear: f64,
    /// Rate amplitude that the joints leave the mode with, `|int (c . qdd) exp(-i w t) dt|`, if it were undamped and the
    /// arm stayed near its start pose (unit of the mode's largest coordinate per second).
    pub left_swinging: f64,
}

/// Spectra of the excitation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Spectrum {
    /// Resolution (Hz): one over the duration.
    pub resolution_hz: f64,
    /// The excitation at each mode.
    pub modes: Vec<ModePower>,
    /// From a fifth below the lowest mode to a fifth above the highest (Hz); absent without modes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub band_hz: Option<(f64, f64)>,
    /// Mean square of the joint accelerations in that band, summed over joints (rad^2/s^4).
    pub in_band: f64,
    /// Mean square of the joint accelerations over all frequencies (rad^2/s^4).
    pub total: f64,
    /// Density of the joint accelerations, for figures.
    #[serde(skip)]
    pub joints: Psd,
    /// Densities of the base's angular and linear acceleration, for figures.
    #[serde(skip)]
    pub base: [Psd; 2],
}

/// Zeros after a motion in the spectra for figures, in its lengths: a short manoeuvre has few lines below the modes.
const PADDED: usize = 8;

/// Density summed over the columns, one window over the whole record.
fn density(m: &DMatrix<f64>, rate: f64, padded: usize) -> Result<Psd, PsdError> {
    let mut welch = Welch::new(m.nrows(), rate)?.padded(padded);
    let each = m.column_iter().map(|c| welch.run(c.as_slice())).collect::<Result<Vec<_>, _>>()?;
    Psd::weighted_sum(&each, &vec![1.0; m.ncols()])
}

fn at(p: &Psd, f: f64) -> f64 {
    let k = (f / p.df).round() as usize;
    p.density.get(k).copied().unwrap_or(0.0)
}

pub(super) fn of(q: &Question<'_>, modes: &[Mode], t: &Trace, start: &[f64]) -> Result<Spectrum, PreflightError> {
    let rate = q.sensing.rate_hz;
    let fail = |e: PsdError| PreflightError::Sensitivities(format!("spectrum: {e}"));
    let joints = density(&t.qdd, rate, 1).map_err(fail)?;
    let (linear, angular) = (t.accel.columns(0, 3).into_owned(), t.accel.columns(3, 3).into_owned());
    let drawn = |m: &DMatrix<f64>| density(m, rate, PADDED).map_err(fail);
    let figures = (drawn(&t.qdd)?, [drawn(&angular)?, drawn(&linear)?]);
    let linear = density(&linear, rate, 1).map_err(fail)?;
    let angular = density(&angular, rate, 1).map_err(fail)?;
    let targets = modal_targets(q.model, q.params, start)?;
    let left = |frequency: f64, weights: &[f64]| {
        let (mut re, mut im) = (0.0, 0.0);
        for i in 0..t.len() {
            let drive: f64 = weights.iter().enumerate().map(|(j, w)| w * t.qdd[(i, j)]).sum();
            let weight = if i == 0 || i + 1 == t.len() { 0.5 } else { 1.0 };
            let (sin, cos) = (TAU * frequency * i as f64 * t.dt).sin_cos();
            re += weight * drive * cos;
            im -= weight * drive * sin;
        }
        t.dt * f64::hypot(re, im)
    };
    let band_hz =
        modes.first().zip(modes.last()).map(|(a, b)| ((1.0 - BAND) * a.frequency_hz, (1.0 + BAND) * b.frequency_hz));
    let power = |within: &dyn Fn(f64) -> bool| {
        joints.frequency.iter().zip(&joints.density).filter(|(f, _)| within(**f)).map(|(_, d)| d).sum::<f64>()
            * joints.df
    };
    Ok(Spectrum {
        resolution_hz: joints.df,
        modes: targets
            .iter()
            .map(|m| ModePower {
                frequency_hz: m.frequency,
                joints: at(&joints, m.frequency),
                base_angular: at(&angular, m.frequency),
                base_linear: at(&linear, m.frequency),
                left_swinging: left(m.frequency, &m.weights),
            })
            .collect(),
        in_band: band_hz.map_or(0.0, |(a, b)| power(&|f| f >= a && f <= b)),
        total: power(&|_| true),
        band_hz,
        joints: figures.0,
        base: figures.1,
    })
}
