//! Base parameters of a regressor: the combinations of parameters that motions tell.

use ff_linalg::{LinalgError, eliminate, svd};
use nalgebra::DMatrix;

/// Combinations of parameters that rows of a regressor tell (M. Gautier, *Numerical calculation of the base inertial parameters of robots*,
/// J. Robotic Systems 8(4), 1991): with the columns `Y_1` of the kept parameters `phi_1` and the others' `Y_2 = Y_1 K`,
/// `Y phi = Y_1 (phi_1 + K phi_2)`.
#[derive(Clone, Debug, PartialEq)]
pub struct BaseParameters {
    /// Parameters whose columns are kept, ascending.
    pub kept: Vec<usize>,
    /// The base parameters as functions of all: kept x all; 1 for what is kept, `K` for what is not.
    pub matrix: DMatrix<f64>,
    /// Condition number of the kept columns, each scaled by the size of its parameter.
    pub condition: f64,
}

/// Factors below this, in units of the sizes, are rounding of the elimination.
const NEGLIGIBLE: f64 = 1e-9;

/// Base parameters of the triangle `r` (`regressor_triangle`, without forces). Columns count by the sizes of their parameters
/// ([`ident::parameters::sizes`]); singular values below `tolerance` times the largest are zero. Allocates.
///
/// # Errors
/// [`LinalgError`].
///
/// # Panics
/// If `sizes` has not one number for each column.
pub fn base_parameters(r: &DMatrix<f64>, sizes: &[f64], tolerance: f64) -> Result<BaseParameters, LinalgError> {
    let n = r.ncols();
    assert_eq!(sizes.len(), n, "one size for each column");
    let mut scaled = r.clone();
    for (mut column, size) in scaled.column_iter_mut().zip(sizes) {
        column *= *size;
    }
    let rank = svd(&scaled)?.rank(tolerance);
    let e = eliminate(&scaled, rank)?;
    let mut order: Vec<usize> = (0..rank).collect();
    order.sort_by_key(|&i| e.kept[i]);
    let mut matrix = DMatrix::zeros(rank, n);
    for (row, &i) in order.iter().enumerate() {
        let own = e.kept[i];
        matrix[(row, own)] = 1.0;
        for (k, &other) in e.left.iter().enumerate() {
            let factor = e.c[(i, k)];
            if factor.abs() > NEGLIGIBLE {
                matrix[(row, other)] = factor * sizes[own] / sizes[other];
            }
        }
    }
    let kept: Vec<usize> = order.iter().map(|&i| e.kept[i]).collect();
    let singular = svd(&scaled.select_columns(&kept))?.s;
    let (most, least) = singular.iter().fold((0.0_f64, f64::INFINITY), |(a, b), s| (a.max(*s), b.min(*s)));
    Ok(BaseParameters { kept, matrix, condition: if rank == 0 { 1.0 } else { most / least } })
}
