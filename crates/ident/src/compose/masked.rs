//! An estimator with weights on its samples.

use crate::belief::covariance::Unknown;
use crate::estimate::along::Direction;
use crate::estimate::estimator::{At, Coarse, Estimator, Steps, columns_by_directions};
use crate::estimate::row_stream::{RowBlock, RowStream, weigh};
use ff_least_squares::EvalError;
use ff_records::Mask;
use nalgebra::DMatrix;

/// An estimator whose rows are multiplied by the square root of weights.
pub struct Masked<E> {
    inner: E,
    roots: Vec<f64>,
}

impl<E: Estimator> Masked<E> {
    /// `None` unless there is one weight per row.
    pub fn new(inner: E, mask: &Mask) -> Option<Self> {
        let roots: Vec<f64> = mask.rows().iter().map(|w| w.max(0.0).sqrt()).collect();
        (roots.len() == inner.rows()).then_some(Self { inner, roots })
    }
    /// [`Masked::new`] for a record whose torques or gyro have sample times of their own: rows of all torque samples come first.
    pub fn by_group(inner: E, mask: &Mask) -> Option<Self> {
        let rows = |m: &DMatrix<f64>| m.transpose().as_slice().to_vec();
        let roots: Vec<f64> = [rows(&mask.tau), rows(&mask.gyro)].concat().iter().map(|w| w.max(0.0).sqrt()).collect();
        (roots.len() == inner.rows()).then_some(Self { inner, roots })
    }
}

impl<E: Estimator> Masked<E> {
    fn over_less<'b>(&self, inner: Coarse<'b>) -> Coarse<'b> {
        let roots = inner.rows.iter().map(|&i| self.roots[i]).collect();
        Coarse { estimator: Box::new(Masked { inner: inner.estimator, roots }), ..inner }
    }
}

impl<E: Estimator> Estimator for Masked<E> {
    fn rows(&self) -> usize {
        self.inner.rows()
    }
    fn left_out(&self) -> usize {
        self.inner.left_out()
    }
    fn coarse(&self, full: &[f64]) -> Option<Coarse<'_>> {
        Some(self.over_less(self.inner.coarse(full)?))
    }
    fn rough(&self, full: &[f64]) -> Option<Coarse<'_>> {
        Some(self.over_less(self.inner.rough(full)?))
    }
    fn stepped(&self, full: &[f64], steps: Steps) -> Option<Coarse<'_>> {
        Some(self.over_less(self.inner.stepped(full, steps)?))
    }
    fn beginning(&self, share: f64) -> Option<Coarse<'_>> {
        Some(self.over_less(self.inner.beginning(share)?))
    }
    fn nuisance(&self) -> Vec<Unknown> {
        self.inner.nuisance()
    }
    fn residuals(&mut self, full: &[f64], extra: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
        self.inner.residuals(full, extra, r)?;
        weigh(r, &self.roots);
        Ok(())
    }
    fn residuals_at(&mut self, at: &[At<'_>], r: &mut [&mut [f64]]) -> Vec<Result<(), EvalError>> {
        let done = self.inner.residuals_at(at, r);
        r.iter_mut().for_each(|r| weigh(r.iter_mut(), &self.roots));
        done
    }
    fn refine(&mut self, full: &[f64], extra: &[f64], most: usize) -> Result<bool, EvalError> {
        self.inner.refine(full, extra, most)
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
        self.inner.jacobian_along(full, extra, along, r, j)?;
        weigh(r, &self.roots);
        j.column_iter_mut().for_each(|mut c| weigh(c.iter_mut(), &self.roots));
        Ok(())
    }
    fn streams_along<'s>(
        &'s mut self,
        full: &[f64],
        extra: &[f64],
        along: &[Direction],
    ) -> Result<Vec<Box<dyn RowStream + 's>>, EvalError> {
        let Self { inner, roots } = self;
        let weighed = |inner| -> Box<dyn RowStream + 's> { Box::new(Weighed { inner, roots }) };
        Ok(inner.streams_along(full, extra, along)?.into_iter().map(weighed).collect())
    }
}

/// Rows of a stream with their weights.
struct Weighed<'s> {
    inner: Box<dyn RowStream + 's>,
    roots: &'s [f64],
}

impl RowStream for Weighed<'_> {
    fn next(&mut self, block: &mut RowBlock) -> Result<bool, EvalError> {
        if !self.inner.next(block)? {
            return Ok(false);
        }
        let roots: Vec<f64> = block.rows.iter().flat_map(|r| &self.roots[r.clone()]).copied().collect();
        weigh(&mut block.residuals, &roots);
        block.jacobian.column_iter_mut().for_each(|mut c| weigh(c.iter_mut(), &roots));
        Ok(true)
    }
}
