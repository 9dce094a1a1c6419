//! Fits from many starts: the best of them, and whether they agree.
//!
//! One start may end in a local minimum without a sign of it. Several that agree are no proof, but several that disagree are
//! a warning (bad-inputs row D33): the lowest is taken, and the others are listed with their costs.

use crate::estimate::estimation::estimate;
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
        match estimate(&Request { start, ..request.clone() }, estimator) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use ff_least_squares::EvalError;
    use ff_model::{ParamDecl, ParamGroup};
    use nalgebra::DMatrix;

    /// `(p^2 - 1)^2 + tilt p` has a minimum on each side of zero, the left one lower where it is tilted.
    struct TwoWells {
        tilt: f64,
    }

    impl Estimator for TwoWells {
        fn rows(&self) -> usize {
            2
        }
        fn residuals(&mut self, full: &[f64], _: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
            if full[0] > 5.0 {
                return Err(EvalError::Rejected("too far".into()));
            }
            r[0] = full[0] * full[0] - 1.0;
            r[1] = (self.tilt * (full[0] + 4.0)).sqrt();
            Ok(())
        }
        fn jacobian(
            &mut self,
            full: &[f64],
            extra: &[f64],
            _: &[usize],
            r: &mut [f64],
            j: &mut DMatrix<f64>,
        ) -> Result<(), EvalError> {
            self.residuals(full, extra, r)?;
            j[(0, 0)] = 2.0 * full[0];
            j[(1, 0)] = if self.tilt > 0.0 { 0.5 * self.tilt / r[1] } else { 0.0 };
            Ok(())
        }
    }

    #[test]
    fn the_lower_minimum_is_taken_and_the_other_reported() {
        let inf = f64::INFINITY;
        let decls = [ParamDecl { bounds: (-inf, inf), group: ParamGroup::Free, ..ParamDecl::positive("p", "1", 1.0) }];
        let request = Request::new(&decls, &[0], &[1.0]);
        let starts: Vec<Vec<f64>> = [1.4, -1.7, 0.8, 7.0, -0.9].iter().map(|p| vec![*p]).collect();
        let best = best_of(&request, &starts, &mut TwoWells { tilt: 0.3 }).unwrap();
        assert!(best.estimate.values[0] < -1.0, "{:?}", best.estimate.values);
        assert_eq!(best.minima.len(), 2);
        assert!(best.minima[0] < best.minima[1]);
        assert!(best.endings[3].error.as_deref().is_some_and(|e| e.contains("too far")));
        assert_eq!(best.endings.iter().filter(|e| e.converged).count(), 4);
        let one = best_of(&request, &starts[..1], &mut TwoWells { tilt: 0.3 }).unwrap();
        assert!(one.minima.len() == 1 && one.estimate.values[0] > 0.0);
        assert!(best_of(&request, &starts[3..4], &mut TwoWells { tilt: 0.3 }).is_err());
        assert!(matches!(best_of(&request, &[], &mut TwoWells { tilt: 0.3 }), Err(EstimateError::NoStart)));
    }

    #[test]
    fn minima_of_equal_cost_are_told_apart_by_their_places() {
        let inf = f64::INFINITY;
        let decls = [ParamDecl { bounds: (-inf, inf), group: ParamGroup::Free, ..ParamDecl::positive("p", "1", 1.0) }];
        let request = Request::new(&decls, &[0], &[1.0]);
        let starts: Vec<Vec<f64>> = [1.4, -1.7, 0.8, -0.9].iter().map(|p| vec![*p]).collect();
        let best = best_of(&request, &starts, &mut TwoWells { tilt: 0.0 }).unwrap();
        assert!(best.endings.iter().all(|e| e.converged));
        assert!(best.minima.len() == 2 && equal_cost(best.minima[0], best.minima[1]), "{:?}", best.minima);
        let right = [starts[0].clone(), starts[2].clone()];
        assert_eq!(best_of(&request, &right, &mut TwoWells { tilt: 0.0 }).unwrap().minima.len(), 1);
    }
}
