//! The posterior of a fit as a density, in coordinates in which the fit says that it is standard normal.
//!
//! ```text
//! x = x_0 + W z,    W = P^-1 diag(s) V diag(1 / sigma)
//! ln p(z) = -1/2 (sum rho(r) + |priors|^2) + ln |det dp/dx|
//! ```
//!
//! with the singular values `sigma` and directions `V` of the whitened sensitivities at the fit over parameters scaled by their sizes
//! `s` ([`crate::belief::Uncertainty`]), and `P = dp/dx` there. Columns of W are the directions of the fit, each a standard deviation
//! long. The density is one over the physical parameters, where they are physical: what is estimated has its priors and nothing
//! else, and the determinant is that of the coordinates. The gradient is exact: `W^T (P^T (J^T r) + slope)`.

use super::chains::{LogDensity, SampleError};
use crate::belief::prior::Priors;
use crate::estimate::estimator::Estimator;
use crate::estimate::fit::Reference;
use crate::estimate::outcome::Estimate;
use crate::estimate::request::Request;
use crate::estimate::row_stream::RowBlock;
use crate::parameters::transform::{Transform, TransformError};
use crate::solve::loss::Loss;
use ff_least_squares::EvalError;
use nalgebra::{DMatrix, DVector};
use std::error::Error;

/// Largest standard deviation, relative to the body or to the value, up to which parameters are drawn in coordinates that are linear in
/// them: the edge of what is physical is then five deviations away.
const STRAIGHT: f64 = 0.2;

/// Coordinates whitened by a fit.
#[derive(Clone, Debug)]
pub struct Frame {
    transform: Transform,
    /// Where the fit has ended, over `[transform | nuisance / size]`.
    centre: DVector<f64>,
    /// Standard deviations along the directions of the fit, in columns.
    root: DMatrix<f64>,
    sizes: Vec<f64>,
    /// All parameters at the fit.
    full: Vec<f64>,
    /// Gradient of the logarithm of the determinant.
    slope: DVector<f64>,
}

impl Frame {
    /// Around the end of a fit, in coordinates that are linear in what is known well, and have no edge in the others.
    ///
    /// # Errors
    /// [`SampleError::Improper`] where something is determined by neither data nor priors, [`SampleError::NotAtMinimum`] for fits that
    /// have not ended, or that have ended at the edge of what is physical.
    pub fn new(request: &Request<'_>, at: &Estimate) -> Result<Self, SampleError> {
        determined(at)?;
        let n = request.selected.len();
        // Deviations in linear coordinates tell which parameters are near the edge of what is physical.
        let straight = Transform::affine(request.decls, request.selected, &at.values).map_err(edge)?;
        let covariance = at.uncertainty.covariance.view((0, 0), (n, n)).into_owned();
        let (_, p) = inverse(&straight, at)?;
        let spread = &p * covariance * p.transpose();
        let narrow = |first: usize, count: usize| {
            let block = spread.view((first, first), (count, count)).into_owned();
            block.symmetric_eigenvalues().max().max(0.0).sqrt() < STRAIGHT
        };
        let transform = Transform::mixed(request.decls, request.selected, &at.values, narrow).map_err(edge)?;
        Self::of(transform, at)
    }
    /// As [`Frame::new`], in coordinates that are linear in all parameters.
    ///
    /// # Errors
    /// See [`Frame::new`].
    pub(super) fn straight(request: &Request<'_>, at: &Estimate) -> Result<Self, SampleError> {
        determined(at)?;
        Self::of(Transform::affine(request.decls, request.selected, &at.values).map_err(edge)?, at)
    }
    fn of(transform: Transform, at: &Estimate) -> Result<Self, SampleError> {
        let u = &at.uncertainty;
        let (n, all) = (transform.dim(), u.unknowns.len());
        let (mut centre, p) = inverse(&transform, at)?;
        let sizes: Vec<f64> = u.unknowns[n..].iter().map(|k| k.size).collect();
        centre.extend(at.nuisance.iter().zip(&sizes).map(|(v, s)| v.value / s));
        let mut root =
            DMatrix::from_fn(all, all, |i, k| u.unknowns[i].size * u.directions[(i, k)] / u.singular_values[k]);
        let top = &p * root.rows(0, n);
        root.rows_mut(0, n).copy_from(&top);
        for (k, s) in sizes.iter().enumerate() {
            root.row_mut(n + k).unscale_mut(*s);
        }
        let mut slope = DVector::zeros(all);
        slope.rows_mut(0, n).copy_from_slice(&transform.log_volume_slope());
        Ok(Self { transform, centre: DVector::from_vec(centre), root, sizes, full: at.values.clone(), slope })
    }
    /// With other directions: `z` becomes what `by` makes of it.
    pub(super) fn turned(mut self, by: &DMatrix<f64>) -> Self {
        self.root *= by;
        self
    }
    /// Number of coordinates.
    pub fn dim(&self) -> usize {
        self.centre.len()
    }
    fn at(&self, z: &[f64]) -> Point {
        let x = &self.centre + &self.root * DVector::from_column_slice(z);
        let n = self.transform.dim();
        let mut full = self.full.clone();
        self.transform.apply(&x.as_slice()[..n], &mut full);
        let extra = x.as_slice()[n..].iter().zip(&self.sizes).map(|(x, s)| x * s).collect();
        Point { x, full, extra }
    }
    /// The selected parameters, then the nuisance unknowns, in their units. Allocates.
    ///
    /// # Panics
    /// If `z` has another length.
    pub fn physical(&self, z: &[f64]) -> Vec<f64> {
        let Point { full, extra, .. } = self.at(z);
        [self.selected_of(&full), extra].concat()
    }
    fn selected_of(&self, full: &[f64]) -> Vec<f64> {
        self.transform.selected().iter().map(|&i| full[i]).collect()
    }
}

/// Refuses fits that have not ended, and those whose data and priors leave something open.
fn determined(at: &Estimate) -> Result<(), SampleError> {
    if !at.status.is_converged() {
        return Err(SampleError::NotAtMinimum(format!("{:?}", at.status)));
    }
    let u = &at.uncertainty;
    if !u.full_rank() {
        return Err(SampleError::Improper(u.null.first().map_or_else(String::new, ToString::to_string)));
    }
    Ok(())
}

fn edge(e: TransformError) -> SampleError {
    SampleError::NotAtMinimum(e.to_string())
}

/// Coordinates of a fit, and their derivatives over the parameters.
fn inverse(t: &Transform, at: &Estimate) -> Result<(Vec<f64>, DMatrix<f64>), SampleError> {
    let x = t.coordinates(&at.values).map_err(edge)?;
    let p = t.jacobian(&x).try_inverse();
    Ok((x, p.ok_or_else(|| SampleError::NotAtMinimum("a parameter is zero".into()))?))
}

/// A point in the coordinates of a frame.
struct Point {
    /// Coordinates before whitening.
    x: DVector<f64>,
    /// All parameters.
    full: Vec<f64>,
    /// Nuisance values.
    extra: Vec<f64>,
}

/// All rows at a point, those of priors after those of the data, and their derivatives.
pub(super) struct Linear {
    pub(super) rows: DVector<f64>,
    /// Over parameters and nuisance unknowns.
    pub(super) jacobian: DMatrix<f64>,
    /// Of parameters and nuisance unknowns over the coordinates: the product of the two are the derivatives over these.
    pub(super) map: DMatrix<f64>,
}

/// The posterior of what an estimator predicts.
pub struct PosteriorDensity<'a, E: Estimator + ?Sized> {
    estimator: Box<E>,
    frame: &'a Frame,
    loss: Loss,
    priors: &'a Priors,
    /// Derivatives of the rows of priors at the last point, for the room.
    known: DMatrix<f64>,
    reference: Option<Reference>,
    block: RowBlock,
    /// How often residuals were asked for with their derivatives as a whole.
    pub(super) linearisations: usize,
}

impl<'a, E: Estimator + ?Sized> PosteriorDensity<'a, E> {
    /// Of a request, around its fit.
    ///
    /// # Errors
    /// [`SampleError::NotAtMinimum`] for a prior width whose centre has no coordinates.
    pub fn new(request: &'a Request<'_>, frame: &'a Frame, estimator: Box<E>) -> Result<Self, SampleError> {
        let reference = match request.prior_width {
            Some(w) => {
                let centre = request.centre.unwrap_or(request.start);
                let made = Reference::new(request.decls, request.selected, centre, w);
                Some(made.map_err(|e| SampleError::NotAtMinimum(e.to_string()))?)
            }
            None => None,
        };
        let (loss, priors) = (request.loss, &request.priors);
        let known = DMatrix::zeros(priors.len(), request.selected.len());
        Ok(Self { estimator, frame, loss, priors, known, reference, block: RowBlock::default(), linearisations: 0 })
    }
    /// Adds what the data say at a point: half the loss, and its gradient over parameters and nuisance values.
    fn data(&mut self, full: &[f64], extra: &[f64], gradient: &mut DVector<f64>) -> Result<f64, EvalError> {
        let Self { estimator, frame, loss, block, .. } = self;
        let mut sum = 0.0;
        for mut stream in estimator.streams(full, extra, frame.transform.selected())? {
            while stream.next(block)? {
                let mut weighted = DVector::zeros(block.count());
                for (w, &r) in weighted.iter_mut().zip(&block.residuals) {
                    let (root, slope) = loss.root(r);
                    sum += 0.5 * root * root;
                    *w = root * slope;
                }
                gradient.gemv_tr(1.0, &block.jacobian, &weighted, 1.0);
            }
        }
        Ok(sum)
    }
    /// The point, refused where it is not physical.
    fn physical(&self, z: &[f64]) -> Result<Point, EvalError> {
        let point = self.frame.at(z);
        match self.frame.transform.inconsistent(&point.full) {
            Some(name) => Err(EvalError::Rejected(format!("{name} is not physical here"))),
            None => Ok(point),
        }
    }
    /// The logarithm of the density without its gradient, for the price of a prediction; minus infinity where the density is zero.
    ///
    /// # Errors
    /// What no other point could repair.
    pub fn value(&mut self, z: &[f64]) -> Result<f64, Box<dyn Error + Send + Sync>> {
        match self.plain(z) {
            Ok(v) if !v.is_nan() => Ok(v),
            Ok(_) | Err(EvalError::Rejected(_)) => Ok(f64::NEG_INFINITY),
            Err(EvalError::Fatal(e)) => Err(e),
        }
    }
    fn plain(&mut self, z: &[f64]) -> Result<f64, EvalError> {
        let Point { x, full, extra } = self.physical(z)?;
        let frame = self.frame;
        let sum = self.rows_at(&full, &extra)?.norm_squared();
        Ok(frame.slope.dot(&(&x - &frame.centre)) - 0.5 * sum)
    }
    /// Residuals of the data, then of priors, whose squares are twice the cost; at any point, physical or not.
    ///
    /// # Errors
    /// [`EvalError`].
    pub(super) fn rows(&mut self, z: &[f64]) -> Result<DVector<f64>, EvalError> {
        let Point { full, extra, .. } = self.frame.at(z);
        self.rows_at(&full, &extra)
    }
    fn rows_at(&mut self, full: &[f64], extra: &[f64]) -> Result<DVector<f64>, EvalError> {
        let mut rows = vec![0.0; self.estimator.rows()];
        self.estimator.residuals(full, extra, &mut rows)?;
        rows.iter_mut().for_each(|r| *r = self.loss.root(*r).0);
        self.push_priors(full, &mut rows)?;
        Ok(DVector::from_vec(rows))
    }
    fn push_priors(&self, full: &[f64], rows: &mut Vec<f64>) -> Result<(), EvalError> {
        let values = self.frame.selected_of(full);
        self.priors.push_residuals(&values, rows);
        if let Some(reference) = &self.reference {
            rows.extend(reference.residuals(full)?);
        }
        Ok(())
    }
    /// [`PosteriorDensity::rows`] with their derivatives, for losses of squares.
    ///
    /// # Errors
    /// [`EvalError`].
    pub(super) fn linearised(&mut self, z: &[f64]) -> Result<Linear, EvalError> {
        self.linearisations += 1;
        let frame = self.frame;
        let (n, count) = (frame.transform.dim(), self.estimator.rows());
        let Point { x, full, extra } = frame.at(z);
        let mut rows = vec![0.0; count];
        let mut j = DMatrix::zeros(count, frame.dim());
        self.estimator.jacobian(&full, &extra, frame.transform.selected(), &mut rows, &mut j)?;
        self.push_priors(&full, &mut rows)?;
        let mut j = j.resize_vertically(rows.len(), 0.0);
        let values = frame.selected_of(&full);
        self.priors.fill_jacobian(&values, &mut j, count);
        if let Some(reference) = &self.reference {
            j.view_mut((count + self.priors.len(), 0), (n, n)).copy_from(&reference.jacobian(&full)?);
        }
        let mut map = frame.root.clone();
        let top = frame.transform.jacobian(&x.as_slice()[..n]) * map.rows(0, n);
        map.rows_mut(0, n).copy_from(&top);
        for (k, s) in frame.sizes.iter().enumerate() {
            map.row_mut(n + k).scale_mut(*s);
        }
        Ok(Linear { rows: DVector::from_vec(rows), jacobian: j, map })
    }
    fn evaluate(&mut self, z: &[f64], gradient: &mut [f64]) -> Result<f64, EvalError> {
        let Point { x, full, extra } = self.physical(z)?;
        let frame = self.frame;
        let n = frame.transform.dim();
        let mut g = DVector::zeros(frame.dim());
        let mut half = self.data(&full, &extra, &mut g)?;
        let values = frame.selected_of(&full);
        let mut rows = Vec::with_capacity(self.priors.len());
        self.priors.push_residuals(&values, &mut rows);
        let mut physical = g.rows(0, n).into_owned();
        self.priors.fill_jacobian(&values, &mut self.known, 0);
        physical.gemv_tr(1.0, &self.known, &DVector::from_column_slice(&rows), 1.0);
        half += 0.5 * rows.iter().map(|r| r * r).sum::<f64>();
        if let Some(reference) = &self.reference {
            let r = DVector::from_vec(reference.residuals(&full)?);
            physical.gemv_tr(1.0, &reference.jacobian(&full)?, &r, 1.0);
            half += 0.5 * r.norm_squared();
        }
        let chained = frame.transform.jacobian(&x.as_slice()[..n]).tr_mul(&physical);
        g.rows_mut(0, n).copy_from(&chained);
        g.rows_mut(n, frame.sizes.len()).iter_mut().zip(&frame.sizes).for_each(|(g, s)| *g *= s);
        let volume = frame.slope.dot(&(&x - &frame.centre));
        let out = frame.root.tr_mul(&(&frame.slope - g));
        gradient.copy_from_slice(out.as_slice());
        Ok(volume - half)
    }
}

impl<E: Estimator + ?Sized> LogDensity for PosteriorDensity<'_, E> {
    fn dim(&self) -> usize {
        self.frame.dim()
    }
    fn log_density(&mut self, z: &[f64], gradient: &mut [f64]) -> Result<Option<f64>, Box<dyn Error + Send + Sync>> {
        match self.evaluate(z, gradient) {
            Ok(v) => Ok(Some(v)),
            Err(EvalError::Rejected(_)) => Ok(None),
            Err(EvalError::Fatal(e)) => Err(e),
        }
    }
}
