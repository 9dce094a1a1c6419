//! One interface for every way of comparing a record with a model, and the fit that they share.
//!
//! An estimator predicts what the sensors should have read for given parameters, with exact derivatives.
//! [`estimate`] adds priors and nuisance unknowns, minimises with [`crate::lm`] over physical values only, and
//! says how well each parameter is known.
//!
//! Bodies are estimated in their inertial parameters, in which records are nearly linear, and steps that
//! would leave the physical bodies are refused and shortened. In log-Cholesky coordinates, where every point is
//! physical, the same fit of the flexible case creeps along curved valleys (`docs/decisions/0004-coordinates.md`).

use crate::covariance::{Uncertainty, Unknown, analyse};
use crate::linalg::LinalgError;
use crate::lm::{self, Criterion, EvalError, LmError, Problem, Scale, Settings, Status};
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
    /// Prior knowledge of everything selected at once: relative standard deviation around the start (0.3 is
    /// 30 %), bodies measured in the affine-invariant metric. `None` for none.
    pub prior_width: Option<f64>,
    /// Holds directions that neither data nor priors determine near where they are, without biasing the
    /// others: a pull of this relative width that is re-centred at each estimate until it moves nothing
    /// (proximal point method). `None` leaves such directions to drift.
    pub anchor: Option<f64>,
    /// When to stop.
    pub settings: Settings,
}

impl<'a> Request<'a> {
    /// These parameters from this start, with the data alone: no priors, no anchor, default settings.
    pub fn new(decls: &'a [ParamDecl], selected: &'a [usize], start: &'a [f64]) -> Self {
        Self {
            decls,
            selected,
            start,
            priors: Priors::default(),
            prior_width: None,
            anchor: None,
            settings: Settings::default(),
        }
    }
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
    /// A prior or anchor with a width that is not positive and finite.
    #[error("prior or anchor width {0} must be positive and finite, such as 0.3 for 30 %")]
    Width(f64),
    /// The minimisation failed.
    #[error(transparent)]
    Minimise(#[from] LmError),
    /// A factorisation failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

/// Relative singular value below which a direction counts as one the data say nothing about.
pub const RANK_TOLERANCE: f64 = 1e-9;

/// Longest step in affine coordinates. Coordinates are taken anew around every estimate, so that a step below 1
/// always leads to physical values, and a body close to the boundary is approached, never crossed.
const RADIUS: f64 = 0.5;
/// Relative move below which it has no more to give.
const ANCHOR_MOVED: f64 = 1e-10;

/// A Gaussian pull towards reference values: residuals `(x - x0) / width` in the affine coordinates of bodies
/// and the logarithms of positive parameters, so that `width` is a relative change of everything.
struct Reference {
    transform: Transform,
    centre: Vec<f64>,
    width: f64,
}

impl Reference {
    fn new(decls: &[ParamDecl], selected: &[usize], values: &[f64], width: f64) -> Result<Self, EstimateError> {
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
    fn residuals(&self, full: &[f64]) -> Result<Vec<f64>, EvalError> {
        Ok(self.coordinates(full)?.iter().zip(&self.centre).map(|(x, c)| (x - c) / self.width).collect())
    }
    /// With respect to the selected physical parameters, dim x dim.
    fn jacobian(&self, full: &[f64]) -> Result<DMatrix<f64>, EvalError> {
        let inverse = self.transform.jacobian(&self.coordinates(full)?).try_inverse();
        let inverse = inverse.ok_or_else(|| EvalError::Rejected("a parameter has become zero".into()))?;
        Ok(inverse / self.width)
    }
}

/// The estimator as a least-squares problem in unconstrained coordinates `[transform | nuisance / size]`.
struct Fit<'a, E: Estimator + ?Sized> {
    estimator: &'a mut E,
    transform: &'a Transform,
    priors: &'a Priors,
    /// References with the width of the change they allow, in their coordinates.
    references: &'a [Reference],
    sizes: Vec<f64>,
    /// Start coordinates, and the exact values they stand for.
    origin: (&'a [f64], &'a [f64]),
    full: Vec<f64>,
    last: &'a mut Evaluated,
}

/// The last linearisation: the next round starts where this one ended.
#[derive(Default)]
struct Evaluated {
    full: Vec<f64>,
    extra: Vec<f64>,
    residuals: Vec<f64>,
    /// With respect to selected physical parameters and nuisance.
    jacobian: DMatrix<f64>,
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
        r.clear();
        if self.last.full != self.full || self.last.extra != extra {
            self.last.residuals.resize(rows, 0.0);
            self.last.jacobian.resize_mut(rows, self.dim(), 0.0);
            self.last.full.clear();
            let (selected, last) = (self.transform.selected(), &mut *self.last);
            self.estimator.jacobian(&self.full, &extra, selected, &mut last.residuals, &mut last.jacobian)?;
            last.full.clone_from(&self.full);
            last.extra = extra;
        }
        r.extend_from_slice(&self.last.residuals);
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
    let extra = estimator.nuisance();
    let n = request.selected.len();
    let sizes_extra: Vec<f64> = extra.iter().map(|u| u.size).collect();
    let mut nuisance = vec![0.0; extra.len()];
    let mut full = request.start.to_vec();
    let mut iterations = 0;
    let fixed = match request.prior_width {
        Some(w) => Some(Reference::new(request.decls, request.selected, request.start, w)?),
        None => None,
    };
    let mut references: Vec<Reference> = fixed.into_iter().collect();
    let priors_kept = references.len();
    let mut settings = Settings {
        scale: Scale::Unit,
        initial_radius: RADIUS,
        max_radius: RADIUS,
        max_iterations: 1,
        acceleration: true,
        ..request.settings.clone()
    };
    let mut last = None;
    let mut evaluated = Evaluated::default();
    let (transform, status) = loop {
        // Coordinates around the present estimate: linear in the bodies, scaled by them.
        let transform = match (Transform::affine(request.decls, request.selected, &full), last.take()) {
            (Ok(t), _) => t,
            // The fit has pressed a body against the boundary of what is physical: that is the answer.
            (Err(TransformError::Boundary { .. }), Some(t)) => {
                break (t, Status::AtBound { at: Vec::new(), by: Criterion::Step });
            }
            (Err(e), _) => return Err(e.into()),
        };
        references.truncate(priors_kept);
        if let Some(w) = request.anchor {
            references.push(Reference::new(request.decls, request.selected, &full, w)?);
        }
        let mut x = transform.coordinates(&full)?;
        x.extend_from_slice(&nuisance);
        let mut fit = Fit {
            estimator: &mut *estimator,
            transform: &transform,
            priors: &request.priors,
            references: &references,
            sizes: sizes_extra.clone(),
            origin: (&x, &full),
            full: full.clone(),
            last: &mut evaluated,
        };
        let solution = lm::minimise(&mut fit, &x, &settings)?;
        iterations += solution.iterations;
        settings.initial_radius = solution.radius.min(RADIUS);
        nuisance.copy_from_slice(&solution.x[n..]);
        if solution.x[..n] != x[..n] {
            transform.apply(&solution.x[..n], &mut full);
        }
        let moved = solution.x.iter().zip(&x).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let settled = solution.status.is_converged() && (request.anchor.is_none() || moved < ANCHOR_MOVED);
        if settled || iterations >= request.settings.max_iterations || matches!(solution.status, Status::Stalled { .. })
        {
            break (transform, solution.status);
        }
        last = Some(transform);
    };
    references.truncate(priors_kept);
    let values_extra: Vec<f64> = nuisance.iter().zip(&sizes_extra).map(|(x, s)| x * s).collect();
    let rows = estimator.rows();
    let selected = transform.selected();
    let at_solution = |e: EvalError| LmError::Setup(e.to_string());
    // The last linearisation is the one at the solution, unless the last step was refused after it.
    if evaluated.full != full || evaluated.extra != values_extra {
        evaluated.residuals.resize(rows, 0.0);
        evaluated.jacobian.resize_mut(rows, n + extra.len(), 0.0);
        let Evaluated { residuals, jacobian, .. } = &mut evaluated;
        estimator.jacobian(&full, &values_extra, selected, residuals, jacobian).map_err(at_solution)?;
    }
    let Evaluated { residuals, jacobian: data, .. } = evaluated;
    let values = full;
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
    let uncertainty = if request.priors.is_empty() && references.is_empty() {
        data_only.clone()
    } else {
        let known = request.priors.len() + n * references.len();
        let mut tail = DMatrix::zeros(known, n);
        request.priors.fill_jacobian(&mut tail, 0);
        for (k, r) in references.iter().enumerate() {
            let rows = r.jacobian(&values).map_err(at_solution)?;
            tail.rows_mut(request.priors.len() + k * n, n).copy_from(&rows);
        }
        let mut both = data.resize_vertically(rows + known, 0.0);
        both.view_mut((rows, 0), (known, n)).copy_from(&tail);
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
