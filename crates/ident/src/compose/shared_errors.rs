//! Errors that all records have in common, as parameters.
//!
//! A gain of a torque sensor or the place of a mount is a nuisance unknown of every estimator that knows it. Left there, each record
//! would have one of its own, with a prior of its own, and five records would average away what one sensor does to all of them.
//! [`SharedErrors`] makes one parameter of such unknowns: appended to those of the model, selected, given a prior and kept in a posterior
//! like any other. Its column is the sum of theirs.
//!
//! An error may be a part of several of them instead ([`SharedErrors::combine`]): a step of a random walk from record to record.

use crate::belief::covariance::Unknown;
use crate::compose::several::is_called;
use crate::compose::substituted::{Substituted, Substitution};
use crate::estimate::along::Direction;
use crate::estimate::estimator::Estimator;
use ff_least_squares::EvalError;

/// An estimator whose parameter vector goes on, behind that of the model, with errors that its records share.
///
/// ```
/// use ff_least_squares::EvalError;
/// use ident::belief::Unknown;
/// use ident::compose::SharedErrors;
/// use ident::Estimator;
/// use nalgebra::DMatrix;
///
/// /// Two records that read `(1 + gain) p`, each with a gain and a bias of its own.
/// struct Two;
/// impl Estimator for Two {
///     fn rows(&self) -> usize { 2 }
///     fn nuisance(&self) -> Vec<Unknown> {
///         ["a.gain", "a.bias", "b.gain", "b.bias"].map(|n| Unknown { name: n.into(), unit: "1".into(), size: 0.01 }).to_vec()
///     }
///     fn residuals(&mut self, p: &[f64], e: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
///         r.copy_from_slice(&[(1.0 + e[0]) * p[0] + e[1] - 3.0, (1.0 + e[2]) * p[0] + e[3] - 3.1]);
///         Ok(())
///     }
///     fn jacobian(&mut self, p: &[f64], e: &[f64], _: &[usize], r: &mut [f64], j: &mut DMatrix<f64>) -> Result<(), EvalError> {
///         j.copy_from(&DMatrix::from_row_slice(2, 5, &[1.0 + e[0], p[0], 1.0, 0.0, 0.0, 1.0 + e[2], 0.0, 0.0, p[0], 1.0]));
///         self.residuals(p, e, r)
///     }
/// }
/// let mut shared = SharedErrors::new(Box::new(Two), 1, &["gain".to_owned()], &["a".to_owned(), "b".to_owned()]);
/// assert_eq!(shared.nuisance().iter().map(|u| u.name.as_str()).collect::<Vec<_>>(), ["a.bias", "b.bias"]);
/// let (mut r, mut j) = ([0.0; 2], DMatrix::zeros(2, 4));
/// shared.jacobian(&[2.5, 0.2], &[0.1, 0.3], &[0, 1], &mut r, &mut j)?;
/// assert_eq!(j.column(1).as_slice(), [2.5, 2.5]);
/// # Ok::<(), EvalError>(())
/// ```
pub type SharedErrors<'a> = Substituted<Box<dyn Estimator + 'a>, CommonErrors>;

/// Nuisance unknowns that are made of parameters behind those of the model.
#[derive(Clone, Debug)]
pub struct CommonErrors {
    /// Parameters of the model.
    parameters: usize,
    /// Nuisance unknowns that each shared error stands for, each with its value per unit of the error, and those that are left, by their
    /// place among those of the inner one.
    of: Vec<Vec<(usize, f64)>>,
    kept: Vec<usize>,
}

impl<'a> SharedErrors<'a> {
    /// The nuisance unknowns of `inner` called `names`, with the labels of records before them where there are several, become parameters
    /// behind the first `parameters`. A name that none has is a parameter without effect. Allocates.
    pub fn new(inner: Box<dyn Estimator + 'a>, parameters: usize, names: &[String], labels: &[String]) -> Self {
        let all = inner.nuisance();
        let own = |unknown: &str| names.iter().position(|name| is_called(unknown, name, labels));
        let (mut of, mut kept) = (vec![Vec::new(); names.len()], Vec::new());
        for (k, u) in all.iter().enumerate() {
            match own(&u.name) {
                Some(i) => of[i].push((k, 1.0)),
                None => kept.push(k),
            }
        }
        Self { inner, by: CommonErrors { parameters, of, kept } }
    }
    /// With nuisance unknowns of the inner estimator, called by their full names, that are made of errors: error `i` (its place in the list
    /// of [`SharedErrors::new`]) adds so much per unit to each of `made`. Several errors may have a part in one: the change of a
    /// parameter in a record is the sum of its steps from record to record. Names that none has are left out. Allocates.
    ///
    /// # Panics
    /// If there is no such error.
    #[must_use]
    pub fn combine(mut self, i: usize, made: &[(String, f64)]) -> Self {
        let all = self.inner.nuisance();
        for (name, by) in made {
            if let Some(k) = all.iter().position(|u| u.name == *name) {
                self.by.of[i].push((k, *by));
                self.by.kept.retain(|kept| *kept != k);
            }
        }
        self
    }
}

impl Substitution for CommonErrors {
    fn nuisance(&self, inner: Vec<Unknown>) -> Vec<Unknown> {
        self.kept.iter().map(|&k| inner[k].clone()).collect()
    }
    fn parameters(&self, full: &[f64]) -> Result<Vec<f64>, EvalError> {
        Ok(full[..self.parameters].to_vec())
    }
    fn values(&self, full: &[f64], extra: &[f64]) -> Result<(Vec<f64>, Vec<f64>), EvalError> {
        let made = self.of.iter().flatten().map(|o| o.0).chain(self.kept.iter().copied());
        let mut out = vec![0.0; made.max().map_or(0, |last| last + 1)];
        self.kept.iter().zip(extra).for_each(|(&k, x)| out[k] = *x);
        for (all, x) in self.of.iter().zip(&full[self.parameters..]) {
            all.iter().for_each(|&(k, by)| out[k] += by * x);
        }
        Ok((full[..self.parameters].to_vec(), out))
    }
    fn slopes(&self, _full: &[f64], _extra: &[f64]) -> Result<Vec<Direction>, EvalError> {
        let behind = |&(k, by): &(usize, f64)| (self.parameters + k, by);
        let errors = self.of.iter().map(|made| Direction(made.iter().map(behind).collect()));
        let kept = self.kept.iter().map(|k| Direction::of(self.parameters + k));
        Ok((0..self.parameters).map(Direction::of).chain(errors).chain(kept).collect())
    }
}
