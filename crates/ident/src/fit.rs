//! The least-squares problem behind [`crate::estimate`]: data, priors and references in unconstrained coordinates.

use crate::estimator::{EstimateError, Estimator};
use crate::lm::{EvalError, Problem};
use crate::loss::Loss;
use crate::prior::Priors;
use crate::transform::Transform;
use ff_model::ParamDecl;
use nalgebra::DMatrix;

/// A Gaussian pull towards reference values: residuals `(x - x0) / width` in the affine coordinates of bodies
/// and the logarithms of positive parameters, so that `width` is a relative change of everything.
pub(crate) struct Reference {
    transform: Transform,
    centre: Vec<f64>,
    width: f64,
}

impl Reference {
    pub(crate) fn new(
        decls: &[ParamDecl],
        selected: &[usize],
        values: &[f64],
        width: f64,
    ) -> Result<Self, EstimateError> {
        if !(width > 0.0 && width.is_finite()) {
            return Err(EstimateError::Width(width));
        }
        let transform = Transform::affine(decls, selected, values)?;
        let centre = transform.coordinates(values)?;
        Ok(Self { transform, centre, width })
    }
    fn coordinates(&self, full: &[f64]) -> Result<Vec<f64>, EvalError> {
        self.transform.coordinates(full).map_err(|e| EvalError::Rejected(e.to_string()))
    }
    pub(crate) fn residuals(&self, full: &[f64]) -> Result<Vec<f64>, EvalError> {
        Ok(self.coordinates(full)?.iter().zip(&self.centre).map(|(x, c)| (x - c) / self.width).collect())
    }
    /// With respect to the selected physical parameters, dim x dim.
    pub(crate) fn jacobian(&self, full: &[f64]) -> Result<DMatrix<f64>, EvalError> {
        let inverse = self.transform.jacobian(&self.coordinates(full)?).try_inverse();
        let inverse = inverse.ok_or_else(|| EvalError::Rejected("a parameter has become zero".into()))?;
        Ok(inverse / self.width)
    }
}

/// The estimator as a least-squares problem in unconstrained coordinates `[transform | nuisance / size]`.
pub(crate) struct Fit<'a, E: Estimator + ?Sized> {
    pub(crate) estimator: &'a mut E,
    pub(crate) loss: Loss,
    pub(crate) transform: &'a Transform,
    pub(crate) priors: &'a Priors,
    /// References with the width of the change they allow, in their coordinates.
    pub(crate) references: &'a [Reference],
    pub(crate) sizes: Vec<f64>,
    /// Start coordinates, and the exact values they stand for.
    pub(crate) origin: (&'a [f64], &'a [f64]),
    pub(crate) full: Vec<f64>,
    pub(crate) last: &'a mut Evaluated,
}

/// The last linearisation: the next round starts where this one ended.
#[derive(Default)]
pub(crate) struct Evaluated {
    pub(crate) full: Vec<f64>,
    pub(crate) extra: Vec<f64>,
    /// Whitened, before the loss.
    pub(crate) residuals: Vec<f64>,
    /// With respect to selected physical parameters and nuisance, before the loss.
    pub(crate) jacobian: DMatrix<f64>,
}

impl Evaluated {
    /// Evaluates anew unless this is where it was evaluated last.
    pub(crate) fn at<E: Estimator + ?Sized>(
        &mut self,
        estimator: &mut E,
        selected: &[usize],
        full: &[f64],
        extra: &[f64],
    ) -> Result<(), EvalError> {
        if self.full != full || self.extra != extra {
            let rows = estimator.rows();
            self.residuals.resize(rows, 0.0);
            self.jacobian.resize_mut(rows, selected.len() + extra.len(), 0.0);
            self.full.clear();
            estimator.jacobian(full, extra, selected, &mut self.residuals, &mut self.jacobian)?;
            self.full.extend_from_slice(full);
            self.extra.clear();
            self.extra.extend_from_slice(extra);
        }
        Ok(())
    }
}

impl<E: Estimator + ?Sized> Fit<'_, E> {
    fn split(&mut self, x: &[f64]) -> Vec<f64> {
        let n = self.transform.dim();
        if x[..n] == self.origin.0[..n] {
            self.full.copy_from_slice(self.origin.1);
        } else {
            self.transform.apply(&x[..n], &mut self.full);
        }
        x[n..].iter().zip(&self.sizes).map(|(x, s)| x * s).collect()
    }
    /// Refuses points where a body is not physical; the solver then takes a shorter step.
    fn check(&self) -> Result<(), EvalError> {
        match self.transform.inconsistent(&self.full) {
            Some(name) => Err(EvalError::Rejected(format!("{name} is not physical here"))),
            None => Ok(()),
        }
    }
    fn selected_values(&self) -> Vec<f64> {
        self.transform.selected().iter().map(|&i| self.full[i]).collect()
    }
}

impl<E: Estimator + ?Sized> Problem for Fit<'_, E> {
    fn dim(&self) -> usize {
        self.transform.dim() + self.sizes.len()
    }
    fn residuals(&mut self, x: &[f64], r: &mut Vec<f64>) -> Result<(), EvalError> {
        let extra = self.split(x);
        self.check()?;
        r.clear();
        r.resize(self.estimator.rows(), 0.0);
        self.estimator.residuals(&self.full, &extra, r)?;
        let loss = self.loss;
        r.iter_mut().for_each(|r| *r = loss.root(*r).0);
        let values = self.selected_values();
        self.priors.push_residuals(&values, r);
        for reference in self.references {
            r.extend(reference.residuals(&self.full)?);
        }
        Ok(())
    }
    fn jacobian(&mut self, x: &[f64], r: &mut Vec<f64>, j: &mut DMatrix<f64>) -> Result<(), EvalError> {
        let extra = self.split(x);
        let (n, rows) = (self.transform.dim(), self.estimator.rows());
        let all = rows + self.priors.len() + n * self.references.len();
        self.last.at(self.estimator, self.transform.selected(), &self.full, &extra)?;
        let loss = self.loss;
        r.clear();
        r.extend(self.last.residuals.iter().map(|&r| loss.root(r).0));
        let physical = &self.last.jacobian;
        let mut own = DMatrix::zeros(all, n);
        own.rows_mut(0, rows).copy_from(&physical.columns(0, n));
        let values = self.selected_values();
        self.priors.fill_jacobian(&mut own, r.len());
        self.priors.push_residuals(&values, r);
        for reference in self.references {
            own.rows_mut(r.len(), n).copy_from(&reference.jacobian(&self.full)?);
            r.extend(reference.residuals(&self.full)?);
        }
        self.transform.chain(&x[..n], &mut own);
        j.resize_mut(all, self.dim(), 0.0);
        j.fill(0.0);
        j.columns_mut(0, n).copy_from(&own);
        for (k, s) in self.sizes.iter().enumerate() {
            j.view_mut((0, n + k), (rows, 1)).copy_from(&(self.last.jacobian.column(n + k) * *s));
        }
        if loss != Loss::Squares {
            let slopes: Vec<f64> = self.last.residuals.iter().map(|&r| loss.root(r).1).collect();
            for mut c in j.column_iter_mut() {
                c.iter_mut().zip(&slopes).for_each(|(x, slope)| *x *= slope);
            }
        }
        Ok(())
    }
    fn describe(&self, x: &[f64]) -> Vec<(String, f64)> {
        self.transform.describe(&x[..self.transform.dim()])
    }
}
