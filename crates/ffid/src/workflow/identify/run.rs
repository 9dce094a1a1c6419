//! One identification: unknowns, fit, reduction, identifiability, profiles, result.

use super::adoption::Adopted;
use super::elsewhere::{Subject, elsewhere};
use super::error::{IdentifyError, config};
use super::explain::{self, Ended};
use super::findings::Minima;
use super::ground;
use super::identified::Identified;
use super::known;
use super::labelled_record::LabelledRecord;
use super::observed_estimator::{ObservedEstimator, Observer};
use super::options::FitOptions;
use super::record_estimator::{RecordEstimator, Twin};
use super::report::{Fitted, Report};
use super::result::fit::Method;
use super::result::provenance::Provenance;
use super::settings::{Settings, check, method};
use super::signals::Signals;
use super::text;
use super::uncertain::UncertainItems;
use super::unknowns::Unknowns;
use crate::open::Opened;
use ff_least_squares::Settings as Solver;
use ff_model::{Area, Model, Problem, Problems};
use ident::Estimator;
use ident::Loss;
use ident::Request;
use ident::Several;
use ident::belief::{ChannelRows, coloured_covariance};
use ident::compose::best_of;
use ident::compose::{Shared, SharedErrors};
use ident::estimate::attempt;
use ident::parameters::random_start;
use nalgebra::DMatrix;

/// Pull that holds what neither data nor priors tell near where it is, relative.
const ANCHOR: f64 = 10.0;
/// Promised reduction of chi-squared below which a fit is at its end: a thirtieth of a standard deviation is left to go.
const GAIN: f64 = 1e-3;
/// Promised relative reduction at which a fit that only leads to another is near enough.
const NEAR: f64 = 1e-3;
/// Relative width that such a fit is held to about the mission, and linearisations of each of its passes.
const LOOSE: f64 = 0.5;
/// See [`LOOSE`].
const FEW: usize = 4;
/// Relative width of the draws of other starts.
const SPREAD: f64 = 0.3;

/// Estimates the parameters of `[estimate]` from one or several records of the robot. Allocates the Jacobian.
///
/// # Errors
/// [`IdentifyError`]. A fit that stalls, or cannot tell some parameters, is a result ([`crate::workflow::identify::IdentificationResult::exit`]).
pub fn identify(
    opened: &Opened,
    records: &[LabelledRecord],
    settings: &Settings,
    options: &FitOptions,
    provenance: Provenance,
    watch: &Observer<'_>,
) -> Result<Identified, IdentifyError> {
    let model = &opened.model;
    check(opened, settings).map_err(IdentifyError::Refused)?;
    for t in records {
        t.record.check_joints(&model.joint_names()).map_err(IdentifyError::Refused)?;
        t.record.check_uniform("identification with all checks").map_err(|e| {
            let p = Problem::error(Area::Data, "Data::TimeBase", e.to_string());
            IdentifyError::Refused(Problems(vec![p.hint("bring it to one clock, or fit it with ident::OutputError")]))
        })?;
    }
    if method(model, settings.method) == Method::Ground {
        ground::check(settings, options).map_err(IdentifyError::Refused)?;
        return ground::identify(opened, records, settings, options, provenance);
    }
    let adopted = Adopted::new(model, &opened.estimated, &settings.adopt).map_err(IdentifyError::Refused)?;
    let mut uncertain = UncertainItems::of(opened);
    if records.len() > 1 {
        adopted.share(model, &settings.noise, &mut uncertain);
    }
    // The rigid method knows no errors of sensors and placements.
    let needs = !uncertain.shared.is_empty() && settings.method.is_none();
    let settings =
        &Settings { method: if needs { Some(Method::OutputError) } else { settings.method }, ..settings.clone() };
    let mut estimated = opened.estimated.clone();
    estimated.extend(&adopted.parameters);
    let with_ties = FitOptions { ties: [&options.ties[..], &adopted.ties].concat(), ..options.clone() };
    let options = &with_ties;
    let unknowns = Unknowns::new(model, &estimated, settings, options, &uncertain)?;
    let decls = model.param_decls();
    let labelled: Vec<(&str, &[_])> = records.iter().map(|t| (t.label.as_str(), decls.as_slice())).collect();
    let none: [&str; 0] = [];
    let shared = Shared::new(&labelled, &none)
        .map_err(|e| IdentifyError::Refused(config("Config::Records", e.to_string(), "name each record once")))?;
    let labels: Vec<String> = records.iter().map(|t| t.label.clone()).collect();
    let fit = Assembly { model, records, settings, shared: &shared, labels: &labels, unknowns: &unknowns };
    let Assembled { mut whole, twins, sigma, rows } = fit.assemble(&uncertain, &uncertain.shared_names())?;
    let solver = Solver {
        max_iterations: settings.max_iterations,
        decrement_tolerance: 1e-10,
        gain_tolerance: GAIN,
        cost_floor: 1e-13,
        ..Solver::default()
    };
    let start = fit.first_start(&uncertain, &solver, watch)?;
    let priors = unknowns.priors(&unknowns.selected)?;
    let request = Request {
        anchor: (!unknowns.has_priors()).then_some(ANCHOR),
        marginal: unknowns.marginal.iter().map(|m| (m.0, m.1.std)).collect(),
        loss: settings.loss,
        priors,
        settings: solver,
        centre: Some(&unknowns.start),
        ..Request::new(&unknowns.decls, &unknowns.selected, &start)
    };
    let mut watched = ObservedEstimator::new(&mut *whole, watch);
    let subject = Subject { model, records, unknowns: &unknowns, settings, sigma: &sigma };
    let fitted = solve(&request, &subject, options, &mut watched);
    let fitted = if watched.stopped() { return Err(IdentifyError::Interrupted) } else { fitted? };
    let values = unknowns.expand(&fitted.estimate.values)?;
    let silent = known::silent(model, &values, &unknowns, &fitted.full)?;
    let profiles = known::profiles(&request, &unknowns, (&fitted.selected, &fitted.estimate), options, &mut watched);
    let profiles = if watched.stopped() { return Err(IdentifyError::Interrupted) } else { profiles? };
    let mut signals = Vec::new();
    let mut at = 0;
    for (t, n) in records.iter().zip(&rows) {
        signals.push(Signals::of(model, &t.record, &fitted.estimate.residuals[at..at + n], &sigma));
        at += n;
    }
    let end = Ended {
        model,
        shared: &shared,
        labels: &labels,
        unknowns: &unknowns,
        fitted: &fitted,
        values: &values,
        records,
        signals: &signals,
    };
    let tests = if fitted.estimate.is_solution() { explain::tests(&end, &twins, settings)? } else { None };
    let tests = tests.as_ref();
    let unknowns = &unknowns;
    let coloured = coloured_deviations(&end, &rows, sigma.len(), settings, &mut watched);
    let coloured = if watched.stopped() { return Err(IdentifyError::Interrupted) } else { coloured };
    let report = Report { opened, records, settings, options, unknowns, signals: &signals, values: &values, tests };
    let mut result = report.result(&fitted, provenance)?;
    for p in result.parameters.iter_mut().chain(&mut result.nuisance).filter(|p| p.std.is_some()) {
        p.std_coloured = coloured.iter().find(|(name, _)| *name == p.name).map(|c| c.1);
    }
    result.silent = silent;
    result.profiles = profiles;
    result.verdict = text::verdict(&result);
    let tried = tests.map_or_else(Vec::new, |t| t.alone.clone());
    Ok(Identified { result, signals, values, selected: unknowns.touched.clone(), tried })
}

/// Standard deviations of the unknowns under random noise of the colour that the residuals have, by name; none where they are white, or
/// outliers are weighted down. What cannot be linearised there has none either.
fn coloured_deviations(
    end: &Ended<'_>,
    rows: &[usize],
    channels: usize,
    s: &Settings,
    estimator: &mut ObservedEstimator<'_>,
) -> Vec<(String, f64)> {
    let e = &end.fitted.estimate;
    let white = known::whiteness(end.records, end.signals, &[], &[]).iter().all(|w| w.white);
    if white || s.loss != Loss::Squares || !e.is_solution() {
        return Vec::new();
    }
    let extra: Vec<f64> = e.nuisance.iter().map(|p| p.value).collect();
    let unknowns = end.fitted.selected.len() + extra.len();
    let (mut r, mut j) = (vec![0.0; e.residuals.len()], DMatrix::zeros(e.residuals.len(), unknowns));
    if estimator.jacobian(&e.values, &extra, &end.fitted.selected, &mut r, &mut j).is_err() {
        return Vec::new();
    }
    let mut of = Vec::new();
    let mut first = 0;
    for n in rows {
        of.extend((first..first + channels).map(|c| ChannelRows { rows: c..first + n, every: channels }));
        first += n;
    }
    let c = coloured_covariance(&e.uncertainty.covariance, &j, &r, &of);
    let names = e.uncertainty.unknowns.iter().map(|u| u.name.clone());
    names.zip(c.diagonal().iter().map(|v| v.max(0.0).sqrt())).filter(|(_, s)| s.is_finite()).collect()
}

/// What the estimators of a fit are made of.
struct Assembly<'a> {
    model: &'a Model,
    records: &'a [LabelledRecord],
    settings: &'a Settings,
    shared: &'a Shared,
    labels: &'a [String],
    unknowns: &'a Unknowns,
}

/// Estimator of all records over the unknowns of a fit.
struct Assembled<'a> {
    whole: Box<dyn Estimator + 'a>,
    twins: Vec<Twin<'a>>,
    /// Standard deviation of every channel of a sample, and residuals of each record.
    sigma: Vec<f64>,
    rows: Vec<usize>,
}

impl<'a> Assembly<'a> {
    /// With columns of these errors of sensors and placements; `names` are all that stand behind the parameters of the model.
    fn assemble(&self, uncertain: &UncertainItems, names: &[String]) -> Result<Assembled<'a>, IdentifyError> {
        let of = |t: &'a LabelledRecord| RecordEstimator::beside(self.model, &t.record, self.settings, uncertain);
        let mut fits = self.records.iter().map(of).collect::<Result<Vec<_>, _>>()?;
        let sigma = fits.first().map(|f| f.sigmas(self.model)).unwrap_or_default();
        let rows: Vec<usize> = fits.iter_mut().map(|f| f.estimator().rows()).collect();
        let (mut parts, twins): (Vec<Box<dyn Estimator + '_>>, Vec<Twin<'_>>) =
            fits.into_iter().map(RecordEstimator::split).unzip();
        let mut whole = if parts.len() == 1 { parts.remove(0) } else { Box::new(Several::new(self.shared, parts)) };
        if !names.is_empty() {
            let of_model = self.model.param_decls().len();
            whole = Box::new(SharedErrors::new(whole, of_model, names, self.labels));
        }
        Ok(Assembled { whole: self.unknowns.tied(whole), twins, sigma, rows })
    }
    /// Where the fit starts: where one leads that takes as exact what the mission is not sure of, which needs none of its columns and
    /// comes near the answer.
    fn first_start(
        &self,
        uncertain: &UncertainItems,
        solver: &Solver,
        watch: &Observer<'_>,
    ) -> Result<Vec<f64>, IdentifyError> {
        let unknowns = self.unknowns;
        if unknowns.marginal.is_empty() {
            return Ok(unknowns.start.clone());
        }
        let asked: Vec<usize> = unknowns.selected.iter().copied().filter(|&i| unknowns.is_asked(i)).collect();
        let mut bare = self.assemble(&UncertainItems::default(), &uncertain.shared_names())?.whole;
        let mut watched = ObservedEstimator::new(&mut *bare, watch);
        let request = Request {
            anchor: (!unknowns.has_priors()).then_some(ANCHOR),
            loss: self.settings.loss,
            priors: unknowns.priors(&asked)?,
            // What is wrong elsewhere must not lead it astray.
            prior_width: Some(LOOSE),
            settings: Solver {
                decrement_tolerance: NEAR,
                max_iterations: FEW.min(solver.max_iterations),
                ..solver.clone()
            },
            ..Request::new(&unknowns.decls, &asked, &unknowns.start)
        };
        let found = attempt(&request, &mut watched);
        if watched.stopped() {
            return Err(IdentifyError::Interrupted);
        }
        // What goes wrong here may go right with more unknowns.
        Ok(found.map_or_else(|_| unknowns.start.clone(), |e| e.values))
    }
}

/// Fits; from several starts, and again with fewer unknowns, when asked to.
fn solve(
    request: &Request<'_>,
    of: &Subject<'_>,
    options: &FitOptions,
    estimator: &mut ObservedEstimator<'_>,
) -> Result<Fitted, IdentifyError> {
    let (unknowns, s) = (of.unknowns, of.settings);
    let (first, minima) = if options.more_starts == 0 {
        let first = attempt(request, estimator)?;
        (elsewhere(request, first, of, estimator), None)
    } else {
        let draw = |k: usize| {
            random_start(request.decls, request.start, request.selected, SPREAD, s.seed.wrapping_add(1 + k as u64))
        };
        let starts: Vec<Vec<f64>> =
            std::iter::once(request.start.to_vec()).chain((0..options.more_starts).map(draw)).collect();
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
    if options.reduce && !out.full.null.is_empty() {
        let (kept, mut set) = known::reduced(&out.full, request.selected)?;
        let selected: Vec<usize> = kept.iter().map(|&k| request.selected[k]).collect();
        let priors = unknowns.priors(&selected)?;
        let (start, held) = known::held_at_mission(unknowns, &set, &out.estimate.values);
        set.values = held;
        let again = Request { selected: &selected, start: &start, priors, ..request.clone() };
        out.estimate = attempt(&again, estimator)?;
        for (p, &i) in out.estimate.parameters.iter_mut().zip(&selected) {
            p.start = request.start[i];
        }
        out.selected = selected;
        out.reduced = Some(set);
    }
    Ok(out)
}
