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
use ff_least_squares::{Criterion, EvalError, Linearise, LmError, Scale, Settings, Status, minimise_linearised};
use nalgebra::DMatrix;

/// Longest step in affine coordinates. Coordinates are taken anew around every estimate, so that a step below 1
/// always leads to physical values, and a body close to the boundary is approached, never crossed.
const RADIUS: f64 = 0.5;
/// Relative move below which it has no more to give.
const ANCHOR_MOVED: f64 = 1e-10;

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
/// an anchor is added and taken out again, and has no more to give when a step moves less than `still`.
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
    let end = loop {
        // Coordinates around the present estimate: linear in the bodies, scaled by them.
        let transform = match (Transform::affine(request.decls, request.selected, &place.full), last.take()) {
            (Ok(t), _) => t,
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
        if settled || over || matches!(solution.status, Status::Stalled { .. }) {
            break (transform, solution.status);
        }
        last = Some(transform);
    };
    references.truncate(priors_kept);
    Ok(end)
}

/// Relative reduction of the cost below which a pass over less data has done its part: a hundred times that of the pass it is for,
/// within these bounds.
const APPROACHED: (f64, f64) = (1e-4, 1e-2);

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
    let settings = Settings {
        decrement_tolerance: (100.0 * request.settings.decrement_tolerance).clamp(APPROACHED.0, APPROACHED.1),
        max_iterations: request.settings.max_iterations / 2,
        ..request.settings.clone()
    };
    let lax = Request { settings, ..request.clone() };
    let mut there = place.clone();
    approach(&lax, &mut *thin.estimator, sizes, references, &mut there);
    let threads = request.jacobian.threads(thin.estimator.rows(), request.selected.len() + sizes.len());
    let mut evaluated = Evaluated::new(threads);
    let end = settle(&lax, &mut *thin.estimator, sizes, references, &mut there, &mut evaluated, f64::INFINITY);
    drop(thin);
    place.iterations = there.iterations;
    if !end.is_ok_and(|(_, status)| status.is_converged()) {
        return;
    }
    let mut cost = |at: &Place| -> Option<f64> {
        let transform = Transform::affine(request.decls, request.selected, &at.full).ok()?;
        let mut x = transform.coordinates(&at.full).ok()?;
        x.extend_from_slice(&at.nuisance);
        let (mut new, origin) = (Evaluated::new(None), (&x[..], &at.full[..]));
        let mut fit = Fit::new(request, &mut *estimator, &transform, references, sizes, origin, &mut new);
        let mut r = Vec::new();
        let tried = fit.residuals(&x, &mut r).ok()?;
        tried.ok().map(|()| r.iter().map(|r| r * r).sum())
    };
    if let (Some(before), Some(after)) = (cost(place), cost(&there))
        && after < before
    {
        *place = there;
    }
}
