//! Biases and initial state of a record, fitted while the parameters of the robot stay as they are.

use crate::estimate::estimator::Estimator;
use crate::estimate::request::FINEST;
use ff_least_squares::{EvalError, LmError, Problem, Settings, minimise};
use nalgebra::DMatrix;

/// Relative reduction of the cost below which the fit ends.
const COST_FLOOR: f64 = 1e-13;

/// The nuisance unknowns of a record at given parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct NuisanceFit {
    /// Values in the order and units of [`Estimator::nuisance`].
    pub values: Vec<f64>,
    /// Whitened residuals `(model - measured) / sigma` there.
    pub residuals: Vec<f64>,
    /// How many of them are no data ([`Estimator::left_out`]).
    pub left_out: usize,
}

impl NuisanceFit {
    /// Sum of squared residuals over the degrees of freedom: residuals that are data less nuisance unknowns, at least one.
    pub fn chi2_per_dof(&self) -> f64 {
        let freedom = self.residuals.len().saturating_sub(self.values.len() + self.left_out);
        self.residuals.iter().map(|r| r * r).sum::<f64>() / freedom.max(1) as f64
    }
}

/// Why nuisance unknowns cannot be fitted.
#[derive(Debug, thiserror::Error)]
pub enum NuisanceError {
    /// The record cannot be predicted at these parameters.
    #[error(transparent)]
    Evaluate(#[from] EvalError),
    /// The minimisation failed.
    #[error(transparent)]
    Minimise(#[from] LmError),
}

/// The nuisance unknowns as a least-squares problem: coordinates are values over their sizes.
struct Scaled<'a> {
    inner: &'a mut dyn Estimator,
    parameters: &'a [f64],
    sizes: Vec<f64>,
}

impl Scaled<'_> {
    fn values(&self, x: &[f64]) -> Vec<f64> {
        x.iter().zip(&self.sizes).map(|(x, s)| x * s).collect()
    }
}

impl Problem for Scaled<'_> {
    fn dim(&self) -> usize {
        self.sizes.len()
    }
    fn residuals(&mut self, x: &[f64], r: &mut Vec<f64>) -> Result<(), EvalError> {
        let extra = self.values(x);
        r.resize(self.inner.rows(), 0.0);
        self.inner.residuals(self.parameters, &extra, r)
    }
    fn jacobian(&mut self, x: &[f64], r: &mut Vec<f64>, j: &mut DMatrix<f64>) -> Result<(), EvalError> {
        let extra = self.values(x);
        r.resize(self.inner.rows(), 0.0);
        j.resize_mut(self.inner.rows(), self.sizes.len(), 0.0);
        self.inner.jacobian(self.parameters, &extra, &[], r, j)?;
        for (k, s) in self.sizes.iter().enumerate() {
            j.column_mut(k).scale_mut(*s);
        }
        Ok(())
    }
}

/// Minimises the squared residuals over the nuisance unknowns of `estimator`, from zero, with the full parameter vector
/// `parameters` held; predictions are as exact as these ask for ([`Estimator::refine`]). Without nuisance unknowns the
/// residuals are evaluated once. Allocates.
///
/// # Errors
/// [`NuisanceError`].
pub fn fit_nuisance(
    estimator: &mut dyn Estimator,
    parameters: &[f64],
    max_iterations: usize,
) -> Result<NuisanceFit, NuisanceError> {
    let left_out = estimator.left_out();
    let sizes: Vec<f64> = estimator.nuisance().iter().map(|u| u.size).collect();
    // Steps of the integration are those that other parameters asked for. Where nothing can be predicted, what follows says so.
    let _ = estimator.refine(parameters, &vec![0.0; sizes.len()], FINEST);
    if sizes.is_empty() {
        let mut residuals = vec![0.0; estimator.rows()];
        estimator.residuals(parameters, &[], &mut residuals)?;
        return Ok(NuisanceFit { values: Vec::new(), residuals, left_out });
    }
    let start = vec![0.0; sizes.len()];
    let mut problem = Scaled { inner: estimator, parameters, sizes };
    let settings = Settings { max_iterations, cost_floor: COST_FLOOR, ..Settings::default() };
    let found = minimise(&mut problem, &start, &settings)?;
    Ok(NuisanceFit { values: problem.values(&found.x), residuals: found.residuals, left_out })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::belief::covariance::Unknown;
    use ff_testkit::assert_within;

    /// Residuals `a p + B e - y` with one parameter p and two nuisance values e of different sizes.
    struct Linear {
        a: Vec<f64>,
        b: DMatrix<f64>,
        y: Vec<f64>,
    }

    impl Estimator for Linear {
        fn rows(&self) -> usize {
            self.y.len()
        }
        fn nuisance(&self) -> Vec<Unknown> {
            let one = |name: &str, size| Unknown { name: name.into(), unit: "N m".into(), size };
            vec![one("first", 0.01), one("second", 30.0)]
        }
        fn residuals(&mut self, full: &[f64], extra: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
            for (i, r) in r.iter_mut().enumerate() {
                *r = self.a[i] * full[0] + self.b[(i, 0)] * extra[0] + self.b[(i, 1)] * extra[1] - self.y[i];
            }
            Ok(())
        }
        fn jacobian(
            &mut self,
            full: &[f64],
            extra: &[f64],
            selected: &[usize],
            r: &mut [f64],
            j: &mut DMatrix<f64>,
        ) -> Result<(), EvalError> {
            self.residuals(full, extra, r)?;
            for i in 0..r.len() {
                for (c, _) in selected.iter().enumerate() {
                    j[(i, c)] = self.a[i];
                }
                for k in 0..2 {
                    j[(i, selected.len() + k)] = self.b[(i, k)];
                }
            }
            Ok(())
        }
    }

    #[test]
    fn the_normal_equations_of_the_nuisance_alone_hold() {
        let n = 23;
        let b = DMatrix::from_fn(n, 2, |i, k| ((i + 1) as f64 * (0.37 + 0.21 * k as f64)).sin());
        let a: Vec<f64> = (0..n).map(|i| (0.11 * i as f64).cos()).collect();
        let y: Vec<f64> = (0..n).map(|i| (0.7 * i as f64).sin() + 0.3 * i as f64).collect();
        let held = 1.7;
        // Independent: solve B'B e = B'(y - a p) by LU.
        let rhs = nalgebra::DVector::from_fn(n, |i, _| y[i] - a[i] * held);
        let expected = (b.tr_mul(&b)).lu().solve(&b.tr_mul(&rhs)).unwrap();
        let squares = (&b * &expected - &rhs).norm_squared();
        let fit = fit_nuisance(&mut Linear { a, b, y }, &[held], 50).unwrap();
        for (found, want) in fit.values.iter().zip(expected.iter()) {
            assert_within!((found - want).abs(), 1e-8 * want.abs().max(1.0), "{found} {want}");
        }
        assert_within!((fit.chi2_per_dof() - squares / (n - 2) as f64).abs(), 1e-9 * squares);
    }
}
