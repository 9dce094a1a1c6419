//! What keeps a fit from any answer: a client in the hand that the mission knows nothing of, fuel that was burnt between two records.
//!
//! An error that large leaves no end from which it could be tested: springs and dampers take its place until nothing moves any more, and other
//! starts only find other such places. So the question is put to the shape of the signals first. At a twentieth of their amplitude, and under a
//! prior about the mission, a fit stays where the model is itself; the errors that account for most of what it leaves are fitted there, and
//! the best of them, or those that explain it together, are fitted to the noise of the sensors. They are named if the record is followed with
//! them. Records that each by itself are explained, and together are not, are of robots that differ. Where other starts lead nowhere either, a robot
//! that may not have been at rest when a record began is fitted from a start in motion, and modes are looked for that the mission lacks.

use super::assembly::{Assembled, Assembly, Setup};
use super::ends::{WIDE, explains, from_the_start, gone_on, owner};
use super::error::IdentifyError;
use super::evidence::{ErrorSize, NamedError, State};
use super::explain::{Tests, in_words, tests_of_listed};
use super::fitted::{Ended, Fitted};
use super::labelled_record::LabelledRecord;
use super::missing_mode::Place;
use super::observed_estimator::{ObservedEstimator, Observer};
use super::options::FitOptions;
use super::record_estimator::Twin;
use super::refit::{MOST_ANEW, SETTLED, moved, sizes};
use super::settings::Settings;
use super::survey::other_robot;
use super::suspect_starts::{clients, starts};
use crate::open::Opened;
use crate::workflow::amplitude::{PART, amplitude};
use ff_least_squares::Settings as Solver;
use ff_records::Record;
use ident::belief::{PriorRow, Sigma};
use ident::estimate::{Estimate, attempt};
use ident::{Estimator, Noise, Priors, Request};
use std::collections::BTreeMap;

/// Relative standard deviation of the prior about the mission.
const WIDTH: f64 = 0.3;
/// Linearisations of a fit to the shape of the signals, of one that is to follow them with an error, and promised relative reduction at which they end
/// before.
const ITERATIONS: usize = 60;
const FOLLOW: usize = 30;
const SHOWN: f64 = 0.01;
/// Linearisations over all data behind it.
const OF_ALL: usize = 8;
/// Part of what such a fit leaves that an error must account for, to first order, to be fitted; errors that are.
const WORTH: f64 = 0.2;
const LEADING: usize = 3;
/// Errors that are fitted together, at most.
const TOGETHER: usize = 3;
/// Part of what a fit leaves that another leaves at most, to be gone on with.
const HALVES: f64 = 0.5;
/// Linearisations of a fit without an error from the end of that with it: of one record, and of several.
const ON: [usize; 2] = [40, 12];
/// Part of what a fit leaves above noise that is nearly all of it.
const NEARLY_ALL: f64 = 0.9;
/// Part of chi-squared above that of noise that a fit with the error leaves at most, where it is what kept the other from any answer.
pub(super) const EXPLAINS: f64 = 0.1;
/// Deviations by which parameters of one record differ from those of another.
const DIFFERS: f64 = 5.0;

/// A fit that led nowhere, and what it was made of.
pub(super) struct Suspects<'a> {
    pub(super) opened: &'a Opened,
    pub(super) records: &'a [LabelledRecord],
    /// As they were given.
    pub(super) settings: &'a Settings,
    pub(super) options: &'a FitOptions,
    pub(super) setup: &'a Setup,
    pub(super) watch: &'a Observer<'a>,
    /// Mean squared residual that noise alone leaves ([`Request::noise`]).
    pub(super) noise: f64,
}

/// What was found.
pub(super) struct Found {
    /// The fit without the error from where the one with it has ended, or the first where that is better.
    pub(super) estimate: Estimate,
    /// The error in front; `None` where the fit explains the record without it after all, or is much nearer to it.
    pub(super) tests: Option<Tests>,
}

impl Found {
    /// Whether nothing is left of what kept the fit from an answer, with an error.
    pub(super) fn is_all(&self) -> bool {
        self.tests.as_ref().is_none_or(|t| t.with_first == Some(State::Explained))
    }
    /// A fit that explains the record, or is much nearer to it than the first.
    fn nearer(estimate: Estimate) -> Self {
        Self { estimate, tests: None }
    }
    /// Sum of squares that is left with the error in front.
    fn left(&self) -> f64 {
        let drop = self.tests.as_ref().and_then(|t| t.named.first()).map_or(0.0, |n| n.drop);
        self.estimate.objective - drop
    }
    /// With errors in front.
    pub(super) fn with(estimate: Estimate, tests: Tests) -> Self {
        Self { estimate, tests: Some(tests) }
    }
}

/// A fit with errors to the noise of the sensors.
struct With {
    errors: Vec<NamedError>,
    estimate: Estimate,
    /// Values of its unknowns by name.
    values: BTreeMap<String, f64>,
}

/// How far a fit without errors begins from its end, if that explains the record.
#[derive(Clone, Copy, PartialEq)]
enum Begins {
    /// A few linearisations.
    Near,
    /// It is another start.
    Afar,
}

/// Until when a fit to the shape of the signals goes on.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Until {
    /// It has ended.
    Ended,
    /// It is seen not to get below another, by objective.
    Beats(f64),
    /// It is seen not to follow the signals.
    Follows,
}

/// A fit to the shape of the signals.
pub(super) struct Shape {
    /// Sum of squared residuals, and the same per degree of freedom.
    objective: f64,
    misfit: f64,
    /// Values of the unknowns by name.
    values: BTreeMap<String, f64>,
}

impl Shape {
    /// To a twentieth of the signals.
    pub(super) fn follows(&self) -> bool {
        self.misfit < 1.0
    }
    pub(super) fn of(setup: &Setup, e: &Estimate) -> Self {
        Self { objective: e.objective, misfit: e.chi2_per_dof, values: setup.unknowns.by_name(&e.values) }
    }
}

/// Whether a fit is so far off that errors are looked for before other starts.
pub(super) fn leads_nowhere(e: &Estimate, noise: f64) -> bool {
    e.chi2_per_dof >= WIDE * noise
}

impl Suspects<'_> {
    /// The errors without which the fit led nowhere, if there are any.
    pub(super) fn found(&self, stuck: &Estimate) -> Result<Option<Found>, IdentifyError> {
        let setup = self.setup;
        let loud = self.at_the_shape(&setup.settings);
        let Assembled { mut whole, twins, .. } = self.assembled(setup, &loud)?;
        let mut shape: Option<Estimate> = None;
        for start in starts(&self.opened.model, self.records, setup, stuck)? {
            let until = shape.as_ref().map_or(Until::Ended, |e| Until::Beats(e.objective));
            let found = self.shape(setup, &mut *whole, &start, until)?;
            shape = least(shape.into_iter().chain(found).collect());
        }
        let Some(shape) = shape else { return Ok(None) };
        let shape = Shape::of(setup, &shape);
        let mut nearer = None;
        if shape.follows() {
            // The model can have that shape: another start is all that it takes, or a small thing is wrong.
            let estimate = self.without(stuck, &self.estimated_at(&shape.values), Begins::Afar)?;
            let (explained, halved) = (self.explained(&estimate), estimate.objective < HALVES * stuck.objective);
            let found = Found::nearer(estimate);
            if explained {
                return Ok(Some(found));
            }
            nearer = halved.then_some(found);
        }
        let apart = self.robots_that_differ(stuck)?;
        if apart.is_some() || shape.follows() {
            return Ok(apart.or(nearer));
        }
        let start = self.estimated_at(&shape.values);
        let Some((end, tests)) = self.scored((setup, &loud), &mut *whole, &twins, &start)? else { return Ok(None) };
        drop(whole);
        match self.followed(stuck, &shape, &tests, end.objective)? {
            Some(with) => self.named(stuck, &with, &tests),
            None => Ok(None),
        }
    }
    /// Whether one error accounts, to first order, for nearly all that a fit leaves above noise ([`NEARLY_ALL`]). Other starts have nothing to gain there.
    pub(super) fn is_one_error(&self, e: &Estimate) -> Result<bool, IdentifyError> {
        let (setup, settings) = (self.setup, &self.setup.settings);
        let Assembled { twins, .. } = self.assembled(setup, settings)?;
        let tests = self.tests_at(setup, settings, &twins, e)?;
        Ok(tests.is_some_and(|t| !t.leading(NEARLY_ALL * self.above_noise(e), 1, |_| true).is_empty()))
    }
    /// What the mission lacks where no other start leads anywhere either: a start in motion, or modes. A mode more can make up for springs that are
    /// far from where they belong, so that this is asked last; `suspected` stays where that leaves less.
    pub(super) fn lacking(&self, stuck: &Estimate, suspected: Option<Found>) -> Result<Option<Found>, IdentifyError> {
        if let Some(found) = self.in_motion(stuck)? {
            return Ok(Some(found));
        }
        let left = suspected.as_ref().map_or(f64::INFINITY, Found::left);
        let setup = self.setup;
        let loud = self.at_the_shape(&setup.settings);
        let Assembled { mut whole, twins, sigma, rows } = self.assembled(setup, &loud)?;
        let shape = self.shape(setup, &mut *whole, &setup.unknowns.start, Until::Ended)?;
        let Some(shape) = shape.map(|e| Shape::of(setup, &e)).filter(|shape| !shape.follows()) else {
            return Ok(suspected);
        };
        let start = self.estimated_at(&shape.values);
        let Some(end) = self.over_all(setup, &mut *whole, &start)? else { return Ok(suspected) };
        drop(whole);
        let (opened, settings) = (self.opened, &loud);
        let at = Place { setup, opened, end: &end, settings, twins: &twins, sigma: &sigma, rows: &rows };
        let modes = self.modes(stuck, &at, Vec::new(), left)?;
        Ok(modes.map(|with| with.found(stuck)).or(suspected))
    }
    /// The errors with which a fit follows the record, as few as explain it: one that leads, those that first order adds to one another, or one after
    /// the other.
    fn followed(
        &self,
        stuck: &Estimate,
        shape: &Shape,
        tests: &Tests,
        excess: f64,
    ) -> Result<Option<With>, IdentifyError> {
        let mut alone: Vec<(NamedError, Shape)> = Vec::new();
        for error in leading(tests, excess, &[]) {
            // One that follows is not to be had again from an error that first order says is half of it at most.
            if alone.iter().any(|(of, with)| with.follows() && error.drop < HALVES * of.drop) {
                break;
            }
            let with = self.shape_with(std::slice::from_ref(&error), shape)?;
            alone.extend(with.map(|with| (error, with)));
        }
        alone.sort_by(|a, b| a.1.objective.total_cmp(&b.1.objective));
        let mut best = None;
        if let Some((error, with)) = alone.first().filter(|a| a.1.follows()) {
            best = self.fitted(stuck, vec![error.clone()], with)?;
        }
        let first = tests.named.iter().enumerate().filter(|(k, n)| *k == 0 || n.beside).map(|(_, n)| n);
        let together: Vec<NamedError> = first.filter(|n| !n.is_another_robot()).cloned().collect();
        // In the order in which they add to one another, no more than it takes.
        for n in 2..=together.len().min(TOGETHER) {
            let errors = &together[..n];
            if self.is_done(&best) {
                break;
            }
            if errors.iter().map(|e| e.drop).sum::<f64>() < WORTH * excess {
                continue;
            }
            if let Some(with) = self.shape_with(errors, shape)?.filter(Shape::follows) {
                best = better(best, self.fitted(stuck, errors.to_vec(), &with)?);
            }
        }
        if !self.is_done(&best)
            && let Some((error, with)) = alone.into_iter().next().filter(|a| a.1.objective < HALVES * shape.objective)
        {
            best = better(best, self.one_after_the_other(stuck, error, with)?);
        }
        Ok(best)
    }
    /// Errors that are fitted to the shape beside one that leads, each scored where those before it have ended: what first order says of a second where the first
    /// is not in the model is of little worth.
    fn one_after_the_other(
        &self,
        stuck: &Estimate,
        first: NamedError,
        mut shape: Shape,
    ) -> Result<Option<With>, IdentifyError> {
        let (mut errors, mut best) = (vec![first], None);
        while errors.len() < TOGETHER {
            let Some(setup) = self.adopting(&errors, self.settings.max_iterations) else { break };
            let loud = self.at_the_shape(&setup.settings);
            let Ok(Assembled { mut whole, twins, .. }) = self.assembled(&setup, &loud) else { break };
            let start = setup.unknowns.at(&shape.values);
            let Some((end, tests)) = self.scored((&setup, &loud), &mut *whole, &twins, &start)? else { break };
            drop(whole);
            let mut next: Option<(NamedError, Shape)> = None;
            for error in leading(&tests, end.objective, &errors) {
                let with = self.shape_with(&[&errors[..], std::slice::from_ref(&error)].concat(), &shape)?;
                let least = next.as_ref().map_or(HALVES * shape.objective, |n| n.1.objective);
                next = with.filter(|w| w.objective < least).map(|w| (error, w)).or(next);
            }
            let Some((error, with)) = next else { break };
            errors.push(error);
            shape = with;
            if shape.follows() {
                best = better(best, self.fitted(stuck, errors.clone(), &shape)?);
                if self.is_done(&best) {
                    break;
                }
            }
        }
        Ok(best)
    }
    /// The end of a fit to the shape of the signals over all data, and the tests there; `None` where nothing can be predicted.
    fn scored(
        &self,
        (setup, loud): (&Setup, &Settings),
        whole: &mut dyn Estimator,
        twins: &[Twin<'_>],
        start: &[f64],
    ) -> Result<Option<(Estimate, Tests)>, IdentifyError> {
        let Some(e) = self.over_all(setup, whole, start)? else { return Ok(None) };
        Ok(self.tests_at(setup, loud, twins, &e)?.map(|tests| (e, tests)))
    }
    /// Tests of all listed errors where a fit has got to.
    fn tests_at(
        &self,
        setup: &Setup,
        s: &Settings,
        twins: &[Twin<'_>],
        e: &Estimate,
    ) -> Result<Option<Tests>, IdentifyError> {
        let Setup { unknowns, shared, labels, .. } = setup;
        let (fitted, values) = (Fitted::of(e.clone(), &unknowns.selected), unknowns.expand(&e.values)?);
        let (model, records, signals) = (&self.opened.model, self.records, &[][..]);
        tests_of_listed(
            &Ended { model, shared, labels, unknowns, fitted: &fitted, values: &values, records, signals, loud: false },
            twins,
            s,
        )
    }
    /// A fit to the shape of the signals, gone on with over all data; `None` where nothing can be predicted.
    pub(super) fn over_all(
        &self,
        setup: &Setup,
        whole: &mut dyn Estimator,
        start: &[f64],
    ) -> Result<Option<Estimate>, IdentifyError> {
        self.fit(&self.shape_request(setup, start, OF_ALL)?, whole)
    }
    /// Whether nothing is left to be looked for beside these errors.
    fn is_done(&self, best: &Option<With>) -> bool {
        best.as_ref().is_some_and(|b| self.explained(&b.estimate))
    }
    /// Whether a fit leaves no more than noise.
    pub(super) fn explained(&self, e: &Estimate) -> bool {
        explains(e, self.noise)
    }
    /// The fit with errors to the noise of the sensors; `None` where that does not follow the record.
    fn fitted(&self, stuck: &Estimate, errors: Vec<NamedError>, with: &Shape) -> Result<Option<With>, IdentifyError> {
        let max_iterations = MOST_ANEW.min(self.settings.max_iterations);
        let Some(setup) = self.adopting(&errors, max_iterations) else { return Ok(None) };
        let Ok(mut whole) = setup.estimator(&self.opened.model, self.records) else { return Ok(None) };
        let start = setup.unknowns.at(&with.values);
        let mut request = Request { start: &start, noise: self.noise, ..setup.request()? };
        request.settings.gain_tolerance = request.settings.gain_tolerance.max(SETTLED);
        request.to_beat = Some(self.noise * whole.rows() as f64 + EXPLAINS * self.above_noise(stuck));
        let Some(mut estimate) = self.fit(&request, &mut *whole)? else { return Ok(None) };
        // An error is what its value differs from the mission's by.
        from_the_start(&mut estimate, &Request { start: &setup.unknowns.start, ..request.clone() });
        let follows = estimate.is_solution() && self.above_noise(&estimate) <= EXPLAINS * self.above_noise(stuck);
        let values = setup.unknowns.by_name(&estimate.values);
        Ok(follows.then_some(With { errors, estimate, values }))
    }
    /// Setup with these errors among the unknowns, if there is such a fit.
    fn adopting(&self, errors: &[NamedError], max_iterations: usize) -> Option<Setup> {
        let mut settings = Settings { max_iterations, ..self.settings.clone() };
        settings.adopt.extend(errors.iter().map(|n| n.name.clone()));
        Setup::new(self.opened, self.records, &settings, self.options).ok()
    }
    /// What comes of a fit with errors: their names and sizes, or none where it was another start that it took.
    fn named(&self, stuck: &Estimate, with: &With, tests: &Tests) -> Result<Option<Found>, IdentifyError> {
        let e = &with.estimate;
        let mut lines = Vec::new();
        for error in &with.errors {
            let Some(h) = tests.tried.iter().find(|h| h.name == error.name) else { return Ok(None) };
            let Some(size) = sizes(h, e, &self.setup.labels) else { return Ok(None) };
            let text = in_words(&h.words, &size);
            let (drop, alike) = (0.0, Vec::new());
            lines.push(NamedError { text, size, drop, refitted: true, alike, ..error.clone() });
        }
        let seen = lines.iter().any(NamedError::is_seen);
        // What first order had added and is not there after all is no part of the answer.
        lines.retain(|n| !seen || n.is_seen());
        lines.iter_mut().enumerate().for_each(|(k, n)| n.beside = k > 0);
        let from = if seen { Begins::Near } else { Begins::Afar };
        let estimate = self.without(stuck, &self.estimated_at(&with.values), from)?;
        if self.explained(&estimate) {
            return Ok(Some(Found::nearer(estimate)));
        }
        if !seen {
            return Ok(None);
        }
        let unknowns = &self.setup.unknowns;
        if let Some((moves, by)) = moved((&estimate, &unknowns.selected), unknowns, e, &|_| 0.0) {
            lines.iter_mut().for_each(|n| (n.moves, n.moves_by) = (moves.clone(), by));
        }
        // Together: what each would take away alone is not known.
        lines[0].drop = estimate.objective - e.objective;
        Ok(Some(Found::with(estimate, tests.explained_by(lines, self.explained(e)))))
    }
    /// The start with what is estimated at these values, by name; what the mission holds stays.
    fn estimated_at(&self, values: &BTreeMap<String, f64>) -> Vec<f64> {
        let unknowns = &self.setup.unknowns;
        let (mut out, there) = (unknowns.start.clone(), unknowns.at(values));
        unknowns.selected.iter().for_each(|&i| out[i] = there[i]);
        out
    }
    /// The fit without an error from where one with it has ended, as one with the first; the first where it is the better.
    fn without(&self, stuck: &Estimate, start: &[f64], from: Begins) -> Result<Estimate, IdentifyError> {
        let mut whole = self.setup.estimator(&self.opened.model, self.records)?;
        let asked = self.setup.request()?;
        let on = ON[usize::from(self.records.len() > 1)];
        let max_iterations = if from == Begins::Near { on } else { asked.settings.max_iterations };
        let settings = Solver { max_iterations, ..asked.settings.clone() };
        let coarse = from == Begins::Afar;
        let request = Request { start, coarse, give_up: coarse.then_some(WIDE), noise: self.noise, settings, ..asked };
        let asked = Request { start: &self.setup.unknowns.start, ..request.clone() };
        Ok(match self.fit(&request, &mut *whole)? {
            Some(e) if e.objective < stuck.objective => gone_on(e, stuck, &asked),
            _ => stuck.clone(),
        })
    }
    /// The estimators of a setup under other settings.
    pub(super) fn assembled<'s>(&self, setup: &'s Setup, settings: &'s Settings) -> Result<Assembled<'s>, IdentifyError>
    where
        Self: 's,
    {
        Assembly { settings, ..setup.assembly(&self.opened.model, self.records) }.assemble(&setup.uncertain)
    }
    /// Settings with a twentieth of the signals in place of the noise.
    pub(super) fn at_the_shape(&self, s: &Settings) -> Settings {
        let largest = |of: &dyn Fn(&Record) -> f64| self.records.iter().map(|t| of(&t.record)).fold(0.0, f64::max);
        let own = self.noise.sqrt();
        let torque = largest(&|r| PART * amplitude(r.tau())).max(own * s.noise.torque);
        let gyro = largest(&|r| PART * amplitude(r.gyro())).max(own * s.noise.gyro);
        Settings { noise: Noise { torque, gyro }, ..s.clone() }
    }
    /// The fit to the shape of the signals with errors, from the end of that without them, from the mission, or from clients of several sizes; `None` where it fails.
    fn shape_with(&self, errors: &[NamedError], before: &Shape) -> Result<Option<Shape>, IdentifyError> {
        let Some(setup) = self.adopting(errors, self.settings.max_iterations) else { return Ok(None) };
        let loud = self.at_the_shape(&setup.settings);
        let Ok(Assembled { mut whole, .. }) = self.assembled(&setup, &loud) else { return Ok(None) };
        // Without them the fit may have gone where no way leads back from.
        let from_there = self.shape(&setup, &mut *whole, &setup.unknowns.at(&before.values), Until::Follows)?;
        let anew = self.shape(&setup, &mut *whole, &setup.unknowns.start, Until::Follows)?;
        let mut all: Vec<Estimate> = from_there.into_iter().chain(anew).collect();
        for start in errors.iter().flat_map(|n| clients(&setup, &n.name)) {
            all.extend(self.shape(&setup, &mut *whole, &start, Until::Follows)?);
        }
        Ok(least(all).map(|e| Shape::of(&setup, &e)))
    }
    /// A fit of these unknowns to the shape of the signals. What is asked for is held to the mission; errors may be as large as they are.
    fn shape_request<'r>(
        &self,
        setup: &'r Setup,
        start: &'r [f64],
        max_iterations: usize,
    ) -> Result<Request<'r>, IdentifyError> {
        let (asked, unknowns) = (setup.request()?, &setup.unknowns);
        let settings = Solver { max_iterations, decrement_tolerance: SHOWN, ..asked.settings.clone() };
        let of = &self.setup.unknowns;
        let free = |name: &str| {
            let mut links = self.settings.adopt.iter().filter_map(|a| a.strip_prefix("held."));
            links.any(|link| owner(name) == Some(link))
        };
        let wanted: Vec<&str> =
            of.selected.iter().map(|&i| of.decls[i].name.as_str()).filter(|name| !free(name)).collect();
        let mission = [("*", Sigma::Relative(WIDTH))];
        let held = Priors::new(&unknowns.decls, &unknowns.selected, &unknowns.nominal, &mission)
            .map_err(|e| IdentifyError::Model(e.to_string()))?
            .of_columns(|column| {
                let i = unknowns.selected[column];
                unknowns.is_asked(i) && wanted.contains(&unknowns.decls[i].name.as_str())
            });
        let is_new = |row: &&PriorRow| asked.priors.rows().iter().all(|r| r.column != row.column);
        let priors = held.rows().iter().filter(is_new).fold(asked.priors.clone(), |all, row| all.with(*row));
        let centre = Some(&unknowns.start[..]);
        Ok(Request { start, centre, priors, anchor: None, coarse: false, near_end: false, finer: 0, settings, ..asked })
    }
    /// A fit to the shape of the signals over less data, where there is less; `None` where it fails.
    pub(super) fn shape(
        &self,
        setup: &Setup,
        whole: &mut dyn Estimator,
        start: &[f64],
        until: Until,
    ) -> Result<Option<Estimate>, IdentifyError> {
        let most = if until == Until::Follows { FOLLOW } else { ITERATIONS };
        let request = self.shape_request(setup, start, most)?;
        let fit = |of: &mut dyn Estimator| {
            let to_beat = match until {
                Until::Follows => Some(of.rows() as f64),
                Until::Beats(best) => Some(best),
                Until::Ended => None,
            };
            self.fit(&Request { to_beat, ..request.clone() }, of)
        };
        if let Some(mut thin) = whole.rough(start) {
            return fit(&mut *thin.estimator);
        }
        fit(whole)
    }
    /// A fit beside the one that is asked for, as far as it gets; `None` where nothing is predicted.
    pub(super) fn fit(
        &self,
        request: &Request<'_>,
        estimator: &mut dyn Estimator,
    ) -> Result<Option<Estimate>, IdentifyError> {
        let watch = self.watch.aside();
        let mut watched = ObservedEstimator::new(estimator, &watch);
        let found = attempt(request, &mut watched);
        if watched.stopped() { Err(IdentifyError::Interrupted) } else { Ok(found.ok()) }
    }
    /// What a fit leaves beyond noise.
    pub(super) fn above_noise(&self, e: &Estimate) -> f64 {
        e.objective - self.noise * e.residuals.len() as f64
    }
    /// Records that are explained each by itself, while all together are not.
    fn robots_that_differ(&self, stuck: &Estimate) -> Result<Option<Found>, IdentifyError> {
        if self.records.len() < 2 || self.records.iter().any(|t| t.continues) {
            return Ok(None);
        }
        let mut alone: Vec<(Setup, Estimate)> = Vec::new();
        for k in 0..self.records.len() {
            let records = &self.records[k..=k];
            let Ok(setup) = Setup::new(self.opened, records, self.settings, self.options) else { return Ok(None) };
            let mut whole = setup.estimator(&self.opened.model, records)?;
            let request = Request { give_up: Some(WIDE), noise: self.noise, ..setup.request()? };
            let found = self.fit(&request, &mut *whole)?;
            drop(whole);
            match found {
                Some(e) if e.is_solution() && self.explained(&e) => alone.push((setup, e)),
                _ => return Ok(None),
            }
        }
        let mut named: Vec<NamedError> = Vec::new();
        let objective: f64 = alone.iter().map(|a| a.1.objective).sum();
        let first = &alone[0].1;
        for (t, (_, e)) in self.records.iter().zip(&alone).skip(1) {
            let changed = |(p, q): (&ident::Estimated, &ident::Estimated)| {
                let std = p.std?.hypot(q.std?);
                let (name, unit) = (q.name.clone(), q.unit.clone());
                Some(ErrorSize { name, unit, value: q.value - p.value, std })
            };
            let size: Vec<ErrorSize> = first.parameters.iter().zip(&e.parameters).filter_map(changed).collect();
            let by = |s: &ErrorSize| (s.value / s.std).abs();
            let Some(most) = size.iter().max_by(|a, b| by(a).total_cmp(&by(b))).filter(|s| by(s) > DIFFERS) else {
                continue;
            };
            let h = other_robot(&t.label, Vec::new());
            let moves = (most.name.clone(), by(most));
            named.push(NamedError::fitted(h.name, in_words(&h.words, &size), size, 0.0, moves));
        }
        if named.is_empty() {
            return Ok(None);
        }
        named.sort_by(|a, b| b.moves_by.total_cmp(&a.moves_by));
        let (setup, e) = &alone[0];
        let start = self.estimated_at(&setup.unknowns.by_name(&e.values));
        let estimate = self.without(stuck, &start, Begins::Near)?;
        if self.explained(&estimate) {
            return Ok(Some(Found::nearer(estimate)));
        }
        named.iter_mut().for_each(|n| n.drop = estimate.objective - objective);
        Ok(Some(Found::with(estimate, Tests::default().explained_by(named, true))))
    }
}

/// The fit that leaves least.
pub(super) fn least(all: Vec<Estimate>) -> Option<Estimate> {
    all.into_iter().min_by(|a, b| a.objective.total_cmp(&b.objective))
}

/// The better of two fits with errors.
fn better(a: Option<With>, b: Option<With>) -> Option<With> {
    match (a, b) {
        (Some(a), Some(b)) => Some(if b.estimate.objective < a.estimate.objective { b } else { a }),
        (a, b) => a.or(b),
    }
}

/// The errors beside these that account for most of what a fit leaves, to first order.
fn leading(tests: &Tests, excess: f64, beside: &[NamedError]) -> Vec<NamedError> {
    tests.leading(WORTH * excess, LEADING, |n| beside.iter().all(|o| o.name != n.name))
}
