//! An estimator over other unknowns than its own: parameters and nuisance unknowns are functions of those that the fit sees.

use crate::belief::covariance::Unknown;
use crate::estimate::along::Direction;
use crate::estimate::estimator::{At, Coarse, Estimator, Steps, columns_by_directions};
use crate::estimate::row_stream::RowStream;
use ff_least_squares::EvalError;
use nalgebra::DMatrix;

/// What parameters and nuisance unknowns of an estimator are functions of.
pub trait Substitution: Clone {
    /// The nuisance unknowns that the fit sees, of those of the estimator.
    fn nuisance(&self, inner: Vec<Unknown>) -> Vec<Unknown> {
        inner
    }
    /// About what the parameters of the estimator are, whatever the nuisance values are.
    ///
    /// # Errors
    /// As [`Substitution::values`].
    fn parameters(&self, full: &[f64]) -> Result<Vec<f64>, EvalError>;
    /// Parameters and nuisance values of the estimator.
    ///
    /// # Errors
    /// [`EvalError`] where they are not defined; the fit then takes a shorter step.
    fn values(&self, full: &[f64], extra: &[f64]) -> Result<(Vec<f64>, Vec<f64>), EvalError>;
    /// The derivatives of all of these with respect to every parameter, then every nuisance unknown that the fit sees.
    ///
    /// # Errors
    /// As [`Substitution::values`].
    fn slopes(&self, full: &[f64], extra: &[f64]) -> Result<Vec<Direction>, EvalError>;
}

/// The estimator with a substitution before it. Columns are the estimator's along the directions in which an unknown of the fit moves
/// its parameters and nuisance unknowns (chain rule, exact).
pub struct Substituted<E, S> {
    /// The estimator over its own unknowns.
    pub inner: E,
    pub(crate) by: S,
}

impl<E: Estimator, S: Substitution> Substituted<E, S> {
    fn around<'b>(&self, inner: Coarse<'b>) -> Coarse<'b>
    where
        S: 'b,
    {
        Coarse { estimator: Box::new(Substituted { inner: inner.estimator, by: self.by.clone() }), ..inner }
    }
    /// Directions of the estimator for those of the fit.
    fn through(&self, full: &[f64], extra: &[f64], along: &[Direction]) -> Result<Vec<Direction>, EvalError> {
        let slopes = self.by.slopes(full, extra)?;
        Ok(along.iter().map(|d| d.through(&slopes)).collect())
    }
}

impl<E: Estimator, S: Substitution> Estimator for Substituted<E, S> {
    fn rows(&self) -> usize {
        self.inner.rows()
    }
    fn left_out(&self) -> usize {
        self.inner.left_out()
    }
    fn nuisance(&self) -> Vec<Unknown> {
        self.by.nuisance(self.inner.nuisance())
    }
    fn coarse(&self, full: &[f64]) -> Option<Coarse<'_>> {
        Some(self.around(self.inner.coarse(&self.by.parameters(full).ok()?)?))
    }
    fn rough(&self, full: &[f64]) -> Option<Coarse<'_>> {
        Some(self.around(self.inner.rough(&self.by.parameters(full).ok()?)?))
    }
    fn stepped(&self, full: &[f64], steps: Steps) -> Option<Coarse<'_>> {
        Some(self.around(self.inner.stepped(&self.by.parameters(full).ok()?, steps)?))
    }
    fn beginning(&self, share: f64) -> Option<Coarse<'_>> {
        Some(self.around(self.inner.beginning(share)?))
    }
    fn residuals(&mut self, full: &[f64], extra: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
        let (full, extra) = self.by.values(full, extra)?;
        self.inner.residuals(&full, &extra, r)
    }
    fn residuals_at(&mut self, at: &[At<'_>], r: &mut [&mut [f64]]) -> Vec<Result<(), EvalError>> {
        let values: Result<Vec<_>, EvalError> = at.iter().map(|(full, extra)| self.by.values(full, extra)).collect();
        match values {
            Ok(values) => {
                let at: Vec<At<'_>> = values.iter().map(|(full, extra)| (&full[..], &extra[..])).collect();
                self.inner.residuals_at(&at, r)
            }
            Err(_) => at.iter().zip(r).map(|(&(full, extra), r)| self.residuals(full, extra, r)).collect(),
        }
    }
    fn refine(&mut self, full: &[f64], extra: &[f64], most: usize) -> Result<bool, EvalError> {
        let (full, extra) = self.by.values(full, extra)?;
        self.inner.refine(&full, &extra, most)
    }
    columns_by_directions!();
    fn jacobian_along(
        &mut self,
        full: &[f64],
        extra: &[f64],
        along: &[Direction],
        r: &mut [f64],
        j: &mut DMatrix<f64>,
    ) -> Result<(), EvalError> {
        let (of_full, of_extra) = self.by.values(full, extra)?;
        let along = self.through(full, extra, along)?;
        self.inner.jacobian_along(&of_full, &of_extra, &along, r, j)
    }
    fn streams_along<'s>(
        &'s mut self,
        full: &[f64],
        extra: &[f64],
        along: &[Direction],
    ) -> Result<Vec<Box<dyn RowStream + 's>>, EvalError> {
        let (of_full, of_extra) = self.by.values(full, extra)?;
        let along = self.through(full, extra, along)?;
        self.inner.streams_along(&of_full, &of_extra, &along)
    }
}
