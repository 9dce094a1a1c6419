//! How well a plan will identify: standard deviations that the information matrix predicts.
//!
//! The covariance of any unbiased estimate is bounded by `M^-1` (Cramer and Rao), which a least-squares fit
//! reaches for white Gaussian noise of the stated size. Errors of the model, of the sensors' calibration and
//! of the differentiated joint positions come on top.

use crate::system::rigid::RigidInformation;
use ff_model::{Dual, Inertia, Scalar};
use nalgebra::{DMatrix, Matrix3};

/// Predicted standard deviation of one quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction {
    /// Full name of the parameter, or `base.com_x`, `base.com_i_xx` and so on for what follows from it.
    pub name: String,
    /// SI unit.
    pub unit: &'static str,
    /// Value at which it is predicted.
    pub value: f64,
    /// Standard deviation after an unoptimised motion: median over the random plans.
    pub random: f64,
    /// Standard deviation after the plan.
    pub planned: f64,
}

/// Names of centre of mass and inertia about it, in the order of [`about_com`].
pub const DERIVED: [(&str, &str); 9] = [
    ("com_x", "m"),
    ("com_y", "m"),
    ("com_z", "m"),
    ("com_i_xx", "kg m^2"),
    ("com_i_xy", "kg m^2"),
    ("com_i_yy", "kg m^2"),
    ("com_i_xz", "kg m^2"),
    ("com_i_yz", "kg m^2"),
    ("com_i_zz", "kg m^2"),
];

/// Centre of mass `c = h / m` (m) and inertia about it, `I - (h . c) 1 + h c^T` (kg m^2), of the ten parameters `phi` of a body, in
/// the order of [`DERIVED`]. Does not allocate.
///
/// # Panics
/// If there are fewer than ten.
pub fn about_com<T: Scalar>(phi: &[T]) -> [T; 9] {
    let b = Inertia::from_params(phi);
    let c = b.h * (T::one() / b.mass);
    let d = b.h.x * c.x + b.h.y * c.y + b.h.z * c.z;
    let i: Matrix3<T> = b.rot - Matrix3::from_diagonal_element(d) + b.h * c.transpose();
    [c.x, c.y, c.z, i[(0, 0)], i[(0, 1)], i[(1, 1)], i[(0, 2)], i[(1, 2)], i[(2, 2)]]
}

/// The quantities predicted, as `(name, unit, value)`: the parameters themselves, then, when all ten are
/// estimated, centre of mass and inertia about it. Allocates.
pub(crate) fn quantities(source: &RigidInformation) -> Vec<(String, &'static str, f64)> {
    let base = source.base_parameters();
    let names = source.names().iter().zip(source.estimated());
    let mut out: Vec<_> = names.map(|((name, unit), &k)| (name.clone(), *unit, base[k])).collect();
    if complete(source) {
        let values = about_com(&base);
        out.extend(DERIVED.iter().zip(values).map(|((name, unit), v)| (format!("base.{name}"), *unit, v)));
    }
    out
}

fn complete(source: &RigidInformation) -> bool {
    source.estimated().len() == 10
}

/// Standard deviations of [`quantities`] for an information matrix over scaled parameters; infinite when the
/// matrix is not positive definite. Allocates.
pub(crate) fn deviations(source: &RigidInformation, information: &DMatrix<f64>) -> Vec<f64> {
    let count = quantities(source).len();
    let finite = information.iter().all(|x| x.is_finite());
    let Some(chol) = information.clone().cholesky().filter(|_| finite) else {
        return vec![f64::INFINITY; count];
    };
    let n = source.sizes().len();
    // Covariance in SI units, in the order of the estimated parameters.
    let inverse = chol.inverse();
    let covariance = DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * source.sizes()[i] * source.sizes()[j]);
    let mut out: Vec<f64> = (0..n).map(|i| covariance[(i, i)].sqrt()).collect();
    if complete(source) {
        let base = source.base_parameters();
        let phi: Vec<Dual<f64, 10>> = base.iter().enumerate().map(|(k, &x)| Dual::variable(x, k)).collect();
        out.extend(about_com(&phi).iter().map(|y| {
            let slope = |i: usize| y.eps[source.estimated()[i]];
            let variance: f64 = (0..n)
                .flat_map(|i| (0..n).map(move |j| (i, j)))
                .map(|(i, j)| slope(i) * covariance[(i, j)] * slope(j))
                .sum();
            variance.max(0.0).sqrt()
        }));
    }
    out
}

/// Middle value of each column of `samples` (one row per plan); the upper one for an even number. Allocates.
pub(crate) fn medians(samples: &[Vec<f64>], columns: usize) -> Vec<f64> {
    (0..columns)
        .map(|c| {
            let mut column: Vec<f64> = samples.iter().map(|row| row[c]).collect();
            column.sort_by(f64::total_cmp);
            column.get(column.len() / 2).copied().unwrap_or(f64::NAN)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use nalgebra::Vector3;

    #[test]
    fn derived_quantities_are_those_of_the_body() {
        let i = Matrix3::new(15.0, 0.3, -0.2, 0.3, 18.0, 0.7, -0.2, 0.7, 21.0);
        let c = Vector3::new(0.9, -0.3, 0.6);
        let y = about_com(&Inertia::from_com(60.0, &c, &i).to_params());
        let want = [0.9, -0.3, 0.6, 15.0, 0.3, 18.0, -0.2, 0.7, 21.0];
        for (y, w) in y.iter().zip(want) {
            assert_relative_eq!(*y, w, epsilon = 1e-12);
        }
    }

    #[test]
    fn the_median_is_the_middle() {
        let rows = vec![vec![3.0, 1.0], vec![1.0, f64::INFINITY], vec![2.0, 5.0]];
        assert_eq!(medians(&rows, 2), vec![2.0, 5.0]);
    }
}
