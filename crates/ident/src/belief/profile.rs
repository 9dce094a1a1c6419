//! Intervals from the likelihood itself: the profile of one parameter.
//!
//! A standard deviation assumes that the cost is a parabola. The profile does not: for values `p` of one parameter all others
//! are fitted again, and `D(p) = min C(. | p) - min C`, with C twice the negative log posterior, is chi-squared with one degree
//! of freedom when `p` is the truth (Wilks). The 95 % interval is where `D <= 3.84`; where it never gets there the data put no
//! bound on that side (A. Raue et al., *Structural and practical identifiability analysis ... by exploiting the profile
//! likelihood*, Bioinformatics 25(15), 2009).
//!
//! The parameter is held by a prior a ten-thousandth of its deviation wide, so that the body it belongs to stays a body.

use crate::belief::prior::PriorRow;
use crate::estimate::estimation::attempt;
use crate::estimate::estimator::Estimator;
use crate::estimate::outcome::{Estimate, EstimateError};
use crate::estimate::request::Request;

/// `D` at the ends of a 95 % interval: the square of 1.96.
pub const LIMIT95: f64 = 3.841_458_820_694_124;

/// Width of the prior that holds the parameter, in standard deviations.
const HELD: f64 = 1e-4;

/// One point of a profile.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Point {
    /// Value of the parameter.
    pub value: f64,
    /// `D` there.
    pub excess: f64,
    /// Whether the fit of the others converged.
    pub converged: bool,
}

/// The profile of one parameter.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Profile {
    /// Full name.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// The estimate.
    pub value: f64,
    /// Points with ascending values; the estimate is among them with zero excess.
    pub points: Vec<Point>,
    /// Ends of the 95 % interval; none where `D` stays below the limit as far as was looked.
    pub interval95: (Option<f64>, Option<f64>),
}

/// Profiles parameter `column` of the selection around its estimate, in steps of half a standard deviation until the limit is
/// passed or `reach` standard deviations are (parameters without a deviation: of their size). Every point is a fit; they start
/// from each other.
///
/// # Errors
/// [`EstimateError`] when a point cannot be fitted at all. A point at which the parameter is not physical ends its side.
///
/// # Panics
/// If there is no such column.
pub fn profile<E: Estimator + ?Sized>(
    request: &Request<'_>,
    at: &Estimate,
    column: usize,
    reach: f64,
    estimator: &mut E,
) -> Result<Profile, EstimateError> {
    let p = &at.parameters[column];
    let index = request.selected[column];
    let sigma = p.std.unwrap_or_else(|| crate::parameters::scale::sizes(request.decls, &at.values)[index]);
    let mut points = vec![Point { value: p.value, excess: 0.0, converged: at.status.is_converged() }];
    let mut interval = [None, None];
    for (side, sign) in [-1.0, 1.0].into_iter().enumerate() {
        let mut from = at.values.clone();
        let mut last = (0.0, 0.0);
        for k in 1.. {
            let distance = 0.5 * f64::from(k);
            if distance > reach {
                break;
            }
            let value = p.value + sign * distance * sigma;
            let Some((found, point)) = held(request, at, (column, value, sigma), &from, estimator)? else { break };
            points.push(point);
            from = found.values;
            // The square root of D is nearly straight.
            let root = point.excess.max(0.0).sqrt();
            let limit = LIMIT95.sqrt();
            if root >= limit {
                let share = (limit - last.1) / (root - last.1);
                interval[side] = Some(p.value + sign * sigma * (last.0 + share * (distance - last.0)));
                break;
            }
            last = (distance, root);
        }
    }
    points.sort_by(|a, b| a.value.total_cmp(&b.value));
    Ok(Profile {
        name: p.name.clone(),
        unit: p.unit.clone(),
        value: p.value,
        points,
        interval95: (interval[0], interval[1]),
    })
}

/// The fit with the parameter at a value; `None` where that is not physical.
fn held<E: Estimator + ?Sized>(
    request: &Request<'_>,
    at: &Estimate,
    (column, value, sigma): (usize, f64, f64),
    from: &[f64],
    estimator: &mut E,
) -> Result<Option<(Estimate, Point)>, EstimateError> {
    let own = request.priors.rows().iter().find(|r| r.column == column).copied();
    let pin = PriorRow { column, mean: value, sigma: HELD * sigma };
    let fixed = Request { priors: request.priors.with(pin), start: from, ..request.clone() };
    match attempt(&fixed, estimator) {
        Ok(e) => {
            let got = e.parameters[column].value;
            // The pin does not belong to the cost, the prior that it replaced does.
            let pinned = ((got - value) / pin.sigma).powi(2);
            let prior = own.map_or(0.0, |r| ((got - r.mean) / r.sigma).powi(2));
            let excess = e.objective - pinned + prior - at.objective;
            let point = Point { value: got, excess, converged: e.status.is_converged() };
            Ok(Some((e, point)))
        }
        Err(EstimateError::Transform(_)) => Ok(None),
        Err(e) => Err(e),
    }
}
