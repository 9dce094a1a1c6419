//! The fit that all estimators share.
//!
//! [`estimate`] adds priors and nuisance unknowns, minimises with [`ff_least_squares::lm`] over physical values only, and
//! says how well each parameter is known.
//!
//! Bodies are estimated in their inertial parameters, in which records are nearly linear, and steps that
//! would leave the physical bodies are refused and shortened. In log-Cholesky coordinates, where every point is
//! physical, the same fit of the flexible case creeps along curved valleys (`docs/decisions/0004-coordinates.md`).

use crate::belief::covariance::{Unknown, analyse};
use crate::belief::prior::PriorRow;
use crate::estimate::approach::{approach, unless_hopeless};
use crate::estimate::descent::{Place, Way, above, settle};
use crate::estimate::estimator::Estimator;
use crate::estimate::fit::{Evaluated, Reference};
use crate::estimate::near_end;
use crate::estimate::outcome::{Estimate, EstimateError, Estimated, Linearisation, RANK_TOLERANCE};
use crate::estimate::request::Request;
use crate::parameters::scale;
use ff_least_squares::{EvalError, LmError, Status};
use nalgebra::DMatrix;

/// How much further than other unknowns an initial state may go in a step, over its size, and biases beside it. Records are (nearly) linear
/// in them, and behind a gap the state is tens of sizes away from rest, and in a short part biases are known to tens of theirs, as they
/// look like initial rates. Held to steps as short as those of the bodies, they would be what a fit creeps along, and stiffnesses and
/// dampers would take their place meanwhile.
const STATE_REACH: f64 = 100.0;
/// How often an estimator is made more exact ([`Estimator::refine`]): springs that have stiffened ask for finer steps, and once is enough but
/// for those that stiffen further by it; how elastic joints deflect is found in a few passes, each of which leaves a part of the last.
const REFINED: usize = 8;
/// Relative move below which an anchor has no more to give.
const ANCHOR_MOVED: f64 = 1e-10;

/// Fits the selected parameters of `request` with `estimator`. Allocates the Jacobian and its factors, or the triangle alone
/// ([`Request::jacobian`]).
///
/// # Errors
/// [`EstimateError`]; a fit that stalls or meets its iteration limit is [`EstimateError::Unfinished`], with where it got to.
pub fn estimate<E: Estimator + ?Sized>(request: &Request<'_>, estimator: &mut E) -> Result<Estimate, EstimateError> {
    attempt(request, estimator)?.ended()
}

/// As [`estimate()`], but a fit that has not ended is returned as far as it got. Its values are no estimates: look at
/// [`Estimate::status`] first.
///
/// # Errors
/// [`EstimateError`], never [`EstimateError::Unfinished`].
pub fn attempt<E: Estimator + ?Sized>(request: &Request<'_>, mut estimator: &mut E) -> Result<Estimate, EstimateError> {
    fitted(request, &mut estimator)
}

/// Compiled once, here, and not for every estimator of every crate.
fn fitted(request: &Request<'_>, estimator: &mut dyn Estimator) -> Result<Estimate, EstimateError> {
    if !request.loss.is_valid() {
        return Err(EstimateError::Loss(request.loss));
    }
    let extra = estimator.nuisance();
    let n = request.selected.len();
    let moving = extra.iter().any(Unknown::is_initial);
    let reach = |u: &Unknown| if moving && (u.is_initial() || u.is_bias()) { STATE_REACH * u.size } else { u.size };
    let sizes_extra: Vec<f64> = extra.iter().map(reach).collect();
    let fixed = match request.prior_width {
        Some(w) => Some(Reference::new(request.decls, request.selected, request.centre.unwrap_or(request.start), w)?),
        None => None,
    };
    let mut references: Vec<Reference> = fixed.into_iter().collect();
    let nuisance = match request.nuisance.filter(|given| given.len() == extra.len()) {
        Some(given) => given.iter().zip(&sizes_extra).map(|(x, size)| x / size).collect(),
        None => vec![0.0; extra.len()],
    };
    let mut place = Place { full: request.start.to_vec(), nuisance, iterations: 0, descent: Vec::new(), crept: false };
    let at_solution = |e: EvalError| LmError::Setup(e.to_string());
    let over = |nuisance: &[f64]| -> Vec<f64> { nuisance.iter().zip(&sizes_extra).map(|(x, s)| x * s).collect() };
    let mut crept_there = false;
    if request.coarse {
        approach(request, estimator, &sizes_extra, &mut references, &mut place);
    }
    if request.coarse || request.led {
        // Where nothing can be predicted, the fit says so.
        let _ = estimator.refine(&place.full, &over(&place.nuisance), request.finer);
    }
    if place.iterations > 0 || request.led {
        crept_there = near_end::land(request, estimator, &sizes_extra, &mut references, &mut place);
    }
    let asked = request.settings.max_iterations;
    let hopeful = unless_hopeless(request, estimator, &sizes_extra, &references, &place);
    let request = &hopeful;
    let threads = request.jacobian.threads(estimator.rows(), n + extra.len());
    let mut evaluated = Evaluated::new(threads);
    let mut hop =
        |estimator: &mut dyn Estimator, references: &mut Vec<Reference>, at: &mut Place, last: &mut Evaluated| {
            near_end::hop(request, estimator, &sizes_extra, references, at, last)
        };
    let mut refined = 0;
    let status = loop {
        if crept_there {
            // Other starts come first: what is wanted is what this one looks like.
            break Status::IterationLimit;
        }
        let all = (0.0, request.noise_of(estimator.rows()));
        let way = Way {
            still: ANCHOR_MOVED,
            range: f64::INFINITY,
            all,
            above: above(request),
            to_beat: request.to_beat,
            to_reach: None,
            near_end: Some(&mut hop),
        };
        let end = settle(request, estimator, &sizes_extra, &mut references, &mut place, &mut evaluated, way)?.1;
        // A fit that was given up is no place to ask for.
        if request.finer == 0 || refined == REFINED || end == Status::IterationLimit {
            break end;
        }
        if !estimator.refine(&place.full, &over(&place.nuisance), request.finer).map_err(at_solution)? {
            break end;
        }
        refined += 1;
        evaluated = Evaluated::new(threads);
    };
    let Place { full, nuisance, iterations, mut descent, crept } = place;
    let crept = crept || (crept_there && status == Status::IterationLimit);
    let values_extra = over(&nuisance);
    let (rows, left_out) = (estimator.rows(), estimator.left_out());
    let selected = request.selected;
    // The last linearisation is the one at the solution, unless the last step was refused after it.
    let at = evaluated.at(estimator, selected, &full, &values_extra, request.loss).map_err(at_solution)?;
    let mut data = at.information()?;
    let residuals = core::mem::take(&mut at.residuals);
    // What a loss leaves of the information.
    data.unscale_mut(request.loss.inflation(&residuals).sqrt());
    let values = full;
    let sizes = scale::sizes_at_least(request.decls, &values, request.centre.unwrap_or(request.start));
    let mut unknowns = Unknown::of_parameters(request.decls, selected, &sizes);
    unknowns.extend(extra.iter().cloned());
    let row = |&(i, sigma): &(usize, f64)| {
        let column = selected.iter().position(|&s| s == i)?;
        Some(PriorRow { column, mean: 0.0, sigma })
    };
    let given: Vec<PriorRow> = request.marginal.iter().filter_map(row).collect();
    let data_only = analyse(&with_rows(&data, &given), &unknowns, RANK_TOLERANCE)?;
    let estimated: Vec<f64> = selected.iter().map(|&i| values[i]).collect();
    let uncertainty = if request.priors.is_empty() && references.is_empty() {
        data_only.clone()
    } else {
        let known = request.priors.len() + n * references.len();
        let mut tail = DMatrix::zeros(known, n);
        request.priors.fill_jacobian(&estimated, &mut tail, 0);
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
    request.priors.push_residuals(&estimated, &mut known);
    for r in &references {
        known.extend(r.residuals(&values).map_err(at_solution)?);
    }
    let objective =
        residuals.iter().map(|&r| request.loss.rho(r)).sum::<f64>() + known.iter().map(|r| r * r).sum::<f64>();
    descent.push(Linearisation { objective, residuals: rows });
    // What a prior holds is not fitted to the data: of n unknowns with priors, `n - tr(P S^-1)` are.
    let held: f64 =
        given.iter().filter_map(|row| Some((uncertainty.deviation[row.column]? / row.sigma).powi(2).min(1.0))).sum();
    let counted = rows.saturating_sub(left_out);
    let dof = (counted as f64 - (data_only.rank as f64 - held)).max(1.0);
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
        given_up: status == Status::IterationLimit && (crept || request.settings.max_iterations < asked),
        crept,
        status,
        chi2_per_dof: chi2 / dof,
        objective,
        data_only,
        uncertainty,
        iterations,
        descent,
        residuals,
    })
}

/// A triangle with rows of priors below it.
fn with_rows(data: &DMatrix<f64>, given: &[PriorRow]) -> DMatrix<f64> {
    let from = data.nrows();
    let mut out = data.clone().resize_vertically(from + given.len(), 0.0);
    given.iter().enumerate().for_each(|(k, row)| out[(from + k, row.column)] = 1.0 / row.sigma);
    out
}
