//! Fits from many starts: the best of them, and whether they agree.
//!
//! One start may end in a local minimum without a sign of it. Several that agree are no proof, but several that disagree are
//! a warning (bad-inputs row D33): the lowest is taken, and the others are listed with their costs.

use crate::estimate::estimation::attempt;
use crate::estimate::estimator::Estimator;
use crate::estimate::outcome::{Estimate, EstimateError};
use crate::estimate::request::Request;

/// Relative difference of two objectives below which they are equal.
const SAME_COST: f64 = 1e-6;
/// Distance of two estimates, in standard deviations of every parameter, below which they are the same minimum.
const SAME_PLACE: f64 = 0.1;
/// The same for two of equal cost: one flat minimum whose ends the uncertainty covers. Beyond it they are two, as those of a
/// symmetric system, between which the data cannot choose.
const SAME_FLAT: f64 = 3.0;

/// Where one start led.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Ending {
    /// Which start.
    pub start: usize,
    /// What was minimised, at the end; absent when there is no estimate.
    pub objective: Option<f64>,
    /// Whether it is a minimum.
    pub converged: bool,
    /// Why there is no estimate.
    pub error: Option<String>,
}

/// The result of [`best_of`].
#[derive(Clone, Debug)]
pub struct Best {
    /// The lowest minimum, or when nothing converged the lowest end.
    pub estimate: Estimate,
    /// Every start.
    pub endings: Vec<Ending>,
    /// Objectives of distinct minima, ascending: one when all that converged agree.
    pub minima: Vec<f64>,
}

/// Fits from every start (full parameter vectors) with the same estimator. Priors stay those of the request.
///
/// # Errors
/// That of the first start if no start gives an estimate; [`EstimateError::NoStart`].
pub fn best_of<E: Estimator + ?Sized>(
    request: &Request<'_>,
    starts: &[Vec<f64>],
    estimator: &mut E,
) -> Result<Best, EstimateError> {
    let (mut found, mut endings, mut first_error) = (Vec::<Estimate>::new(), Vec::new(), None);
    for (k, start) in starts.iter().enumerate() {
        let mut ending = Ending { start: k, objective: None, converged: false, error: None };
        match attempt(&Request { start, ..request.clone() }, estimator) {
            Ok(e) => {
                (ending.objective, ending.converged) = (Some(e.objective), e.status.is_converged());
                found.push(e);
            }
            Err(e) => {
                ending.error = Some(e.to_string());
                first_error = first_error.or(Some(e));
            }
        }
        endings.push(ending);
    }
    found.sort_by(|a, b| {
        let key = |e: &Estimate| (!e.status.is_converged(), e.objective);
        key(a).0.cmp(&key(b).0).then(a.objective.total_cmp(&b.objective))
    });
    let mut minima: Vec<&Estimate> = Vec::new();
    for e in found.iter().filter(|e| e.status.is_converged()) {
        if !minima.iter().any(|m| same(m, e)) {
            minima.push(e);
        }
    }
    let minima = minima.iter().map(|e| e.objective).collect();
    match found.into_iter().next() {
        Some(estimate) => Ok(Best { estimate, endings, minima }),
        None => Err(first_error.unwrap_or(EstimateError::NoStart)),
    }
}

/// Whether two objectives (sums of squared whitened residuals and prior terms) are equal as far as a fit reaches.
pub fn equal_cost(a: f64, b: f64) -> bool {
    (a - b).abs() <= SAME_COST * a.abs().max(1.0)
}

/// Whether two ends are the same minimum. Parameters that the data cannot tell do not count.
fn same(a: &Estimate, b: &Estimate) -> bool {
    let reach = if equal_cost(a.objective, b.objective) { SAME_FLAT } else { SAME_PLACE };
    a.parameters.iter().zip(&b.parameters).all(|(x, y)| x.std.is_none_or(|s| (x.value - y.value).abs() <= reach * s))
}
