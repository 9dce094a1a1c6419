//! A record during which some parameters were others than in the list.
//!
//! Fuel is burnt between two records, and the same robot has less of it. [`Changed`] predicts a record with `p_i + e_i` in place of `p_i`,
//! with a nuisance unknown `e_i` for each parameter that changes. What the unknowns of several records have to do with one another
//! (a random walk) is said where they are put together: [`crate::compose::SharedErrors::combine`].

use crate::belief::covariance::Unknown;
use crate::compose::substituted::{Substituted, Substitution};
use crate::estimate::along::Direction;
use crate::estimate::estimator::Estimator;
use ff_least_squares::EvalError;
use ff_model::{ParamDecl, ParamGroup};

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
pub type Changed<'a> = Substituted<Box<dyn Estimator + 'a>, Changes>;

/// Parameters that are others in a record by nuisance unknowns of its own: `p_i + e_i` for `p_i`.
#[derive(Clone, Debug)]
pub struct Changes {
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
        Self { inner, by: Changes { of: changes.iter().map(one).collect() } }
    }
    /// Name of the unknown that is the change of a parameter.
    pub fn name(parameter: &str) -> String {
        format!("{CHANGE}{parameter}")
    }
}

impl Substitution for Changes {
    fn nuisance(&self, mut inner: Vec<Unknown>) -> Vec<Unknown> {
        inner.extend(self.of.iter().map(|c| c.1.clone()));
        inner
    }
    fn parameters(&self, full: &[f64]) -> Result<Vec<f64>, EvalError> {
        Ok(full.to_vec())
    }
    fn values(&self, full: &[f64], extra: &[f64]) -> Result<(Vec<f64>, Vec<f64>), EvalError> {
        let (own, changes) = extra.split_at(extra.len() - self.of.len());
        let mut full = full.to_vec();
        for ((i, unknown, positive), by) in self.of.iter().zip(changes) {
            full[*i] += by;
            if *positive && (full[*i].is_nan() || full[*i] <= 0.0) {
                let name = unknown.name.trim_start_matches(CHANGE);
                return Err(EvalError::Rejected(format!("{name} is not positive here")));
            }
        }
        Ok((full, own.to_vec()))
    }
    fn slopes(&self, full: &[f64], extra: &[f64]) -> Result<Vec<Direction>, EvalError> {
        let own = full.len() + extra.len() - self.of.len();
        Ok((0..own).chain(self.of.iter().map(|c| c.0)).map(Direction::of).collect())
    }
}
