//! The normal matrix of a linearisation with what is known beside the data.

use ff_linalg::{LinalgError, gram};
use nalgebra::{Cholesky, DMatrix, Dyn};

/// Ridge of a normal matrix with ones on its diagonal.
const RIDGE: f64 = 1e-9;

/// `S^-1 (J^T J + K^T K) S^-1` with ones on its diagonal and a ridge of 1e-9, `J` the columns of the data and `K` those of what is known.
#[derive(Clone, Debug)]
pub struct Normal {
    /// The scaled matrix, columns x columns.
    pub matrix: DMatrix<f64>,
    /// Its factor.
    pub root: Cholesky<f64, Dyn>,
    /// Diagonal of `S`: the norm of every column, in its unit.
    pub size: Vec<f64>,
}

impl Normal {
    /// Of the columns of the data (rows x columns) and of what is known (rows x columns); `None` where it is not positive definite. Allocates.
    ///
    /// # Errors
    /// [`LinalgError`] where a column is not finite.
    pub fn new(data: &DMatrix<f64>, known: &DMatrix<f64>) -> Result<Option<Self>, LinalgError> {
        let mut matrix = gram(data)? + gram(known)?;
        let size: Vec<f64> = matrix.diagonal().iter().map(|d| d.sqrt().max(f64::MIN_POSITIVE)).collect();
        for a in 0..size.len() {
            for b in 0..size.len() {
                matrix[(a, b)] /= size[a] * size[b];
            }
            matrix[(a, a)] += RIDGE;
        }
        Ok(matrix.clone().cholesky().map(|root| Self { matrix, root, size }))
    }
}
