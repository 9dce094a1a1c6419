//! Fits from many starts: the best of them, and whether they agree.

use ff_least_squares::EvalError;
use ff_model::{ParamDecl, ParamGroup};
use ident::compose::*;
use ident::estimate::EstimateError;
use ident::estimate::Estimator;
use ident::estimate::Request;
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
