//! Consider parameters: errors that are not estimated and widen the covariance of what is.
//!
//! An estimate `x` with covariance `P` from whitened data with Jacobian `J_x`, errors `c` held at their nominal values, moves by
//! `S = -P J_x^T J_c` per unit of an error. With errors of deviation `s_c`, independent of the data, the covariance of the estimate is
//!
//! ```text
//! P_c = P + S diag(s_c^2) S^T
//! ```
//!
//! (B. Tapley, B. Schutz, G. Born, *Statistical Orbit Determination*, 2004, sec. 6.4, eqs. 6.4.12 to 6.4.14; S. Schmidt, *Application of
//! state-space methods to navigation problems*, Advances in Control Systems 3, 1966.) It is never smaller than the covariance with the
//! errors estimated beside, which takes from the data what they tell of the errors.

use nalgebra::DMatrix;

/// What [`consider`] finds.
#[derive(Clone, Debug, PartialEq)]
pub struct Considered {
    /// Covariance of the estimate with the errors considered.
    pub covariance: DMatrix<f64>,
    /// Change of the estimate per unit of every error, estimated by considered.
    pub sensitivity: DMatrix<f64>,
}

/// Covariance of an estimate with the covariance `covariance` when errors with the whitened columns `considered` and standard deviations
/// `stds` were held at their nominal values; `estimated` are the columns of what was estimated. Rows may be those of a triangle. Allocates.
///
/// ```
/// use ident::belief::consider;
/// use nalgebra::DMatrix;
///
/// // y = p + b + n with n known to 4 and b to 3: p is known to 5.
/// let (p, column) = (DMatrix::from_element(1, 1, 16.0), DMatrix::from_element(1, 1, 0.25));
/// let c = consider(&p, &column, &column, &[3.0]);
/// assert_eq!((c.covariance[(0, 0)], c.sensitivity[(0, 0)]), (25.0, -1.0));
/// ```
///
/// # Panics
/// If shapes do not fit.
pub fn consider(
    covariance: &DMatrix<f64>,
    estimated: &DMatrix<f64>,
    considered: &DMatrix<f64>,
    stds: &[f64],
) -> Considered {
    let sensitivity = -(covariance * estimated.tr_mul(considered));
    let mut scaled = sensitivity.clone();
    scaled.column_iter_mut().zip(stds).for_each(|(mut c, s)| c.scale_mut(*s));
    Considered { covariance: covariance + &scaled * scaled.transpose(), sensitivity }
}
