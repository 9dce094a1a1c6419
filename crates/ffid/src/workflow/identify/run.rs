//! One identification: unknowns, fit, reduction, identifiability, profiles, result.

use super::assembly::{Assembled, Assembly, Setup};
use super::band::{self, Band};
use super::bends::{self, Followed};
use super::compliances::allow_for_compliances;
use super::consider::{self, Side};
use super::course::Course;
use super::drives;
use super::elsewhere::{Subject, elsewhere, follows};
use super::encoder_noise::{allow_for_encoders, kinked, said};
use super::ends::{FAR, LOWER, WIDE, explains, from_the_start, gone_on, has_springs, within};
use super::error::IdentifyError;
use super::evidence::State;
use super::explain::{self, Tests};
use super::findings::Minima;
use super::fitted::{Ended, Fitted};
use super::ground;
use super::identified::Identified;
use super::known;
use super::labelled_record::LabelledRecord;
use super::lost::has_lost;
use super::mission_end::allow_for_mission;
use super::noise_floor::NoiseFloor;
use super::observed_estimator::{ObservedEstimator, Observer};
use super::options::FitOptions;
use super::orders;
use super::places::Places;
use super::refit::Contradicted;
use super::report::Report;
use super::result::fit::{Ended as EndOfFit, Method};
use super::result::identification::IdentificationResult;
use super::result::provenance::Provenance;
use super::ringing;
use super::settings::{Settings, check, method};
use super::signals::Signals;
use super::suspects::{Found, Suspects, leads_nowhere};
use super::text;
use super::uncertain::UncertainItems;
use super::unknowns::Unknowns;
use super::valleys::{ASIDE, Ending, best_valley};
use crate::open::Opened;
use ff_least_squares::{Settings as Solver, Status};
use ff_model::{Area, Problem, Problems};
use ident::Loss;
use ident::belief::{ChannelRows, Profile, coloured_covariance};
use ident::compose::best_of;
use ident::estimate::{Estimate, EstimateError, OtherStarts, attempt};
use ident::parameters::random_start;
use ident::{Estimator, Request};
use nalgebra::DMatrix;

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
    identify_from(None, opened, records, settings, options, provenance, watch)
}

/// [`identify`], at first by a fit that begins at these unknowns, which another has found.
fn identify_from(
    begun: Option<&Estimate>,
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
    let start = begun.map_or(&unknowns.start, |e| &e.values);
    let floor = NoiseFloor::of(records, &sigma).at(&twins, &unknowns.expand(start)?);
    let noise = floor.total();
    let mut request = Request { noise, ..setup.request()? };
    // Standard deviations are those of the noise that there is.
    request.settings.gain_tolerance *= noise;
    let mut watched = ObservedEstimator::new(&mut *whole, watch);
    let subject = Subject { model, records, unknowns, settings, sigma: &sigma, twins: &twins, floor: &floor };
    let suspects = Suspects { opened, records, settings: given.0, options: given.1, setup: &setup, watch, noise };
    let fitted = solve(&request, begun, &subject, options, &suspects, &mut watched);
    let ended = |at: &ObservedEstimator<'_>| {
        at.leave(|unknown| unknowns.expand(unknown));
        IdentifyError::Interrupted
    };
    let stopped = watched.stopped() || matches!(fitted, Err(IdentifyError::Interrupted));
    // Linearisations of a fit that was ended from outside.
    let mut after = None;
    let (mut fitted, suspected) = if stopped {
        let interrupted = ended(&watched);
        let Some(estimate) = watch.partial.then(|| so_far(&request, &mut watched)).flatten() else {
            return Err(interrupted);
        };
        after = Some(watched.linearisations());
        (Fitted::of(estimate, request.selected), None)
    } else {
        fitted?
    };
    let values = unknowns.expand(&fitted.estimate.values)?;
    let loud = floor.is_loud();
    let end = Ended { model, shared, labels, unknowns, fitted: &fitted, values: &values, records, signals: &[], loud };
    let mut shaken = Vec::new();
    if !watch.ends_with_result()
        && let Some((wider, by)) = allow_for_encoders(&end, &twins, settings)?
    {
        (fitted, shaken) = (wider, by);
    }
    let silent = known::silent(model, &values, unknowns, &fitted.full)?;
    let profiles = known::profiles(&request, unknowns, (&fitted.selected, &fitted.estimate), options, &mut watched);
    let mut profiles = match profiles {
        // What the fit has found is there; what would come behind it is not.
        _ if watched.stopped() && watch.partial => Vec::new(),
        _ if watched.stopped() => return Err(ended(&watched)),
        found => found?,
    };
    known::bent(&fitted, &mut profiles);
    let alone = || Unknowns::new(model, &setup.estimated, settings, options, &uncertain.held_at_mission());
    let own = if options.consider && fitted.estimate.is_solution() { Some(alone()?) } else { None };
    let considered = match &own {
        Some(own) => {
            let mut bare = Assembly { unknowns: own, ..fit }.assemble(&UncertainItems::default())?.whole;
            let joint = Side { unknowns, estimator: &mut watched };
            let own = Side { unknowns: own, estimator: &mut *bare };
            match consider::hold(joint, own, &fitted, &request) {
                Err(_) if watch.ends_with_result() => {
                    after = Some(watched.linearisations());
                    fitted.estimate.status = Status::IterationLimit;
                    None
                }
                held => Some(held?),
            }
        }
        None => None,
    };
    let signals = Signals::of_each(model, records, &rows, &fitted.estimate.residuals, &sigma);
    let end =
        Ended { model, shared, labels, unknowns, fitted: &fitted, values: &values, records, signals: &signals, loud };
    let ended_well = fitted.estimate.is_solution();
    let named_already = suspected.is_some() || options.start_at_posterior && !ended_well;
    let mut found = suspected;
    let goes_on = || !watch.ends_with_result();
    if found.is_none() && goes_on() && ended_well && method(model, settings.method) == Method::Rda {
        found = watch.unless_ended(fit.tested_by_all_sensors(&request, &end, uncertain, watch))?.flatten();
    }
    if found.is_none() && goes_on() && (ended_well || method(model, settings.method) == Method::OutputError) {
        found = explain::tests(&end, &twins, settings)?;
    }
    // Draws at the end say what noise of the encoders leaves there.
    let noise = floor.with_motion(found.as_ref().map(|t| t.motion_noise));
    let tests = found.as_ref();
    let coloured = coloured_deviations(&end, &rows, sigma.len(), settings, &mut watched);
    let coloured = if watched.stopped() && !watch.partial { return Err(ended(&watched)) } else { coloured };
    let mut report = Report {
        opened,
        records,
        settings,
        options,
        unknowns,
        signals: &signals,
        values: &values,
        tests,
        floor: &floor,
    };
    let mut stated = &fitted;
    if let (Some(own), Some(c)) = (&own, &considered) {
        (report.unknowns, report.values, stated) = (own, &c.values, &c.fitted);
    }
    let mut result = report.result(stated, provenance)?;
    for p in result.parameters.iter_mut().chain(&mut result.nuisance).filter(|p| p.std.is_some()) {
        // Sums over lags may come out below zero, and then say nothing.
        p.std_coloured = coloured.iter().find(|(name, std)| *name == p.name && *std > 0.0).map(|c| c.1);
    }
    let contradicted = result.state() == State::Contradicted && ended_well && own.is_none() && goes_on();
    let plain = contradicted && options.more_starts == 0 && fitted.reduced.is_none();
    let from_end = |records: &[LabelledRecord], known: &IdentificationResult| {
        let (begun, known) = (Some(&fitted.estimate), known.provenance.clone());
        identify_from(begun, opened, records, given.0, given.1, known, watch)
    };
    if plain
        && begun.is_none()
        && let Some(places) = Places::of(records, &signals, &twins)
    {
        let mut again = from_end(&places.without(records), &result)?;
        if again.result.state() == State::Explained {
            places.say(&mut again.result);
            return Ok(again);
        }
    }
    if plain
        && let Some(tests) = &found
        && let Some(band) = Band::of((model, settings), records, &signals, &twins, (tests, &floor, &result.whiteness))
    {
        let mut slow = from_end(&band.records, &result)?;
        if slow.result.state() == State::Explained || band::is_named(&slow.result) {
            band.say(&mut slow.result);
            return Ok(slow);
        }
    }
    if plain && begun.is_none() {
        let lower = orders::lower(&request, &fitted.estimate, &mut watched);
        if let Some(e) = lower.filter(|_| !watch.is_stopped()) {
            let e = gone_on(e, &fitted.estimate, &request);
            return identify_from(Some(&e), opened, records, given.0, given.1, result.provenance, watch);
        }
    }
    if !shaken.is_empty() {
        result.warnings.push(said(&shaken));
    }
    result.warnings.extend(kinked(&twins));
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
    let noisy = explain::of_sensors(&fitted.estimate, &floor, tests, &result.whiteness, settings).is_some();
    if let Some(tests) = found.as_mut().filter(|_| {
        !named_already && goes_on() && own.is_none() && (!ended_well || result.state() == State::Contradicted && !noisy)
    }) {
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
            floor: &floor,
        };
        watch.unless_ended(end.named_by_fits(tests))?;
        let below = if begun.is_none() { tests.below.take() } else { None };
        let first = (&fitted.estimate, LOWER);
        let lower = below.and_then(|start| lower_from(&start, &request, first, &mut watched));
        if let Some(e) = lower.filter(|_| !watch.is_stopped()) {
            return identify_from(Some(&e), opened, records, given.0, given.1, result.provenance, watch);
        }
        let estimates = !result.parameters.is_empty();
        let evidence =
            explain::evidence(Some(tests), (&fitted.estimate, &floor), &result.whiteness, estimates, settings);
        result.evidence = Some(evidence);
    }
    if let Some(after) = after {
        (result.status, result.iterations) = (EndOfFit::Interrupted { after }, after);
    }
    result.verdict = text::verdict(&result);
    let selected = own.as_ref().unwrap_or(unknowns).touched.clone();
    let values = considered.map_or(values, |c| c.values);
    Ok(Identified { result, signals, values, selected, tried, draws: None, fitted: Some(fitted) })
}

/// The end of a fit that begins there, if its objective is lower than that of this one by so much.
fn lower_from(
    start: &[f64],
    request: &Request<'_>,
    (end, by): (&Estimate, f64),
    estimator: &mut ObservedEstimator<'_>,
) -> Option<Estimate> {
    let centre = Some(request.centre.unwrap_or(request.start));
    let e = attempt(&Request { start, centre, coarse: false, led: true, ..request.clone() }, estimator).ok()?;
    (e.is_solution() && e.objective < end.objective - by).then(|| gone_on(e, end, request))
}

/// A fit that was ended from outside, as one that has not ended: one linearisation of all data at the best point that it has come to.
/// `None` where it has not come to any, or nothing can be linearised there.
fn so_far(request: &Request<'_>, estimator: &mut ObservedEstimator<'_>) -> Option<Estimate> {
    let at = estimator.so_far()?;
    let asked = Request {
        start: &at.full,
        nuisance: Some(&at.extra),
        centre: Some(request.centre.unwrap_or(request.start)),
        coarse: false,
        near_end: false,
        finer: 0,
        give_up: None,
        to_beat: None,
        other_starts: None,
        ..request.clone()
    };
    let settings = Solver { max_iterations: 1, ..request.settings.clone() };
    let mut found = attempt(&Request { settings, ..asked }, estimator.unwatched()).ok()?;
    from_the_start(&mut found, request);
    found.status = Status::IterationLimit;
    Some(found)
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

/// A fit that was given up, gone on with ([`Request::give_up`]); one that all its linearisations have not led to an end stays, and so does one
/// with a body at the edge of what can exist, where no fit begins.
fn finished(
    request: &Request<'_>,
    so_far: Estimate,
    estimator: &mut ObservedEstimator<'_>,
) -> Result<Estimate, IdentifyError> {
    if !so_far.given_up {
        return Ok(so_far);
    }
    match attempt(&Request { start: &so_far.values, ..request.clone() }, estimator) {
        Ok(on) => Ok(gone_on(on, &so_far, request)),
        Err(EstimateError::Transform(_)) => Ok(so_far),
        Err(e) => Err(e.into()),
    }
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
        let aside = Request { finer: ASIDE, ..request.clone() };
        match lower_from(&start, &aside, (&ending.estimate, bends::LOWER), estimator) {
            Some(e) => {
                *ending = best_valley(request, e, of, estimator);
                left -= 1;
            }
            // The chord promised too much: the valley is taken as it is.
            None => left = 0,
        }
    }
}

/// Fits; from several starts, and again with fewer unknowns, when asked to. With tests where an error keeps the fit from any answer.
fn solve(
    request: &Request<'_>,
    begun: Option<&Estimate>,
    of: &Subject<'_>,
    options: &FitOptions,
    suspects: &Suspects<'_>,
    estimator: &mut ObservedEstimator<'_>,
) -> Result<(Fitted, Option<Tests>), IdentifyError> {
    let (unknowns, s) = (of.unknowns, of.settings);
    let mut ending = if options.more_starts == 0 {
        let quick = Request { give_up: Some(WIDE), ..request.clone() };
        let tuned = || ringing::starts(of.model, of.records, unknowns, &s.noise, request);
        let mut best = match begun {
            Some(before) => {
                let on = Request { start: &before.values, centre: Some(request.start), coarse: false, ..quick.clone() };
                gone_on(attempt(&on, estimator)?, before, request)
            }
            None => attempt(&Request { other_starts: Some(OtherStarts(&tuned)), ..quick.clone() }, estimator)?,
        };
        // Noise of the encoders at the end of the fit, where it is no more than where it began: a spring on the wrong way may ring with it.
        let at_end = if within(&best, FAR, of.floor.sensors) {
            None
        } else {
            unknowns.expand(&best.values).ok().map(|values| of.floor.at(of.twins, &values))
        };
        let floor = at_end.filter(|end| end.total() < of.floor.total() || of.floor.drawn.is_empty());
        let of = &Subject { floor: floor.as_ref().unwrap_or(of.floor), ..*of };
        let request = &Request { noise: of.floor.total(), ..request.clone() };
        let suspects = &Suspects { noise: request.noise, ..*suspects };
        let quick = Request { noise: request.noise, ..quick };
        // Ten linearisations may have led near the answer after all.
        if best.chi2_per_dof < WIDE * request.noise && !best.crept {
            best = finished(&quick, best, estimator)?;
        }
        let mut suspected = None;
        // Without springs a fit mostly ends, if at the edge of what can exist, and errors are tested there.
        let rigid = !has_springs(request);
        if rigid && leads_nowhere(&best, request.noise) {
            best = finished(request, best, estimator)?;
        }
        if leads_nowhere(&best, request.noise) && !(rigid && best.is_solution()) && !estimator.stopped() {
            suspects.watch.doubts.map_or(Ok(()), |check| check(of.records, s))?;
            match suspects.found(&best)? {
                Some(Found { estimate, tests: None }) => best = estimate,
                Some(found) if found.is_all() => {
                    return Ok((Fitted::of(found.estimate, request.selected), found.tests));
                }
                in_part => suspected = in_part,
            }
        }
        // A judgement begins at what other records have told. What cannot be led from there even to the shape of the signals lies in no other valley.
        if options.start_at_posterior && leads_nowhere(&best, request.noise) {
            let tests = suspected.and_then(|found| found.tests);
            return Ok((Fitted::of(best, request.selected), tests));
        }
        // Where the signals are followed and one error accounts for what is left, other starts only come back: minutes where sensors are quiet.
        let one_error = leads_nowhere(&best, request.noise)
            && follows(&best, of)
            && !estimator.stopped()
            && suspects.is_one_error(&best)?;
        if one_error {
            best = finished(request, best, estimator)?;
        } else {
            best = elsewhere(&quick, best, false, of, estimator);
            let unfinished = best.given_up;
            best = finished(request, best, estimator)?;
            // What is lost on the rest of the way was not lost yet where other starts were looked for.
            if unfinished && !explains(&best, request.noise) && has_lost(request, &best) {
                best = elsewhere(&quick, best, true, of, estimator);
                best = finished(request, best, estimator)?;
            }
            // Something is left with the error, and so it is named only where no other start has led anywhere.
            if leads_nowhere(&best, request.noise)
                && !estimator.stopped()
                && let Some(found) = if rigid { suspected } else { suspects.lacking(&best, suspected)? }
            {
                return Ok((Fitted::of(found.estimate, request.selected), found.tests));
            }
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
    let mut out = Fitted { minima, alone, bent, ..Fitted::of(estimate, request.selected) };
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
    Ok((out, None))
}
