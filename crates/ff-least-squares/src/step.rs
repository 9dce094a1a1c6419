//! One linearisation of a least-squares problem: its reduction to a triangle, and the damped step.

use crate as linalg;
use crate::LinalgError;
use crate::tall_qr::qr_r;
use nalgebra::{DMatrix, DVector};

/// `(R, c)` with `R^T R = J^T J` and `R^T c = J^T r`: all that a least-squares step needs to know of m rows.
///
/// The normal equations square the condition number, and with it the relative error of small singular
/// values; they cost a third of a QR. They are used when the columns, scaled to unit norm, have a Gram
/// matrix with condition below 1e6, so that the solution keeps ten digits; otherwise Householder QR of `[J r]`.
/// Allocates.
///
/// # Errors
/// [`LinalgError`] for non-finite input or m < n.
pub fn reduce(j: &DMatrix<f64>, r: &[f64]) -> Result<(DMatrix<f64>, DVector<f64>), LinalgError> {
    let (m, n) = j.shape();
    if m < n || r.len() != m {
        return Err(LinalgError::Shape {
            what: "Jacobian",
            rows: m,
            columns: n,
            needed: format!("{} rows, at least as many as columns", r.len()),
        });
    }
    linalg::check_finite_slice("residual", r)?;
    if m > 4 * n {
        let g = linalg::gram(j)?;
        let d = DVector::from_fn(n, |i, _| g[(i, i)].sqrt());
        if d.iter().all(|&x| x > 0.0) {
            let scaled = DMatrix::from_fn(n, n, |a, b| g[(a, b)] / (d[a] * d[b]));
            let (w, _) = linalg::symmetric_eigen(&scaled)?;
            if w[0] > 1e-6 * w[n - 1]
                && let Some(ch) = scaled.cholesky()
            {
                let l = ch.unpack();
                let rr = DMatrix::from_fn(n, n, |a, b| if a <= b { l[(b, a)] * d[b] } else { 0.0 });
                let mut c = j.tr_mul(&DVector::from_column_slice(r));
                if rr.transpose().solve_lower_triangular_mut(&mut c) {
                    return Ok((rr, c));
                }
            }
        }
    }
    let mut jr = DMatrix::zeros(m, n + 1);
    jr.columns_mut(0, n).copy_from(j);
    jr.column_mut(n).copy_from_slice(r);
    let t = qr_r(&jr)?;
    Ok((t.view((0, 0), (n, n)).into_owned(), t.view((0, n), (n, 1)).column(0).into_owned()))
}

/// The linearisation at a point, in the basis where the damped step is explicit.
pub(crate) struct Linear {
    r: DMatrix<f64>,
    c: DVector<f64>,
    /// Free columns, and the SVD of their `R D^-1`.
    free: Vec<usize>,
    s: Vec<f64>,
    v: DMatrix<f64>,
    /// `U^T c`.
    b: DVector<f64>,
}

impl Linear {
    pub(crate) fn new(
        r: DMatrix<f64>,
        c: DVector<f64>,
        d: &[f64],
        free: Vec<usize>,
        tolerance: f64,
    ) -> Result<Self, LinalgError> {
        if free.is_empty() {
            return Ok(Self { r, c, free, s: vec![], v: DMatrix::zeros(0, 0), b: DVector::zeros(0) });
        }
        let a = DMatrix::from_fn(r.nrows(), free.len(), |i, k| r[(i, free[k])] / d[free[k]]);
        let f = linalg::svd(&a)?;
        let rank = f.rank(tolerance);
        let b = f.u.columns(0, rank).tr_mul(&c);
        let v = f.v.columns(0, rank).into_owned();
        Ok(Self { r, c, free, s: f.s.as_slice()[..rank].to_vec(), v, b })
    }
    /// Scaled step for a damping, and `|D p|`.
    fn weights(&self, lambda: f64) -> (DVector<f64>, f64) {
        let q = DVector::from_fn(self.s.len(), |i, _| -self.s[i] * self.b[i] / (self.s[i] * self.s[i] + lambda));
        let norm = q.norm();
        (q, norm)
    }
    /// Damping that makes `|D p| = radius` to 10 % (0 when the undamped step fits): More's iteration.
    pub(crate) fn damping(&self, radius: f64) -> f64 {
        let (_, n0) = self.weights(0.0);
        if n0 <= 1.1 * radius {
            return 0.0;
        }
        let grad = self.s.iter().zip(self.b.iter()).map(|(s, b)| (s * b).powi(2)).sum::<f64>().sqrt();
        let (mut lo, mut hi) = (0.0, grad / radius);
        let mut lambda = 1e-3 * hi;
        for _ in 0..60 {
            let (q, norm) = self.weights(lambda);
            if (norm - radius).abs() <= 0.1 * radius {
                break;
            }
            if norm > radius {
                lo = lambda
            } else {
                hi = lambda
            }
            let slope = -q.iter().zip(&self.s).map(|(q, s)| q * q / (s * s + lambda)).sum::<f64>() / norm;
            let next = lambda - (norm / radius) * (norm - radius) / slope;
            lambda = if next > lo && next < hi { next } else { (lo * hi).sqrt().max(0.5 * lo + 1e-3 * hi) };
        }
        lambda
    }
    /// The unscaled step over all n unknowns (zero where held).
    pub(crate) fn step(&self, lambda: f64, d: &[f64]) -> Vec<f64> {
        self.unscaled(&(&self.v * self.weights(lambda).0), 1.0, d)
    }
    /// Second-order correction `a / 2` of a step `p`: `a = argmin |J a + r_pp|^2 + lambda |D a|^2` from
    /// `gradient = J^T r_pp`, where `r_pp` is the second derivative of the residuals along `p`. `None` when it is too
    /// large against the step for the expansion to mean anything (`2 |D a| > 0.75 |D p|`).
    ///
    /// M. Transtrum, J. Sethna, *Improvements to the Levenberg-Marquardt algorithm for nonlinear least-squares
    /// minimization*, arXiv:1201.5885, eqs. (4)-(6).
    pub(crate) fn correction(&self, lambda: f64, d: &[f64], p: &[f64], gradient: &DVector<f64>) -> Option<Vec<f64>> {
        let mut y = self.onto(gradient, d);
        for (y, s) in y.iter_mut().zip(&self.s) {
            *y = -*y / (s * s + lambda);
        }
        let p_norm = p.iter().zip(d).map(|(p, d)| (p * d).powi(2)).sum::<f64>().sqrt();
        let small = 2.0 * y.norm() <= 0.75 * p_norm; // false for NaN
        if !small {
            return None;
        }
        Some(self.unscaled(&(&self.v * y), 0.5, d))
    }
    /// `C(x) - C_linear(x + p)`, exact for the linear model also after projection.
    pub(crate) fn predicted(&self, p: &[f64]) -> f64 {
        let q = &self.r * DVector::from_column_slice(p);
        -(self.c.dot(&q) + 0.5 * q.norm_squared())
    }
    /// The undamped step from where the gradient `J^T r` is this one, by the same linearisation, and what it promises.
    pub(crate) fn again(&self, gradient: &DVector<f64>, d: &[f64]) -> (Vec<f64>, f64) {
        let (mut y, mut promised) = (self.onto(gradient, d), 0.0);
        for (y, s) in y.iter_mut().zip(&self.s) {
            promised += 0.5 * (*y / s).powi(2);
            *y /= -s * s;
        }
        (self.unscaled(&(&self.v * y), 1.0, d), promised)
    }
    /// `V^T D^-1` of a gradient.
    fn onto(&self, gradient: &DVector<f64>, d: &[f64]) -> DVector<f64> {
        let g = DVector::from_fn(self.free.len(), |k, _| gradient[self.free[k]] / d[self.free[k]]);
        self.v.tr_mul(&g)
    }
    /// `J^T J p`.
    pub(crate) fn squared(&self, p: &[f64]) -> DVector<f64> {
        self.r.tr_mul(&(&self.r * DVector::from_column_slice(p)))
    }
    /// Scaled step of the free unknowns over all n, times `factor`.
    fn unscaled(&self, y: &DVector<f64>, factor: f64, d: &[f64]) -> Vec<f64> {
        let mut p = vec![0.0; self.r.ncols()];
        for (k, &i) in self.free.iter().enumerate() {
            p[i] = factor * y[k] / d[i];
        }
        p
    }
    /// Reduction that an undamped step of the free unknowns promises: `|U^T c|^2 / 2`.
    pub(crate) fn promised(&self) -> f64 {
        0.5 * self.b.norm_squared()
    }
}
