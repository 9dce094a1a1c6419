//! One interface for every way of comparing a record with a model.
//!
//! An estimator predicts what the sensors should have read for given parameters, with exact derivatives.
//! [`crate::estimate()`] is the fit that they share.

use crate::belief::covariance::Unknown;
use crate::estimate::along::{Direction, Sums};
use crate::estimate::row_stream::{RowBlock, RowStream, Whole};
use ff_least_squares::EvalError;
use nalgebra::DMatrix;

/// A cheaper look at the same data ([`Estimator::coarse`]).
pub struct Coarse<'a> {
    /// Over some of the rows, with the same parameters and nuisance.
    pub estimator: Box<dyn Estimator + 'a>,
    /// Which of the rows they are, ascending.
    pub rows: Vec<usize>,
    /// Where each row of the whole lies between them; empty where they end before those do.
    pub between: Vec<Between>,
}

/// Rows that one of the whole is interpolated from.
pub(crate) const STENCIL: usize = 6;

/// Where a row of the whole lies between rows of fewer ([`Coarse`]): a quantity that changes slowly against these is the sum of so many
/// parts of what it is in them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Between {
    /// The rows.
    pub rows: [usize; STENCIL],
    /// The part of each; their sum is one.
    pub parts: [f64; STENCIL],
}

impl Between {
    /// This row alone.
    pub fn only(row: usize) -> Self {
        let mut parts = [0.0; STENCIL];
        parts[0] = 1.0;
        Self { rows: [row; STENCIL], parts }
    }
    /// Every one of so many rows is one of the fewer. Allocates.
    pub fn same(rows: usize) -> Vec<Self> {
        (0..rows).map(Self::only).collect()
    }
}

/// A way of predicting a record. Residuals are whitened: divided by the standard deviation of the sensor.
///
/// ```
/// use ff_least_squares::EvalError;
/// use ff_model::ParamDecl;
/// use ident::{Estimator, Request, estimate};
/// use nalgebra::DMatrix;
///
/// /// A stiffness from a static test: deflections under three torques, read to 1 mrad.
/// struct Static([(f64, f64); 3]);
/// impl Estimator for Static {
///     fn rows(&self) -> usize { 3 }
///     fn residuals(&mut self, p: &[f64], _: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
///         r.iter_mut().zip(self.0).for_each(|(r, (torque, angle))| *r = (torque / p[0] - angle) / 1e-3);
///         Ok(())
///     }
///     fn jacobian(&mut self, p: &[f64], e: &[f64], _: &[usize], r: &mut [f64], j: &mut DMatrix<f64>) -> Result<(), EvalError> {
///         (0..3).for_each(|i| j[(i, 0)] = -self.0[i].0 / p[0].powi(2) / 1e-3);
///         self.residuals(p, e, r)
///     }
/// }
/// let k = [ParamDecl::positive("hinge.k", "N m/rad", 150.0)];
/// let fit = estimate(&Request::new(&k, &[0], &[150.0]), &mut Static([(5.0, 0.025), (9.0, 0.0449), (14.0, 0.0701)]))?;
/// assert!((fit.values[0] - 200.0).abs() < 1.0);
/// # Ok::<(), ident::EstimateError>(())
/// ```
pub trait Estimator {
    /// Number of residuals, the same for every call.
    fn rows(&self) -> usize;
    /// Unknowns besides the parameters of the model (biases, initial state); their `size` is the scale of a
    /// relevant change, and their start value is zero.
    fn nuisance(&self) -> Vec<Unknown> {
        Vec::new()
    }
    /// Whitened residuals `(model - measured) / sigma` into `r` ([`Estimator::rows`] long).
    ///
    /// `full` is the full parameter vector of the model, `extra` the nuisance values.
    ///
    /// # Errors
    /// [`EvalError`].
    fn residuals(&mut self, full: &[f64], extra: &[f64], r: &mut [f64]) -> Result<(), EvalError>;
    /// [`Estimator::residuals`] at several places, those of `at[k]` into `r[k]`; side by side where that is faster. Unless overridden, one after
    /// the other.
    fn residuals_at(&mut self, at: &[At<'_>], r: &mut [&mut [f64]]) -> Vec<Result<(), EvalError>> {
        at.iter().zip(r).map(|(&(full, extra), r)| self.residuals(full, extra, r)).collect()
    }
    /// Rows among them that are zero whatever the unknowns are, and are no data: torques of joints next to rest, and readings near kinks of the motion. None unless overridden.
    fn left_out(&self) -> usize {
        0
    }
    /// Residuals and their derivatives: columns are `selected` (indices into the full vector), then nuisance.
    /// `j` arrives with the right shape and unspecified contents.
    ///
    /// # Errors
    /// [`EvalError`].
    fn jacobian(
        &mut self,
        full: &[f64],
        extra: &[f64],
        selected: &[usize],
        r: &mut [f64],
        j: &mut DMatrix<f64>,
    ) -> Result<(), EvalError>;
    /// What [`Estimator::jacobian`] gives, block by block, so that nobody need hold all rows: every row is in one block of one of the
    /// streams, whose number and cuts do not depend on the point. Streams may be gone through side by side. Unless overridden, one
    /// block of all rows.
    ///
    /// # Errors
    /// [`EvalError`].
    fn streams<'s>(
        &'s mut self,
        full: &[f64],
        extra: &[f64],
        selected: &[usize],
    ) -> Result<Vec<Box<dyn RowStream + 's>>, EvalError> {
        let mut all = RowBlock::default();
        let rows = self.rows();
        all.resize(core::slice::from_ref(&(0..rows)), selected.len() + extra.len());
        self.jacobian(full, extra, selected, &mut all.residuals, &mut all.jacobian)?;
        Ok(vec![Box::new(Whole(Some(all)))])
    }
    /// As [`Estimator::jacobian`], with columns along the directions `along`. Unless overridden, sums of columns along single unknowns.
    ///
    /// # Errors
    /// [`EvalError`].
    fn jacobian_along(
        &mut self,
        full: &[f64],
        extra: &[f64],
        along: &[Direction],
        r: &mut [f64],
        j: &mut DMatrix<f64>,
    ) -> Result<(), EvalError> {
        let sums = Sums::new(full.len(), along);
        let mut all = DMatrix::zeros(r.len(), sums.wanted.len() + extra.len());
        self.jacobian(full, extra, &sums.wanted, r, &mut all)?;
        sums.gather(&all, j);
        Ok(())
    }
    /// As [`Estimator::streams`], with columns along the directions `along`.
    ///
    /// # Errors
    /// [`EvalError`].
    fn streams_along<'s>(
        &'s mut self,
        full: &[f64],
        extra: &[f64],
        along: &[Direction],
    ) -> Result<Vec<Box<dyn RowStream + 's>>, EvalError> {
        let sums = Sums::new(full.len(), along);
        let inner = self.streams(full, extra, &sums.wanted)?;
        Ok(sums.over(inner))
    }
    /// Makes the predictions themselves more exact for all that follows, if their numerical error at these unknowns is too large, and says
    /// whether they were made so, which takes up to `most` times the work. Never unless overridden.
    ///
    /// # Errors
    /// [`EvalError`].
    fn refine(&mut self, full: &[f64], extra: &[f64], most: usize) -> Result<bool, EvalError> {
        let _ = (full, extra, most);
        Ok(false)
    }
    /// The same over so much less data that it takes a fraction of the time, if there is enough of it: [`crate::estimate()`] takes the way
    /// there and does the last steps with all of it. `full` is about where it will be used. `None` unless overridden.
    fn coarse(&self, full: &[f64]) -> Option<Coarse<'_>> {
        let _ = full;
        None
    }
    /// The same over fewer data still, where all of them have the last word: what hardly rings there need not be followed. [`Estimator::coarse`]
    /// unless overridden.
    fn rough(&self, full: &[f64]) -> Option<Coarse<'_>> {
        self.coarse(full)
    }
    /// The same over fewer data in long steps, whether the fastest mode at `full` rings or not: who asks finds out whether what is left tells enough
    /// ([`crate::estimate::Around`]). `None` where that is not less, and unless overridden.
    fn stepped(&self, full: &[f64], steps: Steps) -> Option<Coarse<'_>> {
        let _ = (full, steps);
        None
    }
    /// The same over the first `share` (0 to 1) of every record, if that is enough of it: where oscillations predicted and measured have
    /// not yet slipped by a period, [`crate::estimate()`] finds the way that it does not find over the whole. `None` unless overridden.
    fn beginning(&self, share: f64) -> Option<Coarse<'_>> {
        let _ = share;
        None
    }
}

/// Steps over less data ([`Estimator::stepped`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Steps {
    /// Of which so many make a period of the fastest mode.
    pub per_period: f64,
    /// So many in place of each: the data stay the same, and are predicted where modes are faster by as much.
    pub each_in: usize,
}

/// Unknowns at which a record is predicted: all parameters, and the nuisance unknowns.
pub type At<'p> = (&'p [f64], &'p [f64]);

/// Columns of single unknowns as those along directions, for an estimator that has these: a default of the trait for both would call itself.
macro_rules! columns_by_directions {
    () => {
        fn jacobian(
            &mut self,
            full: &[f64],
            extra: &[f64],
            selected: &[usize],
            r: &mut [f64],
            j: &mut DMatrix<f64>,
        ) -> Result<(), EvalError> {
            let along = Direction::of_columns(selected, full.len(), extra.len());
            self.jacobian_along(full, extra, &along, r, j)
        }
        fn streams<'s>(
            &'s mut self,
            full: &[f64],
            extra: &[f64],
            selected: &[usize],
        ) -> Result<Vec<Box<dyn RowStream + 's>>, EvalError> {
            let along = Direction::of_columns(selected, full.len(), extra.len());
            self.streams_along(full, extra, &along)
        }
    };
}
pub(crate) use columns_by_directions;

/// What points to an estimator is one.
macro_rules! pointer {
    ($pointer:ty) => {
        impl<E: Estimator + ?Sized> Estimator for $pointer {
            fn rows(&self) -> usize {
                (**self).rows()
            }
            fn left_out(&self) -> usize {
                (**self).left_out()
            }
            fn nuisance(&self) -> Vec<Unknown> {
                (**self).nuisance()
            }
            fn residuals(&mut self, full: &[f64], extra: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
                (**self).residuals(full, extra, r)
            }
            fn residuals_at(&mut self, at: &[At<'_>], r: &mut [&mut [f64]]) -> Vec<Result<(), EvalError>> {
                (**self).residuals_at(at, r)
            }
            fn jacobian(
                &mut self,
                full: &[f64],
                extra: &[f64],
                selected: &[usize],
                r: &mut [f64],
                j: &mut DMatrix<f64>,
            ) -> Result<(), EvalError> {
                (**self).jacobian(full, extra, selected, r, j)
            }
            fn streams<'s>(
                &'s mut self,
                full: &[f64],
                extra: &[f64],
                selected: &[usize],
            ) -> Result<Vec<Box<dyn RowStream + 's>>, EvalError> {
                (**self).streams(full, extra, selected)
            }
            fn jacobian_along(
                &mut self,
                full: &[f64],
                extra: &[f64],
                along: &[Direction],
                r: &mut [f64],
                j: &mut DMatrix<f64>,
            ) -> Result<(), EvalError> {
                (**self).jacobian_along(full, extra, along, r, j)
            }
            fn streams_along<'s>(
                &'s mut self,
                full: &[f64],
                extra: &[f64],
                along: &[Direction],
            ) -> Result<Vec<Box<dyn RowStream + 's>>, EvalError> {
                (**self).streams_along(full, extra, along)
            }
            fn refine(&mut self, full: &[f64], extra: &[f64], most: usize) -> Result<bool, EvalError> {
                (**self).refine(full, extra, most)
            }
            fn coarse(&self, full: &[f64]) -> Option<Coarse<'_>> {
                (**self).coarse(full)
            }
            fn rough(&self, full: &[f64]) -> Option<Coarse<'_>> {
                (**self).rough(full)
            }
            fn stepped(&self, full: &[f64], steps: Steps) -> Option<Coarse<'_>> {
                (**self).stepped(full, steps)
            }
            fn beginning(&self, share: f64) -> Option<Coarse<'_>> {
                (**self).beginning(share)
            }
        }
    };
}
pointer!(Box<E>);
pointer!(&mut E);
