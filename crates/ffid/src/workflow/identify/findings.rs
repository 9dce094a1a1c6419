//! Findings of an identification beside the estimates, as lines of the result: identifiability, checks of records and model.

use ident::belief::Profile;
use ident::belief::{Reduced, Silence};
use ident::checks::whiteness::ChannelCheck;
use ident::compose::equal_cost;
use ident::estimate::Estimate;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::number::num;
use super::result::channel::Channel;
use super::result::parameter::{Combination, Parameter, Value};

/// Deviations of a half of a 95 % interval.
pub(super) const HALF95: f64 = 1.96;

/// One record of several.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordFit {
    /// Its name: prefix of its biases and initial state.
    pub label: String,
    /// Samples.
    pub samples: usize,
    /// Rate (Hz).
    pub rate_hz: f64,
    /// Length (s).
    pub seconds: f64,
    /// Mean square of its whitened residuals.
    pub mean_square: f64,
    /// Every channel.
    pub channels: Vec<Channel>,
}

/// Combinations on which the record is silent, told apart (`ident::belief::identifiability`).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UnobservedDirections {
    /// No record of this robot can tell these; they move nothing.
    pub structural: Vec<Combination>,
    /// Another motion, or more sensors, might tell these.
    pub unexcited: Vec<Combination>,
}

impl UnobservedDirections {
    pub(super) fn of(s: &Silence) -> Self {
        let list = |d: &[ident::belief::Direction]| d.iter().map(Combination::of).collect();
        Self { structural: list(&s.structural), unexcited: list(&s.unexcited) }
    }
}

/// The set that was estimated in place of what was asked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReducedSet {
    /// Parameters held at their values, because others stand for them.
    pub held: Vec<String>,
    /// The same with their values: those of the mission.
    pub values: Vec<Value>,
    /// What was estimated, and for what it stands.
    pub combinations: Vec<DeterminedCombination>,
}

/// A prior that the data contradict.
///
/// The estimate without the prior follows from the two with it: with the value `v +- s` that data and all priors give and the prior
/// `m +- p`, `1/d^2 = 1/s^2 - 1/p^2` and `u = d^2 (v/s^2 - m/p^2)` are deviation and value without it, exact for a linear model. In conflict are
/// those with `|u - m| > LIMIT sqrt(d^2 + p^2)`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PriorConflict {
    /// Full name of the parameter.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Mean of the prior.
    pub prior_mean: f64,
    /// Its standard deviation.
    pub prior_std: f64,
    /// What the record says without this prior.
    pub data_value: f64,
    /// The standard deviation of that.
    pub data_std: f64,
    /// How many standard deviations of the difference they are apart.
    pub deviations: f64,
}

impl PriorConflict {
    /// Standard deviations of the difference from which prior and data are in conflict: 6 of 100,000 by chance.
    pub const LIMIT: f64 = 4.0;
    /// For a parameter with an independent prior; none where they agree, and where the data add next to nothing.
    pub(super) fn of(p: &Parameter) -> Option<Self> {
        Self::between((&p.name, &p.unit), (p.prior_mean?, p.prior_std?), (p.value, p.std?))
    }
    /// Mean and deviation of a prior, and the value and deviation of it and the data together.
    pub(super) fn between(
        (name, unit): (&str, &str),
        (prior_mean, prior_std): (f64, f64),
        (value, std): (f64, f64),
    ) -> Option<Self> {
        let (all, before) = (std.powi(-2), prior_std.powi(-2));
        let data = all - before;
        if data <= 1e-6 * all {
            return None;
        }
        let data_value = (all * value - before * prior_mean) / data;
        let data_std = data.sqrt().recip();
        let deviations = (data_value - prior_mean).abs() / data_std.hypot(prior_std);
        let (name, unit) = (name.to_owned(), unit.to_owned());
        (deviations > Self::LIMIT).then_some(Self {
            name,
            unit,
            prior_mean,
            prior_std,
            data_value,
            data_std,
            deviations,
        })
    }
}

/// A parameter that is estimated for itself and for others.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeterminedCombination {
    /// The one among the unknowns.
    pub name: String,
    /// Those held, with what each unit of them adds to it.
    pub terms: Vec<(String, f64)>,
    /// In words.
    pub text: String,
}

impl ReducedSet {
    /// Parameters alone: biases and initial state are never held. `held` are the names held.
    pub(super) fn of(r: &Reduced, held: Vec<String>) -> Self {
        let stands = r.combinations.iter().filter(|c| !c.terms.is_empty()).map(|c| DeterminedCombination {
            name: c.name.clone(),
            terms: c.terms.clone(),
            text: c.to_string(),
        });
        Self { held, values: Vec::new(), combinations: stands.collect() }
    }
}

/// The interval of one parameter from the likelihood itself ([`ident::belief::profile`]).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProfileLine {
    /// Full name.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Estimate.
    pub value: f64,
    /// The Gaussian interval beside it.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub gaussian95: Option<(f64, f64)>,
    /// Lower end; absent where the data put no bound as far as was looked.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub lower95: Option<f64>,
    /// Upper end.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub upper95: Option<f64>,
    /// Values and by how much twice the negative log posterior is above its minimum there.
    pub points: Vec<(f64, f64)>,
    /// Whether it was looked for because the cost is no parabola there; the deviation of the parameter allows for it.
    #[serde(skip_serializing_if = "std::ops::Not::not", default)]
    pub bent: bool,
}

impl ProfileLine {
    pub(super) fn of(p: &Profile, gaussian95: Option<(f64, f64)>) -> Self {
        Self {
            name: p.name.clone(),
            unit: p.unit.clone(),
            value: p.value,
            gaussian95,
            lower95: p.interval95.0,
            upper95: p.interval95.1,
            points: p.points.iter().map(|p| (p.value, p.excess)).collect(),
            bent: false,
        }
    }
}

/// Where several starts led.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Minima {
    /// Starts that were tried.
    pub starts: usize,
    /// How many of them converged.
    pub converged: usize,
    /// Twice the negative log posterior of every distinct minimum, ascending; one when all agree.
    pub objectives: Vec<f64>,
    /// Parameters that differ between minima of which the record does not choose one; the deviations of the result cover all of them. Empty
    /// where the lowest was taken for what it is.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub alternatives: Vec<Alternative>,
}

/// A parameter with another value in each of several minima.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Alternative {
    /// Full name.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Its value at every minimum, in the order of their objectives; the first is the estimate.
    pub values: Vec<f64>,
    /// Its standard deviation at each of them alone.
    pub stds: Vec<f64>,
}

impl Alternative {
    /// Deviations from which two values of a parameter differ.
    const DIFFERS: f64 = 1.0;
    /// Those of the parameters that are `asked` for, the ones that differ most first.
    pub(super) fn all(best: &Estimate, others: &[Estimate], asked: impl Fn(usize) -> bool) -> Vec<Self> {
        let one = |k: usize| {
            let ends = || std::iter::once(best).chain(others).map(|e| &e.parameters[k]);
            let stds: Vec<f64> = ends().map(|p| p.std).collect::<Option<_>>()?;
            let values: Vec<f64> = ends().map(|p| p.value).collect();
            let by = |(v, s): (&f64, &f64)| (v - values[0]).abs() / s.min(stds[0]);
            let most = values.iter().zip(&stds).map(by).fold(0.0, f64::max);
            let p = &best.parameters[k];
            (most > Self::DIFFERS).then(|| (most, Self { name: p.name.clone(), unit: p.unit.clone(), values, stds }))
        };
        let mut all: Vec<(f64, Self)> = (0..best.parameters.len()).filter(|&k| asked(k)).filter_map(one).collect();
        all.sort_by(|a, b| b.0.total_cmp(&a.0));
        all.into_iter().map(|a| a.1).collect()
    }
    /// In words: the values, each with its own deviation.
    pub fn in_words(&self) -> String {
        let one = |(v, s): (&f64, &f64)| format!("{} +- {}", num(*v), num(*s));
        let all: Vec<String> = self.values.iter().zip(&self.stds).map(one).collect();
        format!("{} is {} {}", self.name, all.join(" or "), self.unit)
    }
}

impl Minima {
    /// Parameters that are listed in words.
    const LISTED: usize = 3;
    /// Objective above the lowest up to which an interval covers a minimum: beyond, it has less than 2.5 % of the probability.
    const COVERED: f64 = 7.3;
    /// What the other minima add to a covariance about the lowest, for unknowns of these names: the second moment `sum_i w_i d_i d_i^T` of the
    /// parameters that differ, with weights `w_i` in proportion to `exp(-c_i/2)` of the objectives.
    pub(super) fn moment(&self, names: &[String]) -> DMatrix<f64> {
        let weight: Vec<f64> = self.objectives.iter().map(|c| (0.5 * (self.objectives[0] - c)).exp()).collect();
        let all: f64 = weight.iter().sum();
        let mut out = DMatrix::zeros(names.len(), names.len());
        for (i, w) in weight.iter().enumerate() {
            let step = |name: &String| {
                let of = self.alternatives.iter().find(|a| a.name == *name);
                of.and_then(|a| Some(a.values.get(i)? - a.values[0])).unwrap_or_default()
            };
            let d = DVector::from_iterator(names.len(), names.iter().map(step));
            out.ger(w / all, &d, &d, 1.0);
        }
        out
    }
    /// An interval of 95 % about the estimate of a parameter, made to cover those about the other minima.
    pub(super) fn covered(&self, name: &str, about: (f64, f64)) -> (f64, f64) {
        let Some(a) = self.alternatives.iter().find(|a| a.name == name) else { return about };
        let near = |objective: &&f64| **objective - self.objectives[0] <= Self::COVERED;
        let count = self.objectives.iter().take_while(near).count();
        let ends = a.values.iter().zip(&a.stds).take(count);
        ends.fold(about, |(low, high), (v, s)| (low.min(v - HALF95 * s), high.max(v + HALF95 * s)))
    }
    /// That the record does not choose between several minima, and what differs; `None` where it does.
    pub fn undecided(&self) -> Option<String> {
        let first = self.alternatives.get(..self.alternatives.len().min(Self::LISTED)).filter(|a| !a.is_empty())?;
        let named: Vec<String> = first.iter().map(Alternative::in_words).collect();
        let more = self.alternatives.len() - first.len();
        let more = if more > 0 { format!("; and {more} more differ") } else { String::new() };
        let apart = self.objectives.last().unwrap_or(&0.0) - self.objectives.first().unwrap_or(&0.0);
        Some(format!(
            "{} minima explain the record, with chi-squared within {}, and the record does not choose between them: {}{more}",
            self.objectives.len(),
            num(apart),
            named.join("; ")
        ))
    }
    /// Which of several minima was taken, in words.
    pub fn taken(&self) -> &'static str {
        match self.objectives.get(..2) {
            Some(&[a, b]) if equal_cost(a, b) => "one of equal cost was taken: the data cannot choose between them",
            _ => "the lowest was taken",
        }
    }
}

/// Residuals of one channel against white noise ([`ident::checks::whiteness`]).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Whiteness {
    /// Channel, such as `tau.joint2`.
    pub channel: String,
    /// Mean square of the whitened residuals: one when the noise is as assumed.
    pub mean_square: f64,
    /// How often white noise would look at least as coloured (Bartlett).
    pub white_p: f64,
    /// The same by Ljung and Box.
    pub portmanteau_p: f64,
    /// How often normal noise would look at least as skewed or heavy-tailed (Jarque and Bera).
    pub normal_p: f64,
    /// First autocorrelation.
    pub first_correlation: f64,
    /// Largest residual in standard deviations.
    pub largest: f64,
    /// White at the level of [`ident::checks::whiteness::LEVEL`] over all channels.
    pub white: bool,
    /// How often white noise no larger than assumed would show as much power in a part of the spectrum;
    /// absent in results of older versions.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub excess_p: Option<f64>,
    /// That is less often than the level of all channels: it speaks against the model.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub excess: Option<bool>,
    /// Where the power of residuals that are not white is largest (Hz).
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub peak_hz: Option<f64>,
    /// Natural frequencies of the model (Hz) at which the residuals stand out.
    pub stands_out_hz: Vec<f64>,
}

impl Whiteness {
    /// One channel, `white` at the joint level of all.
    pub(super) fn of(c: &ChannelCheck, white: bool, excess: bool) -> Self {
        Self {
            channel: c.channel.clone(),
            mean_square: c.mean_square,
            white_p: c.white_p,
            portmanteau_p: c.portmanteau_p,
            normal_p: c.normal_p,
            first_correlation: c.first_correlation,
            largest: c.largest,
            white,
            excess_p: Some(c.excess_p),
            excess: Some(excess),
            peak_hz: (!white).then_some(c.peak_hz),
            stands_out_hz: c.modes.iter().filter(|m| m.stands_out).map(|m| m.frequency_hz).collect(),
        }
    }
}

/// Clock of a group of channels against that of the encoders (`ident::checks::clock`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClockLine {
    /// The record.
    pub record: String,
    /// `torque` or `gyro`.
    pub group: String,
    /// How late the channels are at mid-record (s).
    pub offset_s: f64,
    /// Its standard deviation (s).
    pub offset_std_s: f64,
    /// How fast their clock runs (ppm).
    pub skew_ppm: f64,
    /// Its standard deviation (ppm).
    pub skew_std_ppm: f64,
    /// Whether the record was corrected by it.
    pub corrected: bool,
}

/// Modes of the free decay in a record (`ff_spectral::modal::fit`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DecayModes {
    /// The record.
    pub record: String,
    /// Beginning of the free motion (s since the first sample).
    pub from_s: f64,
    /// Its end.
    pub to_s: f64,
    /// What a spectrum of that length resolves (Hz).
    pub resolution_hz: f64,
    /// Noise found over noise declared.
    pub noise_ratio: f64,
    /// Modes by frequency.
    pub modes: Vec<DecayMode>,
    /// Pairs of frequencies that the record cannot keep apart (Hz).
    pub unresolved: Vec<(f64, f64)>,
    /// Modes of the identified model that were not measured.
    pub unseen: Vec<UnseenMode>,
}

/// One measured mode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DecayMode {
    /// Undamped natural frequency (Hz).
    pub frequency_hz: f64,
    /// Its standard deviation (Hz).
    pub frequency_std_hz: f64,
    /// Damping ratio.
    pub damping_ratio: f64,
    /// Its standard deviation.
    pub damping_std: f64,
    /// Frequency of the mode of the identified model that it is (Hz).
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub model_hz: Option<f64>,
    /// Damping ratio of that mode.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub model_damping: Option<f64>,
    /// Modal assurance of the two.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub mac: Option<f64>,
    /// What it is, when it is no mode of the model.
    #[serde(skip_serializing_if = "String::is_empty", default)]
    pub note: String,
}

/// A mode of the model that was not measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UnseenMode {
    /// Its frequency (Hz).
    pub frequency_hz: f64,
    /// Why.
    pub why: String,
}

/// Models against each other ([`ident::checks::compare`]).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ComparisonTable {
    /// The one to use.
    pub recommended: String,
    /// Why.
    pub reason: String,
    /// Whether it explains the data that were held out to their noise.
    pub explains: bool,
    /// What judged.
    pub judged_by: String,
    /// All, best prediction first.
    pub candidates: Vec<CandidateLine>,
}

/// One model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CandidateLine {
    /// Its name.
    pub name: String,
    /// Combinations of unknowns that were estimated.
    pub unknowns: usize,
    /// Akaike's criterion above that of the best.
    pub aic: f64,
    /// Schwarz's criterion above that of the best.
    pub bic: f64,
    /// `-2 ln L` of the data held out above that of the best: the cross-validated likelihood.
    pub held_out: f64,
    /// Standard deviation of that difference.
    pub held_out_std: f64,
    /// Mean square of the residuals held out: one when they are explained.
    pub held_out_mean_square: f64,
}
