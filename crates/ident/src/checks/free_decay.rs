//! Modes of the free decay in a record: panels and fuel ring while the joints stand still.

use crate::modal::{HeldPose, MatchSettings, ModalModel, ModalModelError, ModeMatch, ModelMode, match_modes};
use ff_dynamics::Boundary;
use ff_model::{Model, Params, Problems};
use ff_records::Record;
use ff_records::time_base::TimeBaseError;
use ff_spectral::modal::ModalError;
use ff_spectral::psd::energy_at_the_top;
use ff_spectral::{ModalFit, ModalSettings, fit_modes};

/// A joint stands still while it stays within this part of its range in the record.
const STILL: f64 = 1e-3;
/// Modes are looked for up to this many times the highest frequency of the model.
const ABOVE: f64 = 1.5;
/// Relative standard deviation of the frequencies of an identified model, for the match.
const FREQUENCY_SPREAD: f64 = 0.05;
/// Shortest decay that is analysed, in periods of the slowest mode of the model.
const PERIODS: f64 = 2.0;
/// Part of the energy of a channel just below half the sampling rate from which it counts as aliased.
pub const ALIASED: f64 = 0.01;

/// Modes measured in a free decay, and the modes of the model that they are.
#[derive(Clone, Debug)]
pub struct FreeDecay {
    /// First sample of the decay and the one after the last.
    pub samples: (usize, usize),
    /// Measured modes.
    pub fit: ModalFit,
    /// Modes of the model at the pose of the decay, joints held.
    pub model_modes: Vec<ModelMode>,
    /// Which measured mode is which mode of the model.
    pub matched: ModeMatch,
    /// Names of the channels that were not filtered before sampling, with the part of their energy above 0.45 of the rate,
    /// more than [`ALIASED`] (row D24).
    pub aliased: Vec<(f64, String)>,
}

/// Why a record has no modes of a free decay.
#[derive(Debug, thiserror::Error)]
pub enum FreeDecayError {
    /// The model has no passive coordinates.
    #[error("the model has no passive coordinates")]
    NoPassiveCoordinates,
    /// Every mode of the model is overdamped.
    #[error("no mode of the model oscillates")]
    NoOscillation,
    /// The joints do not stand still for two periods of the slowest mode.
    #[error("the joints stand still for {longest:.2} s at most; modes from {slowest_hz:.4} Hz need {needed:.2} s")]
    TooShort {
        /// Longest rest of the joints (s).
        longest: f64,
        /// Needed (s).
        needed: f64,
        /// Lowest frequency of the model (Hz).
        slowest_hz: f64,
        /// Frequency resolution of a spectrum over the longest rest (Hz).
        resolution_hz: f64,
    },
    /// The model has no modes at the pose of the decay.
    #[error(transparent)]
    Model(#[from] ModalModelError),
    /// Channels have sample times of their own.
    #[error(transparent)]
    TimeBase(#[from] TimeBaseError),
    /// The part of the record is no record.
    #[error("{0}")]
    Record(Problems),
    /// The signals determine no modes.
    #[error(transparent)]
    Fit(#[from] ModalError),
}

/// The longest time during which no joint moves: first sample of the joint motion and the one after the last.
/// Allocates.
pub fn longest_rest(record: &Record) -> (usize, usize) {
    let q = record.q();
    let tolerance: Vec<f64> = q.column_iter().map(|c| STILL * (c.max() - c.min())).collect();
    let (mut best, mut from) = ((0, 0), 0);
    let mut lo: Vec<f64> = q.row(0).iter().copied().collect();
    let mut hi = lo.clone();
    for i in 0..q.nrows() {
        for j in 0..q.ncols() {
            (lo[j], hi[j]) = (lo[j].min(q[(i, j)]), hi[j].max(q[(i, j)]));
        }
        while (0..q.ncols()).any(|j| hi[j] - lo[j] > tolerance[j]) {
            // Begin later: after the first sample that is too far from this one.
            from += 1;
            while from < i && (0..q.ncols()).any(|j| (q[(from, j)] - q[(i, j)]).abs() > tolerance[j]) {
                from += 1;
            }
            for j in 0..q.ncols() {
                let part = q.column(j).rows(from, i + 1 - from).into_owned();
                (lo[j], hi[j]) = (part.min(), part.max());
            }
        }
        if i + 1 - from > best.1 - best.0 {
            best = (from, i + 1);
        }
    }
    best
}

/// Fits the modes of the longest rest of the joints and matches them to those of `model` at the parameters `values`. `sigma` are
/// the standard deviations of torques and gyro. Allocates.
///
/// # Errors
/// [`FreeDecayError`].
pub fn free_decay(model: &Model, values: &[f64], record: &Record, sigma: &[f64]) -> Result<FreeDecay, FreeDecayError> {
    decay(model, values, record, sigma, true)
}

/// [`free_decay`] of what the rest is long enough for, whatever else the model has: at parameters that are far off its slowest mode may be
/// slower than any that the record holds. Allocates.
///
/// # Errors
/// [`FreeDecayError`].
pub fn resolved_decay(
    model: &Model,
    values: &[f64],
    record: &Record,
    sigma: &[f64],
) -> Result<FreeDecay, FreeDecayError> {
    decay(model, values, record, sigma, false)
}

fn decay(
    model: &Model,
    values: &[f64],
    record: &Record,
    sigma: &[f64],
    all_modes: bool,
) -> Result<FreeDecay, FreeDecayError> {
    if model.np() == 0 {
        return Err(FreeDecayError::NoPassiveCoordinates);
    }
    record.check_uniform("a fit of modes")?;
    let (from, to) = longest_rest(record);
    let (dt, n) = (record.dt(), to - from);
    let mid = (from + to) / 2;
    let pose: Vec<f64> = record.q().row(mid).iter().copied().collect();
    let params = Params::from_values(model, values.to_vec());
    let eta = model.rest_position(&params);
    let held = HeldPose { q: &pose, eta: &eta, boundary: Boundary::JointsHeld };
    let modal = ModalModel::new(model, &params, &held)?;
    let known = modal.modes();
    let longest = n as f64 * dt;
    let resolved = |m: &&ModelMode| all_modes || longest >= PERIODS / m.frequency();
    let known: Vec<ModelMode> = known.iter().filter(resolved).cloned().collect();
    let (Some(first), Some(last)) = (known.first(), known.last()) else {
        return Err(FreeDecayError::NoOscillation);
    };
    let (slowest_hz, f_max) = (first.frequency(), ABOVE * last.frequency());
    let needed = PERIODS / slowest_hz;
    if longest < needed {
        let resolution_hz = 1.0 / longest.max(dt);
        return Err(FreeDecayError::TooShort { longest, needed, slowest_hz, resolution_hz });
    }
    let window = record.window(from as f64 * dt, to as f64 * dt).map_err(FreeDecayError::Record)?;
    let fit = fit_modes(&window.responses(), sigma, record.rate_hz(), &ModalSettings::up_to(f_max))?;
    let settings = MatchSettings { frequency_spread: FREQUENCY_SPREAD, ..MatchSettings::up_to(f_max) };
    let matched = match_modes(&fit, &known, sigma, &settings);
    Ok(FreeDecay { samples: (from, to), aliased: aliased(&window, sigma), model_modes: known, fit, matched })
}

/// Channels that are not quiet just below half the sampling rate.
fn aliased(window: &Record, sigma: &[f64]) -> Vec<(f64, String)> {
    let rate = window.rate_hz();
    let all = window.responses();
    let share = |k: usize| energy_at_the_top(all.column(k).as_slice(), rate, sigma[k]).unwrap_or(0.0);
    let names = window.response_names().into_iter().enumerate();
    names.map(|(k, name)| (share(k), name)).filter(|(share, _)| *share > ALIASED).collect()
}
