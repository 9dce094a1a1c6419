//! What the least-squares solver needs of a problem: residuals, and of a linearisation its triangle alone.
//!
//! A Jacobian of 1e5 rows is made once, reduced once, and otherwise only multiplied: every copy of it costs as much as
//! a simulation. [`Linearise`] therefore leaves it where it is made. [`Dense`] puts it before any [`Problem`].

use crate::problem::{EvalError, LmError, Problem};
use crate::step::{Linear, reduce};
use ff_linalg::LinalgError;
use nalgebra::{DMatrix, DVector};

/// `(R, c)` with `R^T R = J^T J` and `R^T c = J^T r`.
///
/// ```
/// use ff_least_squares::{Reduced, reduce};
/// use nalgebra::DMatrix;
///
/// let j = DMatrix::from_fn(40, 2, |i, k| if k == 0 { 1.3 } else { (0.2 * i as f64).sin() });
/// let r: Vec<f64> = (0..40).map(|i| 0.7 + (0.3 * f64::from(i)).cos()).collect();
/// let (triangle, c): Reduced = reduce(&j, &r)?;
/// assert!((triangle.tr_mul(&triangle) - j.tr_mul(&j)).norm() < 1e-12);
/// assert!((triangle.tr_mul(&c) - j.tr_mul(&nalgebra::DVector::from_vec(r))).norm() < 1e-12);
/// # Ok::<(), ff_linalg::LinalgError>(())
/// ```
pub type Reduced = (DMatrix<f64>, DVector<f64>);

/// A result at a point, or why the point has none; the outer error ends the fit.
///
/// ```
/// use ff_least_squares::{EvalError, LmError, Tried, finite};
///
/// // A rejected point is an answer: the solver tries a shorter step. A fatal error ends the fit.
/// let point: Tried<()> = finite(Err(EvalError::Rejected("panel beyond 1 rad".into())), &[], None);
/// assert!(matches!(point, Ok(Err(reason)) if reason == "panel beyond 1 rad"));
/// let point = finite(Err(EvalError::Fatal("record lost".into())), &[], None);
/// assert!(matches!(point, Err(LmError::Fatal(_))));
/// ```
pub type Tried<T> = Result<Result<T, String>, LmError>;

/// A least-squares problem that keeps its Jacobian.
///
/// ```
/// # use ff_least_squares::{EvalError, Problem};
/// # /// `y = 3 exp(-0.7 t)` at four times, fitted by `x0 exp(-x1 t)`.
/// # struct Decay;
/// # impl Problem for Decay {
/// #     fn dim(&self) -> usize { 2 }
/// #     fn residuals(&mut self, x: &[f64], r: &mut Vec<f64>) -> Result<(), EvalError> {
/// #         *r = [0.3, 0.9, 1.7, 2.6].map(|t: f64| x[0] * (-x[1] * t).exp() - 3.0 * (-0.7 * t).exp()).to_vec();
/// #         Ok(())
/// #     }
/// #     fn jacobian(&mut self, x: &[f64], r: &mut Vec<f64>, j: &mut nalgebra::DMatrix<f64>) -> Result<(), EvalError> {
/// #         let e = [0.3, 0.9, 1.7, 2.6].map(|t: f64| (t, (-x[1] * t).exp()));
/// #         *j = nalgebra::DMatrix::from_fn(4, 2, |i, k| if k == 0 { e[i].1 } else { -x[0] * e[i].0 * e[i].1 });
/// #         self.residuals(x, r)
/// #     }
/// # }
/// use ff_least_squares::{Dense, Linearise};
///
/// // What the solver keeps of a Jacobian: the triangle, and products with the rows.
/// let (mut decay, mut r) = (Decay, Vec::new());
/// let mut problem = Dense::new(&mut decay);
/// let (triangle, c) = problem.linearise(&[2.0, 0.5], &mut r)?.map_err(|reason| reason.to_string())?;
/// problem.accept();
/// let product = problem.transposed(&r)?.map_err(|reason| reason.to_string())?;
/// assert!((product - triangle.tr_mul(&c)).norm() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Linearise {
    /// Number of unknowns n.
    fn dim(&self) -> usize;
    /// Residuals at `x` into `r` (resized to m).
    fn residuals(&mut self, x: &[f64], r: &mut Vec<f64>) -> Tried<()>;
    /// Residuals and triangle at `x`. The linearisation gone on from stays until [`Linearise::accept`].
    fn linearise(&mut self, x: &[f64], r: &mut Vec<f64>) -> Tried<Reduced>;
    /// The last linearisation is the one to go on from.
    fn accept(&mut self);
    /// `J^T v` of the linearisation gone on from; a problem that keeps no rows evaluates them once more.
    ///
    /// # Errors
    /// As [`Linearise::linearise`].
    fn transposed(&mut self, v: &[f64]) -> Tried<DVector<f64>>;
    /// What rounding of the unknowns to machine numbers changes in the cost, `sum |r_i| eps sqrt(sum (J_ij x_j)^2)`, at the
    /// linearisation gone on from: no step can be seen to win less. It matters where residuals are many digits smaller
    /// than what they are differences of.
    fn rounding(&self, x: &[f64], r: &[f64]) -> f64;
    /// Names and values at `x`.
    fn describe(&self, x: &[f64]) -> Vec<(String, f64)>;
}

/// A [`Problem`] with its Jacobian kept for it.
///
/// ```
/// # use ff_least_squares::{EvalError, Problem};
/// # /// `y = 3 exp(-0.7 t)` at four times, fitted by `x0 exp(-x1 t)`.
/// # struct Decay;
/// # impl Problem for Decay {
/// #     fn dim(&self) -> usize { 2 }
/// #     fn residuals(&mut self, x: &[f64], r: &mut Vec<f64>) -> Result<(), EvalError> {
/// #         *r = [0.3, 0.9, 1.7, 2.6].map(|t: f64| x[0] * (-x[1] * t).exp() - 3.0 * (-0.7 * t).exp()).to_vec();
/// #         Ok(())
/// #     }
/// #     fn jacobian(&mut self, x: &[f64], r: &mut Vec<f64>, j: &mut nalgebra::DMatrix<f64>) -> Result<(), EvalError> {
/// #         let e = [0.3, 0.9, 1.7, 2.6].map(|t: f64| (t, (-x[1] * t).exp()));
/// #         *j = nalgebra::DMatrix::from_fn(4, 2, |i, k| if k == 0 { e[i].1 } else { -x[0] * e[i].0 * e[i].1 });
/// #         self.residuals(x, r)
/// #     }
/// # }
/// use ff_least_squares::{Dense, Settings, minimise_linearised};
///
/// let mut decay = Decay;
/// let mut problem = Dense::new(&mut decay);
/// let solution = minimise_linearised(&mut problem, &[2.0, 0.5], &Settings::default())?;
/// assert!(solution.status.is_converged());
/// assert_eq!(problem.j.shape(), (4, 2)); // the Jacobian at the solution
/// # Ok::<(), ff_least_squares::LmError>(())
/// ```
pub struct Dense<'a, P: ?Sized> {
    problem: &'a mut P,
    /// Jacobian at the last linearisation, m x n.
    pub j: DMatrix<f64>,
    next: DMatrix<f64>,
}

impl<'a, P: Problem + ?Sized> Dense<'a, P> {
    /// Allocates on the first linearisation.
    pub fn new(problem: &'a mut P) -> Self {
        Self { problem, j: DMatrix::zeros(0, 0), next: DMatrix::zeros(0, 0) }
    }
}

impl<P: Problem + ?Sized> Linearise for Dense<'_, P> {
    fn dim(&self) -> usize {
        self.problem.dim()
    }
    fn residuals(&mut self, x: &[f64], r: &mut Vec<f64>) -> Tried<()> {
        let res = self.problem.residuals(x, r);
        finite(res, r, None)
    }
    fn linearise(&mut self, x: &[f64], r: &mut Vec<f64>) -> Tried<Reduced> {
        let res = self.problem.jacobian(x, r, &mut self.next);
        if let Err(reason) = finite(res, r, Some(&self.next))? {
            return Ok(Err(reason));
        }
        let (m, n) = (r.len(), self.dim());
        if self.next.shape() != (m, n) || m < n {
            let (a, b) = self.next.shape();
            return Err(LmError::Setup(format!(
                "{m} residuals, {n} unknowns and a Jacobian of {a} x {b}: need as many rows as residuals, at least n"
            )));
        }
        Ok(Ok(reduce(&self.next, r)?))
    }
    fn accept(&mut self) {
        core::mem::swap(&mut self.j, &mut self.next);
    }
    fn transposed(&mut self, v: &[f64]) -> Tried<DVector<f64>> {
        Ok(Ok(self.j.tr_mul(&DVector::from_column_slice(v))))
    }
    fn rounding(&self, x: &[f64], r: &[f64]) -> f64 {
        rounding(&self.j, x, r)
    }
    fn describe(&self, x: &[f64]) -> Vec<(String, f64)> {
        self.problem.describe(x)
    }
}

/// See [`Linearise::rounding`]. Allocates a vector of m.
pub fn rounding(j: &DMatrix<f64>, x: &[f64], r: &[f64]) -> f64 {
    let mut rows = vec![0.0; r.len()];
    for (column, x) in j.column_iter().zip(x) {
        rows.iter_mut().zip(column.iter()).for_each(|(s, j)| *s += (j * x).powi(2));
    }
    f64::EPSILON * rows.iter().zip(r).map(|(s, r)| r.abs() * s.sqrt()).sum::<f64>()
}

/// What a call of a problem came to: residuals and derivatives that are finite, or the reason why there are none.
pub fn finite(res: Result<(), EvalError>, r: &[f64], j: Option<&DMatrix<f64>>) -> Tried<()> {
    match res {
        Err(EvalError::Fatal(e)) => Err(LmError::Fatal(e)),
        Err(EvalError::Rejected(why)) => Ok(Err(why)),
        Ok(()) if !r.iter().map(|x| x * x).sum::<f64>().is_finite() => Ok(Err(String::new())),
        Ok(()) if j.is_some_and(|j| j.iter().any(|x| !x.is_finite())) => Ok(Err(NOT_FINITE.into())),
        Ok(()) => Ok(Ok(())),
    }
}

/// Why a linearisation without numbers is refused.
pub const NOT_FINITE: &str = "the derivatives are not finite";

/// A triangle of rows that were not looked at: numbers that are not finite, if there were any, are all over it.
pub fn reduced(res: Result<Reduced, LinalgError>) -> Tried<Reduced> {
    match res {
        Err(LinalgError::NotFinite { .. }) => Ok(Err(NOT_FINITE.into())),
        Err(e) => Err(e.into()),
        Ok(t) => Ok(Ok(t)),
    }
}

/// `J^T r_pp` with the second derivative of the residuals along `p` by a one-sided difference,
/// `r_pp = 2 ((r(x + h p) - r) / h - J p) / h`; `None` where the residuals cannot be evaluated.
pub(crate) fn curvature<P: Linearise + ?Sized>(
    problem: &mut P,
    linear: &Linear,
    x: &[f64],
    p: &[f64],
    r: &[f64],
    buffer: &mut Vec<f64>,
) -> Result<Option<DVector<f64>>, LmError> {
    const H: f64 = 0.1;
    let near: Vec<f64> = x.iter().zip(p).map(|(x, p)| x + H * p).collect();
    if problem.residuals(&near, buffer)?.is_err() {
        return Ok(None);
    }
    buffer.iter_mut().zip(r).for_each(|(new, old)| *new = (*new - old) / H);
    Ok(problem.transposed(buffer)?.ok().map(|g| (g - linear.squared(p)) * (2.0 / H)))
}
