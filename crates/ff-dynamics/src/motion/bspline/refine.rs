//! Knot insertion: the same curve with more control points, which hug it more closely.

use super::{BSplineError, Knots, LOCAL, triangle};
use nalgebra::DMatrix;

/// The exact linear map from control points on coarse knots to those of the same curve on finer knots.
///
/// Oslo algorithm (E. Cohen, T. Lyche, R. Riesenfeld, *Discrete B-splines and subdivision techniques*,
/// 1980; de Boor ch. XI): `P_new_j = sum_i alpha_{i,p}(j) P_i`, where `alpha` obeys the B-spline recurrence
/// with abscissa `tau_{j+q}` at degree `q`. The weights are not negative and sum to 1, so the new polygon
/// lies inside the hull of the old one; its distance from the curve falls with the square of the spacing.
#[derive(Clone, Debug, PartialEq)]
pub struct Refinement {
    coarse: usize,
    knots: Knots,
    rows: Vec<(usize, [f64; LOCAL])>,
}

impl Refinement {
    /// The finer basis.
    pub fn knots(&self) -> &Knots {
        &self.knots
    }
    /// New control points (`n x K`) from old ones (`n x k`). Allocates the result.
    ///
    /// # Panics
    /// If `control` has not `k` columns.
    pub fn apply(&self, control: &DMatrix<f64>) -> DMatrix<f64> {
        assert_eq!(control.ncols(), self.coarse, "control points");
        let width = self.knots.degree() + 1;
        DMatrix::from_fn(control.nrows(), self.rows.len(), |r, j| {
            let (first, w) = &self.rows[j];
            (0..width).map(|i| w[i] * control[(r, first + i)]).sum()
        })
    }
    /// The map as a dense `K x k` matrix (for linear constraints). Allocates.
    pub fn matrix(&self) -> DMatrix<f64> {
        let mut m = DMatrix::zeros(self.rows.len(), self.coarse);
        for (j, (first, w)) in self.rows.iter().enumerate() {
            for i in 0..=self.knots.degree() {
                m[(j, first + i)] += w[i];
            }
        }
        m
    }
}

impl Knots {
    /// Divides every span into `parts` equal ones; `parts = 1` changes nothing. Allocates.
    pub fn refine(&self, parts: usize) -> Refinement {
        let mut tau = Vec::with_capacity(self.t.len() * parts.max(1));
        for (i, &a) in self.t.iter().enumerate() {
            tau.push(a);
            if let Some(&b) = self.t.get(i + 1).filter(|b| **b > a) {
                tau.extend((1..parts).map(|j| a + (b - a) * (j as f64 / parts as f64)));
            }
        }
        self.to_finer(Knots { degree: self.degree, t: tau })
    }
    /// Inserts one knot at `u` (s), `0 < u < duration` (P&T algorithm A5.1, as a linear map). Allocates.
    ///
    /// # Errors
    /// [`BSplineError::Knot`] if `u` is outside or is already a knot of multiplicity `p`.
    pub fn insert(&self, u: f64) -> Result<Refinement, BSplineError> {
        let bad = |why| Err(BSplineError::Knot { index: 0, value: u, why });
        if !(u > 0.0 && u < self.duration()) {
            return bad("outside the open interval of the spline");
        }
        if self.t.iter().filter(|&&x| x == u).count() >= self.degree {
            return bad("already a knot as often as the degree allows");
        }
        let mut t = self.t.clone();
        t.insert(t.partition_point(|&x| x <= u), u);
        Ok(self.to_finer(Knots { degree: self.degree, t }))
    }
    /// Oslo algorithm; `fine` must hold all knots of `self`.
    fn to_finer(&self, fine: Knots) -> Refinement {
        let p = self.degree;
        let rows = (0..fine.count())
            .map(|j| {
                let mu = self.span(fine.t[j]);
                (mu - p, triangle(&self.t, mu, p, |q| fine.t[j + q])[p])
            })
            .collect();
        Refinement { coarse: self.count(), knots: fine, rows }
    }
}
