//! Minima beside the one where a fit has ended.
//!
//! The line of a weakly moved mode is not wider than `1/T`, T the length of the record, and the noise has a peak in every `1/T`. Where the mode
//! hardly stands out of the noise, the cost has a minimum at each of several peaks, all within a few units of chi-squared, and the
//! curvature at one of them says nothing of the others. That is so where a frequency has a deviation of more than about a twentieth of
//! `1/T` (docs/theory/output-error.md). Mirrored hinges that are nearly alike have, besides, a minimum with the two exchanged, or what
//! goes with them.
//!
//! At the end of a fit such places are looked at by residuals alone, with all other unknowns moved by one linearisation (a chord); those
//! that come near the cost of the end are fitted. The lowest counts, and where others explain the record as well, deviations cover
//! them all ([`super::mixture`]). Where the cost rises on neither side to what chance does not reach, the mode stands out of the noise nowhere, and
//! deviations cover all frequencies that are left ([`super::unresolved`]).

use super::chord::{Chord, Place};
use super::elsewhere::{Subject, frequencies, own_mode};
use super::ends::{explains, from_the_start, is_spring, keeps_rows, owner};
use super::findings::{Alternative, Minima};
use super::lost::{given_life, has_vanished};
use super::mixture;
use super::observed_estimator::ObservedEstimator;
use super::unresolved::Unresolved;
use ff_least_squares::Settings as Solver;
use ff_model::ParamGroup;
use ident::estimate::{Estimate, attempt};
use ident::{Loss, Request, Uncertainty};
use nalgebra::DMatrix;

/// Deviation of a frequency, in widths `1/T` of a line, from which there may be several minima. At a peak of the noise, where damping vanishes,
/// it is less than at the mode itself.
const UNRESOLVED: f64 = 0.05;
/// Distance of the places that are looked at, in widths of a line.
const STEP: f64 = 0.7;
/// How many there are on either side, and by which factor the distance of others grows, up to [`FOLLOW`] times the frequency, where none of these
/// shows the mode.
const REACH: i32 = 12;
const FURTHER: f64 = 1.5;
/// Chi-squared above the end up to which a place is fitted: looked at by a chord, it is more than at its minimum.
const NEAR: f64 = 16.0;
/// Places in a row, each beyond [`NEAR`], from which on none is looked at any further out: the mode stands out of the noise there.
const OUT: usize = 3;
/// Chi-squared that must lie between the end and a place for there to be a minimum of its own: over less, the posterior between the two is
/// more than half of what it is there, and they are one.
const BARRIER: f64 = 1.2;
/// How much lower than the end a place is worth a fit without one.
const LOWER: f64 = 0.3;
/// Change of chi-squared from place to place below which nothing is seen of a mode, and how many such places in a row end the looks.
const FLAT: f64 = 0.02;
const SEEN: usize = 4;
/// Places on either side that are looked at at once.
const AT_ONCE: usize = 4;
/// Fits of each spring.
const TRIES: usize = 2;
/// Chi-squared above the best up to which a minimum counts beside it: exceeded by chance in one of a hundred.
pub(super) const BESIDE: f64 = 9.2;
/// Linearisations after which a fit must have come within [`NEAR`] of the best, and most of them.
const SHOWN: usize = 3;
const MOST: usize = 12;
/// Promised reduction of chi-squared at which they are at their end: they are compared with [`BESIDE`].
const SETTLED: f64 = 0.1;
/// Times the work of predictions that other ends may ask for: where a mode runs away beyond, there is no end, and every look afterwards would take
/// that long.
pub(super) const ASIDE: usize = 4;
/// Linearisations of all of them, a prediction without derivatives counting as [`LOOK`].
const BUDGET: f64 = 45.0;
/// See [`BUDGET`].
const LOOK: f64 = 1.0 / 6.0;
/// From how many ends places are looked at.
const ROUNDS: usize = 2;
/// Deviations within which two ends are one.
const SAME: f64 = 0.5;
/// Ratio of dampers, masses and lengths within which two starts are one.
const ONE_START: f64 = 2.0;
/// Ratio of two stiffnesses up to which an exchange is tried.
const ALIKE: f64 = 2.0;
/// Most by which springs follow another.
const FOLLOW: f64 = 3.0;

/// Where a search for other minima has ended.
pub(super) struct Ending {
    /// The lowest minimum, with deviations that cover the others.
    pub(super) estimate: Estimate,
    /// All of them; absent where there is one.
    pub(super) minima: Option<Minima>,
    /// Covariance about the lowest alone, where there are others.
    pub(super) alone: Option<Uncertainty>,
}

impl Ending {
    fn single(estimate: Estimate) -> Self {
        Self { estimate, minima: None, alone: None }
    }
    /// Puts a covariance that allows for more in place of that of the estimate; the one about the lowest minimum alone is kept as it was.
    pub(super) fn widened(&mut self, covariance: DMatrix<f64>) {
        self.alone.get_or_insert_with(|| self.estimate.uncertainty.clone());
        mixture::widen(&mut self.estimate, covariance);
    }
}

/// Whether a fit has ended at what explains its data, in squares, with rows few enough to be kept: there is sense in looking around it.
pub(super) fn answers(request: &Request<'_>, e: &Estimate) -> bool {
    request.loss == Loss::Squares && keeps_rows(request, e) && e.is_solution() && explains(e, request.noise)
}

/// The fit, or a lower minimum beside it; with deviations that cover the others where the record does not choose, and a list of them.
pub(super) fn best_valley(
    request: &Request<'_>,
    first: Estimate,
    of: &Subject<'_>,
    estimator: &mut ObservedEstimator<'_>,
) -> Ending {
    if !answers(request, &first) {
        return Ending::single(first);
    }
    let mut search = estimator.around(
        request,
        &first,
        |i| !of.unknowns.is_asked(i),
        |near, beyond| {
            let mut search = Search {
                request,
                of,
                ends: vec![Estimate { objective: first.objective - beyond, ..first.clone() }],
                best: 0,
                used: 0,
                looks: 0,
                tried: 1,
                followed: Vec::new(),
                unresolved: Vec::new(),
            };
            search.run(near);
            search.ends.iter_mut().for_each(|e| e.objective += beyond);
            search
        },
    );
    search.settle(estimator);
    search.outcome()
}

/// A spring that is estimated.
#[derive(Clone, Debug)]
struct Spring {
    /// Among the unknowns, and among those selected.
    index: usize,
    column: usize,
    /// Frequency of the mode that it moves most (Hz).
    hz: f64,
    /// Whether that is not resolved.
    open: bool,
}

struct Search<'s> {
    request: &'s Request<'s>,
    of: &'s Subject<'s>,
    /// Minima, the first being that of the fit.
    ends: Vec<Estimate>,
    best: usize,
    /// Linearisations beside those of the first.
    used: usize,
    /// Predictions without derivatives.
    looks: usize,
    /// Fits, the first included.
    tried: usize,
    /// Where they began, but for the first.
    followed: Vec<Vec<f64>>,
    /// Modes of the best that do not stand out of the noise.
    unresolved: Vec<Unresolved>,
}

impl Search<'_> {
    fn run(&mut self, estimator: &mut ObservedEstimator<'_>) {
        for _ in 0..ROUNDS {
            let from = self.best;
            let Some((springs, places)) = self.places() else { return };
            let Some(mut starts) = self.looked_at(&places, estimator) else { return };
            starts.sort_by(|a, b| a.0.total_cmp(&b.0));
            for (_, start) in starts {
                if self.spent() >= BUDGET || estimator.stopped() {
                    return;
                }
                if !self.known(&springs, &start) {
                    self.follow(&start, estimator);
                    self.followed.push(start);
                }
            }
            if self.best == from {
                return;
            }
        }
        self.unresolved.clear();
    }
    fn spent(&self) -> f64 {
        self.used as f64 + LOOK * self.looks as f64
    }
    /// The best of other ends with all data, as near its minimum as the fit itself. Where that does not end, or is no better after all, the fit
    /// stays.
    fn settle(&mut self, estimator: &mut ObservedEstimator<'_>) {
        if self.best == 0 {
            return;
        }
        let other = std::mem::take(&mut self.best);
        let start = self.ends[other].values.clone();
        let centre = Some(self.request.centre.unwrap_or(self.request.start));
        let Ok(e) = attempt(
            &Request { start: &start, centre, coarse: false, led: true, finer: ASIDE, ..self.request.clone() },
            estimator,
        ) else {
            return;
        };
        self.used += e.iterations;
        if !e.is_solution() {
            return;
        }
        if one_end(&self.ends[0], &e) {
            self.ends.remove(other);
            self.unresolved.clear();
            return;
        }
        self.best = if e.objective < self.ends[0].objective { other } else { 0 };
        if self.best == 0 {
            self.unresolved.clear();
        }
        self.ends[other] = e;
    }
    /// Springs, and the places to look at, those of one spring together; `None` where there are none.
    fn places(&self) -> Option<(Vec<Spring>, Vec<Vec<Place>>)> {
        let springs = self.springs()?;
        let mut places: Vec<Vec<Place>> = springs.iter().filter(|s| s.open).map(|s| self.along(s, &springs)).collect();
        places.extend(self.exchanges(&springs).into_iter().map(|p| vec![p]));
        places.retain(|p| !p.is_empty());
        (!places.is_empty()).then_some((springs, places))
    }
    fn springs(&self) -> Option<Vec<Spring>> {
        let (e, request) = (&self.ends[self.best], self.request);
        let seconds = self.of.records.iter().map(|r| r.record.seconds()).fold(0.0, f64::max);
        let columns: Vec<usize> =
            (0..request.selected.len()).filter(|&k| is_spring(request, request.selected[k])).collect();
        let here = if columns.is_empty() { None } else { frequencies(self.of, &e.values) }?;
        let one = |column: usize| {
            let index = request.selected[column];
            let std = e.parameters[column].std?;
            let hz = here[own_mode(self.of, &e.values, &here, index)?];
            // A mode without damping rings through the whole record, which sharpens its line beyond what the record tells.
            let open =
                self.gone(e, index) || 0.5 * hz * std / e.values[index].max(f64::MIN_POSITIVE) * seconds > UNRESOLVED;
            Some(Spring { index, column, hz, open })
        };
        Some(columns.into_iter().filter_map(one).collect())
    }
    /// Whether a damping, mass or spring of the same appendage as a spring has vanished.
    fn gone(&self, e: &Estimate, spring: usize) -> bool {
        let (request, owner) = (self.request, |i: usize| owner(&self.request.decls[i].name));
        request.selected.iter().any(|&i| owner(i) == owner(spring) && has_vanished(request, e, i))
    }
    /// Places at which the mode of a spring is some widths of a line away. The other springs follow: compliances of springs in a row add,
    /// and so follow one another in proportion while a mode that the record tells stays where it is.
    fn along(&self, s: &Spring, springs: &[Spring]) -> Vec<Place> {
        let e = &self.ends[self.best];
        let (c, k) = (&e.uncertainty.covariance, e.values[s.index]);
        let seconds = self.of.records.iter().map(|r| r.record.seconds()).fold(0.0, f64::max);
        let whole = given_life(self.request, e);
        let gone = self.gone(e, s.index);
        let one = |n: i32| {
            let hz = s.hz + f64::from(n) * STEP / seconds;
            if (n == 0 && !gone) || hz < s.hz / FOLLOW || hz > s.hz * FOLLOW {
                return None;
            }
            let mut at = whole.clone();
            at[s.index] = k * (hz / s.hz).powi(2);
            let softer = 1.0 / at[s.index] - 1.0 / k;
            for o in springs.iter().filter(|o| o.index != s.index) {
                let own = e.values[o.index];
                let slope = c[(o.column, s.column)] / c[(s.column, s.column)] * (k / own).powi(2);
                let compliance = 1.0 / own + slope * softer;
                if compliance > 0.0 {
                    at[o.index] = (1.0 / compliance).clamp(own / FOLLOW, own * FOLLOW);
                }
            }
            Some(Place { at, fixed: vec![s.column], steps: n })
        };
        distances(s.hz * seconds).into_iter().filter_map(one).collect()
    }
    /// Places with springs of equal name of two appendages exchanged, and what else bears their number; one by one, and all.
    fn exchanges(&self, springs: &[Spring]) -> Vec<Place> {
        let (e, request) = (&self.ends[self.best], self.request);
        let name = |i: usize| request.decls[i].name.split_once('.');
        let number = |local: &str| local.find('[').map(|at| local[at..].to_owned());
        let mut out: Vec<Place> = Vec::new();
        for (n, a) in springs.iter().enumerate() {
            for b in &springs[n + 1..] {
                let (Some((of_a, local)), Some((of_b, other))) = (name(a.index), name(b.index)) else { continue };
                let (x, y) = (e.values[a.index], e.values[b.index]);
                if of_a == of_b || local != other || !(1.0 / ALIKE..ALIKE).contains(&(x / y)) {
                    continue;
                }
                // Springs may be equal where what goes with them is not: a mode without damping is one more minimum for each of two hinges.
                let apart = |a: usize, b: usize| {
                    let least = [a, b].iter().filter_map(|&k| e.parameters[k].std).fold(f64::INFINITY, f64::min);
                    (e.parameters[a].value - e.parameters[b].value).abs() > 2.0 * SAME * least
                };
                // One pair alone, then everything of the two.
                for alone in [true, false] {
                    let mut at = e.values.clone();
                    let (mut fixed, mut differs) = (Vec::new(), false);
                    for (column, &i) in request.selected.iter().enumerate() {
                        let Some((owner, own)) = name(i).filter(|_| request.decls[i].group == ParamGroup::Positive)
                        else {
                            continue;
                        };
                        if owner != of_a || (alone && number(own) != number(local)) {
                            continue;
                        }
                        let twin = request.selected.iter().position(|&j| name(j) == Some((of_b, own)));
                        if let Some(twin) = twin {
                            at.swap(i, request.selected[twin]);
                            fixed.extend([column, twin]);
                            differs |= apart(column, twin);
                        }
                    }
                    if differs && out.iter().all(|o| o.at != at) {
                        out.push(Place { at, fixed, steps: 0 });
                    }
                }
            }
        }
        out
    }
    /// Starts for fits: of every group the places whose cost is a minimum along it and near that of the best, with that cost.
    fn looked_at(
        &mut self,
        groups: &[Vec<Place>],
        estimator: &mut ObservedEstimator<'_>,
    ) -> Option<Vec<(f64, Vec<f64>)>> {
        self.used += 1;
        let mut looks = 0;
        self.unresolved.clear();
        let best = &self.ends[self.best];
        let chord = Chord::new(self.request, best, estimator)?;
        let limit = best.objective + NEAR;
        let mut out = Vec::new();
        for group in groups {
            let mut seen: Vec<(f64, Vec<f64>)> = group.iter().map(|p| (f64::INFINITY, p.at.clone())).collect();
            let mut apart = vec![false; group.len()];
            let middle = group.partition_point(|p| p.steps < 0);
            // Where the group has a place for the end itself, something has come to life there, and nothing is known of the way to it.
            let alive = group.get(middle).is_some_and(|p| p.steps == 0);
            let from = if alive { f64::INFINITY } else { best.objective };
            let mut sides = [
                Side::new(best.objective, from, (0..middle).rev().collect()),
                Side::new(best.objective, from, (middle..group.len()).collect()),
            ];
            while sides.iter().any(|s| !s.left.is_empty()) {
                let next: Vec<usize> = sides.iter().flat_map(|s| s.left.iter().take(AT_ONCE).copied()).collect();
                looks += next.len();
                let places: Vec<&Place> = next.iter().map(|&k| &group[k]).collect();
                for (k, found) in next.into_iter().zip(chord.looks(self.request, best, &places, estimator)) {
                    if let Some(found) = found {
                        seen[k] = found;
                    }
                }
                for side in &mut sides {
                    side.judge(&seen, limit, |k| apart[k] = true);
                }
            }
            let cost = |k: usize| seen.get(k).map_or(f64::INFINITY, |s| s.0);
            let lowest = |k: usize| cost(k) <= cost(k + 1) && (k == 0 || cost(k) <= cost(k - 1));
            let counts = |k: &usize| cost(*k) < limit && apart[*k] && lowest(*k);
            let mut found: Vec<(f64, Vec<f64>)> = (0..seen.len()).filter(counts).map(|k| seen[k].clone()).collect();
            found.sort_by(|a, b| a.0.total_cmp(&b.0));
            found.truncate(TRIES);
            out.extend(found);
            for side in &sides {
                side.alike.iter().for_each(|&k| seen[k].0 = side.before);
            }
            if let ([column], false) = (&group[0].fixed[..], sides.iter().all(|s| s.closed)) {
                self.unresolved.push(Unresolved::new(self.request, best, *column, seen));
            }
        }
        self.looks += looks;
        Some(out)
    }
    /// Whether a start lies within half the width of a line of an end, in every spring that is open, or so near an earlier start and has
    /// the same dampers, masses and lengths.
    fn known(&self, springs: &[Spring], start: &[f64]) -> bool {
        let (seconds, request) = (self.of.records.iter().map(|r| r.record.seconds()).fold(0.0, f64::max), self.request);
        let springs_near = |values: &[f64]| {
            springs.iter().all(|s| {
                let width = if s.open { 1.0 / (s.hz * seconds) } else { 2.0 * SAME * self.relative(s) };
                (start[s.index] / values[s.index]).ln().abs() <= width
            })
        };
        // Where something has vanished, the same springs with it are another place.
        let near = |e: &Estimate| springs_near(&e.values) && !springs.iter().any(|s| self.gone(e, s.index));
        let positive = |i: &&usize| request.decls[**i].group == ParamGroup::Positive;
        let alike = |from: &Vec<f64>| {
            let one = |&i: &usize| (start[i] / from[i]).ln().abs() <= ONE_START.ln();
            springs_near(from) && request.selected.iter().filter(positive).all(one)
        };
        self.ends.iter().any(near) || self.followed.iter().any(alike)
    }
    /// Relative deviation of a spring.
    fn relative(&self, s: &Spring) -> f64 {
        let e = &self.ends[self.best];
        e.parameters[s.column].std.map_or(1.0, |std| std / e.values[s.index].abs().max(f64::MIN_POSITIVE))
    }
    /// Fits from a start as long as it comes near the best.
    fn follow(&mut self, start: &[f64], estimator: &mut ObservedEstimator<'_>) {
        let mut from = start.to_vec();
        self.tried += 1;
        for most in [SHOWN, MOST] {
            let gain_tolerance = self.request.settings.gain_tolerance.max(SETTLED);
            let settings = Solver { max_iterations: most, gain_tolerance, ..self.request.settings.clone() };
            let centre = Some(self.request.centre.unwrap_or(self.request.start));
            let tried = Request { start: &from, centre, coarse: false, finer: ASIDE, settings, ..self.request.clone() };
            let Ok(e) = attempt(&tried, estimator) else { return };
            self.used += e.iterations;
            if e.is_solution() {
                self.arrived(e);
                return;
            }
            if e.objective > self.ends[self.best].objective + NEAR {
                return;
            }
            from = e.values;
        }
    }
    fn arrived(&mut self, e: Estimate) {
        match self.ends.iter().position(|o| one_end(o, &e)) {
            // The fit itself has ended there with all data.
            Some(0) => {}
            Some(k) if e.objective < self.ends[k].objective => self.ends[k] = e,
            Some(_) => {}
            None => self.ends.push(e),
        }
        let objective = |k: &usize| self.ends[*k].objective;
        self.best = (0..self.ends.len()).min_by(|a, b| objective(a).total_cmp(&objective(b))).unwrap_or_default();
    }
    fn outcome(mut self) -> Ending {
        let (iterations, descent) = (self.ends[0].iterations + self.used, self.ends[0].descent.clone());
        let mut best = self.ends.swap_remove(self.best);
        let moved = self.best != 0;
        self.ends.retain(|e| e.objective < best.objective + BESIDE);
        self.ends.sort_by(|a, b| a.objective.total_cmp(&b.objective));
        best.iterations = iterations;
        if moved {
            best.descent.splice(0..0, descent);
        }
        from_the_start(&mut best, self.request);
        if self.ends.is_empty() {
            let mut ending = Ending::single(best);
            covered(&mut ending, &self.unresolved);
            return ending;
        }
        let asked = |k: usize| self.of.unknowns.is_asked(self.request.selected[k]);
        let alternatives = Alternative::all(&best, &self.ends, asked);
        let objectives = std::iter::once(&best).chain(&self.ends).map(|e| e.objective).collect();
        let alone = mixture::cover(&mut best, &self.ends);
        let minima = Minima { starts: self.tried, converged: 1 + self.ends.len(), objectives, alternatives };
        let mut ending = Ending { estimate: best, minima: Some(minima), alone };
        covered(&mut ending, &self.unresolved);
        ending
    }
}

/// Makes deviations cover modes that stand out nowhere.
fn covered(ending: &mut Ending, unresolved: &[Unresolved]) {
    for u in unresolved {
        if let Some(covariance) = u.cover(&ending.estimate) {
            ending.widened(covariance);
        }
    }
}

/// Distances of places from the end of a fit, ascending, for a mode that swings so often in the record.
fn distances(periods: f64) -> Vec<i32> {
    let mut out: Vec<i32> = (1..=REACH).collect();
    let mut next = f64::from(REACH) * FURTHER;
    while next * STEP < (FOLLOW - 1.0) * periods {
        out.push(next as i32);
        next *= FURTHER;
    }
    out.iter().rev().map(|n| -n).chain([0]).chain(out.iter().copied()).collect()
}

/// Places on one side of the end of a fit, looked at from there outwards.
struct Side {
    /// Those to come.
    left: Vec<usize>,
    /// Cost of the end, of the place before, and the highest between them.
    end: f64,
    before: f64,
    highest: f64,
    /// How many in a row lay beyond the limit, and differed by nothing.
    beyond: usize,
    flat: usize,
    /// Whether what lies further out is beyond the limit, and what is as the last that was looked at.
    closed: bool,
    alike: Vec<usize>,
}

impl Side {
    fn new(end: f64, highest: f64, left: Vec<usize>) -> Self {
        Self { left, end, before: end, highest, beyond: 0, flat: 0, closed: false, alike: Vec::new() }
    }
    /// Goes through the next places, of which `seen` has the costs; those that are no part of the valley of the end are told to `apart`.
    fn judge(&mut self, seen: &[(f64, Vec<f64>)], limit: f64, mut apart: impl FnMut(usize)) {
        let next = AT_ONCE.min(self.left.len());
        for k in self.left.drain(..next).collect::<Vec<_>>() {
            let cost = seen[k].0;
            if cost < self.highest - BARRIER || cost < self.end - LOWER {
                apart(k);
            }
            self.beyond = if cost < limit { 0 } else { self.beyond + 1 };
            self.flat = if (cost - self.before).abs() < FLAT { self.flat + 1 } else { 0 };
            (self.before, self.highest) = (cost, self.highest.max(cost));
            if self.beyond == OUT || self.flat == SEEN {
                self.closed = self.beyond == OUT;
                let rest = std::mem::take(&mut self.left);
                self.alike = if self.closed { Vec::new() } else { rest };
                return;
            }
        }
    }
}

/// Whether two ends are one within [`SAME`] deviations.
fn one_end(a: &Estimate, b: &Estimate) -> bool {
    let one = |(a, b): (&ident::Estimated, &ident::Estimated)| match (a.std, b.std) {
        (Some(s), Some(t)) => (a.value - b.value).abs() <= SAME * s.min(t),
        _ => true,
    };
    a.parameters.iter().zip(&b.parameters).all(one)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_reach_to_a_third_and_to_three_times_the_frequency() {
        // Of 71 periods in the record, a third are left 68 widths of 0.7 lines below, and three times as many are 203 above.
        let all = distances(71.0);
        assert!(all.windows(2).all(|w| w[0] < w[1]) && all.contains(&0), "{all:?}");
        let last = *all.last().unwrap();
        assert!((203 / 2..=203).contains(&last) && all[0] == -last, "{all:?}");
        assert_eq!(distances(2.0).last(), Some(&REACH));
    }

    #[test]
    fn a_side_is_closed_where_chance_does_not_reach() {
        let side = |costs: &[f64]| {
            let seen: Vec<(f64, Vec<f64>)> = costs.iter().map(|c| (*c, Vec::new())).collect();
            let mut side = Side::new(100.0, 100.0, (0..costs.len()).collect());
            while !side.left.is_empty() {
                side.judge(&seen, 116.0, |_| {});
            }
            (side.closed, side.alike)
        };
        assert_eq!(side(&[103.0, 118.0, 121.0, 117.0, 104.0]), (true, Vec::new()));
        assert_eq!(side(&[103.0, 109.0, 121.0, 108.0, 110.0]), (false, Vec::new()));
        // Nothing is seen of a mode out there.
        let flat = [103.0, 108.0, 108.001, 108.002, 108.0, 108.0, 108.01, 108.0, f64::INFINITY, f64::INFINITY];
        assert_eq!(side(&flat), (false, vec![8, 9]));
    }
}
