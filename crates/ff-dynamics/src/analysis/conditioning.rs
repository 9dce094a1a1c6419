//! How near to singular a mass matrix is, and along which degrees of freedom.
//!
//! Metres and radians, a base of tonnes and a hinge of grams differ by many powers of ten for no fault of the
//! model, so `H` is scaled to unit diagonal first: `S H S` with `S = diag(H)^(-1/2)`, which is within a factor
//! `n` of the best diagonal scaling there is (van der Sluis 1969). What remains is geometry: two joints on one
//! line with nothing between them, or a point mass on its own axis.

use nalgebra::{DMatrix, SymmetricEigen};

/// Condition of a mass matrix ([`conditioning`]).
#[derive(Clone, Debug, PartialEq)]
pub struct Conditioning {
    /// Ratio of the largest to the smallest eigenvalue of the scaled matrix; infinite when it is singular,
    /// indefinite or not finite.
    pub number: f64,
    /// The direction of the smallest eigenvalue: index of a degree of freedom and its share (largest 1), in
    /// descending order, without shares below [`SHARE`].
    pub weakest: Vec<(usize, f64)>,
}

/// Smallest share of a degree of freedom in [`Conditioning::weakest`].
pub const SHARE: f64 = 0.1;

/// Condition of the symmetric matrix `h`. Allocates; `O(n^3)`.
///
/// # Panics
/// If `h` is not square.
pub fn conditioning(h: &DMatrix<f64>) -> Conditioning {
    assert!(h.is_square(), "mass matrix must be square");
    let n = h.nrows();
    // Without inertia of its own a degree of freedom cannot be scaled, and is known to be the culprit.
    // This is also the door before the eigenvalues, which must not see NaN.
    let alive = |i: usize| h[(i, i)] > 0.0 && h.row(i).iter().all(|x| x.is_finite());
    let dead: Vec<_> = (0..n).filter(|&i| !alive(i)).map(|i| (i, 1.0)).collect();
    if !dead.is_empty() {
        return Conditioning { number: f64::INFINITY, weakest: dead };
    }
    if n == 0 {
        return Conditioning { number: 1.0, weakest: Vec::new() };
    }
    let s: Vec<f64> = (0..n).map(|i| 1.0 / h[(i, i)].sqrt()).collect();
    let scaled = DMatrix::from_fn(n, n, |i, j| 0.5 * (h[(i, j)] + h[(j, i)]) * s[i] * s[j]);
    let Some(eigen) = SymmetricEigen::try_new(scaled, f64::EPSILON, 100 * n + 1000) else {
        return Conditioning { number: f64::INFINITY, weakest: Vec::new() };
    };
    let (low, high) = (eigen.eigenvalues.min(), eigen.eigenvalues.max());
    let number = if low > 0.0 { high / low } else { f64::INFINITY };
    let direction = eigen.eigenvectors.column(eigen.eigenvalues.imin());
    let largest = direction[direction.icamax()];
    let mut weakest: Vec<_> = direction.iter().map(|x| x / largest).enumerate().collect();
    weakest.retain(|(_, x)| x.abs() >= SHARE);
    weakest.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
    Conditioning { number, weakest }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn scales_do_not_matter_and_directions_do() {
        // Correlation 0.6 between the first two: eigenvalues 0.4, 1, 1.6 whatever the units.
        let (a, b, c) = (1e-9, 3e6, 0.2);
        let h = DMatrix::from_row_slice(3, 3, &[a * a, 0.6 * a * b, 0.0, 0.6 * a * b, b * b, 0.0, 0.0, 0.0, c * c]);
        let k = conditioning(&h);
        assert_relative_eq!(k.number, 4.0, max_relative = 1e-12);
        let dofs: Vec<usize> = k.weakest.iter().map(|w| w.0).collect();
        assert!(dofs == [0, 1] || dofs == [1, 0], "{k:?}");
        assert_relative_eq!(k.weakest[1].1, -1.0, max_relative = 1e-12);
    }

    #[test]
    fn what_cannot_be_scaled_is_named() {
        let mut h = DMatrix::identity(3, 3);
        h[(1, 1)] = 0.0;
        assert_eq!(conditioning(&h), Conditioning { number: f64::INFINITY, weakest: vec![(1, 1.0)] });
        h[(1, 1)] = 1.0;
        h[(0, 2)] = f64::NAN;
        assert_eq!(conditioning(&h).weakest, [(0, 1.0)]);
        let singular = DMatrix::from_element(2, 2, 0.7);
        assert!(conditioning(&singular).number > 1e15);
        assert_eq!(conditioning(&DMatrix::zeros(0, 0)).number, 1.0);
    }
}
