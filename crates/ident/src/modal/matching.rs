//! Which of the model's modes a measured one is, and what was not seen and why.
//!
//! Every pair of a measured and a model mode costs
//!
//! ```text
//! cost = (ln(f_measured / f_model) / s)^2 / 2 + w (1 - MAC)
//! ```
//!
//! with `s` the relative deviation that the frequencies of the model may have, and MAC the assurance between the measured
//! complex amplitudes of all torque and gyro channels and those that the model's mode predicts there
//! ([`crate::modal::model`]), both in units of sensor noise. The assignment with the least total cost is taken
//! (Hungarian method), where leaving both of a pair alone has a price as well. Pairs that a record cannot keep apart
//! have shapes of no meaning each; their MAC is that with the plane of both.

use crate::modal::assignment::assign;
use crate::modal::model::ModelMode;
use ff_spectral::ModalFit;
use ff_spectral::era::{mac, subspace_mac};
use ff_spectral::modal::Mode;
use nalgebra::Complex;
use serde::Serialize;

/// What counts as a match.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MatchSettings {
    /// Relative standard deviation of the model's frequencies, as far as its parameters are known.
    pub frequency_spread: f64,
    /// Weight of a shape that does not fit at all.
    pub shape_weight: f64,
    /// Cost above which a pair is no match.
    pub limit: f64,
    /// Highest frequency that was looked at (Hz).
    pub f_max: f64,
    /// A sensor is blind to a mode whose amplitude in it, per joule and in units of noise, is below this part of that
    /// of the mode it sees best.
    pub blind: f64,
}

impl MatchSettings {
    /// Frequencies known to 30 %, looked at up to `f_max` (Hz).
    pub fn up_to(f_max: f64) -> Self {
        Self { frequency_spread: 0.3, shape_weight: 4.0, limit: 5.0, f_max, blind: 0.05 }
    }
}

/// A measured mode and its model mode.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Pair {
    /// Index of the measured mode.
    pub measured: usize,
    /// Index of the model mode.
    pub model: usize,
    /// Modal assurance of their sensor amplitudes.
    pub mac: f64,
    /// `f_measured / f_model`.
    pub frequency_ratio: f64,
}

/// Why a measured mode has no counterpart.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Stray {
    /// It lies at the sum, difference or double of louder modes: a product of their geometry, not a mode.
    Combination {
        /// Measured modes it comes from (twice the same for a double).
        of: (usize, usize),
    },
    /// The model has no mode left near this frequency with this shape.
    NoCounterpart {
        /// Frequency of the model mode that fits best (Hz); absent when the model has none.
        nearest: Option<f64>,
        /// MAC with it.
        mac: f64,
    },
}

/// Why a model mode was not measured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Unseen {
    /// Above the highest frequency looked at.
    OutOfBand,
    /// Neither torque sensors nor gyro would see it.
    Invisible,
    /// It does not turn the base (symmetric panels): only the torque sensors could see it, and there it was too faint.
    GyroBlind,
    /// It does not load the joints: only the gyro could see it, and there it was too faint.
    TorqueBlind,
    /// It merges with a neighbour that the record does not keep apart from it.
    Merged {
        /// The neighbour, by index among the model's modes.
        with: usize,
    },
    /// The sensors could see it, but the motion did not excite it above their noise.
    NotExcited,
}

impl Unseen {
    /// In words.
    pub fn words(&self) -> &'static str {
        match self {
            Self::OutOfBand => "above the frequencies looked at",
            Self::Invisible => "neither torque sensors nor gyro can see it",
            Self::GyroBlind => {
                "it does not turn the base (symmetric), so the gyro cannot see it, and the torques were too faint"
            }
            Self::TorqueBlind => "it does not load the joints, and the gyro saw too little of it",
            Self::Merged { .. } => "the record cannot keep it apart from its neighbour",
            Self::NotExcited => "the motion did not excite it above the noise",
        }
    }
}

/// The result of [`match_modes`].
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ModeMatch {
    /// Pairs, by measured mode.
    pub pairs: Vec<Pair>,
    /// Measured modes without a counterpart.
    pub strays: Vec<(usize, Stray)>,
    /// Model modes that were not measured.
    pub unseen: Vec<(usize, Unseen)>,
}

/// Matches the modes of a fit to those of a model. `sigma` are the noise deviations of the channels (torques, then the
/// three gyro axes), as given to the fit. Channels beyond the shorter of two shapes are not compared. Allocates.
pub fn match_modes(fit: &ModalFit, model: &[ModelMode], sigma: &[f64], set: &MatchSettings) -> ModeMatch {
    let whiten = |s: &[Complex<f64>]| -> Vec<Complex<f64>> { s.iter().zip(sigma).map(|(a, s)| a / *s).collect() };
    let measured: Vec<Vec<Complex<f64>>> = fit.modes.iter().map(|m| whiten(&m.shape())).collect();
    let predicted: Vec<Vec<Complex<f64>>> = model.iter().map(|m| whiten(&m.channels)).collect();
    let merged = |i: usize| -> Option<usize> {
        let f = fit.modes[i].frequency;
        let pair = fit.unresolved.iter().find(|u| u.f1 == f || u.f2 == f)?;
        fit.modes.iter().position(|m| m.frequency != f && (m.frequency == pair.f1 || m.frequency == pair.f2))
    };
    let assurance = |i: usize, j: usize| match merged(i) {
        Some(k) => subspace_mac(&predicted[j], &[&measured[i], &measured[k]]),
        None => mac(&measured[i], &predicted[j]),
    };
    // On a held base the arm's sensors feel nothing: frequencies alone decide.
    let felt = predicted.iter().flatten().any(|x| x.norm_sqr() > 0.0);
    let shape_weight = if felt { set.shape_weight } else { 0.0 };
    let tones: Vec<Option<(usize, usize)>> = (0..measured.len()).map(|i| fit.combination(i)).collect();
    let cost = |i: usize, j: usize| {
        let x = (fit.modes[i].frequency / model[j].frequency()).ln() / set.frequency_spread;
        // Finite whatever the shapes: zero channels give a MAC of 0.
        let c = 0.5 * x * x + shape_weight * (1.0 - assurance(i, j));
        if c.is_finite() { c } else { f64::MAX.sqrt() }
    };
    let real: Vec<usize> = (0..measured.len()).filter(|&i| tones[i].is_none()).collect();
    let costs: Vec<Vec<f64>> = real.iter().map(|&i| (0..model.len()).map(|j| cost(i, j)).collect()).collect();
    let found = assign(&costs, model.len(), set.limit);
    let mut out = ModeMatch::default();
    for (r, &i) in real.iter().enumerate() {
        if let Some(j) = found[r] {
            let frequency_ratio = fit.modes[i].frequency / model[j].frequency();
            out.pairs.push(Pair { measured: i, model: j, mac: assurance(i, j), frequency_ratio });
        }
    }
    for i in 0..measured.len() {
        if let Some(of) = tones[i] {
            out.strays.push((i, Stray::Combination { of }));
        } else if out.pairs.iter().all(|p| p.measured != i) {
            let best = (0..model.len()).min_by(|&a, &b| cost(i, a).total_cmp(&cost(i, b)));
            let nearest = best.map(|j| model[j].frequency());
            out.strays.push((i, Stray::NoCounterpart { nearest, mac: best.map_or(0.0, |j| assurance(i, j)) }));
        }
    }
    let loudness = |j: usize, gyro: bool| {
        let n = predicted[j].len().saturating_sub(3);
        let part = if gyro { &predicted[j][n..] } else { &predicted[j][..n] };
        part.iter().map(|x| x.norm_sqr()).sum::<f64>().sqrt()
    };
    let loudest = |gyro: bool| (0..model.len()).map(|j| loudness(j, gyro)).fold(0.0, f64::max);
    let (torque_best, gyro_best) = (loudest(false), loudest(true));
    for j in 0..model.len() {
        if out.pairs.iter().any(|p| p.model == j) {
            continue;
        }
        let (torque, gyro) = (loudness(j, false) > set.blind * torque_best, loudness(j, true) > set.blind * gyro_best);
        let f = model[j].frequency();
        let neighbour = out.pairs.iter().find(|p| (model[p.model].frequency() - f).abs() < fit.df);
        let why = match (torque, gyro) {
            _ if f > set.f_max => Unseen::OutOfBand,
            (false, false) => Unseen::Invisible,
            _ if neighbour.is_some() => Unseen::Merged { with: neighbour.map_or(j, |p| p.model) },
            (true, false) => Unseen::GyroBlind,
            (false, true) => Unseen::TorqueBlind,
            (true, true) => Unseen::NotExcited,
        };
        out.unseen.push((j, why));
    }
    out
}

/// Strength, relative to the modes it combines, up to which a tone can be their product.
const TONE: f64 = 0.05;
/// Greatest difference, relative, of decay rates that count as the same.
const SAME_DECAY: f64 = 0.1;

impl ModalFit {
    /// The louder modes whose sum, difference or double the mode `i` is, if any: panels and fuel are not linear, and
    /// torques have terms of second order in them.
    ///
    /// The product of two decays rings at the sum and at the difference of the frequencies at which they ring (not of their undamped ones),
    /// and decays at the sum of their rates: its poles are `p_a + p_b` and `p_a + conj(p_b)`. What is within [`ModalFit::df`] of such a
    /// frequency is no mode of its own if it is at most 5 % of both. A difference whose decay agrees to a tenth as well is none if it is
    /// weaker than both: a structure has no mode that slow and that damped by accident, and a channel that both modes hardly reach may
    /// show much of their product. A true mode at a double frequency does decay like the product, so that sums have no such rule.
    ///
    /// # Panics
    /// If there is no such mode.
    pub fn combination(&self, i: usize) -> Option<(usize, usize)> {
        let m: &Mode = &self.modes[i];
        let near = |f: f64| (f - m.damped_frequency()).abs() < self.df;
        let louder: Vec<usize> = (0..self.modes.len()).filter(|&k| m.snr < self.modes[k].snr).collect();
        for (n, &a) in louder.iter().enumerate() {
            for &b in &louder[n..] {
                let (one, other) = (&self.modes[a], &self.modes[b]);
                let (fa, fb) = (one.damped_frequency(), other.damped_frequency());
                let (sum, difference) = (near(fa + fb), near((fa - fb).abs()));
                let weak = m.snr < TONE * one.snr.min(other.snr);
                let rate = one.decay_rate() + other.decay_rate();
                let decays = (m.decay_rate() - rate).abs() < SAME_DECAY * rate;
                if weak && (sum || difference) || difference && decays {
                    return Some((a, b));
                }
            }
        }
        None
    }
}
