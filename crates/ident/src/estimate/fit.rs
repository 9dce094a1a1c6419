//! The least-squares problem behind [`crate::estimate()`]: data, priors and references in unconstrained coordinates.

use crate::belief::prior::Priors;
use crate::estimate::estimator::Estimator;
use crate::estimate::fold::{self, At, Folded};
use crate::estimate::outcome::EstimateError;
use crate::estimate::request::Request;
use crate::parameters::transform::Transform;
use crate::solve::loss::Loss;
use ff_least_squares::{EvalError, LmError};
use ff_least_squares::{Linearise, Reduced, Tried, finite, reduced, rounding};
use ff_least_squares::{Tall, triangle_of};
use ff_linalg as linalg;
use ff_linalg::LinalgError;
use ff_model::ParamDecl;
use nalgebra::{DMatrix, DVector};

/// A Gaussian pull towards reference values: residuals `(x - x0) / width` in the affine coordinates of bodies
/// and the logarithms of positive parameters, so that `width` is a relative change of everything.
pub(crate) struct Reference {
    transform: Transform,
    centre: Vec<f64>,
    width: f64,
}

impl Reference {
    pub(crate) fn new(
        decls: &[ParamDecl],
        selected: &[usize],
        values: &[f64],
        width: f64,
    ) -> Result<Self, EstimateError> {
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
    pub(crate) fn residuals(&self, full: &[f64]) -> Result<Vec<f64>, EvalError> {
        Ok(self.coordinates(full)?.iter().zip(&self.centre).map(|(x, c)| (x - c) / self.width).collect())
    }
    /// With respect to the selected physical parameters, dim x dim.
    pub(crate) fn jacobian(&self, full: &[f64]) -> Result<DMatrix<f64>, EvalError> {
        let inverse = self.transform.jacobian(&self.coordinates(full)?).try_inverse();
        let inverse = inverse.ok_or_else(|| EvalError::Rejected("a parameter has become zero".into()))?;
        Ok(inverse / self.width)
    }
}

/// The estimator as a least-squares problem in unconstrained coordinates `[transform | nuisance / size]`.
pub(crate) struct Fit<'a, E: Estimator + ?Sized> {
    estimator: &'a mut E,
    loss: Loss,
    transform: &'a Transform,
    priors: &'a Priors,
    /// References with the width of the change they allow, in their coordinates.
    references: &'a [Reference],
    sizes: &'a [f64],
    /// Start coordinates, and the exact values they stand for.
    origin: (&'a [f64], &'a [f64]),
    full: Vec<f64>,
    last: &'a mut Evaluated,
    /// What turns the physical Jacobian into that of the coordinates: where the solver is, and at the candidate.
    frames: [Frame; 2],
}

/// The coordinates at a point, to first order.
#[derive(Default)]
struct Frame {
    /// `d physical / d x` of the parameters.
    chain: DMatrix<f64>,
    /// Rows of priors and references, over the coordinates.
    known: DMatrix<f64>,
}

/// A linearisation of the data, in physical units.
#[derive(Default)]
pub(crate) struct Linearised {
    full: Vec<f64>,
    extra: Vec<f64>,
    /// Whitened, before the loss.
    pub(crate) residuals: Vec<f64>,
    /// With respect to selected physical parameters and nuisance, before the loss.
    pub(crate) jacobian: DMatrix<f64>,
    /// Derivatives of the roots of the loss; empty for squares.
    slopes: Vec<f64>,
    /// Upper triangle of `[J r]`, after the loss.
    triangle: DMatrix<f64>,
    /// What is left where rows were not kept; its triangle is the one above.
    folded: Option<Folded>,
}

impl Linearised {
    fn is_at(&self, full: &[f64], extra: &[f64]) -> bool {
        self.full == full && self.extra == extra
    }
    fn evaluate<E: Estimator + ?Sized>(
        &mut self,
        estimator: &mut E,
        selected: &[usize],
        full: &[f64],
        extra: &[f64],
        loss: Loss,
        threads: Option<usize>,
    ) -> Result<(), EvalError> {
        let rows = estimator.rows();
        self.residuals.resize(rows, 0.0);
        if let Some(threads) = threads {
            self.full.clear();
            let at = At { full, extra, selected, threads };
            let mut folded = fold::fold(estimator, at, loss, &mut self.residuals)?;
            self.triangle = core::mem::take(&mut folded.triangle);
            self.folded = Some(folded);
            self.ends_at(full, extra, loss);
            return Ok(());
        }
        let columns = selected.len() + extra.len();
        if self.jacobian.shape() != (rows, columns) {
            // Pages that come zeroed are not written twice.
            self.jacobian = DMatrix::from_vec(rows, columns, vec![0.0; rows * columns]);
        }
        self.full.clear();
        estimator.jacobian(full, extra, selected, &mut self.residuals, &mut self.jacobian)?;
        self.ends_at(full, extra, loss);
        Ok(())
    }
    /// Residuals are those of this point.
    fn ends_at(&mut self, full: &[f64], extra: &[f64], loss: Loss) {
        self.full.extend_from_slice(full);
        self.extra.clear();
        self.extra.extend_from_slice(extra);
        self.slopes.clear();
        if loss != Loss::Squares {
            self.slopes.extend(self.residuals.iter().map(|&r| loss.root(r).1));
        }
    }
    /// Triangle of the Jacobian alone, without the loss: what [`crate::belief::covariance::analyse`] needs of it.
    pub(crate) fn information(&self) -> Result<DMatrix<f64>, LinalgError> {
        if let Some(folded) = self.folded.as_ref().filter(|f| !f.plain.is_empty()) {
            return Ok(folded.plain.clone());
        }
        let n = if self.folded.is_some() { self.triangle.ncols() - 1 } else { self.jacobian.ncols() };
        if self.slopes.is_empty() && self.triangle.ncols() == n + 1 {
            return Ok(self.triangle.columns(0, n).into_owned());
        }
        triangle_of(&Tall::new(&self.jacobian))
    }
}

/// The last two linearisations: the next round starts where this one ended.
pub(crate) struct Evaluated {
    /// Threads that fold the rows, where they are not kept.
    threads: Option<usize>,
    /// Where the solver is, and the candidate.
    at: [Linearised; 2],
    /// Which of them was asked for last.
    asked: usize,
}

impl Evaluated {
    /// Of rows that are kept, or folded on so many threads.
    pub(crate) fn new(threads: Option<usize>) -> Self {
        Self { threads, at: Default::default(), asked: 0 }
    }
    /// Whether rows are folded, not kept.
    pub(crate) fn folds(&self) -> bool {
        self.threads.is_some()
    }
    /// The linearisation at a point, without its triangle if it is new. Evaluates unless it is at hand.
    pub(crate) fn at<E: Estimator + ?Sized>(
        &mut self,
        estimator: &mut E,
        selected: &[usize],
        full: &[f64],
        extra: &[f64],
        loss: Loss,
    ) -> Result<&mut Linearised, EvalError> {
        self.asked = usize::from(!self.at[0].is_at(full, extra));
        let at = &mut self.at[self.asked];
        if !at.is_at(full, extra) {
            at.triangle = DMatrix::default();
            at.evaluate(estimator, selected, full, extra, loss, self.threads)?;
        }
        Ok(at)
    }
}

impl<'a, E: Estimator + ?Sized> Fit<'a, E> {
    /// Of what `request` asks for, with the coordinates `transform` around `origin`.
    pub(crate) fn new(
        request: &'a Request<'_>,
        estimator: &'a mut E,
        transform: &'a Transform,
        references: &'a [Reference],
        sizes: &'a [f64],
        origin: (&'a [f64], &'a [f64]),
        last: &'a mut Evaluated,
    ) -> Self {
        let (loss, priors, full) = (request.loss, &request.priors, origin.1.to_vec());
        let frames = Default::default();
        Self { estimator, loss, transform, priors, references, sizes, origin, full, last, frames }
    }
    fn split(&mut self, x: &[f64]) -> Vec<f64> {
        let n = self.transform.dim();
        if x[..n] == self.origin.0[..n] {
            self.full.copy_from_slice(self.origin.1);
        } else {
            self.transform.apply(&x[..n], &mut self.full);
        }
        x[n..].iter().zip(self.sizes).map(|(x, s)| x * s).collect()
    }
    /// Refuses points where a body is not physical; the solver then takes a shorter step.
    fn check(&self) -> Result<(), EvalError> {
        match self.transform.inconsistent(&self.full) {
            Some(name) => Err(EvalError::Rejected(format!("{name} is not physical here"))),
            None => Ok(()),
        }
    }
    /// Residuals of priors and references behind those of the data.
    fn push_known(&self, r: &mut Vec<f64>) -> Result<(), EvalError> {
        let values: Vec<f64> = self.transform.selected().iter().map(|&i| self.full[i]).collect();
        self.priors.push_residuals(&values, r);
        for reference in self.references {
            r.extend(reference.residuals(&self.full)?);
        }
        Ok(())
    }
    fn whitened(&mut self, x: &[f64], r: &mut Vec<f64>) -> Result<(), EvalError> {
        let extra = self.split(x);
        self.check()?;
        r.clear();
        r.resize(self.estimator.rows(), 0.0);
        self.estimator.residuals(&self.full, &extra, r)?;
        let loss = self.loss;
        r.iter_mut().for_each(|r| *r = loss.root(*r).0);
        self.push_known(r)
    }
    /// Evaluates the data at `x`, and the rows of what is known.
    fn evaluate(&mut self, x: &[f64], r: &mut Vec<f64>) -> Result<(), EvalError> {
        let extra = self.split(x);
        let loss = self.loss;
        let at = self.last.at(&mut *self.estimator, self.transform.selected(), &self.full, &extra, loss)?;
        r.clear();
        r.extend(at.residuals.iter().map(|&r| loss.root(r).0));
        let (n, first) = (self.transform.dim(), self.priors.len());
        let chain = self.transform.jacobian(&x[..n]);
        let mut known = DMatrix::zeros(first + n * self.references.len(), n);
        let values: Vec<f64> = self.transform.selected().iter().map(|&i| self.full[i]).collect();
        self.priors.fill_jacobian(&values, &mut known, 0);
        for (k, reference) in self.references.iter().enumerate() {
            known.rows_mut(first + k * n, n).copy_from(&reference.jacobian(&self.full)?);
        }
        self.push_known(r)?;
        self.frames[1] = Frame { known: known * &chain, chain };
        Ok(())
    }
    /// The triangle in coordinates: that of the data, turned, and the rows of what is known folded in.
    fn triangle(&mut self, r: &[f64]) -> Result<Reduced, LinalgError> {
        let (n, dim, frame) = (self.transform.dim(), self.dim(), &self.frames[1]);
        let at = &mut self.last.at[self.last.asked];
        let (data, rest) = r.split_at(at.residuals.len());
        if at.triangle.is_empty() {
            let tall = Tall::new(&at.jacobian).with(data).weighted(&at.slopes);
            at.triangle = triangle_of(&tall)?;
        }
        let mut all = DMatrix::zeros(dim + 1 + rest.len(), dim + 1);
        all.view_mut((0, 0), (dim + 1, n)).copy_from(&(at.triangle.columns(0, n) * &frame.chain));
        for (k, s) in self.sizes.iter().enumerate() {
            all.view_mut((0, n + k), (dim + 1, 1)).copy_from(&(at.triangle.column(n + k) * *s));
        }
        all.view_mut((0, dim), (dim + 1, 1)).copy_from(&at.triangle.column(dim));
        all.view_mut((dim + 1, 0), (rest.len(), n)).copy_from(&frame.known);
        all.view_mut((dim + 1, dim), (rest.len(), 1)).copy_from_slice(rest);
        let t = linalg::qr_r(&all)?;
        Ok((t.view((0, 0), (dim, dim)).into_owned(), t.view((0, dim), (dim, 1)).column(0).into_owned()))
    }
}

impl<E: Estimator + ?Sized> Linearise for Fit<'_, E> {
    fn dim(&self) -> usize {
        self.transform.dim() + self.sizes.len()
    }
    fn residuals(&mut self, x: &[f64], r: &mut Vec<f64>) -> Tried<()> {
        let res = self.whitened(x, r);
        finite(res, r, None)
    }
    fn linearise(&mut self, x: &[f64], r: &mut Vec<f64>) -> Tried<Reduced> {
        let res = self.evaluate(x, r);
        if let Err(reason) = finite(res, r, None)? {
            return Ok(Err(reason));
        }
        let (m, n) = (r.len(), self.dim());
        if m < n {
            return Err(LmError::Setup(format!("{m} residuals for {n} unknowns: need at least as many")));
        }
        reduced(self.triangle(r))
    }
    fn accept(&mut self) {
        self.frames.swap(0, 1);
        self.last.at.swap(0, self.last.asked);
        self.last.asked = 0;
    }
    fn transposed(&mut self, v: &[f64]) -> Tried<DVector<f64>> {
        let (at, frame, n) = (&self.last.at[0], &self.frames[0], self.transform.dim());
        let (data, rest) = v.split_at(at.residuals.len());
        let physical = if let Some(threads) = self.last.threads {
            let place = At { full: &at.full, extra: &at.extra, selected: self.transform.selected(), threads };
            match fold::transposed(&mut *self.estimator, place, data, &at.slopes) {
                Ok(g) => g,
                Err(EvalError::Rejected(why)) => return Ok(Err(why)),
                Err(EvalError::Fatal(e)) => return Err(LmError::Fatal(e)),
            }
        } else {
            let mut data = DVector::from_column_slice(data);
            data.iter_mut().zip(&at.slopes).for_each(|(v, s)| *v *= s);
            at.jacobian.tr_mul(&data)
        };
        let mut g = DVector::zeros(self.dim());
        let known = frame.known.tr_mul(&DVector::from_column_slice(rest));
        g.rows_mut(0, n).copy_from(&(frame.chain.tr_mul(&physical.rows(0, n)) + known));
        for (k, s) in self.sizes.iter().enumerate() {
            g[n + k] = physical[n + k] * s;
        }
        Ok(Ok(g))
    }
    fn rounding(&self, _x: &[f64], r: &[f64]) -> f64 {
        // What is rounded are the parameters themselves.
        let at = &self.last.at[0];
        if let Some(folded) = &at.folded {
            return folded.rounding;
        }
        let mut values: Vec<f64> = self.transform.selected().iter().map(|&i| at.full[i]).collect();
        values.extend_from_slice(&at.extra);
        rounding(&at.jacobian, &values, &r[..at.residuals.len()])
    }
    fn describe(&self, x: &[f64]) -> Vec<(String, f64)> {
        self.transform.describe(&x[..self.transform.dim()])
    }
}
