//! The way down: linearisations with coordinates taken anew at each, until one of the ends is reached.

use crate::estimate::estimator::Estimator;
use crate::estimate::fit::{Evaluated, Fit, Reference};
use crate::estimate::outcome::{EstimateError, Linearisation};
use crate::estimate::request::Request;
use crate::parameters::scale;
use crate::parameters::springs::springs_in_rows;
use crate::parameters::transform::{Transform, TransformError};
use ff_least_squares::{Criterion, Iterate, LmError, Scale, Settings, Solution, Status, minimise_linearised};
use ff_model::{ParamDecl, ParamGroup};

/// Longest step in affine coordinates. Coordinates are taken anew around every estimate, so that a step below 1
/// always leads to physical values, and a body close to the boundary is approached, never crossed.
const RADIUS: f64 = 0.5;
/// Steps of full length in a row that gain next to nothing, after which a fit is at the end of a flat direction or at the edge of
/// what is physical. What is next to nothing: so many times [`Settings::gain_tolerance`].
const FLAT_STEPS: usize = 3;
/// See [`FLAT_STEPS`].
const FLAT_GAIN: f64 = 10.0;
/// Steps in a row of any length that gain next to nothing, each of them, after which a fit is at the end of a flat direction, too: what they
/// promise, and do not keep, it never reaches.
const CREEPS: usize = 20;
/// Relative physical change of such a step below which a body presses against the edge: steps are measured by what is left of it.
const EDGE_MOVED: f64 = 0.05;
/// Trust radius below which the last part of a fit goes on in the metric of the data, and relative promised reduction up to which it is
/// the last part. Two modes of nearly one frequency bend a valley within a hundredth of its parameters, and steps that are as short in all
/// directions creep along it; measured by what each parameter changes in the data, steps follow it.
const CREEPING: f64 = 0.05;
/// See [`CREEPING`].
const LAST_PART: f64 = 1e-2;
/// First trust radius in the metric of the data: whitened residuals that the parameters, each by itself, would change.
const DATA_RADIUS: f64 = 10.0;
/// Gain of a step after which the next may be twice as long.
const TRUSTED: f64 = 0.75;
/// Part of a positive parameter that a step leaves of it at least.
const LEAST_PART: f64 = 0.1;
/// Factor on the start of a positive parameter that a pass over less data keeps it within. Where oscillations have slipped, a spring or
/// a damper that vanishes, or stiffens a thousandfold, explains more than one that is near the truth, and steps do not lead back.
pub(super) const RANGE: f64 = 30.0;
/// Chi-squared that a step promises from which on the end is near, and part of chi-squared per row that residuals must have there, so that
/// it is noise that is left: without noise, steps double their digits.
const NEAR_END: f64 = 100.0;
/// See [`Way::near_end`].
const HOPS: usize = 6;
/// See [`NEAR_END`].
const NOISE: f64 = 0.25;
/// A step near the end that promises more than this part of what the one before promised is one of a fit that creeps. Steps of others promise
/// the square of it, and need no other means.
const SLOW: f64 = 0.1;
/// Chi-squared that a fit that creeps has left to gain when it is at its end, if each step promises the same part of what the one before did: a
/// tenth of a standard deviation, or what the settings of the fit ask for, if that is more.
const REST: f64 = 1e-2;
/// Part of its start below which a positive parameter is at its bound, zero.
const EDGE_VALUE: f64 = 1e-3;

/// Linearisations over which a fit that may be given up ([`Request::give_up`]) must take this part of what its cost lies above noise, where noise
/// is, in deviations of chi-squared ([`Way::above`]), and mean squared residual up to which that counts: on the way from afar a fit may creep for
/// long and find its valley after all.
const WINDOW: usize = 10;
pub(super) const WORTH: f64 = 0.05;
/// [`Way::above`] of a fit to all data, and of one to less: a short part that is not quite explained may still lead on.
const ABOVE_NOISE: f64 = 5.0;
/// See [`ABOVE_NOISE`].
const ABOVE_NOISE_OF_LESS: f64 = 10.0;
const NEARLY: f64 = 1.5;
/// The same below which any fit is at the end of a flat direction: where so much is not explained, deviations do not ask for more.
const WORTHLESS: f64 = 1e-3;
/// Linearisations in which a fit that may be given up is stuck, the same part below which it is, and that however far from noise.
const STUCK_IN: usize = 4;
const STUCK: (f64, f64) = (1e-2, 1e-3);
/// How much faster than over its last few linearisations a fit may fall in those that are left to it ([`Request::to_beat`]). One that found its
/// valley late was seen to fall four times as fast then.
const FASTER: f64 = 5.0;

/// Where a fit is: all parameters, nuisance unknowns over their sizes, the linearisations it took, and those that led here.
#[derive(Clone)]
pub(super) struct Place {
    pub(super) full: Vec<f64>,
    pub(super) nuisance: Vec<f64>,
    pub(super) iterations: usize,
    pub(super) descent: Vec<Linearisation>,
    /// Whether its last pass was ended because it crept, far above noise.
    pub(super) crept: bool,
}

/// How a way down goes.
pub(super) struct Way<'w> {
    /// An anchor has no more to give when a step moves less; infinite for a pass over less data.
    pub(super) still: f64,
    /// Factor on the start of a positive parameter that steps keep it within: [`RANGE`] for a pass over less data.
    pub(super) range: f64,
    /// Cost of all data less that of these, where fewer of them have the cost of all, and what noise alone leaves of all rows
    /// ([`Request::noise_of`]).
    pub(super) all: (f64, f64),
    /// Deviations of chi-squared above noise from which it counts that a fit creeps.
    pub(super) above: f64,
    /// Objective that it must get below to be of use ([`Request::to_beat`]).
    pub(super) to_beat: Option<f64>,
    /// The same where oscillations may have slipped by periods: in the right valley an objective falls by a factor each time ([`is_lost`]).
    pub(super) to_reach: Option<f64>,
    /// Called near the end ([`NEAR_END`]) where steps creep ([`SLOW`]), with the linearisation there; moves the place on by other means,
    /// and says whether that is worth doing again: [`HOPS`] times at most.
    pub(super) near_end: Option<&'w mut NearEnd<'w>>,
}

impl Way<'_> {
    /// Of a pass over less data, which goes wherever it leads.
    pub(super) fn over_less(all: (f64, f64)) -> Self {
        let range = f64::INFINITY;
        let above = ABOVE_NOISE_OF_LESS;
        Self { still: f64::INFINITY, range, all, above, to_beat: None, to_reach: None, near_end: None }
    }
}

/// [`Way::above`] of a fit by what it is asked for: one that is tried beside another goes over less data.
pub(super) fn above(request: &Request<'_>) -> f64 {
    if request.to_beat.is_some() { ABOVE_NOISE_OF_LESS } else { ABOVE_NOISE }
}

/// See [`Way::near_end`].
pub(super) type NearEnd<'w> =
    dyn FnMut(&mut dyn Estimator, &mut Vec<Reference>, &mut Place, &mut Evaluated) -> bool + 'w;

/// Minimises from `place` on, with the coordinates taken anew at every step, and leaves it at the end. `references` are those of priors;
/// an anchor is added and taken out again.
pub(super) fn settle(
    request: &Request<'_>,
    mut estimator: &mut dyn Estimator,
    sizes: &[f64],
    references: &mut Vec<Reference>,
    place: &mut Place,
    evaluated: &mut Evaluated,
    mut way: Way<'_>,
) -> Result<(Transform, Status), EstimateError> {
    let (n, priors_kept) = (request.selected.len(), references.len());
    // The limit is that of a pass: cheap linearisations of thinner records do not use up those of all data.
    let mut limit = place.iterations + request.settings.max_iterations;
    let mut settings = Settings {
        scale: Scale::Unit,
        initial_radius: RADIUS,
        max_radius: RADIUS,
        max_iterations: 1,
        acceleration: true,
        // A chord is for those who have the rows at hand: without them it costs as much as a linearisation.
        chord: !evaluated.folds(),
        ..request.settings.clone()
    };
    let rows = estimator.rows();
    let begun = place.descent.len();
    place.crept = false;
    let in_rows = springs_in_rows(request.decls, request.selected);
    let mut last = None;
    let (mut by_data, mut hops, mut promised) = (true, HOPS, None);
    let (mut flat_steps, mut creeps, mut crept_from) = (0, 0, place.full.clone());
    let end = loop {
        // Coordinates around the present estimate: linear in the bodies, scaled by them.
        let transform = match (Transform::affine(request.decls, request.selected, &place.full), last.take()) {
            (Ok(t), _) => t.scaled_at_least(request.start).reciprocal(&in_rows, &place.full),
            // The fit has pressed a body against the boundary of what is physical: that is the answer.
            (Err(TransformError::Boundary { .. }), Some(t)) => {
                break (t, Status::AtBound { at: Vec::new(), by: Criterion::Step });
            }
            (Err(e), _) => return Err(e.into()),
        };
        references.truncate(priors_kept);
        if let Some(w) = request.anchor {
            references.push(Reference::new(request.decls, request.selected, &place.full, w)?);
        }
        let mut x = transform.coordinates(&place.full)?;
        let start = transform.coordinates(request.start)?;
        settings.bounds = positive_bounds(&transform, &x, &start, way.range, sizes.len());
        x.extend_from_slice(&place.nuisance);
        let full = place.full.clone();
        let mut fit = Fit::new(request, &mut estimator, &transform, references, sizes, (&x, &full), evaluated);
        let solution = match minimise_linearised(&mut fit, &x, &settings) {
            // Steps in the metric of the data may lead beyond what can exist, however much they are shortened; those in affine coordinates
            // do not.
            Err(LmError::NonFiniteResidual { attempts, .. }) if attempts > 1 && settings.scale != Scale::Unit => {
                place.iterations += 1;
                by_data = false;
                (settings.scale, settings.initial_radius, settings.max_radius) = (Scale::Unit, RADIUS, RADIUS);
                last = Some(transform);
                continue;
            }
            found => found?,
        };
        place.iterations += solution.iterations;
        let cost = solution.history.first().map_or(solution.cost, |step| step.cost);
        place.descent.push(Linearisation { objective: 2.0 * cost, residuals: rows });
        next_radius(&mut settings, &solution, by_data);
        place.nuisance.copy_from_slice(&solution.x[n..]);
        if solution.x[..n] != x[..n] {
            transform.apply(&solution.x[..n], &mut place.full);
        }
        let moved = solution.x.iter().zip(&x).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let settled = solution.status.is_converged() && (request.anchor.is_none() || moved < way.still);
        let over = place.iterations >= limit;
        let emptied = emptied(request, &place.full);
        if !gains_nothing(&solution, &settings) {
            (creeps, crept_from) = (0, place.full.clone());
        } else {
            creeps += 1;
        }
        let flat = creeps > 0 && (is_full(&solution, &settings) || !emptied.is_empty());
        flat_steps = if flat { flat_steps + 1 } else { 0 };
        if (flat_steps == FLAT_STEPS || creeps == CREEPS) && !settled {
            let before = if flat_steps == FLAT_STEPS { &full } else { &crept_from };
            let status = flat_end(request, before, &place.full, emptied);
            break (transform, status);
        }
        if let Some(share) = gained_above_noise(&place.descent[begun..], way.all, way.above).filter(|_| !settled) {
            if share < WORTHLESS {
                break (transform, ended(Criterion::Flat, emptied));
            }
            if share < WORTH && request.give_up.is_some() {
                place.crept = true;
                break (transform, Status::IterationLimit);
            }
        }
        if !settled && request.give_up.is_some() && is_stuck(&place.descent[begun..], way.all, way.above) {
            place.crept = true;
            break (transform, Status::IterationLimit);
        }
        let left = limit.saturating_sub(place.iterations);
        let beaten = way.to_beat.is_some_and(|best| is_beaten(&place.descent[begun..], left, best));
        let lost = way.to_reach.is_some_and(|end| is_lost(&place.descent[begun..], left, end));
        if !settled && (beaten || lost) {
            break (transform, Status::IterationLimit);
        }
        // At the bounds of a pass over less data: nothing that may still move wants to.
        let held = solution.iterations == 0 && matches!(solution.status, Status::AtBound { .. });
        if settled || over || held || matches!(solution.status, Status::Stalled { .. }) {
            break (transform, solution.status);
        }
        let before = std::mem::replace(&mut promised, near_end(&solution));
        let slow = promised.zip(before).is_some_and(|(now, before)| now > SLOW * before);
        let rest = promised.zip(before).map_or(f64::INFINITY, |(now, before)| rest_of(now, before));
        if slow && request.settings.gain_tolerance > 0.0 && rest < REST.max(request.settings.gain_tolerance) {
            break (transform, ended(Criterion::Statistics, emptied));
        }
        if hops > 0
            && slow
            && let Some(hop) = &mut way.near_end
        {
            references.truncate(priors_kept);
            let before = place.iterations;
            let again = hop(&mut *estimator, &mut *references, &mut *place, &mut *evaluated);
            hops = if again { hops - 1 } else { 0 };
            limit += place.iterations - before;
        }
        last = Some(transform);
    };
    references.truncate(priors_kept);
    Ok(end)
}

/// What the last linearisations have gained, as part of what lies above noise; `None` where there are too few, noise alone is left, or far
/// more than that.
fn gained_above_noise(descent: &[Linearisation], all: (f64, f64), above: f64) -> Option<f64> {
    let (last, before) = (descent.last()?, &descent[descent.len().checked_sub(1 + WINDOW)?]);
    share_above_noise(before.objective - last.objective, last.objective + all.0, all.1, above)
}

/// Whether the last few linearisations have gained next to nothing of what lies above noise ([`STUCK`]).
fn is_stuck(descent: &[Linearisation], all: (f64, f64), above: f64) -> bool {
    let Some((last, gained)) = gained_last(descent) else { return false };
    let objective = last + all.0;
    let least = if is_near(objective, all.1) { STUCK.0 } else { STUCK.1 };
    above_noise(objective, all.1, above).is_some_and(|above| gained < least * above)
}

/// Whether the linearisations that are `left` will not lead below the objective `best`, unless they gain more than [`FASTER`] times as much
/// as the last few.
fn is_beaten(descent: &[Linearisation], left: usize, best: f64) -> bool {
    gained_last(descent).is_some_and(|(last, gained)| last - FASTER * gained / STUCK_IN as f64 * left as f64 > best)
}

/// Whether the linearisations that are `left` will not lead to the objective `end`, unless each takes as much of it off as [`FASTER`] of the
/// last few.
fn is_lost(descent: &[Linearisation], left: usize, end: f64) -> bool {
    let falls = |(last, gained): (f64, f64)| {
        let each = (last / (last + gained)).ln() / STUCK_IN as f64;
        last * (FASTER * each * left as f64).exp() > end
    };
    gained_last(descent).is_some_and(falls)
}

/// The objective, and what the last few linearisations have gained ([`STUCK_IN`]).
fn gained_last(descent: &[Linearisation]) -> Option<(f64, f64)> {
    let last = descent.last()?.objective;
    Some((last, descent[descent.len().checked_sub(1 + STUCK_IN)?].objective - last))
}

/// What lies above noise, where that is more than its deviations.
fn above_noise(objective: f64, noise: f64, deviations: f64) -> Option<f64> {
    let above = objective - noise;
    (above > deviations * (2.0 * noise).sqrt()).then_some(above)
}

/// Whether what is left is nearly noise.
fn is_near(objective: f64, noise: f64) -> bool {
    objective < NEARLY * noise
}

/// A gain, as part of what lies above noise; `None` where noise alone is left, or far more than that.
pub(super) fn share_above_noise(gained: f64, objective: f64, noise: f64, deviations: f64) -> Option<f64> {
    above_noise(objective, noise, deviations).filter(|_| is_near(objective, noise)).map(|above| gained / above)
}

/// The trust region of the next step: [`Scale::Unit`] up to [`RADIUS`], and, where it may be (`by_data`), the metric of the data from where
/// steps in a last part creep.
fn next_radius(settings: &mut Settings, solution: &Solution, by_data: bool) {
    let last = solution.history.last();
    if settings.scale == Scale::Unit {
        settings.initial_radius = solution.radius.min(RADIUS);
        if by_data && solution.radius < CREEPING && last.is_some_and(|step| step.decrement < LAST_PART) {
            settings.scale = Scale::Columns;
            // Relative to the point: without end, so that the largest is the first.
            (settings.initial_radius, settings.max_radius) = (f64::MAX, DATA_RADIUS);
        }
        return;
    }
    // Every linearisation has columns, and so a metric, of its own: the largest radius is all that one hands on.
    let trusted =
        last.is_some_and(|step| step.accepted && (step.lambda == 0.0 || step.gain.is_some_and(|g| g > TRUSTED)));
    settings.max_radius = if trusted { 2.0 * settings.max_radius } else { solution.radius };
}

/// Bounds of a step from `x`: positive parameters fall to no less than [`LEAST_PART`] of what they are, so that no step leaves them behind
/// zero, and stay within a factor `range` of the `start`.
fn positive_bounds(transform: &Transform, x: &[f64], start: &[f64], range: f64, nuisance: usize) -> Vec<(f64, f64)> {
    let free = (f64::NEG_INFINITY, f64::INFINITY);
    let one = |((d, x), start): ((&ParamDecl, &f64), &f64)| match d.group {
        ParamGroup::Positive => ((LEAST_PART * x).max(start / range).min(*x), (start * range).max(*x)),
        _ => free,
    };
    let parameters = transform.decls().iter().zip(x).zip(start).map(one);
    parameters.chain(std::iter::repeat_n(free, nuisance)).collect()
}

/// Positive parameters that are at zero against their start, by their place among those selected.
fn emptied(request: &Request<'_>, at: &[f64]) -> Vec<usize> {
    let zero = |&i: &usize| request.decls[i].group == ParamGroup::Positive && at[i] < EDGE_VALUE * request.start[i];
    request.selected.iter().enumerate().filter(|(_, i)| zero(i)).map(|(k, _)| k).collect()
}

/// Whether the last step was accepted and gained next to nothing.
fn gains_nothing(solution: &Solution, settings: &Settings) -> bool {
    let Some(step) = solution.history.last() else { return false };
    let noise = (2.0 * solution.cost / solution.residuals.len().max(1) as f64).min(1.0);
    let least = FLAT_GAIN * settings.gain_tolerance * noise;
    step.accepted && 2.0 * (step.cost - solution.cost).abs() < least
}

/// Chi-squared that the last step promised, if it was accepted, that is little, and noise is what it leaves.
fn near_end(solution: &Solution) -> Option<f64> {
    let step = solution.history.last()?;
    let noise = 2.0 * solution.cost > NOISE * solution.residuals.len() as f64;
    let promised = 2.0 * step.decrement * step.cost;
    (noise && step.accepted && promised < NEAR_END).then_some(promised)
}

/// The end of a fit, with these parameters at zero.
fn ended(by: Criterion, emptied: Vec<usize>) -> Status {
    if emptied.is_empty() { Status::Converged { by } } else { Status::AtBound { at: emptied, by } }
}

/// Chi-squared that is left to gain behind a step that promised `now` and one `before` it, if steps go on like that: without end where they
/// promise more.
fn rest_of(now: f64, before: f64) -> f64 {
    if now < before { now * now / (before - now) } else { f64::INFINITY }
}

/// Whether the last step was as long as steps may be.
fn is_full(solution: &Solution, settings: &Settings) -> bool {
    let full = |step: &Iterate| step.lambda > 0.0 && step.radius >= RADIUS;
    settings.scale == Scale::Unit && solution.history.last().is_some_and(full)
}

/// How a fit has ended whose steps gain nothing, between these values: at the edge of what is physical, with the
/// parameters `emptied` at zero, or along a flat direction.
fn flat_end(request: &Request<'_>, before: &[f64], after: &[f64], emptied: Vec<usize>) -> Status {
    let sizes = scale::sizes(request.decls, after);
    let moved = |i: usize| (after[i] - before[i]).abs() > EDGE_MOVED * sizes[i];
    let others = request.selected.iter().enumerate().filter(|(k, _)| !emptied.contains(k));
    if emptied.is_empty() && others.map(|(_, &i)| i).any(moved) {
        return Status::Converged { by: Criterion::Flat };
    }
    Status::AtBound { at: emptied, by: Criterion::Flat }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ff_least_squares::EvalError;
    use ff_model::{ParamDecl, ParamGroup};
    use nalgebra::DMatrix;

    #[test]
    fn what_is_left_of_a_creeping_fit_is_the_sum_of_what_its_steps_will_promise() {
        // 3.7 e-3 and 0.62 of it, and so on.
        let (first, ratio): (f64, f64) = (3.7e-3, 0.62);
        let all: f64 = (2..400).map(|k| first * ratio.powi(k)).sum();
        assert!((rest_of(first * ratio, first) / all - 1.0).abs() < 1e-9);
        assert_eq!(rest_of(2.0, 2.0), f64::INFINITY);
        assert_eq!(rest_of(2.1, 2.0), f64::INFINITY);
    }

    #[test]
    fn a_fit_is_stuck_where_steps_gain_nothing_of_what_is_not_explained() {
        let rows = 64_000;
        let falling = |objective: f64, by: f64, residuals: usize| -> Vec<Linearisation> {
            let one = |k: i32| Linearisation { objective: objective * (1.0 - by).powi(k), residuals };
            (0..6).map(one).collect()
        };
        let noise = rows as f64;
        let all = (0.0, noise);
        let above = |mean: f64| mean * rows as f64;
        let stuck = |descent: &[Linearisation], all| is_stuck(descent, all, ABOVE_NOISE);
        // In the noise there is nothing to be stuck above; near it, a hundredth of what is above counts, far off a thousandth.
        assert!(!stuck(&falling(above(1.02), 1e-5, rows), all));
        let short = falling(above(1.035), 1e-5, rows);
        assert!(stuck(&short, all) && !is_stuck(&short, all, ABOVE_NOISE_OF_LESS));
        assert!(stuck(&falling(above(1.08), 1e-5, rows), all));
        assert!(!stuck(&falling(above(1.08), 3e-4, rows), all));
        assert!(stuck(&falling(above(30.0), 1e-4, rows), all));
        assert!(!stuck(&falling(above(30.0), 1e-3, rows), all));
        assert!(!stuck(&falling(above(1.08), 1e-5, rows)[..4], all));
        // Fewer rows with the cost of all of them: what all rows say counts.
        let fewer = falling(above(0.5), 1e-5, rows / 2);
        assert!(stuck(&fewer, (above(0.58), noise)) && !stuck(&fewer, (above(0.5), noise)));
        // Noise that is larger than was said is noise.
        assert!(!stuck(&falling(above(1.08), 1e-5, rows), (0.0, above(1.09))));
    }

    #[test]
    fn a_fit_is_beaten_where_what_is_left_to_it_does_not_lead_below_another() {
        let falling = |each: f64| -> Vec<Linearisation> {
            (0..6).map(|k| Linearisation { objective: 900.0 - each * f64::from(k), residuals: 100 }).collect()
        };
        // At 800 after 20 each, seven more may lead to 800 - 5 * 20 * 7 = 100.
        assert!(!is_beaten(&falling(20.0), 7, 101.0) && is_beaten(&falling(20.0), 7, 99.0));
        assert!(!is_beaten(&falling(20.0)[..4], 0, 0.0));
    }

    #[test]
    fn a_fit_is_lost_where_it_falls_too_slowly_for_a_valley_that_is_right() {
        let falling = |to: f64| -> Vec<Linearisation> {
            (0..6).map(|k| Linearisation { objective: 2000.0 * to.powi(k), residuals: 100 }).collect()
        };
        // A twentieth each time is a quarter at five times that, and 7 of these lead from 1548 to 257.
        assert!(is_lost(&falling(0.95), 7, 250.0) && !is_lost(&falling(0.95), 7, 260.0));
        // A right valley: a factor of five each time.
        assert!(!is_lost(&falling(0.2), 1, 1.5));
        assert!(!is_lost(&falling(0.95)[..4], 0, 0.0));
    }

    /// Readings of a free parameter, and of a mass that it goes with.
    struct Offset;
    const WHERE: [f64; 2] = [-0.1037, 24.3];
    impl Estimator for Offset {
        fn rows(&self) -> usize {
            60
        }
        fn residuals(&mut self, p: &[f64], _: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
            let moment = |p: &[f64], i: usize| p[1] * (p[0] + 0.07 * (0.3 * i as f64).sin());
            r.iter_mut().enumerate().for_each(|(i, r)| *r = (moment(p, i) - moment(&WHERE, i)) / 0.02);
            Ok(())
        }
        fn jacobian(
            &mut self,
            p: &[f64],
            extra: &[f64],
            _: &[usize],
            r: &mut [f64],
            j: &mut DMatrix<f64>,
        ) -> Result<(), EvalError> {
            for i in 0..r.len() {
                j[(i, 0)] = p[1] / 0.02;
                j[(i, 1)] = (p[0] + 0.07 * (0.3 * i as f64).sin()) / 0.02;
            }
            self.residuals(p, extra, r)
        }
    }

    #[test]
    fn a_free_parameter_crosses_zero() {
        let free = ParamDecl { group: ParamGroup::Free, ..ParamDecl::positive("tank.rest_z", "m", 0.03) };
        let decls = [free, ParamDecl::positive("tank.mass", "kg", 31.0)];
        let request = Request::new(&decls, &[0, 1], &[0.03, 31.0]);
        let e = crate::estimate::estimation::estimate(&request, &mut Offset).unwrap();
        for (value, truth) in e.values.iter().zip(WHERE) {
            assert!((value / truth - 1.0).abs() < 1e-6, "{:?}", e.values);
        }
        assert!(e.iterations < 20, "{}", e.iterations);
    }
}
