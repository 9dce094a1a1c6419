//! An estimator with weights on its samples.

use ff_least_squares::EvalError;
use ff_records::Mask;
use ident::compose::*;
use ident::estimate::Estimator;
use nalgebra::DMatrix;

/// A straight line through samples: torque = a + b i, gyro rows 0.
struct Line(Vec<f64>);
impl Estimator for Line {
    fn rows(&self) -> usize {
        4 * self.0.len()
    }
    fn residuals(&mut self, full: &[f64], _: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
        r.fill(0.0);
        (0..self.0.len()).for_each(|i| r[4 * i] = full[0] + full[1] * i as f64 - self.0[i]);
        Ok(())
    }
    fn jacobian(
        &mut self,
        full: &[f64],
        _: &[f64],
        _: &[usize],
        r: &mut [f64],
        j: &mut DMatrix<f64>,
    ) -> Result<(), EvalError> {
        self.residuals(full, &[], r)?;
        j.fill(0.0);
        (0..self.0.len()).for_each(|i| (j[(4 * i, 0)], j[(4 * i, 1)]) = (1.0, i as f64));
        Ok(())
    }
}

#[test]
fn a_fit_does_not_feel_what_is_masked() {
    let mut y: Vec<f64> = (0..40).map(|i| 0.7 + 0.3 * i as f64).collect();
    let mut mask = Mask::all(40, 1);
    for i in 11..17 {
        y[i] = 2.0;
        mask.tau[i] = 0.0;
    }
    let decls: Vec<ff_model::ParamDecl> =
        ["a", "b"].iter().map(|n| ff_model::ParamDecl::positive(*n, "N m", 1.0)).collect();
    let fit = |e: &mut dyn Estimator| {
        crate::common::estimate(&ident::Request::new(&decls, &[0, 1], &[1.0, 1.0]), e).unwrap().values
    };
    let with = fit(&mut Masked::new(Line(y.clone()), &mask).unwrap());
    assert!((with[0] - 0.7).abs() < 1e-8 && (with[1] - 0.3).abs() < 1e-9, "{with:?}");
    let without = fit(&mut Line(y.clone()));
    assert!((without[0] - 0.7).abs() > 0.1, "{without:?}");
    assert!(Masked::new(Line(y), &Mask::all(39, 1)).is_none());
}
