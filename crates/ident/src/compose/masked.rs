//! An estimator with weights on its samples.

use crate::belief::covariance::Unknown;
use crate::estimate::estimator::{Coarse, Estimator};
use crate::estimate::row_stream::{RowBlock, RowStream};
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

fn weigh<'a>(rows: impl IntoIterator<Item = &'a mut f64>, roots: &[f64]) {
    rows.into_iter().zip(roots).for_each(|(x, w)| *x *= w);
}

impl<E: Estimator> Estimator for Masked<E> {
    fn rows(&self) -> usize {
        self.inner.rows()
    }
    fn coarse(&self, full: &[f64]) -> Option<Coarse<'_>> {
        let thin = self.inner.coarse(full)?;
        let roots = thin.rows.iter().map(|&i| self.roots[i]).collect();
        Some(Coarse { estimator: Box::new(Masked { inner: thin.estimator, roots }), ..thin })
    }
    fn beginning(&self, share: f64) -> Option<Coarse<'_>> {
        let begun = self.inner.beginning(share)?;
        let roots = begun.rows.iter().map(|&i| self.roots[i]).collect();
        Some(Coarse { estimator: Box::new(Masked { inner: begun.estimator, roots }), ..begun })
    }
    fn nuisance(&self) -> Vec<Unknown> {
        self.inner.nuisance()
    }
    fn residuals(&mut self, full: &[f64], extra: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
        self.inner.residuals(full, extra, r)?;
        weigh(r, &self.roots);
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
        self.inner.jacobian(full, extra, selected, r, j)?;
        weigh(r, &self.roots);
        j.column_iter_mut().for_each(|mut c| weigh(c.iter_mut(), &self.roots));
        Ok(())
    }
    fn streams<'s>(
        &'s mut self,
        full: &[f64],
        extra: &[f64],
        selected: &[usize],
    ) -> Result<Vec<Box<dyn RowStream + 's>>, EvalError> {
        let Self { inner, roots } = self;
        let weighed = |inner| -> Box<dyn RowStream + 's> { Box::new(Weighed { inner, roots }) };
        Ok(inner.streams(full, extra, selected)?.into_iter().map(weighed).collect())
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

#[cfg(test)]
mod tests {
    use super::*;

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
            crate::estimate(&crate::Request::new(&decls, &[0, 1], &[1.0, 1.0]), e).unwrap().values
        };
        let with = fit(&mut Masked::new(Line(y.clone()), &mask).unwrap());
        assert!((with[0] - 0.7).abs() < 1e-8 && (with[1] - 0.3).abs() < 1e-9, "{with:?}");
        let without = fit(&mut Line(y.clone()));
        assert!((without[0] - 0.7).abs() > 0.1, "{without:?}");
        assert!(Masked::new(Line(y), &Mask::all(39, 1)).is_none());
    }
}
