//! One interface for every way of comparing a record with a model, and the fit that they share.
//!
//! An estimator predicts what the sensors should have read for given parameters, with exact derivatives.
//! [`estimate`] adds priors and nuisance unknowns, maps to coordinates in which every value is physical
//! ([`crate::transform`]), minimises with [`crate::lm`], and says how well each parameter is known.

use crate::covariance::{Uncertainty, Unknown, analyse};
use crate::linalg::LinalgError;
use crate::lm::{self, EvalError, LmError, Problem, Settings, Solution, Status};
use crate::prior::Priors;
use crate::scale;
use crate::transform::{Transform, TransformError};
use ff_model::ParamDecl;
use nalgebra::DMatrix;

/// A way of predicting a record. Residuals are whitened: divided by the standard deviation of the sensor.
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
}

/// What to estimate, from where, with what prior knowledge.
#[derive(Clone, Debug)]
pub struct Request<'a> {
    /// Declarations of all parameters of the model.
    pub decls: &'a [ParamDecl],
    /// Indices of the parameters to estimate, ascending.
    pub selected: &'a [usize],
    /// Full parameter vector to start from; those not selected stay as they are here.
    pub start: &'a [f64],
    /// Prior knowledge of selected parameters.
    pub priors: Priors,
    /// When to stop.
    pub settings: Settings,
}

/// One estimated parameter.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Estimated {
    /// Full name.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Where the fit started.
    pub start: f64,
    /// Estimate.
    pub value: f64,
    /// Standard deviation; `None` where the data (and priors) cannot tell.
    pub std: Option<f64>,
}

/// The result of [`estimate`].
#[derive(Clone, Debug)]
pub struct Estimate {
    /// Full parameter vector with the estimates in place.
    pub values: Vec<f64>,
    /// The estimated parameters.
    pub parameters: Vec<Estimated>,
    /// Nuisance unknowns.
    pub nuisance: Vec<Estimated>,
    /// How the fit ended.
    pub status: Status,
    /// Sum of squared whitened residuals of the data divided by the degrees of freedom; 1 when model and
    /// noise figures are right.
    pub chi2_per_dof: f64,
    /// What the data can tell: singular values, rank, null and weak directions. Priors are left out.
    pub data_only: Uncertainty,
    /// Covariance with priors included.
    pub uncertainty: Uncertainty,
    /// Linearisations used.
    pub iterations: usize,
    /// Whitened residuals of the data at the estimate.
    pub residuals: Vec<f64>,
}

/// Why there is no estimate.
#[derive(Debug, thiserror::Error)]
pub enum EstimateError {
    /// The start values have no physical coordinates.
    #[error(transparent)]
    Transform(#[from] TransformError),
    /// The minimisation failed.
    #[error(transparent)]
    Minimise(#[from] LmError),
    /// A factorisation failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

/// Relative singular value below which a direction counts as one the data say nothing about.
pub const RANK_TOLERANCE: f64 = 1e-9;

/// The estimator as a least-squares problem in unconstrained coordinates `[transform | nuisance / size]`.
struct Fit<'a, E: Estimator + ?Sized> {
    estimator: &'a mut E,
    transform: &'a Transform,
    priors: &'a Priors,
    sizes: Vec<f64>,
    full: Vec<f64>,
    physical: DMatrix<f64>,
}

impl<E: Estimator + ?Sized> Fit<'_, E> {
    fn split(&mut self, x: &[f64]) -> Vec<f64> {
        let n = self.transform.dim();
        self.transform.apply(&x[..n], &mut self.full);
        x[n..].iter().zip(&self.sizes).map(|(x, s)| x * s).collect()
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
        r.clear();
        r.resize(self.estimator.rows(), 0.0);
        self.estimator.residuals(&self.full, &extra, r)?;
        self.priors.push_residuals(&self.selected_values(), r);
        Ok(())
    }
    fn jacobian(&mut self, x: &[f64], r: &mut Vec<f64>, j: &mut DMatrix<f64>) -> Result<(), EvalError> {
        let extra = self.split(x);
        let (n, rows) = (self.transform.dim(), self.estimator.rows());
        let all = rows + self.priors.len();
        r.clear();
        r.resize(rows, 0.0);
        self.physical.resize_mut(rows, self.dim(), 0.0);
        self.estimator.jacobian(&self.full, &extra, self.transform.selected(), r, &mut self.physical)?;
        let mut own = DMatrix::zeros(all, n);
        own.rows_mut(0, rows).copy_from(&self.physical.columns(0, n));
        self.priors.push_residuals(&self.selected_values(), r);
        self.priors.fill_jacobian(&mut own, rows);
        self.transform.chain(&x[..n], &mut own);
        j.resize_mut(all, self.dim(), 0.0);
        j.fill(0.0);
        j.columns_mut(0, n).copy_from(&own);
        for (k, s) in self.sizes.iter().enumerate() {
            j.view_mut((0, n + k), (rows, 1)).copy_from(&(self.physical.column(n + k) * *s));
        }
        Ok(())
    }
    fn describe(&self, x: &[f64]) -> Vec<(String, f64)> {
        self.transform.describe(&x[..self.transform.dim()])
    }
}

/// Fits the selected parameters of `request` with `estimator`. Allocates the Jacobian and its factors.
///
/// # Errors
/// [`EstimateError`]. A fit that stalls or meets its iteration limit is returned with that
/// [`Estimate::status`], not as an error.
pub fn estimate<E: Estimator + ?Sized>(request: &Request<'_>, estimator: &mut E) -> Result<Estimate, EstimateError> {
    let transform = Transform::new(request.decls, request.selected, request.start)?;
    let extra = estimator.nuisance();
    let n = transform.dim();
    let mut start = transform.coordinates(request.start)?;
    start.resize(n + extra.len(), 0.0);
    let mut fit = Fit {
        estimator,
        transform: &transform,
        priors: &request.priors,
        sizes: extra.iter().map(|u| u.size).collect(),
        full: request.start.to_vec(),
        physical: DMatrix::zeros(0, 0),
    };
    let Solution { x, status, iterations, .. } = lm::minimise(&mut fit, &start, &request.settings)?;
    // Once more at the solution, in physical units, for the uncertainty.
    let values_extra = fit.split(&x);
    let rows = fit.estimator.rows();
    let mut residuals = vec![0.0; rows];
    fit.physical.resize_mut(rows, n + extra.len(), 0.0);
    let selected = transform.selected();
    fit.estimator
        .jacobian(&fit.full, &values_extra, selected, &mut residuals, &mut fit.physical)
        .map_err(|e| LmError::Setup(e.to_string()))?;
    let (data, values) = (fit.physical, fit.full);
    let sizes = scale::sizes(request.decls, &values);
    let mut unknowns: Vec<Unknown> = selected
        .iter()
        .map(|&i| Unknown {
            name: request.decls[i].name.clone(),
            unit: request.decls[i].unit.to_owned(),
            size: sizes[i],
        })
        .collect();
    unknowns.extend(extra.iter().cloned());
    let data_only = analyse(&data, &unknowns, RANK_TOLERANCE)?;
    let uncertainty = if request.priors.is_empty() {
        data_only.clone()
    } else {
        let mut both = data.resize_vertically(rows + request.priors.len(), 0.0);
        let mut tail = DMatrix::zeros(rows + request.priors.len(), n);
        request.priors.fill_jacobian(&mut tail, rows);
        both.view_mut((rows, 0), (request.priors.len(), n)).copy_from(&tail.rows(rows, request.priors.len()));
        analyse(&both, &unknowns, RANK_TOLERANCE)?
    };
    let chi2: f64 = residuals.iter().map(|r| r * r).sum();
    let dof = rows.saturating_sub(data_only.rank).max(1);
    let listed = |k: usize, start: f64, value: f64| Estimated {
        name: unknowns[k].name.clone(),
        unit: unknowns[k].unit.clone(),
        start,
        value,
        std: uncertainty.deviation[k],
    };
    Ok(Estimate {
        parameters: selected.iter().enumerate().map(|(k, &i)| listed(k, request.start[i], values[i])).collect(),
        nuisance: values_extra.iter().enumerate().map(|(k, &v)| listed(n + k, 0.0, v)).collect(),
        values,
        status,
        chi2_per_dof: chi2 / dof as f64,
        data_only,
        uncertainty,
        iterations,
        residuals,
    })
}
