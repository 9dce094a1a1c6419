//! The fit that all estimators share.
//!
//! [`estimate`] adds priors and nuisance unknowns, minimises with [`ff_least_squares::lm`] over physical values only, and
//! says how well each parameter is known.
//!
//! Bodies are estimated in their inertial parameters, in which records are nearly linear, and steps that
//! would leave the physical bodies are refused and shortened. In log-Cholesky coordinates, where every point is
//! physical, the same fit of the flexible case creeps along curved valleys (`docs/decisions/0004-coordinates.md`).

use crate::belief::covariance::{Unknown, analyse};
use crate::estimate::estimator::Estimator;
use crate::estimate::fit::{Evaluated, Fit, Reference};
use crate::estimate::outcome::{Estimate, EstimateError, Estimated, RANK_TOLERANCE};
use crate::estimate::request::Request;
use crate::parameters::scale;
use crate::parameters::transform::{Transform, TransformError};
use ff_least_squares::{
    Criterion, EvalError, Linearise, LmError, Scale, Settings, Solution, Status, minimise_linearised,
};
use ff_model::{ParamDecl, ParamGroup};
use nalgebra::DMatrix;

/// Longest step in affine coordinates. Coordinates are taken anew around every estimate, so that a step below 1
/// always leads to physical values, and a body close to the boundary is approached, never crossed.
const RADIUS: f64 = 0.5;
/// Relative move below which it has no more to give.
const ANCHOR_MOVED: f64 = 1e-10;
/// Steps of full length in a row that gain next to nothing, after which a fit is at the end of a flat direction or at the edge of
/// what is physical. What is next to nothing: so many times [`Settings::gain_tolerance`].
const FLAT_STEPS: usize = 3;
/// See [`FLAT_STEPS`].
const FLAT_GAIN: f64 = 10.0;
/// Relative physical change of such a step below which a body presses against the edge: steps are measured by what is left of it.
const EDGE_MOVED: f64 = 0.05;
/// Part of a positive parameter that a step leaves of it at least.
const LEAST_PART: f64 = 0.1;
/// Factor on the start of a positive parameter that a pass over less data keeps it within. Where oscillations have slipped, a spring or
/// a damper that vanishes, or stiffens a thousandfold, explains more than one that is near the truth, and steps do not lead back.
const RANGE: f64 = 30.0;
/// Part of its start below which a positive parameter is at its bound, zero.
const EDGE_VALUE: f64 = 1e-3;

/// Fits the selected parameters of `request` with `estimator`. Allocates the Jacobian and its factors, or the triangle alone
/// ([`Request::jacobian`]).
///
/// # Errors
/// [`EstimateError`]. A fit that stalls or meets its iteration limit is returned with that
/// [`Estimate::status`], not as an error.
pub fn estimate<E: Estimator + ?Sized>(request: &Request<'_>, estimator: &mut E) -> Result<Estimate, EstimateError> {
    if !request.loss.is_valid() {
        return Err(EstimateError::Loss(request.loss));
    }
    let extra = estimator.nuisance();
    let n = request.selected.len();
    let sizes_extra: Vec<f64> = extra.iter().map(|u| u.size).collect();
    let fixed = match request.prior_width {
        Some(w) => Some(Reference::new(request.decls, request.selected, request.centre.unwrap_or(request.start), w)?),
        None => None,
    };
    let mut references: Vec<Reference> = fixed.into_iter().collect();
    let mut place = Place { full: request.start.to_vec(), nuisance: vec![0.0; extra.len()], iterations: 0 };
    if request.coarse {
        approach(request, estimator, &sizes_extra, &mut references, &mut place);
    }
    let threads = request.jacobian.threads(estimator.rows(), n + extra.len());
    let mut evaluated = Evaluated::new(threads);
    let (transform, status) =
        settle(request, estimator, &sizes_extra, &mut references, &mut place, &mut evaluated, ANCHOR_MOVED)?;
    let Place { full, nuisance, iterations } = place;
    let values_extra: Vec<f64> = nuisance.iter().zip(&sizes_extra).map(|(x, s)| x * s).collect();
    let rows = estimator.rows();
    let selected = transform.selected();
    let at_solution = |e: EvalError| LmError::Setup(e.to_string());
    // The last linearisation is the one at the solution, unless the last step was refused after it.
    let at = evaluated.at(estimator, selected, &full, &values_extra, request.loss).map_err(at_solution)?;
    let mut data = at.information()?;
    let residuals = core::mem::take(&mut at.residuals);
    // What a loss leaves of the information.
    data.unscale_mut(request.loss.inflation(&residuals).sqrt());
    let values = full;
    let sizes = scale::sizes(request.decls, &values);
    let mut unknowns = Unknown::of_parameters(request.decls, selected, &sizes);
    unknowns.extend(extra.iter().cloned());
    let data_only = analyse(&data, &unknowns, RANK_TOLERANCE)?;
    let uncertainty = if request.priors.is_empty() && references.is_empty() {
        data_only.clone()
    } else {
        let known = request.priors.len() + n * references.len();
        let mut tail = DMatrix::zeros(known, n);
        request.priors.fill_jacobian(&mut tail, 0);
        for (k, r) in references.iter().enumerate() {
            let rows = r.jacobian(&values).map_err(at_solution)?;
            tail.rows_mut(request.priors.len() + k * n, n).copy_from(&rows);
        }
        let from = data.nrows();
        let mut both = data.resize_vertically(from + known, 0.0);
        both.view_mut((from, 0), (known, n)).copy_from(&tail);
        analyse(&both, &unknowns, RANK_TOLERANCE)?
    };
    let chi2: f64 = residuals.iter().map(|r| r * r).sum();
    let mut known = Vec::new();
    request.priors.push_residuals(&selected.iter().map(|&i| values[i]).collect::<Vec<_>>(), &mut known);
    for r in &references {
        known.extend(r.residuals(&values).map_err(at_solution)?);
    }
    let objective =
        residuals.iter().map(|&r| request.loss.rho(r)).sum::<f64>() + known.iter().map(|r| r * r).sum::<f64>();
    let dof = rows.saturating_sub(data_only.rank).max(1);
    let listed = |k: usize, start: f64, value: f64| Estimated {
        name: unknowns[k].name.clone(),
        unit: unknowns[k].unit.clone(),
        start,
        value,
        std: uncertainty.deviation[k],
    };
    Ok(Estimate {
        parameters: selected.iter().enumerate().map(|(k, &i)| listed(k, request.start[i], values[i])).collect(),
        nuisance: values_extra.iter().enumerate().map(|(k, &v)| listed(n + k, 0.0, v)).collect(),
        values,
        status,
        chi2_per_dof: chi2 / dof as f64,
        objective,
        data_only,
        uncertainty,
        iterations,
        residuals,
    })
}

/// Where a fit is: all parameters, nuisance unknowns over their sizes, and the linearisations it took.
#[derive(Clone)]
struct Place {
    full: Vec<f64>,
    nuisance: Vec<f64>,
    iterations: usize,
}

/// Minimises from `place` on, with the coordinates taken anew at every step, and leaves it at the end. `references` are those of priors;
/// an anchor is added and taken out again, and has no more to give when a step moves less than `still`: infinite for a pass over less
/// data, which keeps positive parameters within [`RANGE`] of their start.
fn settle<E: Estimator + ?Sized>(
    request: &Request<'_>,
    estimator: &mut E,
    sizes: &[f64],
    references: &mut Vec<Reference>,
    place: &mut Place,
    evaluated: &mut Evaluated,
    still: f64,
) -> Result<(Transform, Status), EstimateError> {
    let (n, priors_kept) = (request.selected.len(), references.len());
    // The limit is that of a pass: cheap linearisations of thinner records do not use up those of all data.
    let limit = place.iterations + request.settings.max_iterations;
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
    let mut last = None;
    let mut flat_steps = 0;
    let end = loop {
        // Coordinates around the present estimate: linear in the bodies, scaled by them.
        let transform = match (Transform::affine(request.decls, request.selected, &place.full), last.take()) {
            (Ok(t), _) => t.scaled_at_least(request.start),
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
        let range = if still.is_finite() { f64::INFINITY } else { RANGE };
        settings.bounds = positive_bounds(&transform, &x, &transform.coordinates(request.start)?, range, sizes.len());
        x.extend_from_slice(&place.nuisance);
        let full = place.full.clone();
        let mut fit = Fit::new(request, &mut *estimator, &transform, references, sizes, (&x, &full), evaluated);
        let solution = minimise_linearised(&mut fit, &x, &settings)?;
        place.iterations += solution.iterations;
        settings.initial_radius = solution.radius.min(RADIUS);
        place.nuisance.copy_from_slice(&solution.x[n..]);
        if solution.x[..n] != x[..n] {
            transform.apply(&solution.x[..n], &mut place.full);
        }
        let moved = solution.x.iter().zip(&x).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let settled = solution.status.is_converged() && (request.anchor.is_none() || moved < still);
        let over = place.iterations >= limit;
        let emptied = emptied(request, &place.full);
        flat_steps = if gains_nothing(&solution, &settings, !emptied.is_empty()) { flat_steps + 1 } else { 0 };
        if flat_steps == FLAT_STEPS && !settled {
            let status = flat_end(request, &full, &place.full, emptied);
            break (transform, status);
        }
        // At the bounds of a pass over less data: nothing that may still move wants to.
        let held = solution.iterations == 0 && matches!(solution.status, Status::AtBound { .. });
        if settled || over || held || matches!(solution.status, Status::Stalled { .. }) {
            break (transform, solution.status);
        }
        last = Some(transform);
    };
    references.truncate(priors_kept);
    Ok(end)
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

/// Whether the last step was as long as steps may be, or at the bound of a parameter (`bound`), and gained next to nothing all the same.
fn gains_nothing(solution: &Solution, settings: &Settings, bound: bool) -> bool {
    let Some(step) = solution.history.last() else { return false };
    let noise = (2.0 * solution.cost / solution.residuals.len().max(1) as f64).min(1.0);
    let least = FLAT_GAIN * settings.gain_tolerance * noise;
    let full = step.lambda > 0.0 && step.radius >= RADIUS;
    step.accepted && (full || bound) && 2.0 * (step.cost - solution.cost).abs() < least
}

/// How a fit has ended whose full steps gain nothing, the last of them between these values: at the edge of what is physical, with the
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

/// Relative reduction of the cost below which a pass over less data has done its part: a hundred times that of the pass it is for,
/// within these bounds.
const APPROACHED: (f64, f64) = (1e-4, 1e-2);
/// Promised reduction of chi-squared below which it has, too.
const APPROACHED_GAIN: f64 = 0.03;

/// Linearisations after which a first pass that has not ended is taken to be lost in a valley, and is led there over growing parts of
/// the record. Passes that find their way take fewer.
const LOST: usize = 12;
/// Mean squared residual from which its end does not explain the data, and it is led as well.
const UNEXPLAINED: f64 = 4.0;
/// Parts of the record it is led over.
const PARTS: [f64; 4] = [0.0625, 0.125, 0.25, 0.5];
/// Linearisations of each of them.
const PART_STEPS: usize = 15;
/// Relative width that what a part of the record leaves open is held to around its start.
const PART_WIDTH: f64 = 1.0;

/// Takes the start to where less data say that the answer is, if there is such a look at them and all data agree that it is better there.
/// What goes wrong on the way is no error: the start stays as it was.
fn approach<E: Estimator + ?Sized>(
    request: &Request<'_>,
    estimator: &mut E,
    sizes: &[f64],
    references: &mut Vec<Reference>,
    place: &mut Place,
) {
    let Some(mut thin) = estimator.coarse(&place.full) else { return };
    let statistics = if request.settings.gain_tolerance > 0.0 { APPROACHED_GAIN } else { 0.0 };
    let settings = Settings {
        decrement_tolerance: (100.0 * request.settings.decrement_tolerance).clamp(APPROACHED.0, APPROACHED.1),
        gain_tolerance: request.settings.gain_tolerance.max(statistics),
        max_iterations: request.settings.max_iterations / 2,
        ..request.settings.clone()
    };
    let lax = Request { settings, ..request.clone() };
    let mut there = place.clone();
    let coarsest = thin.estimator.coarse(&place.full).is_none();
    let thinner: &mut dyn Estimator = &mut *thin.estimator;
    if coarsest {
        lead(&lax, thinner, sizes, references, &mut there);
    } else {
        approach(&lax, thinner, sizes, references, &mut there);
    }
    let end = pass(&lax, thinner, sizes, references, &mut there);
    drop(thin);
    place.iterations = there.iterations;
    // Where the pass got to counts, even where it did not get to its end: all data decide.
    if end.is_some() {
        *place = better(request, estimator, sizes, references, [place.clone(), there]);
    }
}

/// One pass over less data from `place`; none when it fails.
fn pass(
    request: &Request<'_>,
    estimator: &mut dyn Estimator,
    sizes: &[f64],
    references: &mut Vec<Reference>,
    place: &mut Place,
) -> Option<Status> {
    let threads = request.jacobian.threads(estimator.rows(), request.selected.len() + sizes.len());
    let mut evaluated = Evaluated::new(threads);
    let end = settle(request, estimator, sizes, references, place, &mut evaluated, f64::INFINITY);
    end.ok().map(|(_, status)| status)
}

/// A first pass over `estimator` from `place`. When it has not ended after [`LOST`] linearisations, or at what does not explain the data
/// ([`UNEXPLAINED`]), oscillations predicted and measured have slipped by periods: parts of the record that grow from its beginning lead there from the same start, and the better end counts.
fn lead(
    request: &Request<'_>,
    estimator: &mut dyn Estimator,
    sizes: &[f64],
    references: &mut Vec<Reference>,
    place: &mut Place,
) {
    let of = |max_iterations: usize| {
        let settings = Settings { max_iterations, ..request.settings.clone() };
        Request { settings, ..request.clone() }
    };
    let mut direct = place.clone();
    let end = pass(&of(LOST.min(request.settings.max_iterations)), estimator, sizes, references, &mut direct);
    let ended = end.is_some_and(|s| s != Status::IterationLimit);
    let left = cost(request, estimator, sizes, references, &direct).unwrap_or(f64::INFINITY);
    let explains = left < UNEXPLAINED * estimator.rows() as f64;
    if ended && explains || request.settings.max_iterations <= LOST {
        *place = direct;
        return;
    }
    let mut led = Place { iterations: direct.iterations, ..place.clone() };
    for share in PARTS {
        let Some(mut begun) = estimator.beginning(share) else { continue };
        let kept = references.len();
        references.extend(Reference::new(request.decls, request.selected, &led.full, PART_WIDTH).ok());
        let short = Request { anchor: None, ..of(PART_STEPS.min(request.settings.max_iterations)) };
        let mut on = led.clone();
        let end = pass(&short, &mut *begun.estimator, sizes, references, &mut on);
        references.truncate(kept);
        led.iterations = on.iterations;
        if end.is_some() {
            led = on;
        }
    }
    let end = pass(&of(LOST.min(request.settings.max_iterations)), estimator, sizes, references, &mut led);
    direct.iterations = led.iterations;
    *place = if end.is_some() { better(request, estimator, sizes, references, [direct, led]) } else { direct };
}

/// That of two places where all data of the estimator say that the cost is lower; the first where they do not say.
fn better<E: Estimator + ?Sized>(
    request: &Request<'_>,
    estimator: &mut E,
    sizes: &[f64],
    references: &[Reference],
    [here, there]: [Place; 2],
) -> Place {
    let before = cost(request, estimator, sizes, references, &here);
    match (before, cost(request, estimator, sizes, references, &there)) {
        (Some(before), Some(after)) if after >= before => here,
        (_, Some(_)) => there,
        (_, None) => here,
    }
}

/// Sum of squared residuals at a place, those of priors and references included; none where it cannot be evaluated.
fn cost<E: Estimator + ?Sized>(
    request: &Request<'_>,
    estimator: &mut E,
    sizes: &[f64],
    references: &[Reference],
    at: &Place,
) -> Option<f64> {
    let transform = Transform::affine(request.decls, request.selected, &at.full).ok()?;
    let mut x = transform.coordinates(&at.full).ok()?;
    x.extend_from_slice(&at.nuisance);
    let (mut new, origin) = (Evaluated::new(None), (&x[..], &at.full[..]));
    let mut fit = Fit::new(request, estimator, &transform, references, sizes, origin, &mut new);
    let mut r = Vec::new();
    let tried = fit.residuals(&x, &mut r).ok()?;
    tried.ok().map(|()| r.iter().map(|r| r * r).sum())
}
