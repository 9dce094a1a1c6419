//! From a mission and a record to parameters: what `ffid identify` does.
//!
//! ```text
//! identify
//!   Setup::new            method, noise, unknowns, priors, start
//!   fit                   Rda | OutputError -> estimate
//!   predicted             measured, predicted, whitened residual of every channel
//!   held_out::judge       the same on data that were not used
//!   IdentificationResult  numbers, verdict in words, provenance
//! ```

pub mod axes;
pub mod figures;
pub mod held_out;
pub mod model_files;
pub mod page;
pub mod result;
pub mod signals;
mod text;
mod watched;

pub use held_out::explain;
pub use result::{IdentificationResult, Method};
pub use signals::Signals;
pub use watched::Watch;

use watched::Watched;

use crate::ident::estimator::{EstimateError, Estimator};
use crate::ident::lm::Settings as Solver;
use crate::ident::prior::{Priors, Sigma};
use crate::ident::rda::SetupError;
use crate::ident::report::FitReport;
use crate::ident::start::offset_start;
use crate::ident::{Estimate, Noise, Options, OutputError, Rda, Record, Request, estimate};
use crate::model::{Area, BaseKind, Model, Params, Problem, Problems};
use crate::modes::held;
use crate::open::Opened;
use crate::preflight::step;
use result::{
    Combination, Correlation, Covariance, Ended, ModeLine, Parameter, Provenance, RecordLine, Value, Warning,
};

/// Pull that holds what neither data nor priors tell near where it is, relative.
const ANCHOR: f64 = 10.0;
/// Correlation from which a pair is named.
pub const STRONG: f64 = 0.95;

/// What is asked for beside mission and record.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// `None`: [`Method::Rda`] for a rigid model, else [`Method::OutputError`].
    pub method: Option<Method>,
    /// Standard deviations of the sensors.
    pub noise: Noise,
    /// Estimate gyro and torque biases, where the method knows them.
    pub biases: bool,
    /// Estimate the initial base rate and passive state.
    pub initial_state: bool,
    /// Relative standard deviation of a prior on every parameter, about the values of the mission.
    pub prior: Option<f64>,
    /// Relative offset of the start from the values of the mission, for studies.
    pub start_offset: f64,
    /// Seed of the directions of that offset.
    pub seed: u64,
    /// Most linearisations.
    pub max_iterations: usize,
    /// Largest chi-squared per degree of freedom at which a model counts as explaining a record.
    pub limit: f64,
}

/// Largest chi-squared per degree of freedom that counts as explained unless another is given: residuals of 1.4 times the
/// noise.
pub const EXPLAINED: f64 = 2.0;

/// Why there is no result.
#[derive(Debug, thiserror::Error)]
pub enum IdentifyError {
    /// The question cannot be asked of this mission or record: problems with places and next steps.
    #[error("{0}")]
    Refused(Problems),
    /// The fit failed.
    #[error(transparent)]
    Fit(#[from] EstimateError),
    /// Stopped from outside.
    #[error("interrupted")]
    Interrupted,
    /// The model could not be evaluated.
    #[error("{0}")]
    Model(String),
}

/// A result with what figures and files need beside it.
#[derive(Clone, Debug)]
pub struct Identified {
    /// The result; its held-out part and its warnings are the caller's to add.
    pub result: IdentificationResult,
    /// Signals of the record.
    pub signals: Signals,
    /// All parameters with the estimates in place.
    pub values: Vec<f64>,
    /// Indices of the estimated parameters.
    pub selected: Vec<usize>,
}

pub(crate) fn config(code: &'static str, what: impl Into<String>, hint: &str) -> Problems {
    Problems(vec![Problem::error(Area::Config, code, what).hint(hint)])
}

/// The method for a model.
pub fn method(model: &Model, asked: Option<Method>) -> Method {
    asked.unwrap_or(if model.np() > 0 { Method::OutputError } else { Method::Rda })
}

/// Estimates the parameters of `[estimate]` from a record. Allocates the Jacobian.
///
/// # Errors
/// [`IdentifyError`]. A fit that stalls, or cannot tell some parameters, is a result ([`IdentificationResult::exit`]).
pub fn identify(
    opened: &Opened,
    record: &Record,
    settings: &Settings,
    provenance: Provenance,
    watch: &Watch<'_>,
) -> Result<Identified, IdentifyError> {
    let model = &opened.model;
    check(opened, settings).map_err(IdentifyError::Refused)?;
    record.check_joints(&model.joint_names()).map_err(IdentifyError::Refused)?;
    let selected = &opened.estimated;
    let decls = model.param_decls();
    let nominal: Vec<f64> = decls.iter().map(|d| d.nominal).collect();
    let start = if settings.start_offset == 0.0 {
        nominal.clone()
    } else {
        offset_start(&decls, &nominal, selected, settings.start_offset, settings.seed)
    };
    let priors = match settings.prior {
        Some(w) => Priors::new(&decls, selected, &nominal, &[("*", Sigma::Relative(w))])
            .map_err(|e| IdentifyError::Refused(config("Config::Prior", e.to_string(), "give a width such as 0.3")))?,
        None => Priors::default(),
    };
    let mut fit = Fit::new(model, record, settings)?;
    let request = Request {
        priors: priors.clone(),
        anchor: settings.prior.is_none().then_some(ANCHOR),
        settings: Solver {
            max_iterations: settings.max_iterations,
            decrement_tolerance: 1e-10,
            cost_floor: 1e-13,
            ..Solver::default()
        },
        ..Request::new(&decls, selected, &start)
    };
    let e = run(&request, fit.estimator(), watch)?;
    let signals = Signals::of(model, record, &e.residuals, &fit.sigmas(model));
    let result = report(opened, record, settings, provenance, (&e, &priors, &start, &nominal), &signals);
    Ok(Identified { result, signals, values: e.values, selected: selected.clone() })
}

fn check(opened: &Opened, s: &Settings) -> Result<(), Problems> {
    let model = &opened.model;
    if model.base_kind() != BaseKind::Floating || model.gravity().norm() > 0.0 {
        let what = "identification needs a free-floating base and no gravity";
        return Err(config("Config::NotFreeFloating", what, "remove base = \"fixed\" and gravity from [robot]"));
    }
    if opened.estimated.is_empty() {
        let hint = "name some in [estimate], such as parameters = [\"base.*\"]";
        return Err(config("Config::NoParameters", "no parameter is to be estimated", hint));
    }
    if s.method == Some(Method::Rda) && model.np() > 0 {
        let what = format!("the rigid method cannot predict {} passive coordinates", model.np());
        return Err(config("Config::Method", what, "use output-error, or a mission without appendages"));
    }
    let sensors = [
        ("[sensors.torque]", "noise_std_nm", "--torque-noise", s.noise.torque, "N m"),
        ("[sensors.gyro]", "noise_std_rad_per_s", "--gyro-noise", s.noise.gyro, "rad/s"),
    ];
    let mut bad = Problems::default();
    for (section, key, flag, value, unit) in sensors {
        if !(value > 0.0 && value.is_finite()) {
            let what = format!("noise {value} {unit}, limit > 0 {unit}: residuals are weighed by it");
            let p = Problem::error(Area::Config, "Config::NoNoise", what).on(format!("{section} {key}"));
            bad.push(p.hint(format!("give {key} in {section}, or {flag} on the command line")));
        }
    }
    if bad.has_errors() { Err(bad) } else { Ok(()) }
}

/// An estimator for a record, whichever fits.
pub struct Fit<'a> {
    estimator: Box<dyn Estimator + 'a>,
    method: Method,
    noise: Noise,
}

impl<'a> Fit<'a> {
    /// Chooses by the method; the steps of the integration by the modes.
    ///
    /// # Errors
    /// [`IdentifyError::Refused`].
    pub fn new(model: &'a Model, record: &'a Record, s: &Settings) -> Result<Self, IdentifyError> {
        let setup = |e: SetupError| {
            let (area, hint) = match e {
                SetupError::JointMotion(_) => (Area::Data, "look at the joint positions of the record"),
                _ => (Area::Config, "check mission and record"),
            };
            IdentifyError::Refused(Problems(vec![Problem::error(area, "Data::Setup", e.to_string()).hint(hint)]))
        };
        let method = method(model, s.method);
        let estimator: Box<dyn Estimator + 'a> = match method {
            Method::Rda => Box::new(Rda::new(model, record, &s.noise).map_err(setup)?),
            Method::OutputError => {
                let options = Options {
                    substeps: substeps(model, record),
                    gyro_bias: s.biases,
                    torque_bias: s.biases,
                    initial_state: s.initial_state,
                    ..Options::new(s.noise)
                };
                Box::new(OutputError::new(model, record, &options).map_err(setup)?)
            }
        };
        Ok(Self { estimator, method, noise: s.noise })
    }
    /// The estimator.
    pub fn estimator(&mut self) -> &mut (dyn Estimator + 'a) {
        &mut *self.estimator
    }
    /// Standard deviation of every channel of a sample, in the order of the residuals.
    pub fn sigmas(&self, model: &Model) -> Vec<f64> {
        let mut out = vec![self.noise.torque; model.nj()];
        if self.method == Method::OutputError {
            out.extend([self.noise.gyro; 3]);
        }
        out
    }
}

/// Steps per sample that the modes need, at the start pose of a record.
fn substeps(model: &Model, record: &Record) -> usize {
    let pose: Vec<f64> = record.q().row(0).iter().copied().collect();
    let params = Params::nominal(model);
    let rest = model.rest_position(&params);
    let h = step(&held(model, &params, &pose, &rest), record.seconds(), record.dt());
    (record.dt() / h).round().max(1.0) as usize
}

/// Runs the fit under watch.
fn run(request: &Request<'_>, inner: &mut dyn Estimator, watch: &Watch<'_>) -> Result<Estimate, IdentifyError> {
    let mut watched = Watched::new(inner, watch);
    let found = estimate(request, &mut watched);
    if watched.stopped {
        return Err(IdentifyError::Interrupted);
    }
    Ok(found?)
}

fn report(
    opened: &Opened,
    record: &Record,
    s: &Settings,
    provenance: Provenance,
    (e, priors, start, nominal): (&Estimate, &Priors, &[f64], &[f64]),
    signals: &Signals,
) -> IdentificationResult {
    let model = &opened.model;
    let selected = &opened.estimated;
    let decls = model.param_decls();
    let cost = 0.5 * e.residuals.iter().map(|r| r * r).sum::<f64>();
    let mut from: Vec<f64> = selected.iter().map(|&i| start[i]).collect();
    let mut to: Vec<f64> = e.parameters.iter().map(|p| p.value).collect();
    from.extend(e.nuisance.iter().map(|p| p.start));
    to.extend(e.nuisance.iter().map(|p| p.value));
    let fit = FitReport::new(e.status.clone(), (cost, e.residuals.len()), (&from, &to), priors, &e.uncertainty);
    let names: Vec<String> = fit.estimates.iter().map(|l| l.name.clone()).collect();
    let line = |k: usize| Parameter::of(&fit.estimates[k], selected.get(k).map(|&i| nominal[i]));
    let n = selected.len();
    let correlations = e.uncertainty.strong_correlations(STRONG);
    let mut result = IdentificationResult {
        format: result::FORMAT.into(),
        version: result::VERSION,
        robot: model.name().to_owned(),
        method: method(model, s.method),
        verdict: Vec::new(),
        status: Ended::of(&e.status, &names),
        iterations: e.iterations,
        chi2_per_dof: e.chi2_per_dof,
        residuals: e.residuals.len(),
        parameters: (0..n).map(line).collect(),
        nuisance: (n..fit.estimates.len()).map(line).collect(),
        model: decls
            .iter()
            .zip(&e.values)
            .map(|(d, &value)| Value { name: d.name.clone(), unit: d.unit.to_owned(), value })
            .collect(),
        rank: e.data_only.rank,
        singular_values: e.data_only.singular_values.clone(),
        null_directions: e.data_only.null.iter().map(Combination::of).collect(),
        weak_directions: e
            .data_only
            .weak
            .iter()
            // A bias that is not seen worries nobody.
            .filter(|d| d.terms.first().is_some_and(|t| names[..n].contains(&t.0)))
            .map(Combination::of)
            .collect(),
        priors_cover: e.uncertainty.full_rank(),
        correlations: correlations
            .into_iter()
            .map(|(first, second, value)| Correlation { first, second, value })
            .collect(),
        covariance: Covariance::of(&e.uncertainty),
        modes: mode_lines(opened, start, &e.values),
        channels: signals.channels(),
        held_out: None,
        warnings: opened
            .warnings
            .0
            .iter()
            .map(|p| Warning { code: p.code.to_owned(), message: p.to_string() })
            .collect(),
        provenance: Provenance {
            record: RecordLine {
                samples: record.samples(),
                rate_hz: record.rate_hz(),
                seconds: record.seconds(),
                t0: record.t0(),
                rates: record.qd().is_some() && record.qdd().is_some(),
            },
            ..provenance
        },
    };
    result.verdict = text::verdict(&result, s.limit);
    result
}

/// Modes at the pose of the mission, before and after.
fn mode_lines(opened: &Opened, start: &[f64], values: &[f64]) -> Vec<ModeLine> {
    let model = &opened.model;
    let at = |v: &[f64]| {
        let params = Params::from_values(model, v.to_vec());
        let rest = model.rest_position(&params);
        held(model, &params, &opened.pose(), &rest)
    };
    let line = |(a, b): (crate::dynamics::Mode, crate::dynamics::Mode)| ModeLine {
        frequency_hz: b.frequency_hz,
        damping_ratio: b.damping_ratio,
        start_hz: a.frequency_hz,
    };
    at(start).into_iter().zip(at(values)).map(line).collect()
}
