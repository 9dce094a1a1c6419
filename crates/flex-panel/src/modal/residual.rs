//! Residual mass: what is left of the rigid inertia when the modes have taken theirs.

use super::DIRECTIONS;
use ff_model::{Area, Inertia, Problem};
use nalgebra::{DMatrix, Matrix6, SymmetricEigen, Vector6};

/// How far below zero the least eigenvalue of the scaled residual may be: tables of modes are printed with seven
/// digits, and modes that are complete in one direction leave nothing there.
pub const RESIDUAL_SLACK: f64 = 1e-6;

/// `M - P P^T` (modal mass 1 kg), scaled by the square roots of the diagonal of `M`.
///
/// It is the Schur complement of the modes in the kinetic-energy matrix `[[M, P], [P^T, 1]]`, so the kinetic energy is
/// positive semidefinite exactly when it is. Physically it is the mass that the modes left out still carry: negative in
/// a direction means that the modes move more mass than the structure has.
#[derive(Clone, Debug, PartialEq)]
pub struct Residual {
    /// Least eigenvalue of the scaled residual: the part of the rigid inertia that is left in the worst direction.
    /// Not below 0, within [`RESIDUAL_SLACK`], for a structure that can exist. NaN if something is not finite.
    pub margin: f64,
    /// The worst direction: shares of the scaled directions [`DIRECTIONS`], of unit length.
    pub direction: Vector6<f64>,
    /// The mode with the greatest effective mass in that direction.
    pub mode: usize,
    /// Residual of each of the six directions as a part of the rigid inertia: `1 - sum_j P_ij^2 / M_ii`.
    pub parts: Vector6<f64>,
}

impl Residual {
    /// Of the rigid inertia about the mount and the 6 x n participation matrix (kg, kg m; modal mass 1 kg). Allocates.
    ///
    /// # Panics
    /// If `p` has not six rows.
    pub fn new(rigid: &Inertia<f64>, p: &DMatrix<f64>) -> Self {
        assert_eq!(p.nrows(), 6, "participation has six rows");
        let m = rigid.to_matrix();
        // A thin rod has no inertia about itself: there any participation is too much, at the scale of the others.
        let floor = [1e-12 * m[(0, 0)], 1e-12 * (m[(3, 3)] + m[(4, 4)] + m[(5, 5)])];
        let s = Vector6::from_fn(|i, _| 1.0 / m[(i, i)].max(floor[i / 3]).max(f64::MIN_POSITIVE).sqrt());
        let scaled_p = DMatrix::from_fn(6, p.ncols(), |i, j| s[i] * p[(i, j)]);
        let taken = &scaled_p * scaled_p.transpose();
        let left = Matrix6::from_fn(|i, j| s[i] * m[(i, j)] * s[j] - taken[(i, j)]);
        let parts = left.diagonal();
        if !left.iter().all(|x| x.is_finite()) {
            return Self { margin: f64::NAN, direction: Vector6::zeros(), mode: 0, parts };
        }
        let eigen = SymmetricEigen::new((left + left.transpose()) * 0.5);
        let worst = eigen.eigenvalues.imin();
        let direction: Vector6<f64> = eigen.eigenvectors.column(worst).into_owned();
        let mode = (0..p.ncols())
            .max_by(|&a, &b| {
                let share = |j: usize| scaled_p.column(j).dot(&direction).abs();
                share(a).total_cmp(&share(b))
            })
            .unwrap_or(0);
        Self { margin: eigen.eigenvalues[worst], direction, mode, parts }
    }

    /// What is wrong with it, if something is. Allocates.
    pub fn problem(&self) -> Option<Problem> {
        if self.margin >= -RESIDUAL_SLACK {
            return None;
        }
        let main = self.direction.iamax();
        let name = [
            "translation along x",
            "translation along y",
            "translation along z",
            "rotation about x",
            "rotation about y",
            "rotation about z",
        ][main];
        let shares: Vec<String> = (0..6)
            .filter(|&i| self.direction[i].abs() >= 0.1)
            .map(|i| format!("{:+.2} {}", self.direction[i], DIRECTIONS[i]))
            .collect();
        let what = format!(
            "modes move {:.3} % more mass than the rigid body has in {name} (direction {}), limit 0 %; mode {} most",
            -100.0 * self.margin,
            shares.join(" "),
            self.mode
        );
        let hint = "participation must be that of modes scaled to a modal mass of 1 kg, about the mount, in mount axes; \
                    the rigid inertia that of the same structure";
        Some(
            Problem::error(Area::Config, "Config::ResidualMass", what)
                .on(format!("modes[{}].participation", self.mode))
                .hint(hint),
        )
    }
}
