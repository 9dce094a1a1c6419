//! What an identification hands to people and programs: `result.json`. Every number reads back exactly.

use super::findings::{
    ClockLine, ComparisonTable, DecayModes, Minima, ProfileLine, RecordFit, ReducedSet, Silent, Whiteness,
};
use super::signals::Signals;
use ff_least_squares::Status;
use ff_model::{Model, ParamDecl, Problems};
use ff_records::Record;
use ident::Posterior;
use ident::Uncertainty;
use ident::belief::Direction;
use ident::estimate::report::{Estimate as Line, Verdict};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What the field `format` of a result must say.
pub const FORMAT: &str = "ffid-result";
/// Version that is written, and the only one that is read.
pub const VERSION: u32 = 1;
/// Correlation from which a pair is named.
pub const STRONG: f64 = 0.95;

/// A whole identification.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IdentificationResult {
    /// [`FORMAT`].
    pub format: String,
    /// [`VERSION`].
    pub version: u32,
    /// Name of the robot.
    pub robot: String,
    /// How the record was predicted.
    pub method: Method,
    /// In words: what was found, and what was not.
    pub verdict: Vec<String>,
    /// How the fit ended.
    pub status: Ended,
    /// Linearisations used.
    pub iterations: usize,
    /// Sum of squared whitened residuals over the degrees of freedom; 1 when model and noise figures are right.
    pub chi2_per_dof: f64,
    /// Residuals of the record.
    pub residuals: usize,
    /// The parameters asked for.
    pub parameters: Vec<Parameter>,
    /// Biases and initial state, estimated beside them.
    pub nuisance: Vec<Parameter>,
    /// Every parameter of the model with the estimates in place, in the order of the parameter vector.
    pub model: Vec<Value>,
    /// Numerical rank of the scaled sensitivities of the data alone.
    pub rank: usize,
    /// Their singular values, descending.
    pub singular_values: Vec<f64>,
    /// Combinations on which the record is silent, in the names of the parameters.
    pub null_directions: Vec<Combination>,
    /// Combinations that the record tells to worse than their own size, weakest first.
    pub weak_directions: Vec<Combination>,
    /// True when every combination on which the record is silent is held by a prior.
    pub priors_cover: bool,
    /// The combinations on which the record is silent, told apart: by structure, or because it excites too little.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub silent: Option<Silent>,
    /// What was estimated in place of what was asked for, because the record is silent on the rest.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub reduced: Option<ReducedSet>,
    /// Intervals from the likelihood itself.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub profiles: Vec<ProfileLine>,
    /// Where other starts led.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub minima: Option<Minima>,
    /// Pairs with a correlation of 0.95 or more.
    pub correlations: Vec<Correlation>,
    /// Covariance of parameters and nuisance, priors included.
    pub covariance: Covariance,
    /// What is known of the parameters, biases and initial state projected out: the prior of a later identification.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub posterior: Option<Posterior>,
    /// Residuals of every channel against white noise.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub whiteness: Vec<Whiteness>,
    /// Modes of the identified model at the mission's pose, joints held.
    pub modes: Vec<ModeLine>,
    /// Modes of the free decay in the records.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub decay: Vec<DecayModes>,
    /// Clocks of the channels against that of the encoders.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub clocks: Vec<ClockLine>,
    /// Models against each other.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub comparison: Option<ComparisonTable>,
    /// Every record, when there are several.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub records: Vec<RecordFit>,
    /// Every channel over the (first) record.
    pub channels: Vec<Channel>,
    /// The same on data that were not used.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub held_out: Option<HeldOut>,
    /// What was put up with.
    pub warnings: Vec<Warning>,
    /// Where all this comes from.
    pub provenance: Provenance,
}

/// How a record is predicted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Rigid system, base acceleration eliminated ([`ident::Rda`]).
    Rda,
    /// Base and passive states simulated ([`ident::OutputError`]).
    OutputError,
    /// Fixed base with gravity and joint friction, linear least squares ([`ident::Ground`]).
    Ground,
}

/// How the solver ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "status", rename_all = "snake_case")]
pub enum Ended {
    /// At a minimum.
    Converged,
    /// At a minimum of a bounded problem; the named parameters want to leave their bounds.
    AtBound {
        /// Their names; empty when a body is at the boundary of what is physical.
        at: Vec<String>,
    },
    /// No step helps although the linearisation promises one: not a solution.
    Stalled {
        /// Relative reduction still promised.
        promised: f64,
    },
    /// Out of iterations: not a solution.
    IterationLimit,
}

impl Ended {
    pub(super) fn of(s: &Status, names: &[String]) -> Self {
        match s {
            Status::Converged { .. } => Self::Converged,
            Status::AtBound { at, .. } => {
                Self::AtBound { at: at.iter().filter_map(|&i| names.get(i).cloned()).collect() }
            }
            Status::Stalled { promised } => Self::Stalled { promised: *promised },
            Status::IterationLimit => Self::IterationLimit,
        }
    }
    /// True for a minimum, bounded or not.
    pub fn is_solution(&self) -> bool {
        matches!(self, Self::Converged | Self::AtBound { .. })
    }
}

impl std::fmt::Display for Ended {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Converged => f.write_str("converged"),
            Self::AtBound { at } if at.is_empty() => f.write_str("a body reached the boundary of what is physical"),
            Self::AtBound { at } => write!(f, "converged with {} at a bound", at.join(", ")),
            Self::Stalled { promised } => write!(f, "stalled (a reduction of {promised:.1e} still promised)"),
            Self::IterationLimit => f.write_str("ran out of iterations"),
        }
    }
}

/// One unknown.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameter {
    /// Full name.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Where the fit started.
    pub start: f64,
    /// Estimate.
    pub value: f64,
    /// Standard deviation; absent where data and priors cannot tell.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub std: Option<f64>,
    /// 95 % interval.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub interval95: Option<(f64, f64)>,
    /// Mean of its prior.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub prior_mean: Option<f64>,
    /// Standard deviation of its prior.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub prior_std: Option<f64>,
    /// What the data say.
    pub verdict: Told,
}

impl Parameter {
    pub(super) fn of(l: &Line, prior_mean: Option<f64>) -> Self {
        Self {
            name: l.name.clone(),
            unit: l.unit.clone(),
            start: l.start,
            value: l.value,
            std: l.deviation,
            interval95: l.interval95,
            prior_mean: prior_mean.filter(|_| l.prior_sigma.is_some()),
            prior_std: l.prior_sigma,
            verdict: Told::of(l.verdict),
        }
    }
}

/// The verdict on one unknown ([`Verdict`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Told {
    /// Determined by the data.
    Estimated,
    /// Determined to worse than its own size.
    Weak,
    /// The value is that of its prior.
    PriorOnly,
    /// The fit ended with it at a bound.
    AtBound,
    /// Part of a combination on which the data are silent.
    NotIdentifiable,
}

impl Told {
    fn of(v: Verdict) -> Self {
        match v {
            Verdict::Estimated => Self::Estimated,
            Verdict::Weak => Self::Weak,
            Verdict::PriorOnly => Self::PriorOnly,
            Verdict::AtBound => Self::AtBound,
            Verdict::NotIdentifiable => Self::NotIdentifiable,
        }
    }
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Estimated => "estimated",
            Self::Weak => "weak",
            Self::PriorOnly => "prior only",
            Self::AtBound => "at a bound",
            Self::NotIdentifiable => "not identifiable",
        }
    }
}

/// A value of the model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Value {
    /// Full name.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Value.
    pub value: f64,
}

impl Value {
    /// All parameters of a model with these values.
    pub(super) fn all(model: &Model, values: &[f64]) -> Vec<Self> {
        let one = |(d, &value): (&ParamDecl, &f64)| Self { name: d.name.clone(), unit: d.unit.to_owned(), value };
        model.param_decls().iter().zip(values).map(one).collect()
    }
}

/// A combination of parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Combination {
    /// Singular value of the scaled sensitivities along it.
    pub singular_value: f64,
    /// Change of each parameter along it, in its own unit, largest relative part first.
    pub terms: Vec<(String, f64)>,
    /// Smaller parts left out.
    pub omitted: usize,
    /// In words.
    pub text: String,
}

impl Combination {
    pub(super) fn of(d: &Direction) -> Self {
        Self { singular_value: d.singular_value, terms: d.terms.clone(), omitted: d.omitted, text: d.to_string() }
    }
}

/// A strong correlation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Correlation {
    /// One unknown.
    pub first: String,
    /// The other.
    pub second: String,
    /// Coefficient.
    pub value: f64,
}

impl Correlation {
    /// Every pair from [`STRONG`] on, strongest first.
    pub(super) fn strong(u: &Uncertainty) -> Vec<Self> {
        let pairs = u.strong_correlations(STRONG).into_iter();
        pairs.map(|(first, second, value)| Self { first, second, value }).collect()
    }
}

/// Covariance in the units of the unknowns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Covariance {
    /// Unknowns, in the order of rows and columns.
    pub names: Vec<String>,
    /// Rows.
    pub rows: Vec<Vec<f64>>,
}

impl Covariance {
    pub(super) fn of(u: &Uncertainty) -> Self {
        Self {
            names: u.unknowns.iter().map(|k| k.name.clone()).collect(),
            rows: u.covariance.row_iter().map(|r| r.iter().copied().collect()).collect(),
        }
    }
}

/// A mode of the identified model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModeLine {
    /// Natural frequency (Hz).
    pub frequency_hz: f64,
    /// Damping ratio.
    pub damping_ratio: f64,
    /// Natural frequency at the start of the fit (Hz).
    pub start_hz: f64,
}

/// How one channel was predicted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Channel {
    /// Name, such as `tau.joint1`.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Root mean square of the measured signal.
    pub signal_rms: f64,
    /// Root mean square of the residual.
    pub residual_rms: f64,
    /// That over the standard deviation of the sensor: 1 when model and noise figure are right.
    pub over_noise: f64,
}

/// The prediction of data that were not used.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeldOut {
    /// The file, or the part of the record.
    pub source: String,
    /// Samples.
    pub samples: usize,
    /// Length (s).
    pub seconds: f64,
    /// As [`IdentificationResult::chi2_per_dof`], with the parameters as they are and only biases and initial state fitted.
    pub chi2_per_dof: f64,
    /// Largest value at which the model counts as explaining them.
    pub limit: f64,
    /// Whether it does.
    pub explained: bool,
    /// Every channel.
    pub channels: Vec<Channel>,
    /// In words.
    pub verdict: String,
}

impl HeldOut {
    /// The numbers; the verdict in words is the caller's to add.
    pub(super) fn of(source: String, record: &Record, signals: &Signals, chi2_per_dof: f64, limit: f64) -> Self {
        Self {
            source,
            samples: record.samples(),
            seconds: record.seconds(),
            chi2_per_dof,
            limit,
            explained: chi2_per_dof <= limit,
            channels: signals.channels(),
            verdict: String::new(),
        }
    }
}

/// A problem that was let through.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Warning {
    /// Its code.
    pub code: String,
    /// What it says.
    pub message: String,
}

impl Warning {
    /// Every problem of a list.
    pub fn all(problems: &Problems) -> Vec<Self> {
        problems.0.iter().map(|p| Self { code: p.code.to_owned(), message: p.to_string() }).collect()
    }
}

/// Where a result comes from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Program and version.
    pub program: String,
    /// Files, as they were named.
    pub inputs: Vec<InputFile>,
    /// The record, its first part when the rest was held out.
    pub record: RecordLine,
    /// Standard deviations that whitened the residuals: torque (N m).
    pub noise_torque_nm: f64,
    /// Gyro (rad/s).
    pub noise_gyro_rad_per_s: f64,
    /// Settings by name.
    pub settings: BTreeMap<String, String>,
}

/// A file that was read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputFile {
    /// Path as given.
    pub file: String,
    /// Size (bytes).
    pub bytes: u64,
    /// SHA-256, hexadecimal.
    pub sha256: String,
}

/// A record at a glance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordLine {
    /// Samples used.
    pub samples: usize,
    /// Rate (Hz).
    pub rate_hz: f64,
    /// Length (s).
    pub seconds: f64,
    /// First time stamp (s).
    pub t0: f64,
    /// Whether joint rates and accelerations were recorded and used.
    pub rates: bool,
}

impl IdentificationResult {
    /// Without any finding.
    pub(super) fn empty(robot: &str, method: Method, provenance: Provenance) -> Self {
        Self {
            format: FORMAT.into(),
            version: VERSION,
            robot: robot.to_owned(),
            method,
            verdict: Vec::new(),
            status: Ended::Converged,
            iterations: 0,
            chi2_per_dof: 0.0,
            residuals: 0,
            parameters: Vec::new(),
            nuisance: Vec::new(),
            model: Vec::new(),
            rank: 0,
            singular_values: Vec::new(),
            null_directions: Vec::new(),
            weak_directions: Vec::new(),
            priors_cover: false,
            silent: None,
            reduced: None,
            profiles: Vec::new(),
            minima: None,
            correlations: Vec::new(),
            covariance: Covariance { names: Vec::new(), rows: Vec::new() },
            posterior: None,
            whiteness: Vec::new(),
            modes: Vec::new(),
            decay: Vec::new(),
            clocks: Vec::new(),
            comparison: None,
            channels: Vec::new(),
            records: Vec::new(),
            held_out: None,
            warnings: Vec::new(),
            provenance,
        }
    }
    /// The code a command ends with that has found this: 13 for combinations that neither data nor priors tell (whatever
    /// the solver then made of them, unless the set that can be told was asked for), 14 for no solution, else 0.
    pub fn exit(&self) -> crate::exit::Exit {
        use crate::exit::Exit;
        if !self.null_directions.is_empty() && !self.priors_cover && self.reduced.is_none() {
            Exit::IllPosed
        } else if !self.status.is_solution() {
            Exit::Numerical
        } else {
            Exit::Done
        }
    }
    /// As JSON text.
    ///
    /// # Errors
    /// [`crate::exit::Failure::NotFinite`] with the place of a number that is not finite.
    pub fn to_json(&self) -> Result<Vec<u8>, crate::exit::Failure> {
        crate::files::json::bytes(std::path::Path::new("result.json"), self)
    }
    /// Reads a text of [`IdentificationResult::to_json`].
    ///
    /// # Errors
    /// What is wrong, with line and column.
    pub fn from_json(text: &[u8]) -> Result<Self, String> {
        let r: Self = serde_json::from_slice(text).map_err(|e| e.to_string())?;
        if r.format != FORMAT || r.version != VERSION {
            return Err(format!("format '{}' version {}, expected {FORMAT} {VERSION}", r.format, r.version));
        }
        Ok(r)
    }
}
