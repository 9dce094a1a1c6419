//! One identification: unknowns, fit, reduction, identifiability, profiles, result.

use super::adoption::Adopted;
use super::bends::{self, Followed};
use super::compliances::allow_for_compliances;
use super::consider::{self, Side};
use super::course::Course;
use super::drives;
use super::elsewhere::{Subject, WIDE, elsewhere, explains, gone_on, has_lost};
use super::encoder_noise::{allow_for_encoders, said};
use super::error::{IdentifyError, config};
use super::evidence::State;
use super::explain;
use super::findings::Minima;
use super::fitted::{Ended, Fitted};
use super::ground;
use super::identified::Identified;
use super::known;
use super::labelled_record::LabelledRecord;
use super::mission_end::allow_for_mission;
use super::noise_floor::noise_floor;
use super::observed_estimator::{ObservedEstimator, Observer};
use super::options::FitOptions;
use super::over_time::{OverTime, later};
use super::record_estimator::{RecordEstimator, Twin};
use super::refit::Contradicted;
use super::report::Report;
use super::result::fit::Method;
use super::result::provenance::Provenance;
use super::ringing;
use super::settings::{Settings, check, method};
use super::signals::Signals;
use super::text;
use super::uncertain::UncertainItems;
use super::unknowns::Unknowns;
use super::valleys::{ASIDE, Ending, best_valley};
use crate::open::Opened;
use ff_least_squares::Settings as Solver;
use ff_model::{Area, Model, Problem, Problems};
use ident::Estimator;
use ident::Loss;
use ident::Request;
use ident::Several;
use ident::belief::{ChannelRows, Profile, coloured_covariance};
use ident::compose::best_of;
use ident::compose::{Shared, SharedErrors};
use ident::estimate::{Estimate, EstimateError, OtherStarts, attempt};
use ident::parameters::random_start;
use nalgebra::DMatrix;

/// Pull that holds what neither data nor priors tell near where it is, relative.
const ANCHOR: f64 = 10.0;
/// Promised reduction of chi-squared below which a fit is at its end: a thirtieth of a standard deviation is left to go.
const GAIN: f64 = 1e-3;
/// How often a fit goes on down a valley that was followed from its end.
const DOWN: usize = 3;
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
    if records.iter().all(|t| t.record.has_torques()) {
        check(opened, settings).map_err(IdentifyError::Refused)?;
    }
    for t in records {
        t.record.check_joints(&model.joint_names()).map_err(IdentifyError::Refused)?;
    }
    if method(model, settings.method) == Method::Ground {
        for t in records {
            t.record.check_uniform("a calibration on the ground").map_err(|e| {
                let p = Problem::error(Area::Data, "Data::TimeBase", e.to_string()).on(&t.label);
                IdentifyError::Refused(Problems(vec![p.hint("bring it to one clock with on_even_clock")]))
            })?;
        }
        ground::check(settings, options).map_err(IdentifyError::Refused)?;
        return ground::identify(opened, records, settings, options, provenance);
    }
    let settings = &drives::settled(model, records, settings)?;
    check(opened, settings).map_err(IdentifyError::Refused)?;
    let (setup, given) = (Setup::new(opened, records, settings, options)?, (settings, options));
    let Setup { settings, options, unknowns, shared, labels, uncertain, .. } = &setup;
    known::profiled(unknowns, options)?;
    let fit = setup.assembly(model, records);
    let Assembled { mut whole, twins, sigma, rows } = fit.assemble(uncertain)?;
    let noise = noise_floor(records, &sigma);
    let mut request = Request { noise, ..setup.request()? };
    // Standard deviations are those of the noise that there is.
    request.settings.gain_tolerance *= noise;
    let mut watched = ObservedEstimator::new(&mut *whole, watch);
    let subject = Subject { model, records, unknowns, settings, sigma: &sigma };
    let fitted = solve(&request, &subject, options, &mut watched);
    let ended = |at: &ObservedEstimator<'_>| {
        at.leave(|unknown| unknowns.expand(unknown));
        IdentifyError::Interrupted
    };
    let mut fitted = if watched.stopped() { return Err(ended(&watched)) } else { fitted? };
    let values = unknowns.expand(&fitted.estimate.values)?;
    let end = Ended { model, shared, labels, unknowns, fitted: &fitted, values: &values, records, signals: &[] };
    let mut shaken = Vec::new();
    if let Some((wider, by)) = allow_for_encoders(&end, &twins, settings)? {
        (fitted, shaken) = (wider, by);
    }
    let silent = known::silent(model, &values, unknowns, &fitted.full)?;
    let profiles = known::profiles(&request, unknowns, (&fitted.selected, &fitted.estimate), options, &mut watched);
    let mut profiles = if watched.stopped() { return Err(ended(&watched)) } else { profiles? };
    known::bent(&fitted, &mut profiles);
    let alone = || Unknowns::new(model, &setup.estimated, settings, options, &uncertain.held_at_mission());
    let own = if options.consider && fitted.estimate.is_solution() { Some(alone()?) } else { None };
    let considered = match &own {
        Some(own) => {
            let mut bare = Assembly { unknowns: own, ..fit }.assemble(&UncertainItems::default())?.whole;
            let joint = Side { unknowns, estimator: &mut watched };
            let own = Side { unknowns: own, estimator: &mut *bare };
            Some(consider::hold(joint, own, &fitted, &request)?)
        }
        None => None,
    };
    let mut signals = Vec::new();
    let mut at = 0;
    for (t, n) in records.iter().zip(&rows) {
        signals.push(Signals::of(model, &t.record, &fitted.estimate.residuals[at..at + n], &sigma));
        at += n;
    }
    let end = Ended { model, shared, labels, unknowns, fitted: &fitted, values: &values, records, signals: &signals };
    let ended_well = fitted.estimate.is_solution();
    let mut found = None;
    if ended_well && method(model, settings.method) == Method::Rda {
        found = fit.tested_by_all_sensors(&request, &end, uncertain, watch)?;
    }
    if found.is_none() && (ended_well || method(model, settings.method) == Method::OutputError) {
        found = explain::tests(&end, &twins, settings)?;
    }
    let tests = found.as_ref();
    let coloured = coloured_deviations(&end, &rows, sigma.len(), settings, &mut watched);
    let coloured = if watched.stopped() { return Err(ended(&watched)) } else { coloured };
    let mut report =
        Report { opened, records, settings, options, unknowns, signals: &signals, values: &values, tests, noise };
    let mut stated = &fitted;
    if let (Some(own), Some(c)) = (&own, &considered) {
        (report.unknowns, report.values, stated) = (own, &c.values, &c.fitted);
    }
    let mut result = report.result(stated, provenance)?;
    for p in result.parameters.iter_mut().chain(&mut result.nuisance).filter(|p| p.std.is_some()) {
        // Sums over lags may come out below zero, and then say nothing.
        p.std_coloured = coloured.iter().find(|(name, std)| *name == p.name && *std > 0.0).map(|c| c.1);
    }
    if !shaken.is_empty() {
        result.warnings.push(said(&shaken));
    }
    result.silent = silent;
    result.profiles = profiles;
    result.not_allowed_for.clone_from(&setup.not_allowed_for);
    if considered.is_none() {
        result.over_time = Course::all(&uncertain.over_time, model, records, unknowns, (&fitted, &values))?;
    }
    if let Some(c) = &considered {
        (result.uncertain, result.budget) = (c.lines.clone(), c.budget.clone());
        // Its errors are those of the next identification too: taken as independent they would count as noise.
        result.posterior = None;
    }
    watched.leave(|unknown| unknowns.expand(unknown));
    let tried = tests.map_or_else(Vec::new, |t| t.alone.clone());
    let noisy = explain::of_sensors(&fitted.estimate, noise, &result.whiteness, settings).is_some();
    if let Some(tests) =
        found.as_mut().filter(|_| own.is_none() && (!ended_well || result.state() == State::Contradicted && !noisy))
    {
        let white = result.whiteness.iter().all(|w| w.white);
        let end = Contradicted {
            opened,
            records,
            settings: given.0,
            options: given.1,
            end: &end,
            twins: &twins,
            watch,
            white,
            noise,
        };
        end.named_by_fits(tests)?;
        let estimates = !result.parameters.is_empty();
        let evidence =
            explain::evidence(Some(tests), (&fitted.estimate, noise), &result.whiteness, estimates, settings);
        result.evidence = Some(evidence);
    }
    result.verdict = text::verdict(&result);
    let selected = own.as_ref().unwrap_or(unknowns).touched.clone();
    let values = considered.map_or(values, |c| c.values);
    Ok(Identified { result, signals, values, selected, tried, draws: None, fitted: Some(fitted) })
}

/// What a fit is made of, before any record is predicted.
pub(super) struct Setup {
    pub(super) settings: Settings,
    pub(super) options: FitOptions,
    pub(super) unknowns: Unknowns,
    pub(super) shared: Shared,
    pub(super) labels: Vec<String>,
    pub(super) uncertain: UncertainItems,
    /// What the mission is not sure of and the method knows nothing of.
    not_allowed_for: Vec<String>,
    estimated: Vec<usize>,
}

impl Setup {
    pub(super) fn new(
        opened: &Opened,
        records: &[LabelledRecord],
        settings: &Settings,
        options: &FitOptions,
    ) -> Result<Self, IdentifyError> {
        let model = &opened.model;
        let adopted = Adopted::new(model, &opened.estimated, &settings.adopt).map_err(IdentifyError::Refused)?;
        let of_mission = UncertainItems::of(opened);
        let every = of_mission.in_records(opened.mission.as_ref(), model, records, settings)?;
        let mut every = every.with_drives(model, records, settings)?;
        if records.len() > 1 {
            adopted.share(model, &settings.noise, &mut every);
        }
        if options.consider {
            consider_alone(&every, settings, options).map_err(IdentifyError::Refused)?;
        }
        // The rigid method knows no errors of sensors and placements.
        let needs = (every.needs_output_error() || adopted.of_sensors()) && settings.method.is_none();
        let how = if needs { Method::OutputError } else { method(model, settings.method) };
        if how == Method::Rda && adopted.of_sensors() {
            let what = "--adopt: the rigid method has no columns of errors of sensors and placements";
            return Err(IdentifyError::Refused(config("Config::NotAdoptable", what, "leave --method out")));
        }
        let (uncertain, not_allowed_for) =
            if how == Method::Rda { every.of_parameters_alone() } else { (every, Vec::new()) };
        let settings =
            Settings { method: if needs { Some(Method::OutputError) } else { settings.method }, ..settings.clone() };
        let mut estimated = opened.estimated.clone();
        estimated.extend(&adopted.parameters);
        let mut options = FitOptions { ties: [&options.ties[..], &adopted.ties].concat(), ..options.clone() };
        // What may have changed since is known less well.
        if let (Some(p), Some(mission)) = (&options.posterior, &opened.mission) {
            options.posterior = Some(later(p, mission, model)?);
        }
        let unknowns = Unknowns::new(model, &estimated, &settings, &options, &uncertain)?;
        let decls = model.param_decls();
        let labelled: Vec<(&str, &[_])> = records.iter().map(|t| (t.label.as_str(), decls.as_slice())).collect();
        let none: [&str; 0] = [];
        let shared = Shared::new(&labelled, &none)
            .map_err(|e| IdentifyError::Refused(config("Config::Records", e.to_string(), "name each record once")))?;
        let labels: Vec<String> = records.iter().map(|t| t.label.clone()).collect();
        Ok(Self { settings, options, unknowns, shared, labels, uncertain, not_allowed_for, estimated })
    }
    /// Of all unknowns, from the start.
    pub(super) fn request(&self) -> Result<Request<'_>, IdentifyError> {
        let unknowns = &self.unknowns;
        let solver = Solver {
            max_iterations: self.settings.max_iterations,
            decrement_tolerance: 1e-10,
            gain_tolerance: GAIN,
            cost_floor: 1e-13,
            ..Solver::default()
        };
        Ok(Request {
            anchor: (!unknowns.has_priors()).then_some(ANCHOR),
            marginal: unknowns.marginal.iter().map(|m| (m.0, m.1.std)).collect(),
            loss: self.settings.loss,
            priors: unknowns.priors(&unknowns.selected)?,
            settings: solver,
            centre: Some(&unknowns.start),
            ..Request::new(&unknowns.decls, &unknowns.selected, &unknowns.start)
        })
    }
    pub(super) fn assembly<'a>(&'a self, model: &'a Model, records: &'a [LabelledRecord]) -> Assembly<'a> {
        let Self { settings, unknowns, shared, labels, .. } = self;
        Assembly { model, records, settings, shared, labels, unknowns }
    }
    /// The estimator of all records.
    pub(super) fn estimator<'a>(
        &'a self,
        model: &'a Model,
        records: &'a [LabelledRecord],
    ) -> Result<Box<dyn Estimator + 'a>, IdentifyError> {
        Ok(self.assembly(model, records).assemble(&self.uncertain)?.whole)
    }
}

/// Refuses what considered errors do not go with.
fn consider_alone(uncertain: &UncertainItems, s: &Settings, o: &FitOptions) -> Result<(), Problems> {
    let refused = |what: &str, place: &str, hint: &str| {
        let p = Problem::error(Area::Config, "Config::Consider", what).on(place).hint(hint);
        Err(Problems(vec![p]))
    };
    let exact = "the mission is sure of everything, and nothing can be considered";
    if uncertain.count() == 0 {
        return refused(
            exact,
            "--consider",
            "say in [[uncertain]] and [sensors] what is not known exactly, or leave it out",
        );
    }
    let alone = "considered errors widen the covariance of a least-squares fit of all parameters alone";
    for (place, given) in [
        ("--profile", !o.profile.is_empty()),
        ("--reduce", o.reduce),
        ("--prior-from", o.posterior.is_some()),
        ("--loss", s.loss != Loss::Squares),
    ] {
        if given {
            return refused(alone, place, "leave it out, or leave --consider out and estimate the errors");
        }
    }
    Ok(())
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
    // Samples of a channel stand at even distances among the rows.
    if !end.records.iter().all(|r| r.record.is_uniform()) {
        return Vec::new();
    }
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
    // What is asked for, and what belongs to records.
    let all = &e.uncertainty.unknowns;
    let stated = |k: &usize| end.fitted.selected.get(*k).is_none_or(|&i| end.unknowns.is_asked(i));
    let columns: Vec<usize> = (0..all.len()).filter(stated).collect();
    let c = coloured_covariance(&e.uncertainty.covariance, &j, &r, &of, &columns);
    let deviations = c.diagonal().map(|v| v.max(0.0).sqrt());
    let named = columns.iter().map(|&k| all[k].name.clone());
    named.zip(deviations.iter().copied()).filter(|(_, s)| s.is_finite()).collect()
}

/// What the estimators of a fit are made of.
#[derive(Clone, Copy)]
pub(super) struct Assembly<'a> {
    model: &'a Model,
    records: &'a [LabelledRecord],
    settings: &'a Settings,
    shared: &'a Shared,
    labels: &'a [String],
    unknowns: &'a Unknowns,
}

/// Estimator of all records over the unknowns of a fit.
pub(super) struct Assembled<'a> {
    pub(super) whole: Box<dyn Estimator + 'a>,
    pub(super) twins: Vec<Twin<'a>>,
    /// Standard deviation of every channel of a sample, and residuals of each record.
    pub(super) sigma: Vec<f64>,
    pub(super) rows: Vec<usize>,
}

impl<'a> Assembly<'a> {
    /// With columns of these errors of sensors and placements.
    pub(super) fn assemble(&self, uncertain: &UncertainItems) -> Result<Assembled<'a>, IdentifyError> {
        let over = &uncertain.over_time;
        self.with(uncertain, &mut |k, t: &'a LabelledRecord, s| {
            RecordEstimator::beside(self.model, &t.record, s, uncertain, over.walks_of(k))
        })
    }
    /// [`Assembly::assemble`] with the motions of other estimators of the same records, the model at these values.
    pub(super) fn again<'t: 'a>(
        &self,
        uncertain: &UncertainItems,
        twins: &[Twin<'t>],
        at: &[f64],
    ) -> Result<Assembled<'a>, IdentifyError> {
        self.with(uncertain, &mut |k, _, s| RecordEstimator::again(&twins[k], s, uncertain, at))
    }
    fn with(
        &self,
        uncertain: &UncertainItems,
        make: &mut dyn FnMut(usize, &'a LabelledRecord, &Settings) -> Result<RecordEstimator<'a>, IdentifyError>,
    ) -> Result<Assembled<'a>, IdentifyError> {
        let moving = Settings { initial_state: true, ..self.settings.clone() };
        let over = &uncertain.over_time;
        let mut of = |(k, t): (usize, &'a LabelledRecord)| {
            let settings = if t.continues { &moving } else { self.settings };
            make(k, t, settings)
        };
        let mut fits = self.records.iter().enumerate().map(&mut of).collect::<Result<Vec<_>, _>>()?;
        let sigma = fits.first().map(|f| f.sigmas(self.model)).unwrap_or_default();
        let rows: Vec<usize> = fits.iter_mut().map(|f| f.estimator().rows()).collect();
        let (mut parts, mut twins): (Vec<Box<dyn Estimator + '_>>, Vec<Twin<'_>>) =
            fits.into_iter().map(RecordEstimator::split).unzip();
        let decls = self.model.param_decls();
        for (k, twin) in twins.iter_mut().enumerate() {
            twin.changes = over.changes_of(k).to_vec();
        }
        parts =
            parts.into_iter().zip(&twins).map(|(part, twin)| OverTime::changed(part, &decls, &twin.changes)).collect();
        let mut whole = if parts.len() == 1 { parts.remove(0) } else { Box::new(Several::new(self.shared, parts)) };
        let names = uncertain.shared_names();
        if !names.is_empty() {
            let mut shared = SharedErrors::new(whole, decls.len(), &names, self.labels);
            for (i, name) in names.iter().enumerate() {
                if let Some(made) = over.combined.get(name) {
                    shared = shared.combine(i, made);
                }
            }
            whole = Box::new(shared);
        }
        Ok(Assembled { whole: self.unknowns.tied(whole), twins, sigma, rows })
    }
}

impl Assembly<'_> {
    /// Tests of a fit of the torques alone ([`Method::Rda`]), at the end of a fit by output error that begins where it ended. Errors are
    /// scored to first order, and on a base that is light against its arm the torques leave parameters thousands of times less certain
    /// than the gyro: at the end of the rigid method its residuals are not small, and a right model would be contradicted. The initial
    /// rate is free, since the rigid method needs no rest. `None` where output error does not end.
    fn tested_by_all_sensors(
        &self,
        request: &Request<'_>,
        end: &Ended<'_>,
        uncertain: &UncertainItems,
        watch: &Observer<'_>,
    ) -> Result<Option<explain::Tests>, IdentifyError> {
        let settings = Settings { method: Some(Method::OutputError), initial_state: true, ..self.settings.clone() };
        let Assembled { mut whole, twins, .. } = Assembly { settings: &settings, ..*self }.assemble(uncertain)?;
        let silent = Observer { progress: None, ..*watch };
        let mut watched = ObservedEstimator::new(&mut *whole, &silent);
        let (fitted, unknowns) = (end.fitted, self.unknowns);
        let again = Request {
            selected: &fitted.selected,
            start: &fitted.estimate.values,
            priors: unknowns.priors(&fitted.selected)?,
            ..request.clone()
        };
        let ended = |found: Result<Estimate, EstimateError>| found.ok().filter(Estimate::is_solution);
        let mut found = ended(attempt(&again, &mut watched));
        if found.is_none() && !watched.stopped() {
            // The torques alone may have led a body to the edge of what can exist, from which no fit begins.
            found = ended(attempt(&Request { start: request.start, ..again }, &mut watched));
        }
        if watched.stopped() {
            return Err(IdentifyError::Interrupted);
        }
        let Some(estimate) = found else { return Ok(None) };
        let values = unknowns.expand(&estimate.values)?;
        let fitted = Fitted { estimate, ..fitted.clone() };
        explain::tests(&Ended { fitted: &fitted, values: &values, ..*end }, &twins, &settings)
    }
}

/// A fit that was given up, gone on with ([`Request::give_up`]); one that all its linearisations have not led to an end stays.
fn finished(
    request: &Request<'_>,
    so_far: Estimate,
    estimator: &mut ObservedEstimator<'_>,
) -> Result<Estimate, IdentifyError> {
    if !so_far.given_up {
        return Ok(so_far);
    }
    let on = attempt(&Request { start: &so_far.values, ..request.clone() }, estimator)?;
    Ok(gone_on(on, &so_far, request))
}

/// Intervals along valleys that bend. Where one leads down, the fit goes on from there ([`DOWN`]).
fn followed(
    request: &Request<'_>,
    ending: &mut Ending,
    of: &Subject<'_>,
    estimator: &mut ObservedEstimator<'_>,
) -> Vec<Profile> {
    let mut left = DOWN;
    loop {
        let down = if left > 0 { bends::LOWER } else { f64::INFINITY };
        let start = match bends::follow(request, ending, |i| of.unknowns.is_asked(i), down, estimator) {
            Followed::Up(profiles) => return profiles,
            Followed::Down(start) => start,
        };
        let centre = Some(request.centre.unwrap_or(request.start));
        let on = Request { start: &start, centre, coarse: false, finer: ASIDE, ..request.clone() };
        match attempt(&on, estimator) {
            Ok(e) if e.is_solution() && e.objective < ending.estimate.objective - bends::LOWER => {
                *ending = best_valley(request, gone_on(e, &ending.estimate, request), of, estimator);
                left -= 1;
            }
            // The chord promised too much: the valley is taken as it is.
            _ => left = 0,
        }
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
    let mut ending = if options.more_starts == 0 {
        let quick = Request { give_up: Some(WIDE), ..request.clone() };
        let tuned = || ringing::tuned(of, request);
        let mut best = attempt(&Request { other_starts: Some(OtherStarts(&tuned)), ..quick.clone() }, estimator)?;
        // Ten linearisations may have led near the answer after all.
        if best.chi2_per_dof < WIDE * request.noise && !best.crept {
            best = finished(&quick, best, estimator)?;
        }
        best = elsewhere(&quick, best, of, estimator);
        let unfinished = best.given_up;
        best = finished(request, best, estimator)?;
        // What is lost on the rest of the way was not lost yet where other starts were looked for.
        if unfinished && !explains(&best) && has_lost(request, &best) {
            best = elsewhere(&quick, best, of, estimator);
            best = finished(request, best, estimator)?;
        }
        best_valley(request, best, of, estimator)
    } else {
        let draw = |k: usize| {
            random_start(request.decls, request.start, request.selected, SPREAD, s.seed.wrapping_add(1 + k as u64))
        };
        let starts: Vec<Vec<f64>> =
            std::iter::once(request.start.to_vec()).chain((0..options.more_starts).map(draw)).collect();
        let best = best_of(request, &starts, estimator)?;
        let converged = best.endings.iter().filter(|e| e.converged).count();
        let ending = best_valley(request, best.estimate, of, estimator);
        let minima = match ending.minima {
            Some(m) => Minima { starts: starts.len() + m.starts - 1, converged: converged + m.converged - 1, ..m },
            None => Minima { starts: starts.len(), converged, objectives: best.minima, alternatives: Vec::new() },
        };
        Ending { minima: Some(minima), ..ending }
    };
    let bent = followed(request, &mut ending, of, estimator);
    allow_for_compliances(request, &mut ending);
    allow_for_mission(request, &mut ending, |i| unknowns.is_asked(i), estimator);
    let Ending { estimate, minima, alone } = ending;
    let (full, selected) = (estimate.data_only.clone(), request.selected.to_vec());
    let mut out = Fitted { selected, full, estimate, minima, alone, bent, reduced: None };
    if options.reduce && !out.full.null.is_empty() {
        let (kept, mut set) = known::reduced(&out.full, request.selected)?;
        let selected: Vec<usize> = kept.iter().map(|&k| request.selected[k]).collect();
        let priors = unknowns.priors(&selected)?;
        let (start, held) = known::held_at_mission(unknowns, &set, &out.estimate.values);
        set.values = held;
        let again = Request { selected: &selected, start: &start, priors, ..request.clone() };
        out.estimate = attempt(&again, estimator)?;
        out.alone = None;
        out.bent.clear();
        for (p, &i) in out.estimate.parameters.iter_mut().zip(&selected) {
            p.start = request.start[i];
        }
        out.selected = selected;
        out.reduced = Some(set);
    }
    Ok(out)
}
