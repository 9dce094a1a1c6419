//! Clamped B-splines: basis functions, their derivatives, control polygons and knot refinement.
//!
//! Equation and algorithm numbers are those of L. Piegl and W. Tiller, *The NURBS Book*, 2nd ed., 1997
//! ("P&T"); the recurrence is de Boor's (*A Practical Guide to Splines*, ch. IX-X). A spline is
//! `q(t) = sum_i N_{i,p}(t) P_i` with `N_{i,p} >= 0` and `sum_i N_{i,p} = 1`, so that it lies in the convex
//! hull of its control points `P_i`, and so do its derivatives in that of theirs: limits on control points
//! are limits for all time.
pub(crate) mod curve;
pub(crate) mod refine;
#[cfg(test)]
pub(crate) mod tests;

pub use curve::BSplineMotion;
pub use refine::Refinement;

use nalgebra::DMatrix;
use thiserror::Error;

/// Greatest degree supported.
pub const MAX_DEGREE: usize = 7;
/// Length of a local row: at most `MAX_DEGREE + 1` basis functions differ from zero at any time.
pub const LOCAL: usize = MAX_DEGREE + 1;

/// Why a B-spline could not be built or differentiated.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum BSplineError {
    /// Degree outside `1..=7`.
    #[error("degree {0} is outside 1..=7")]
    Degree(usize),
    /// Fewer control points than `degree + 1`.
    #[error("{got} control points; degree {degree} needs at least {}", degree + 1)]
    TooFew {
        /// Degree.
        degree: usize,
        /// Control points met.
        got: usize,
    },
    /// Duration that is not positive and finite.
    #[error("duration {0} s is not positive and finite")]
    Duration(f64),
    /// Knots that are not finite, not ascending, do not start at 0, or are not clamped.
    #[error("knot {index} ({value}): {why}")]
    Knot {
        /// Index of the offending knot.
        index: usize,
        /// Its value (s).
        value: f64,
        /// What is wrong with it.
        why: &'static str,
    },
    /// Control points whose number or values do not fit.
    #[error("control points: {0}")]
    Control(String),
    /// The derivative asked for does not exist as a spline.
    #[error("derivative of order {order} of a degree-{degree} spline does not exist as a spline")]
    Order {
        /// Order asked for.
        order: usize,
        /// Degree of the spline.
        degree: usize,
    },
}

/// Values (or derivatives of one order) of the basis functions that are not zero at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalBasis {
    /// Index of the first basis function.
    pub first: usize,
    /// How many there are: `degree + 1`.
    pub len: usize,
    /// Their values; entries from `len` on are zero. Units `1/s^order`.
    pub values: [f64; LOCAL],
}

impl LocalBasis {
    /// The `len` values.
    pub fn as_slice(&self) -> &[f64] {
        &self.values[..self.len]
    }
}

/// A degree and a clamped knot vector `0 = t_0 = ... = t_p <= ... <= t_k = ... = t_{k+p} = duration`
/// (P&T eq. 2.13), which define `k` basis functions.
#[derive(Clone, Debug, PartialEq)]
pub struct Knots {
    degree: usize,
    t: Vec<f64>,
}

impl Knots {
    /// Equally spaced knots over `[0, duration]` (s) for `count` basis functions of a degree in `1..=7`.
    ///
    /// # Errors
    /// [`BSplineError`] if degree, count or duration is out of range.
    pub fn uniform(degree: usize, count: usize, duration: f64) -> Result<Self, BSplineError> {
        if !(1..=MAX_DEGREE).contains(&degree) {
            return Err(BSplineError::Degree(degree));
        }
        if count <= degree {
            return Err(BSplineError::TooFew { degree, got: count });
        }
        if !(duration.is_finite() && duration > 0.0) {
            return Err(BSplineError::Duration(duration));
        }
        let spans = count - degree;
        let mut t = vec![0.0; degree];
        t.extend((0..spans).map(|i| duration * (i as f64 / spans as f64)));
        t.extend(std::iter::repeat_n(duration, degree + 1));
        Ok(Self { degree, t })
    }
    /// Given knots (s). The first and the last `degree + 1` must be equal, the first 0; an interior knot
    /// may be repeated up to `degree` times, each repetition costing one order of continuity.
    ///
    /// # Errors
    /// [`BSplineError`] naming the offending knot.
    pub fn new(degree: usize, knots: Vec<f64>) -> Result<Self, BSplineError> {
        if !(1..=MAX_DEGREE).contains(&degree) {
            return Err(BSplineError::Degree(degree));
        }
        let count = knots.len().saturating_sub(degree + 1);
        if count <= degree {
            return Err(BSplineError::TooFew { degree, got: count });
        }
        let bad = |index: usize, why| Err(BSplineError::Knot { index, value: knots[index], why });
        if let Some(i) = knots.iter().position(|x| !x.is_finite()) {
            return bad(i, "not finite");
        }
        if let Some(i) = (1..knots.len()).find(|&i| knots[i] < knots[i - 1]) {
            return bad(i, "smaller than the knot before");
        }
        if let Some(i) = (0..=degree).find(|&i| knots[i] != 0.0) {
            return bad(i, "the first degree + 1 knots must be 0");
        }
        let end = knots[knots.len() - 1];
        if end <= 0.0 {
            return Err(BSplineError::Duration(end));
        }
        if let Some(i) = (count..knots.len()).find(|&i| knots[i] != end) {
            return bad(i, "the last degree + 1 knots must be equal");
        }
        if let Some(i) = (1..=count - 1).find(|&i| knots[i] == knots[i + degree]) {
            return bad(i, "an interior or end knot is repeated too often");
        }
        Ok(Self { degree, t: knots })
    }
    /// Degree `p`.
    pub fn degree(&self) -> usize {
        self.degree
    }
    /// Number of basis functions `k` (= control points).
    pub fn count(&self) -> usize {
        self.t.len() - self.degree - 1
    }
    /// All knots (s), ends repeated.
    pub fn knots(&self) -> &[f64] {
        &self.t
    }
    /// Last knot (s).
    pub fn duration(&self) -> f64 {
        self.t[self.t.len() - 1]
    }
    /// Distinct knots (s), ends included. Allocates.
    pub fn breaks(&self) -> Vec<f64> {
        let mut out = self.t.clone();
        out.dedup();
        out
    }
    /// The same spline run over another duration (s): knots scaled, control points unchanged.
    ///
    /// # Errors
    /// [`BSplineError::Duration`].
    pub fn with_duration(&self, duration: f64) -> Result<Self, BSplineError> {
        if !(duration.is_finite() && duration > 0.0) {
            return Err(BSplineError::Duration(duration));
        }
        let old = self.duration();
        // Division first: the end knots become exactly `duration`.
        Ok(Self { degree: self.degree, t: self.t.iter().map(|x| x / old * duration).collect() })
    }
    /// Greville abscissae `(t_{i+1} + ... + t_{i+p}) / p` (s): where control point `i` acts most, and
    /// the control points that reproduce `q(t) = t`. Allocates.
    pub fn greville(&self) -> Vec<f64> {
        let p = self.degree.max(1);
        (0..self.count()).map(|i| self.t[i + 1..=i + p].iter().sum::<f64>() / p as f64).collect()
    }
    /// Index `mu` of the span `[t_mu, t_{mu+1})` that holds `t`, closed at the end (P&T algorithm A2.1).
    fn span(&self, t: f64) -> usize {
        let (p, k) = (self.degree, self.count());
        p + self.t[p + 1..k.max(p + 1)].partition_point(|&x| x <= t)
    }
    /// Derivatives of orders `0..ORDERS` of the basis functions at time `t`, which is clamped to
    /// `[0, duration]`. Returns the index of the first function and one row per order. Does not allocate.
    ///
    /// Values by the triangle of P&T algorithm A2.2; derivatives by P&T eq. (2.9),
    /// `N^(r)_{i,p} = p (N^(r-1)_{i,p-1} / (t_{i+p} - t_i) - N^(r-1)_{i+1,p-1} / (t_{i+p+1} - t_{i+1}))`.
    /// At a knot, derivatives that jump are those from the right (from the left at the end).
    pub fn local<const ORDERS: usize>(&self, t: f64) -> (usize, [[f64; LOCAL]; ORDERS]) {
        let p = self.degree;
        let t = t.clamp(0.0, self.duration());
        let mu = self.span(t);
        let table = triangle(&self.t, mu, p, |_| t);
        let mut out = [[0.0; LOCAL]; ORDERS];
        for (order, row) in out.iter_mut().enumerate() {
            if order <= p {
                *row = self.lift(mu, order, table[p - order]);
            }
        }
        (mu - p, out)
    }
    /// Derivatives of one order (any; zero above the degree) at time `t`. Does not allocate.
    pub fn derivative_at(&self, t: f64, order: usize) -> LocalBasis {
        let p = self.degree;
        let t = t.clamp(0.0, self.duration());
        let mu = self.span(t);
        let values =
            if order <= p { self.lift(mu, order, triangle(&self.t, mu, p, |_| t)[p - order]) } else { [0.0; LOCAL] };
        LocalBasis { first: mu - p, len: p + 1, values }
    }
    /// From the values of degree `p - order` to derivative `order` of degree `p`: P&T eq. (2.9) `order` times.
    fn lift(&self, mu: usize, order: usize, mut row: [f64; LOCAL]) -> [f64; LOCAL] {
        let p = self.degree;
        for q in p - order + 1..=p {
            // `row` holds functions mu-q+1 ..= mu of degree q-1; `next` those of degree q from mu-q.
            let mut next = [0.0; LOCAL];
            for j in 0..q {
                let i = mu + 1 + j - q;
                let g = q as f64 * row[j] / (self.t[i + q] - self.t[i]);
                next[j] -= g;
                next[j + 1] += g;
            }
            row = next;
        }
        row
    }
    /// Writes the dense row of derivative `order` at time `t` into `row` (length `k`), zeros included: one
    /// row of a least-squares matrix. Does not allocate.
    ///
    /// # Panics
    /// If `row` is not `k` long.
    pub fn row(&self, t: f64, order: usize, row: &mut [f64]) {
        assert_eq!(row.len(), self.count(), "row length");
        row.fill(0.0);
        let b = self.derivative_at(t, order);
        row[b.first..b.first + b.len].copy_from_slice(b.as_slice());
    }
    /// Basis of the derivative: one degree lower, first and last knot dropped (P&T eq. 3.5).
    ///
    /// # Errors
    /// [`BSplineError::Order`] if the degree is 0 or an interior knot of multiplicity `p` makes the
    /// derivative jump so that its own derivative would be an impulse.
    pub fn derivative(&self) -> Result<Self, BSplineError> {
        let p = self.degree;
        if p == 0 {
            return Err(BSplineError::Order { order: 1, degree: p });
        }
        let t = self.t[1..self.t.len() - 1].to_vec();
        if (0..self.count() - 1).any(|i| t[i + p] <= t[i]) {
            return Err(BSplineError::Order { order: 1, degree: p });
        }
        Ok(Self { degree: p - 1, t })
    }
    /// Control points of the derivative: `P'_i = p (P_{i+1} - P_i) / (t_{i+p+1} - t_{i+1})`
    /// (P&T eq. 3.4), for `control` of shape `n x k`; the result is `n x (k-1)`. Allocates the result.
    ///
    /// # Panics
    /// If `control` has not `k` columns or the degree is 0.
    pub fn difference(&self, control: &DMatrix<f64>) -> DMatrix<f64> {
        let (p, k) = (self.degree, self.count());
        assert!(p > 0 && control.ncols() == k, "control points of degree {p}: {} of {k}", control.ncols());
        DMatrix::from_fn(control.nrows(), k - 1, |r, i| {
            p as f64 * (control[(r, i + 1)] - control[(r, i)]) / (self.t[i + p + 1] - self.t[i + 1])
        })
    }
    /// The exact linear map from control points to those of derivative `order`, `(k - order) x k`, and
    /// the basis it belongs to. Allocates.
    ///
    /// # Errors
    /// [`BSplineError::Order`] if that derivative is not a spline.
    pub fn derivative_map(&self, order: usize) -> Result<(Self, DMatrix<f64>), BSplineError> {
        let mut knots = self.clone();
        let mut map = DMatrix::identity(self.count(), self.count());
        for _ in 0..order {
            let lower = knots.derivative().map_err(|_| BSplineError::Order { order, degree: self.degree })?;
            map = knots.difference(&map.transpose()).transpose();
            knots = lower;
        }
        Ok((knots, map))
    }
}

/// The triangle of basis values of degrees `0..=p` on span `mu` (P&T algorithm A2.2): row `q` holds
/// functions `mu - q ..= mu`. `x(q)` is the abscissa used to step up to degree `q`: the time itself for
/// values, new knots for the Oslo algorithm, which is the same recurrence with moving abscissa.
fn triangle(t: &[f64], mu: usize, p: usize, x: impl Fn(usize) -> f64) -> [[f64; LOCAL]; LOCAL] {
    let mut rows = [[0.0; LOCAL]; LOCAL];
    rows[0][0] = 1.0;
    for q in 1..=p {
        let x = x(q);
        for j in 0..q {
            let i = mu + 1 + j - q;
            let w = rows[q - 1][j] / (t[i + q] - t[i]);
            rows[q][j] += (t[i + q] - x) * w;
            rows[q][j + 1] += (x - t[i]) * w;
        }
    }
    rows
}
