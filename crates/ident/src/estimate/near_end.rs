//! The last steps of a fit over fewer rows.
//!
//! What a record tells weakly makes valleys that bend, along which a fit creeps: dozens of linearisations, each of which gains a little. Near
//! the end, fewer rows have the cost of all of them ([`Around`]), and what is not asked for keeps its columns, so that a linearisation costs a
//! tenth. All data decide whether it led down, and whether the fit is at its end.

use crate::estimate::approach::cost;
use crate::estimate::around::{Around, Centre};
use crate::estimate::descent::{Place, Way, settle};
use crate::estimate::estimator::Estimator;
use crate::estimate::fit::{Evaluated, Reference};
use crate::estimate::request::Request;
use crate::solve::loss::Loss;
use ff_least_squares::Settings;
use ff_linalg::tr_mul;

/// Linearisations over fewer rows at most.
const MOST: usize = 40;
/// Chi-squared that they must gain by all rows to be worth another look.
const LEAST: f64 = 0.05;

/// Moves `place` to where fewer rows have their minimum around it, if it is lower there by all rows, and says whether it is so much lower there by all rows that this
/// is worth doing again. What goes wrong on the way is no error: the place stays.
pub(super) fn hop(
    request: &Request<'_>,
    mut estimator: &mut dyn Estimator,
    sizes: &[f64],
    references: &mut Vec<Reference>,
    place: &mut Place,
    evaluated: &mut Evaluated,
) -> bool {
    if !request.near_end || request.loss != Loss::Squares || evaluated.folds() {
        return false;
    }
    let extra: Vec<f64> = place.nuisance.iter().zip(sizes).map(|(x, s)| x * s).collect();
    let Ok(at) = evaluated.at(&mut estimator, request.selected, &place.full, &extra, request.loss) else {
        return false;
    };
    let slope = tr_mul(&at.jacobian, &at.residuals);
    let centre = Centre { values: &place.full, extra: &extra, residuals: &at.residuals, slope: Some(&slope) };
    let Some(thin) = estimator.coarse(&place.full) else { return false };
    let stays = |i: usize| request.marginal.iter().any(|m| m.0 == i);
    let Ok(Some(mut near)) = Around::of_point(request, centre, thin, stays) else { return false };
    let settings = Settings { max_iterations: MOST.min(request.settings.max_iterations), ..request.settings.clone() };
    let lax = Request { settings, ..request.clone() };
    let mut there = place.clone();
    let way = Way { still: f64::INFINITY, range: f64::INFINITY, near_end: &mut |_, _, _, _| false };
    let end = settle(&lax, &mut near, sizes, references, &mut there, &mut Evaluated::new(None), way);
    drop(near);
    let (iterations, descent) = (there.iterations, there.descent.clone());
    let mut of = |at: &Place| cost(request, estimator, sizes, references, at).unwrap_or(f64::INFINITY);
    let gained = if end.is_ok() { of(place) - of(&there) } else { 0.0 };
    if gained > 0.0 {
        *place = there;
    }
    (place.iterations, place.descent) = (iterations, descent);
    gained > LEAST
}
