//! The leading errors, fitted. A score test is exact to first order at the end of a fit that is bent by the error; a fit with the error
//! among its unknowns is not bent, so that sizes are right and the order of candidates is that of what they explain. Fits begin where the
//! first has ended, and are made only where the model is contradicted. Where the first has not ended, the error that its last linearisation
//! speaks for most may be what keeps it from ending, and where it has ended far off, what led it there: fits with one then begin where
//! the first began.

use super::assembly::{Assembled, Setup};
use super::ends::{LOWER, NOWHERE, WIDE, explains};
use super::error::IdentifyError;
use super::evidence::{EXTRA_MODE, ErrorSize, NamedError, State};
use super::explain::{self, CLOSE, Tests, in_words};
use super::extra_mode;
use super::fitted::{Ended, Fitted};
use super::known;
use super::labelled_record::LabelledRecord;
use super::mounted_mode::Mounted;
use super::noise_floor::NoiseFloor;
use super::observed_estimator::{ObservedEstimator, Observer};
use super::options::FitOptions;
use super::record_estimator::Twin;
use super::result::fit::Method;
use super::settings::{Settings, method};
use super::signals::Signals;
use super::unknowns::Unknowns;
use crate::open::Opened;
use ident::belief::Unknown;
use ident::compose::is_called;
use ident::estimate::{Estimate, attempt};
use ident::uncertain::{Hypothesis, evidence};
use ident::{Estimator, Request};

/// Candidates that are fitted.
const LEADING: usize = 3;
/// Part of what the best explains from which another may turn out to be better.
const NEAR: f64 = 0.5;
/// Linearisations of a fit: it begins next to its end.
const MOST: usize = 15;
/// Promised reduction of chi-squared at which it is at its end: a fifth of a deviation is left to go.
pub(super) const SETTLED: f64 = 0.05;

/// Part of what is left over that an error must account for, where the first fit has not ended, to be worth a fit from the beginning.
const WORTH: f64 = 0.2;
/// Such fits, and linearisations of each.
const ANEW: usize = 4;
/// See [`ANEW`].
pub(super) const MOST_ANEW: usize = 60;
/// Part of what is left over below which the errors that were tried explain nothing.
pub(super) const UNEXPLAINED: f64 = 0.5;
/// Part of what the first leaves beyond noise that one of them must leave at most.
const EXPLAINS: f64 = 0.5;
/// Fall of chi-squared over the square of an error in its deviations from which it is that of another valley.
const ELSEWHERE: f64 = 2.0;

/// A fit that its record contradicts, or that has not ended, and what it was made of.
pub(super) struct Contradicted<'a, 't> {
    pub(super) opened: &'a Opened,
    pub(super) records: &'a [LabelledRecord],
    /// As they were given.
    pub(super) settings: &'a Settings,
    pub(super) options: &'a FitOptions,
    pub(super) end: &'a Ended<'a>,
    pub(super) twins: &'a [Twin<'t>],
    pub(super) watch: &'a Observer<'a>,
    /// Whether what is left over is white on every channel: noise is then larger than was said, and the fit is in no valley of its own.
    pub(super) white: bool,
    /// Mean squared residual that noise alone leaves ([`Request::noise`]).
    pub(super) noise: f64,
    /// What noise alone leaves.
    pub(super) floor: &'a NoiseFloor,
}

/// What came of fitting an error.
enum Tried {
    Fitted(Box<Refit>),
    /// Its fit can still move: whatever it says of the size has no deviation.
    NotEnded,
    /// It cannot be estimated.
    Impossible,
}

/// A fit with an error among its unknowns.
struct Refit {
    line: NamedError,
    /// Where the robot is another: with a mode.
    mounted: Option<Mounted>,
    settings: Settings,
    setup: Setup,
    estimate: Estimate,
    selected: Vec<usize>,
}

impl Contradicted<'_, '_> {
    /// Puts the figures of fits in place of those of the score tests, for the errors that lead; what cannot be estimated is taken off the
    /// list. Tests behind the best one tell what is left with it.
    fn refitted(&self, tests: &mut Tests) -> Result<(), IdentifyError> {
        // The rigid method has no columns of most errors, and counts other residuals.
        if method(&self.opened.model, self.settings.method) != Method::OutputError {
            return Ok(());
        }
        let worth = |n: &NamedError| evidence(n.drop, n.freedom);
        let is_named = |n: &&NamedError| tests.named.iter().any(|o| o.name == n.name);
        let mut leading: Vec<NamedError> = tests.alone.iter().filter(is_named).cloned().collect();
        leading.sort_by(|a, b| worth(b).total_cmp(&worth(a)));
        let least = leading.first().map_or(0.0, |n| NEAR * n.drop);
        leading.truncate(LEADING);
        let (mut found, mut lost): (Vec<Refit>, Vec<String>) = (Vec::new(), Vec::new());
        for candidate in leading.iter().filter(|n| n.drop >= least && !n.is_another_robot()) {
            let is_mode = candidate.name == EXTRA_MODE;
            match self.fit(candidate, tests, true)? {
                Tried::Fitted(fit) => found.push(*fit),
                Tried::NotEnded => {
                    if is_mode {
                        let lines = tests.named.iter_mut().chain(&mut tests.alone);
                        lines.filter(|n| n.name == EXTRA_MODE).for_each(|n| extra_mode::without_size(n, MOST));
                    }
                }
                // A mode has been estimated by its search.
                Tried::Impossible if is_mode => {}
                Tried::Impossible => lost.push(candidate.name.clone()),
            }
        }
        tests.named.retain(|n| !lost.contains(&n.name));
        if let Some(first) = tests.named.first_mut() {
            first.beside = false;
        }
        found.sort_by(|a, b| worth(&b.line).total_cmp(&worth(&a.line)));
        // What the error has led the first fit to may be another valley, from which none leads back.
        if self.over_noise() > WIDE
            && let Some(best) = found.first().filter(|f| !explains(&f.estimate, self.noise))
            && let Tried::Fitted(anew) = self.fit(&best.line, tests, false)?
            && anew.estimate.objective < best.estimate.objective - CLOSE
        {
            found[0] = *anew;
        }
        let Some(best) = found.first() else { return Ok(()) };
        // Something that was not fitted, such as parameters that differ between records, may explain more.
        if leading.iter().any(|n| found.iter().all(|f| f.line.name != n.name) && worth(n) > worth(&best.line)) {
            return Ok(());
        }
        if best.mounted.is_none() && falls_by_more_than_its_size(&best.line) {
            let ended = best.setup.unknowns.by_name(&best.estimate.values);
            tests.below = Some(self.end.unknowns.at(&ended));
        }
        let (state, behind) = self.left(best)?;
        let mut named = vec![best.line.clone()];
        for n in behind {
            if n.name != best.line.name {
                named.push(NamedError { beside: true, ..n });
            }
        }
        named.extend(found.iter().skip(1).map(|f| f.line.clone()));
        for n in &tests.named {
            let alone =
                if n.beside { tests.alone.iter().find(|a| a.name == n.name && a.p <= n.p.max(1e-6)) } else { Some(n) };
            if let Some(n) = alone.filter(|n| named.iter().all(|o| o.name != n.name)) {
                named.push(NamedError { beside: false, ..n.clone() });
            }
        }
        let counts = |(k, n): &(usize, &NamedError)| *k == 0 || n.beside && self.over_noise() < WIDE;
        let together: f64 = named.iter().enumerate().filter(counts).map(|(_, n)| n.drop).sum();
        tests.explained = tests.excess.map(|excess| (together / excess).min(1.0));
        (tests.named, tests.with_first) = (named, Some(state));
        Ok(())
    }
    /// Names the errors by fits with each of them. Next to what explains the data these begin at the end of the first; where none explains
    /// most of what is left over there, at its beginning, as do all where it has not ended, or at [`NOWHERE`]: it has then ended in a valley of
    /// its own, and first order says little.
    pub(super) fn named_by_fits(&self, tests: &mut Tests) -> Result<(), IdentifyError> {
        let (ended, chi2) = (self.end.fitted.estimate.is_solution(), self.over_noise());
        if ended && chi2 < NOWHERE {
            self.refitted(tests)?;
            let fitted = tests.named.first().is_some_and(|n| n.refitted);
            if chi2 < WIDE || self.white || fitted && tests.explained.is_none_or(|part| part > UNEXPLAINED) {
                return Ok(());
            }
        }
        if self.fitted_anew(tests)? || !ended {
            return Ok(());
        }
        if chi2 >= NOWHERE {
            self.refitted(tests)?;
        }
        // What first order promises so far from what explains the data is no explanation until a fit has kept it.
        if tests.named.first().is_none_or(|n| !n.refitted) {
            tests.explained = Some(0.0);
        }
        Ok(())
    }
    /// Chi-squared per degree of freedom, over what noise leaves.
    fn over_noise(&self) -> f64 {
        self.end.fitted.estimate.chi2_per_dof / self.noise
    }
    /// Puts in front the error with which a fit from the beginning ends and explains most of what is left over, if there is one. Where the
    /// first has not ended, the others stay as indications.
    fn fitted_anew(&self, tests: &mut Tests) -> Result<bool, IdentifyError> {
        let ended = self.end.fitted.estimate.is_solution();
        let excess = self.end.fitted.estimate.objective - self.end.fitted.estimate.residuals.len() as f64;
        let may_be = |n: &NamedError| ended || tests.named.iter().any(|o| o.name == n.name);
        let leading = tests.leading(WORTH * excess, ANEW, may_be);
        let before = self.end.fitted.estimate.objective;
        let all = self.noise * self.end.fitted.estimate.residuals.len() as f64;
        let mut found: Vec<Refit> = Vec::new();
        for candidate in &leading {
            match self.fit(candidate, tests, false)? {
                Tried::Fitted(fit) if fit.estimate.objective < all + EXPLAINS * (before - all) => found.push(*fit),
                _ => {}
            }
        }
        found.sort_by(|a, b| a.estimate.objective.total_cmp(&b.estimate.objective));
        if let Some(best) = found.first() {
            let least = best.estimate.objective;
            if ended {
                tests.explained = Some((best.line.drop / excess).min(1.0));
                tests.with_first = Some(self.left(best)?.0);
            } else if !explains(&best.estimate, self.noise) {
                tests.with_first = Some(State::Contradicted);
            }
            found.retain(|f| f.estimate.objective < least + CLOSE);
            tests.named = found.into_iter().map(|f| f.line).collect();
            return Ok(true);
        }
        if ended {
            return Ok(false);
        }
        // Each by itself: what linearisations that have not settled explain together says nothing.
        let alone = |n: &NamedError| tests.alone.iter().find(|a| a.name == n.name).cloned();
        tests.named = tests.named.iter().filter_map(alone).collect();
        tests.named.sort_by(|a, b| b.drop.total_cmp(&a.drop));
        tests.named.truncate(LEADING);
        Ok(false)
    }
    /// A fit with this error, from where the first has ended, if it has, or from where it began.
    fn fit(&self, candidate: &NamedError, tests: &Tests, from_end: bool) -> Result<Tried, IdentifyError> {
        let settled = from_end && self.end.fitted.estimate.is_solution();
        let most = if settled { MOST } else { MOST_ANEW.min(self.settings.max_iterations) };
        let mut settings = Settings { max_iterations: most, ..self.settings.clone() };
        let mut mounted = None;
        if candidate.name == EXTRA_MODE {
            // Priors are about the base as it is.
            if self.end.unknowns.has_priors() {
                return Ok(Tried::Impossible);
            }
            mounted = tests.extra.as_ref().and_then(|m| m.mounted(self.end, self.opened));
            if mounted.is_none() {
                return Ok(Tried::Impossible);
            }
        } else {
            settings.adopt.push(candidate.name.clone());
        }
        let opened = mounted.as_ref().map_or(self.opened, |m| &m.opened);
        let Ok(setup) = Setup::new(opened, self.records, &settings, self.options) else { return Ok(Tried::Impossible) };
        let (ended, selected) = self.start(&setup, mounted.as_ref());
        let start = if settled { ended } else { setup.unknowns.start.clone() };
        let Ok(mut made) = self.assemble(&setup, mounted.as_ref()) else { return Ok(Tried::Impossible) };
        let silent = Observer { progress: None, ..*self.watch };
        let mut watched = ObservedEstimator::new(&mut *made.whole, &silent);
        let priors = setup.unknowns.priors(&selected)?;
        // Biases and initial states too are where the first has ended: from rest and zero a fit of few linearisations does not come back to them.
        let before = &self.end.fitted.estimate.nuisance;
        let known = |u: &Unknown| before.iter().find(|p| p.name == u.name).map_or(0.0, |p| p.value);
        let nuisance: Option<Vec<f64>> = settled.then(|| watched.nuisance().iter().map(known).collect());
        let mut request = Request {
            coarse: !settled,
            nuisance: nuisance.as_deref(),
            start: &start,
            selected: &selected,
            priors,
            noise: self.noise,
            ..setup.request()?
        };
        request.settings.gain_tolerance = request.settings.gain_tolerance.max(SETTLED);
        let estimate = attempt(&request, &mut watched);
        if watched.stopped() {
            return Err(IdentifyError::Interrupted);
        }
        drop(watched);
        let Ok(estimate) = estimate else { return Ok(Tried::Impossible) };
        if !estimate.is_solution() {
            return Ok(Tried::NotEnded);
        }
        let mut line = candidate.clone();
        line.drop = self.end.fitted.estimate.objective - estimate.objective;
        (line.beside, line.refitted) = (false, true);
        if line.drop <= 0.0 {
            return Ok(Tried::Impossible);
        }
        let told = match (&mounted, tests.tried.iter().find(|h| h.name == candidate.name)) {
            (Some(m), _) => {
                line.freedom = m.freedom();
                m.describe(&estimate, &mut line)
            }
            (None, Some(h)) => match sizes(h, &estimate, self.end.labels) {
                Some(size) => {
                    (line.text, line.size) = (in_words(&h.words, &size), size);
                    true
                }
                None => false,
            },
            (None, None) => false,
        };
        if !told {
            return Ok(Tried::Impossible);
        }
        let taken = |name: &str| mounted.as_ref().map_or(0.0, |m| m.takes(name));
        let first = (&self.end.fitted.estimate, &self.end.fitted.selected[..]);
        if let Some((moves, by)) = moved(first, self.end.unknowns, &estimate, &taken) {
            (line.moves, line.moves_by) = (moves, by);
        }
        drop(made);
        Ok(Tried::Fitted(Box::new(Refit { line, mounted, settings, setup, estimate, selected })))
    }
    /// Where the first fit has ended, in the unknowns of another, and what is estimated.
    fn start(&self, setup: &Setup, mounted: Option<&Mounted>) -> (Vec<f64>, Vec<usize>) {
        let (before, unknowns) = (self.end.unknowns, &setup.unknowns);
        let ended = before.by_name(&self.end.fitted.estimate.values);
        let start = mounted.map_or_else(|| unknowns.at(&ended), |m| m.start(&ended, unknowns));
        // What was held in place of what the data do not tell stays held.
        let names = |of: &[usize]| -> Vec<&str> { of.iter().map(|&i| before.decls[i].name.as_str()).collect() };
        let (asked, kept) = (names(&before.selected), names(&self.end.fitted.selected));
        let stays = |i: &usize| {
            let name = unknowns.decls[*i].name.as_str();
            kept.contains(&name) || !asked.contains(&name)
        };
        (start, unknowns.selected.iter().copied().filter(stays).collect())
    }
    fn assemble<'b>(&'b self, setup: &'b Setup, mounted: Option<&'b Mounted>) -> Result<Assembled<'b>, IdentifyError> {
        match mounted {
            Some(m) => setup.assembly(&m.opened.model, self.records).assemble(&setup.uncertain),
            None => {
                let with = setup.assembly(&self.opened.model, self.records);
                with.again(&setup.uncertain, self.twins, self.end)
            }
        }
    }
    /// What the tests say at the end of a fit: the state, and the errors that explain what is left together.
    fn left(&self, fit: &Refit) -> Result<(State, Vec<NamedError>), IdentifyError> {
        let Assembled { twins, sigma, rows, .. } = self.assemble(&fit.setup, fit.mounted.as_ref())?;
        let model = fit.mounted.as_ref().map_or(&self.opened.model, |m| &m.opened.model);
        let signals = Signals::of_each(model, self.records, &rows, &fit.estimate.residuals, &sigma);
        let values = fit.setup.unknowns.expand(&fit.estimate.values)?;
        let fitted = Fitted::of(fit.estimate.clone(), &fit.selected);
        let end = Ended {
            model,
            shared: &fit.setup.shared,
            labels: &fit.setup.labels,
            unknowns: &fit.setup.unknowns,
            fitted: &fitted,
            values: &values,
            records: self.records,
            signals: &signals,
            loud: self.floor.is_loud(),
        };
        if !fitted.estimate.is_solution() {
            return Ok((State::NotTested, Vec::new()));
        }
        let tests = explain::tests(&end, &twins, &fit.settings)?;
        let heard = tests.as_ref().filter(|t| t.motion_noise > 0.0).map_or(&[][..], |t| &t.drawn);
        let whiteness = known::whiteness(self.records, &signals, &[], heard);
        let found = explain::evidence(tests.as_ref(), (&fitted.estimate, self.floor), &whiteness, true, &fit.settings);
        let mut behind = found.named;
        if let Some(alone) = behind.iter().skip(1).position(|n| !n.beside) {
            behind.truncate(1 + alone);
        }
        Ok((found.state, behind))
    }
}

/// Whether the rest of the unknowns, which went elsewhere, and not the error itself has lowered chi-squared: at the end of a fit an error of `z` deviations
/// lowers it by `z^2`.
fn falls_by_more_than_its_size(line: &NamedError) -> bool {
    let size: f64 = line.size.iter().map(|c| (c.value / c.std).powi(2)).sum();
    line.drop > ELSEWHERE * size + 2.0 * LOWER
}

/// The estimate that differs most from that of the `first` fit, of what is selected there, and by how many of its deviations; `taken` is
/// what another part of the robot has taken over of it.
pub(super) fn moved(
    (first, selected): (&Estimate, &[usize]),
    unknowns: &Unknowns,
    e: &Estimate,
    taken: &dyn Fn(&str) -> f64,
) -> Option<(String, f64)> {
    let asked = first.parameters.iter().zip(selected).filter(|(_, i)| unknowns.is_asked(**i));
    let by = asked.filter_map(|(p, _)| {
        let after = e.parameters.iter().find(|q| q.name == p.name)?;
        Some((p.name.clone(), (after.value + taken(&p.name) - p.value).abs() / p.std?))
    });
    by.max_by(|a, b| a.1.total_cmp(&b.1))
}

/// Components of an error as a fit has found them; `None` where it does not determine one of them. What every record has for itself is
/// their mean, each weighed by what it tells.
pub(super) fn sizes(h: &Hypothesis, e: &Estimate, labels: &[String]) -> Option<Vec<ErrorSize>> {
    let one = |c: &ident::uncertain::Component| {
        let name = match &c.of[..] {
            [(only, _)] => only,
            _ => &h.name,
        };
        let shared = e.parameters.iter().find(|p| p.name == *name).map(|p| (p.value - p.start, p.std));
        let own = e.nuisance.iter().filter(|p| is_called(&p.name, name, labels)).map(|p| (p.value, p.std));
        let (mut sum, mut weight) = (0.0, 0.0);
        for (value, std) in shared.into_iter().chain(own) {
            let w = std?.powi(-2);
            (sum, weight) = (sum + w * value, weight + w);
        }
        let known = weight > 0.0 && weight.is_finite();
        known.then(|| ErrorSize {
            name: c.name.clone(),
            unit: c.unit.clone(),
            value: sum / weight,
            std: weight.sqrt().recip(),
        })
    };
    h.components.iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_that_is_none_has_not_lowered_chi_squared_by_itself() {
        let error = |drop: f64, size: &[(f64, f64)]| NamedError {
            name: "tank.d[1]".into(),
            text: String::new(),
            size: size
                .iter()
                .map(|&(value, std)| ErrorSize { name: "d".into(), unit: "N m s/rad".into(), value, std })
                .collect(),
            drop,
            freedom: size.len(),
            p: 0.0,
            moves: "tank.k[1]".into(),
            moves_by: 342.4,
            beside: false,
            alike: Vec::new(),
            refitted: true,
            mission: String::new(),
        };
        // Of a record whose fit had ended with a spring a third too soft.
        assert!(falls_by_more_than_its_size(&error(135_414.0, &[(-0.0018, 0.01)])));
        assert!(falls_by_more_than_its_size(&error(900.0, &[(0.07, 0.27), (-0.0016, 0.0104)])));
        // Of one that is 30 deviations large, and of one that chance makes.
        assert!(!falls_by_more_than_its_size(&error(931.0, &[(0.3, 0.01)])));
        assert!(!falls_by_more_than_its_size(&error(14.0, &[(0.033, 0.01)])));
    }
}
