//! Covariance of the unknowns of a least-squares problem, and which of them the data determine.

use crate::tall_qr::qr_r;
use ff_linalg::{LinalgError, Svd, svd};
use nalgebra::{DMatrix, DVector};

/// Part of a null direction below which an unknown counts as untouched by it.
pub const TOUCH: f64 = 1e-5;

/// What a whitened Jacobian says of its unknowns ([`determine`]).
///
/// ```
/// use ff_least_squares::determine;
/// use nalgebra::DMatrix;
///
/// // The third unknown enters only as the sum with the second.
/// let j = DMatrix::from_fn(6, 3, |i, k| if k == 0 { 1.5 } else { 0.3 * i as f64 - 0.4 });
/// let found = determine(&j, &[2.0, 0.7, 0.7], 1e-10)?;
/// assert_eq!(found.rank, 2);
/// assert!(found.deviation[0].is_some() && found.deviation[1].is_none() && found.deviation[2].is_none());
/// # Ok::<(), ff_linalg::LinalgError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Determined {
    /// Triangle of the Jacobian with every column times the size of its unknown, n x n.
    pub scaled: DMatrix<f64>,
    /// Its singular values and directions.
    pub svd: Svd,
    /// Singular values above the tolerance, relative to the largest.
    pub rank: usize,
    /// Covariance on the directions within the rank, n x n, in the units of the unknowns.
    pub covariance: DMatrix<f64>,
    /// Standard deviations; none for an unknown with a part in a null direction.
    pub deviation: Vec<Option<f64>>,
}

/// Cramer-Rao covariance `(J^T J)^-1` of a whitened Jacobian `j` (m x n, m >= n) on the directions that it determines.
///
/// With the sizes `s_i` of the unknowns, `J diag(s) = U diag(sigma) V^T`; directions with `sigma_k <= tolerance sigma_1` are null,
/// and the covariance is `diag(s) V diag(1/sigma^2) V^T diag(s)` over the others. Allocates.
///
/// # Errors
/// [`LinalgError`] for non-finite input, m < n, n = 0, or another number of sizes than columns.
pub fn determine(j: &DMatrix<f64>, sizes: &[f64], tolerance: f64) -> Result<Determined, LinalgError> {
    let (m, n) = j.shape();
    if n != sizes.len() || m < n || n == 0 {
        let needed = format!("{} columns, and at least as many rows", sizes.len());
        return Err(LinalgError::Shape { what: "Jacobian", rows: m, columns: n, needed });
    }
    let mut scaled = qr_r(j)?;
    for (k, &size) in sizes.iter().enumerate() {
        scaled.column_mut(k).scale_mut(size);
    }
    let d = svd(&scaled)?;
    let rank = d.rank(tolerance);
    let mut covariance = DMatrix::zeros(n, n);
    for k in 0..rank {
        let w = DVector::from_fn(n, |i, _| sizes[i] * d.v[(i, k)] / d.s[k]);
        covariance.ger(1.0, &w, &w, 1.0);
    }
    let touched = |i: usize| (rank..n).map(|k| d.v[(i, k)].powi(2)).sum::<f64>().sqrt() > TOUCH;
    let deviation = (0..n).map(|i| (!touched(i)).then(|| covariance[(i, i)].sqrt())).collect();
    Ok(Determined { scaled, rank, covariance, deviation, svd: d })
}
