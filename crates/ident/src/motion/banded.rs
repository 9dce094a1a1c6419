//! The normal equations of a spline.

use ff_dynamics::motion::bspline::MAX_DEGREE as DEGREE;
use nalgebra::DMatrix;

/// Symmetric positive definite band matrix of half bandwidth [`MAX_DEGREE`](DEGREE): row `i` holds columns
/// `i - DEGREE ..= i` (Golub and Van Loan, *Matrix Computations*, 4th ed., algorithm 4.3.5).
pub(super) struct Banded {
    rows: Vec<[f64; DEGREE + 1]>,
}

impl Banded {
    pub(super) fn zeros(n: usize) -> Self {
        Self { rows: vec![[0.0; DEGREE + 1]; n] }
    }
    /// Adds `w b b^T` at rows and columns from `first`.
    pub(super) fn add_outer(&mut self, first: usize, b: &[f64], w: f64) {
        for i in 0..b.len() {
            for j in 0..=i {
                self.rows[first + i][DEGREE + j - i] += w * b[i] * b[j];
            }
        }
    }
    /// Holds `b^T x` at zero, with so much of the weight of the samples on knot `first`; the weight that this is.
    pub(super) fn hold(&mut self, first: usize, b: &[f64], weight: f64) -> f64 {
        let largest = b.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let weight = weight * self.rows[first][DEGREE] / (largest * largest);
        self.add_outer(first, b, weight);
        weight
    }
    /// Cholesky factor in place; on failure the row whose pivot vanished.
    pub(super) fn factor(&mut self) -> Result<(), usize> {
        for i in 0..self.rows.len() {
            let diagonal = self.rows[i][DEGREE];
            for j in i.saturating_sub(DEGREE)..=i {
                let mut s = self.rows[i][DEGREE + j - i];
                for m in i.saturating_sub(DEGREE)..j {
                    if j - m <= DEGREE {
                        s -= self.rows[i][DEGREE + m - i] * self.rows[j][DEGREE + m - j];
                    }
                }
                if j < i {
                    self.rows[i][DEGREE + j - i] = s / self.rows[j][DEGREE];
                } else {
                    // Relative to the diagonal before elimination: rank is lost, not merely small.
                    let sound = s > 1e-13 * diagonal && s.is_finite();
                    if !sound {
                        return Err(i);
                    }
                    self.rows[i][DEGREE] = s.sqrt();
                }
            }
        }
        Ok(())
    }
    /// Solves for every row of `rhs` (`n x k`) in place.
    pub(super) fn solve(&self, rhs: &mut DMatrix<f64>) {
        let k = self.rows.len();
        for mut x in rhs.row_iter_mut() {
            for i in 0..k {
                let mut s = x[i];
                for j in i.saturating_sub(DEGREE)..i {
                    s -= self.rows[i][DEGREE + j - i] * x[j];
                }
                x[i] = s / self.rows[i][DEGREE];
            }
            for i in (0..k).rev() {
                let mut s = x[i];
                for j in i + 1..(i + DEGREE + 1).min(k) {
                    s -= self.rows[j][DEGREE + i - j] * x[j];
                }
                x[i] = s / self.rows[i][DEGREE];
            }
        }
    }
}
