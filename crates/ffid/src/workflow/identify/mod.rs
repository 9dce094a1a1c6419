//! From a mission and records to parameters: what `ffid identify` does.
//!
//! ```text
//! identify
//!   Unknowns              what is estimated: parameters, ties, priors, start
//!   Fit                   Rda | OutputError for each record -> Several -> Tied -> estimate | best_of
//!   reduce                where the data are silent: again with what they can tell
//!   known                 structural and unexcited directions, profiles of the likelihood
//!   Signals, Whiteness    measured, predicted, residuals of every channel, and whether they are white
//!   decay::modes          modes of the free decay, against those of the model
//! doubts                  clocks, start at rest, momentum: what else may be wrong with a record
//! explain                 the same on data that were not used
//! compare                 rigid, flexible, sloshing or both
//! IdentificationResult    numbers, verdict in words, provenance
//! ```
pub mod asked;
pub mod axes;
pub mod compare;
pub mod decay;
pub mod doubts;
pub mod findings;
pub mod fit;
pub mod ground;
pub mod held_out;
pub mod known;
pub mod model_files;
pub mod result;
pub mod signals;
pub(crate) mod text;
pub(crate) mod watched;

pub use asked::{Asked, Take, TieSpec};
pub use fit::Fit;
pub use held_out::explain;
pub use result::{IdentificationResult, Method};
pub use signals::Signals;
pub use watched::Watch;

use crate::modes::held;
use crate::open::Opened;
use asked::Unknowns;
use ff_least_squares::Settings as Solver;
use ff_model::{Area, BaseKind, Model, Params, Problem, Problems};
use ff_records::Record;
use findings::{Minima, RecordFit, ReducedSet};
use ident::Posterior;
use ident::Several;
use ident::Uncertainty;
use ident::compose::Shared;
use ident::compose::best_of;
use ident::estimate::Estimate;
use ident::estimate::report::FitReport;
use ident::parameters::random_start;
use ident::{EstimateError, Estimator};
use ident::{Noise, Request, estimate};
use result::{
    Combination, Correlation, Covariance, Ended, ModeLine, Parameter, Provenance, RecordLine, Told, Value, Warning,
};
use std::borrow::Cow;
pub(crate) use text::num;
use watched::Watched;

/// Pull that holds what neither data nor priors tell near where it is, relative.
const ANCHOR: f64 = 10.0;
/// Relative width of the draws of other starts.
const SPREAD: f64 = 0.3;

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
    /// Seed of the directions of that offset, and of other starts.
    pub seed: u64,
    /// Most linearisations.
    pub max_iterations: usize,
    /// Largest chi-squared per degree of freedom at which a model counts as explaining a record.
    pub limit: f64,
    /// Cutoff of the low pass of the ground calibration (Hz); none of the other methods has one.
    pub low_pass_hz: Option<f64>,
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
    /// The record cannot tell what was asked for: problems, with exit code 13.
    #[error("{0}")]
    IllPosed(Problems),
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
    /// Signals of every record.
    pub signals: Vec<Signals>,
    /// All parameters with the estimates in place.
    pub values: Vec<f64>,
    /// Indices of the parameters that were estimated, for themselves or by a tie.
    pub selected: Vec<usize>,
}

pub(crate) fn config(code: &'static str, what: impl Into<String>, hint: &str) -> Problems {
    Problems(vec![Problem::error(Area::Config, code, what).hint(hint)])
}

/// The method for a model: a base that is bolted down is calibrated on the ground.
pub fn method(model: &Model, asked: Option<Method>) -> Method {
    asked.unwrap_or(if model.base_kind() == BaseKind::Fixed {
        Method::Ground
    } else if model.np() > 0 {
        Method::OutputError
    } else {
        Method::Rda
    })
}

/// Estimates the parameters of `[estimate]` from one or several records of the robot. Allocates the Jacobian.
///
/// # Errors
/// [`IdentifyError`]. A fit that stalls, or cannot tell some parameters, is a result ([`IdentificationResult::exit`]).
pub fn identify(
    opened: &Opened,
    takes: &[Take],
    settings: &Settings,
    asked: &Asked,
    provenance: Provenance,
    watch: &Watch<'_>,
) -> Result<Identified, IdentifyError> {
    let model = &opened.model;
    check(opened, settings).map_err(IdentifyError::Refused)?;
    for t in takes {
        t.record.check_joints(&model.joint_names()).map_err(IdentifyError::Refused)?;
    }
    if method(model, settings.method) == Method::Ground {
        ground::check(settings, asked).map_err(IdentifyError::Refused)?;
        return ground::identify(opened, takes, settings, asked, provenance);
    }
    let unknowns = Unknowns::new(model, &opened.estimated, settings, asked)?;
    let mut fits = takes.iter().map(|t| Fit::new(model, &t.record, settings)).collect::<Result<Vec<_>, _>>()?;
    let sigma = fits.first().map(|f| f.sigmas(model)).unwrap_or_default();
    let rows: Vec<usize> = fits.iter_mut().map(|f| f.estimator().rows()).collect();
    let decls = model.param_decls();
    let labelled: Vec<(&str, &[_])> = takes.iter().map(|t| (t.label.as_str(), decls.as_slice())).collect();
    let none: [&str; 0] = [];
    let shared = Shared::new(&labelled, &none)
        .map_err(|e| IdentifyError::Refused(config("Config::Records", e.to_string(), "name each record once")))?;
    let mut parts: Vec<Box<dyn Estimator + '_>> = fits.into_iter().map(Fit::into_estimator).collect();
    let whole = if parts.len() == 1 { parts.remove(0) } else { Box::new(Several::new(&shared, parts)) };
    let mut whole = unknowns.tied(whole);
    let priors = unknowns.priors(&unknowns.selected)?;
    let request = Request {
        anchor: priors.is_empty().then_some(ANCHOR),
        priors,
        settings: Solver {
            max_iterations: settings.max_iterations,
            decrement_tolerance: 1e-10,
            cost_floor: 1e-13,
            ..Solver::default()
        },
        ..Request::new(&unknowns.decls, &unknowns.selected, &unknowns.start)
    };
    let mut watched = Watched::new(&mut *whole, watch);
    let fitted = solve(&request, &unknowns, settings, asked, &mut watched);
    let fitted = if watched.stopped() { return Err(IdentifyError::Interrupted) } else { fitted? };
    let values = unknowns.expand(&fitted.estimate.values)?;
    let silent = known::silent(model, &values, &unknowns, &fitted.full)?;
    let profiles = known::profiles(&request, &unknowns, (&fitted.selected, &fitted.estimate), asked, &mut watched);
    let profiles = if watched.stopped() { return Err(IdentifyError::Interrupted) } else { profiles? };
    let mut signals = Vec::new();
    let mut at = 0;
    for (t, n) in takes.iter().zip(&rows) {
        signals.push(Signals::of(model, &t.record, &fitted.estimate.residuals[at..at + n], &sigma));
        at += n;
    }
    let report = Report { opened, takes, settings, asked, unknowns: &unknowns, signals: &signals, values: &values };
    let mut result = report.result(&fitted, provenance)?;
    result.silent = silent;
    result.profiles = profiles;
    result.verdict = text::verdict(&result, settings.limit);
    Ok(Identified { result, signals, values, selected: unknowns.touched.clone() })
}

/// A fit with what led to it.
struct Fitted {
    estimate: Estimate,
    /// What was estimated in the end, by index among the unknowns' declarations.
    selected: Vec<usize>,
    /// What the data can tell of everything that was asked for.
    full: Uncertainty,
    minima: Option<Minima>,
    reduced: Option<ReducedSet>,
}

/// Fits; from several starts, and again with fewer unknowns, when asked to.
fn solve(
    request: &Request<'_>,
    unknowns: &Unknowns,
    s: &Settings,
    asked: &Asked,
    estimator: &mut Watched<'_>,
) -> Result<Fitted, IdentifyError> {
    let (first, minima) = if asked.more_starts == 0 {
        (estimate(request, estimator)?, None)
    } else {
        let draw = |k: usize| {
            random_start(request.decls, request.start, request.selected, SPREAD, s.seed.wrapping_add(1 + k as u64))
        };
        let starts: Vec<Vec<f64>> =
            std::iter::once(request.start.to_vec()).chain((0..asked.more_starts).map(draw)).collect();
        let best = best_of(request, &starts, estimator)?;
        let minima = Minima {
            starts: starts.len(),
            converged: best.endings.iter().filter(|e| e.converged).count(),
            objectives: best.minima,
        };
        (best.estimate, Some(minima))
    };
    let full = first.data_only.clone();
    let mut out = Fitted { selected: request.selected.to_vec(), full, estimate: first, minima, reduced: None };
    if asked.reduce && !out.full.null.is_empty() {
        let (kept, set) = known::reduced(&out.full, request.selected)?;
        let selected: Vec<usize> = kept.iter().map(|&k| request.selected[k]).collect();
        let priors = unknowns.priors(&selected)?;
        // From where the first fit went: what is held then stays there.
        let start = out.estimate.values.clone();
        let again = Request { selected: &selected, start: &start, priors, ..request.clone() };
        out.estimate = estimate(&again, estimator)?;
        for (p, &i) in out.estimate.parameters.iter_mut().zip(&selected) {
            p.start = request.start[i];
        }
        out.selected = selected;
        out.reduced = Some(set);
    }
    Ok(out)
}

fn check(opened: &Opened, s: &Settings) -> Result<(), Problems> {
    let model = &opened.model;
    let ground = method(model, s.method) == Method::Ground;
    if ground != (model.base_kind() == BaseKind::Fixed) {
        let what = "the ground calibration is for a fixed base, and a fixed base for it";
        return Err(config("Config::NotFreeFloating", what, "leave --method out, or change [robot] base"));
    }
    if ground && model.np() > 0 {
        let what =
            format!("on the ground the arm alone is calibrated, but there are {} passive coordinates", model.np());
        return Err(config("Config::NotRigid", what, "remove the appendages from the mission"));
    }
    if !ground && model.gravity().norm() > 0.0 {
        let what = "identification of a free-floating robot knows no gravity";
        let hint = "remove gravity from [robot]; on the ground give base = \"fixed\"";
        return Err(config("Config::NotFreeFloating", what, hint));
    }
    if opened.estimated.is_empty() {
        let hint = "name some in [estimate], such as parameters = [\"base.*\"]";
        return Err(config("Config::NoParameters", "no parameter is to be estimated", hint));
    }
    if s.method == Some(Method::Rda) && model.np() > 0 {
        let what = format!("the rigid method cannot predict {} passive coordinates", model.np());
        return Err(config("Config::Method", what, "use output-error, or a mission without appendages"));
    }
    // On the ground the residuals say how large they are.
    if ground {
        return Ok(());
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

/// What a result is made of.
struct Report<'a> {
    opened: &'a Opened,
    takes: &'a [Take],
    settings: &'a Settings,
    asked: &'a Asked,
    unknowns: &'a Unknowns,
    signals: &'a [Signals],
    /// All parameters of the model.
    values: &'a [f64],
}

impl Report<'_> {
    fn result(&self, f: &Fitted, provenance: Provenance) -> Result<IdentificationResult, IdentifyError> {
        let (model, e, unknowns) = (&self.opened.model, &f.estimate, self.unknowns);
        let start = unknowns.expand(&unknowns.start)?;
        let cost = 0.5 * e.residuals.iter().map(|r| r * r).sum::<f64>();
        let mut from: Vec<f64> = f.selected.iter().map(|&i| unknowns.start[i]).collect();
        let mut to: Vec<f64> = e.parameters.iter().map(|p| p.value).collect();
        from.extend(e.nuisance.iter().map(|p| p.start));
        to.extend(e.nuisance.iter().map(|p| p.value));
        let priors = unknowns.priors(&f.selected)?;
        let fit = FitReport::new(e.status.clone(), (cost, e.residuals.len()), (&from, &to), &priors, &e.uncertainty);
        let names: Vec<String> = fit.estimates.iter().map(|l| l.name.clone()).collect();
        let line = |k: usize| Parameter::of(&fit.estimates[k], f.selected.get(k).map(|&i| unknowns.nominal[i]));
        let n = f.selected.len();
        let mut parameters: Vec<Parameter> = (0..n).map(line).collect();
        if let Some(p) = &self.asked.posterior {
            let known = asked::known_before(p).map_err(|e| IdentifyError::Model(e.to_string()))?;
            parameters.iter_mut().for_each(|line| before(line, known.get(&line.name)));
        }
        let posterior = Posterior::of(e).map_err(|e| IdentifyError::Model(e.to_string()))?;
        let modes = mode_lines(self.opened, &start, self.values);
        let first = &self.takes[0].record;
        Ok(IdentificationResult {
            status: Ended::of(&e.status, &names),
            iterations: e.iterations,
            chi2_per_dof: e.chi2_per_dof,
            residuals: e.residuals.len(),
            parameters,
            nuisance: (n..fit.estimates.len()).map(line).collect(),
            model: Value::all(model, self.values),
            rank: f.full.rank,
            singular_values: f.full.singular_values.clone(),
            null_directions: f.full.null.iter().map(Combination::of).collect(),
            weak_directions: e
                .data_only
                .weak
                .iter()
                // A bias that is not seen worries nobody.
                .filter(|d| d.terms.first().is_some_and(|t| names[..n].contains(&t.0)))
                .map(Combination::of)
                .collect(),
            priors_cover: e.uncertainty.full_rank(),
            reduced: f.reduced.clone(),
            minima: f.minima.clone(),
            correlations: Correlation::strong(&e.uncertainty),
            covariance: Covariance::of(&e.uncertainty),
            posterior: Some(posterior),
            whiteness: known::whiteness(self.takes, self.signals, &modes),
            modes,
            channels: self.signals[0].channels(),
            records: records_of(self.takes, self.signals),
            warnings: Warning::all(&self.opened.warnings),
            ..IdentificationResult::empty(
                model.name(),
                method(model, self.settings.method),
                Provenance { record: record_line(first), ..provenance },
            )
        })
    }
}

/// Every record, when there are several.
fn records_of(takes: &[Take], signals: &[Signals]) -> Vec<RecordFit> {
    let one = |(t, s): (&Take, &Signals)| {
        let channels = s.channels();
        RecordFit {
            label: t.label.clone(),
            samples: t.record.samples(),
            rate_hz: t.record.rate_hz(),
            seconds: t.record.seconds(),
            mean_square: channels.iter().map(|c| c.over_noise.powi(2)).sum::<f64>() / channels.len().max(1) as f64,
            channels,
        }
    };
    if takes.len() > 1 { takes.iter().zip(signals).map(one).collect() } else { Vec::new() }
}

fn record_line(r: &Record) -> RecordLine {
    RecordLine {
        samples: r.samples(),
        rate_hz: r.rate_hz(),
        seconds: r.seconds(),
        t0: r.t0(),
        rates: r.qd().is_some() && r.qdd().is_some(),
    }
}

/// Adds what an earlier identification knew of a parameter to its prior.
fn before(line: &mut Parameter, known: Option<&(f64, f64)>) {
    let Some(&(mean, std)) = known else { return };
    let (a, b) = (1.0 / (std * std), line.prior_std.map_or(0.0, |s| 1.0 / (s * s)));
    line.prior_mean = Some((a * mean + b * line.prior_mean.unwrap_or(0.0)) / (a + b));
    let both = (a + b).sqrt().recip();
    line.prior_std = Some(both);
    if line.std.is_some_and(|s| s > 0.9 * both) && matches!(line.verdict, Told::Estimated | Told::Weak) {
        line.verdict = Told::PriorOnly;
    }
}

/// Modes at the pose of the mission, before and after.
fn mode_lines(opened: &Opened, start: &[f64], values: &[f64]) -> Vec<ModeLine> {
    let model = &opened.model;
    let at = |v: &[f64]| {
        let params = Params::from_values(model, v.to_vec());
        let rest = model.rest_position(&params);
        held(model, &params, &opened.pose(), &rest)
    };
    let line = |(a, b): (ff_dynamics::Mode, ff_dynamics::Mode)| ModeLine {
        frequency_hz: b.frequency_hz,
        damping_ratio: b.damping_ratio,
        start_hz: a.frequency_hz,
    };
    at(start).into_iter().zip(at(values)).map(line).collect()
}

/// The verdict in words, once everything was found.
pub fn verdict(r: &IdentificationResult, limit: f64) -> Vec<String> {
    text::verdict(r, limit)
}

/// The name of a channel where there are several records.
pub(crate) fn of_record<'a>(takes: &[Take], k: usize, name: &'a str) -> Cow<'a, str> {
    if takes.len() > 1 { format!("{}.{name}", takes[k].label).into() } else { name.into() }
}
