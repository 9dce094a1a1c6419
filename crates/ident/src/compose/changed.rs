//! A record during which some parameters were others than in the list.
//!
//! Fuel is burnt between two records, and the same robot has less of it. [`Changed`] predicts a record with `p_i + e_i` in place of `p_i`,
//! with a nuisance unknown `e_i` for each parameter that changes. What the unknowns of several records have to do with one another
//! (a random walk) is said where they are put together: [`crate::compose::SharedErrors::combine`].

use crate::belief::covariance::Unknown;
use crate::compose::tied_rows::{Made, TiedColumns, TiedRows};
use crate::estimate::estimator::{Coarse, Estimator};
use crate::estimate::row_stream::{RowBlock, RowStream};
use ff_least_squares::EvalError;
use ff_model::{ParamDecl, ParamGroup};
use nalgebra::DMatrix;
use std::sync::Arc;

/// Before the name of a parameter, that of its change in a record.
const CHANGE: &str = "change.";

/// An estimator of which some parameters are off by unknowns of its own, behind its other nuisance unknowns.
///
/// ```
/// use ff_least_squares::EvalError;
/// use ff_model::ParamDecl;
/// use ident::compose::Changed;
/// use ident::Estimator;
/// use nalgebra::DMatrix;
///
/// /// Reads `3 p`.
/// struct Triple;
/// impl Estimator for Triple {
///     fn rows(&self) -> usize { 1 }
///     fn residuals(&mut self, p: &[f64], _: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
///         r[0] = 3.0 * p[0];
///         Ok(())
///     }
///     fn jacobian(&mut self, p: &[f64], e: &[f64], _: &[usize], r: &mut [f64], j: &mut DMatrix<f64>) -> Result<(), EvalError> {
///         j[(0, 0)] = 3.0;
///         self.residuals(p, e, r)
///     }
/// }
/// let decls = [ParamDecl::positive("tank.mass", "kg", 8.0)];
/// let mut later = Changed::new(Box::new(Triple), &decls, &[(0, 0.5)]);
/// assert_eq!(later.nuisance()[0].name, "change.tank.mass");
/// let (mut r, mut j) = ([0.0], DMatrix::zeros(1, 2));
/// later.jacobian(&[8.0], &[-1.5], &[0], &mut r, &mut j)?;
/// assert_eq!((r[0], j[(0, 0)], j[(0, 1)]), (19.5, 3.0, 3.0));
/// // Nothing has a negative mass.
/// assert!(later.residuals(&[8.0], &[-9.0], &mut r).is_err());
/// # Ok::<(), EvalError>(())
/// ```
pub struct Changed<'a> {
    inner: Box<dyn Estimator + 'a>,
    /// Parameters that change, each with its name, unit and whether it is positive.
    of: Vec<(usize, Unknown, bool)>,
}

impl<'a> Changed<'a> {
    /// `changes` are the parameters that may be others in this record, by index into `decls`, each once, with the size of a relevant change.
    /// Allocates.
    ///
    /// # Panics
    /// If an index does not exist.
    pub fn new(inner: Box<dyn Estimator + 'a>, decls: &[ParamDecl], changes: &[(usize, f64)]) -> Self {
        let one = |&(i, size): &(usize, f64)| {
            let d = &decls[i];
            let positive = d.group == ParamGroup::Positive || d.unit == "kg";
            (i, Unknown { name: Self::name(&d.name), unit: d.unit.to_owned(), size }, positive)
        };
        Self { inner, of: changes.iter().map(one).collect() }
    }
    /// Name of the unknown that is the change of a parameter.
    pub fn name(parameter: &str) -> String {
        format!("{CHANGE}{parameter}")
    }
    fn around<'b>(&self, inner: Box<dyn Estimator + 'b>) -> Changed<'b> {
        Changed { inner, of: self.of.clone() }
    }
    /// The parameters of this record, and the nuisance values of the inner estimator.
    fn of_record<'e>(&self, full: &[f64], extra: &'e [f64]) -> Result<(Vec<f64>, &'e [f64]), EvalError> {
        let (own, changes) = extra.split_at(extra.len() - self.of.len());
        let mut full = full.to_vec();
        for ((i, unknown, positive), by) in self.of.iter().zip(changes) {
            full[*i] += by;
            if *positive && (full[*i].is_nan() || full[*i] <= 0.0) {
                let name = unknown.name.trim_start_matches(CHANGE);
                return Err(EvalError::Rejected(format!("{name} is not positive here")));
            }
        }
        Ok((full, own))
    }
    fn columns(&self, selected: &[usize], own: usize) -> TiedColumns {
        let mut wanted: Vec<usize> = selected.iter().copied().chain(self.of.iter().map(|c| c.0)).collect();
        wanted.sort_unstable();
        wanted.dedup();
        let at = |i: usize| Made::Free(wanted.binary_search(&i).unwrap_or_default());
        let mut made: Vec<Made> = selected.iter().map(|&i| at(i)).collect();
        made.extend((0..own).map(|k| Made::Free(wanted.len() + k)));
        made.extend(self.of.iter().map(|c| at(c.0)));
        TiedColumns { wanted, made, extras: 0 }
    }
}

impl Estimator for Changed<'_> {
    fn rows(&self) -> usize {
        self.inner.rows()
    }
    fn nuisance(&self) -> Vec<Unknown> {
        let mut all = self.inner.nuisance();
        all.extend(self.of.iter().map(|c| c.1.clone()));
        all
    }
    fn coarse(&self, full: &[f64]) -> Option<Coarse<'_>> {
        let thin = self.inner.coarse(full)?;
        Some(Coarse { estimator: Box::new(self.around(thin.estimator)), ..thin })
    }
    fn beginning(&self, share: f64) -> Option<Coarse<'_>> {
        let begun = self.inner.beginning(share)?;
        Some(Coarse { estimator: Box::new(self.around(begun.estimator)), ..begun })
    }
    fn residuals(&mut self, full: &[f64], extra: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
        let (full, own) = self.of_record(full, extra)?;
        self.inner.residuals(&full, own, r)
    }
    fn jacobian(
        &mut self,
        full: &[f64],
        extra: &[f64],
        selected: &[usize],
        r: &mut [f64],
        j: &mut DMatrix<f64>,
    ) -> Result<(), EvalError> {
        let (full, own) = self.of_record(full, extra)?;
        let columns = self.columns(selected, own.len());
        let mut all = DMatrix::zeros(r.len(), columns.wanted.len() + own.len());
        self.inner.jacobian(&full, own, &columns.wanted, r, &mut all)?;
        columns.gather(&all, j);
        Ok(())
    }
    fn streams<'s>(
        &'s mut self,
        full: &[f64],
        extra: &[f64],
        selected: &[usize],
    ) -> Result<Vec<Box<dyn RowStream + 's>>, EvalError> {
        let (full, own) = self.of_record(full, extra)?;
        let columns = Arc::new(self.columns(selected, own.len()));
        let inner = self.inner.streams(&full, own, &columns.wanted)?;
        let changed = |inner| -> Box<dyn RowStream + 's> {
            Box::new(TiedRows { inner, columns: Arc::clone(&columns), buffer: RowBlock::default() })
        };
        Ok(inner.into_iter().map(changed).collect())
    }
}
