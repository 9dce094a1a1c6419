//! The last steps of a fit over fewer rows.
//!
//! What a record tells weakly makes valleys that bend, along which a fit creeps: dozens of linearisations, each of which gains a little. Near
//! the end, fewer rows have the cost of all of them ([`Around`]), and what is not asked for keeps its columns, so that a linearisation costs a
//! tenth. All data decide whether it led down, and whether the fit is at its end.

use crate::estimate::approach::cost;
use crate::estimate::around::{Around, Centre, Slope};
use crate::estimate::descent::{Place, WORTH, Way, above, settle, share_above_noise};
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
/// Looks from where less data have led, linearisations of each, and chi-squared that one must gain to be worth another.
const LANDINGS: usize = 3;
/// See [`LANDINGS`].
const LANDED: usize = 4;
/// See [`LANDINGS`].
const WORTH_MORE: f64 = 3.0;
/// Promised reduction of chi-squared below which one has done its part.
const LANDED_GAIN: f64 = 0.1;

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
    if !asked(request) || evaluated.folds() {
        return false;
    }
    let extra = over(place, sizes);
    let Ok(at) = evaluated.at(&mut estimator, request.selected, &place.full, &extra, request.loss) else {
        return false;
    };
    let slope = tr_mul(&at.jacobian, &at.residuals);
    let known = (&at.residuals[..], Slope::Known(&slope));
    let settings = Settings { max_iterations: MOST.min(request.settings.max_iterations), ..request.settings.clone() };
    around(&Request { settings, ..request.clone() }, estimator, sizes, references, place, known) > LEAST
}

/// The same from where less data have led, and as often as it is worth it: all rows are predicted there, and none of their columns. What fewer
/// rows make of the slope is nearly that of all of them, so that linearisations of all begin next to their end. Says whether that crept above noise
/// ([`Request::give_up`]).
pub(super) fn land(
    request: &Request<'_>,
    estimator: &mut dyn Estimator,
    sizes: &[f64],
    references: &mut Vec<Reference>,
    place: &mut Place,
) -> bool {
    if !asked(request) {
        return false;
    }
    let settings = Settings {
        max_iterations: LANDED.min(request.settings.max_iterations),
        gain_tolerance: request.settings.gain_tolerance.max(LANDED_GAIN),
        ..request.settings.clone()
    };
    let lax = Request { settings, ..request.clone() };
    for _ in 0..LANDINGS {
        let mut residuals = vec![0.0; estimator.rows()];
        let done = estimator.residuals(&place.full, &over(place, sizes), &mut residuals);
        if done.is_err() {
            break;
        }
        let gained = around(&lax, estimator, sizes, references, place, (&residuals[..], Slope::Untold));
        // Above noise in a valley that leads nowhere: other starts come first.
        let left = residuals.iter().map(|r| r * r).sum::<f64>() - gained;
        let share = share_above_noise(gained, left, request.noise_of(residuals.len()), above(request));
        if request.give_up.is_some() && share.is_some_and(|share| share < WORTH) {
            return true;
        }
        if gained < WORTH_MORE {
            break;
        }
    }
    false
}

/// Whether a fit goes over fewer rows near its end.
pub(super) fn asked(request: &Request<'_>) -> bool {
    request.near_end && request.loss == Loss::Squares
}

/// Nuisance unknowns in their units.
fn over(place: &Place, sizes: &[f64]) -> Vec<f64> {
    place.nuisance.iter().zip(sizes).map(|(x, s)| x * s).collect()
}

/// See [`hop`]. What it has gained by all rows.
fn around(
    request: &Request<'_>,
    estimator: &mut dyn Estimator,
    sizes: &[f64],
    references: &mut Vec<Reference>,
    place: &mut Place,
    (residuals, slope): (&[f64], Slope<'_>),
) -> f64 {
    let extra = over(place, sizes);
    let centre = Centre { values: &place.full, extra: &extra, residuals, slope, covariance: None };
    let Some(thin) = estimator.rough(&place.full) else { return 0.0 };
    let stays = |i: usize| request.marginal.iter().any(|m| m.0 == i);
    let Ok(Some(mut near)) = Around::of_point(request, centre, thin, stays) else { return 0.0 };
    let mut there = place.clone();
    let all = (near.centred().beyond, request.noise_of(residuals.len()));
    let way = Way::over_less(all);
    let end = settle(request, &mut near, sizes, references, &mut there, &mut Evaluated::new(None), way);
    drop(near);
    let (iterations, descent) = (there.iterations, there.descent.clone());
    let mut of = |at: &Place| cost(request, estimator, sizes, references, at).unwrap_or(f64::INFINITY);
    let gained = if end.is_ok() { of(place) - of(&there) } else { 0.0 };
    if gained > 0.0 {
        *place = there;
    }
    (place.iterations, place.descent) = (iterations, descent);
    gained
}
