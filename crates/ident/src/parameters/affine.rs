//! Affine coordinates of a body around a reference: linear in the inertial parameters, scaled by the body.
//!
//! With `P` the 4 x 4 pseudo-inertia and `P0 = L L^T` a reference, `P = L (1 + S) L^T` with a symmetric `S`. The
//! ten coordinates are the entries of `S` (off-diagonal ones times `sqrt 2`, so that `|x| = |S|_F`). They are linear in
//! the parameters, in which records are nearly linear; and they measure change relative to the body in every
//! direction, however thin it is: `|x|` is, to first order, the affine-invariant distance of T. Lee, P. Wensing,
//! F. Park, *Geometric robot dynamic identification: a convex programming approach*, IEEE T-RO 36(2), 2020, and
//! every `|x| < 1` is a physical body.

use ff_model::Inertia;
use nalgebra::{Matrix4, SMatrix};

/// Row and column of the ten entries.
const ENTRIES: [(usize, usize); 10] = [(0, 0), (1, 1), (2, 2), (3, 3), (0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)];

/// Coordinates around one reference body.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Affine {
    l: Matrix4<f64>,
    inverse: Matrix4<f64>,
}

impl Affine {
    /// Around `body`; `None` if its pseudo-inertia is not positive definite.
    pub(crate) fn around(body: &Inertia<f64>) -> Option<Self> {
        let l = body.pseudo().cholesky()?.l();
        Some(Self { l, inverse: l.try_inverse()? })
    }
    fn weight(k: usize) -> f64 {
        if k < 4 { 1.0 } else { std::f64::consts::SQRT_2 }
    }
    /// The body at `x`.
    pub(crate) fn body(&self, x: &[f64]) -> Inertia<f64> {
        let mut s = Matrix4::identity();
        for (k, &(i, j)) in ENTRIES.iter().enumerate() {
            s[(i, j)] += x[k] / Self::weight(k);
            if i != j {
                s[(j, i)] = s[(i, j)];
            }
        }
        Inertia::from_pseudo(&(self.l * s * self.l.transpose()))
    }
    /// The coordinates of a body.
    pub(crate) fn coordinates(&self, body: &Inertia<f64>) -> [f64; 10] {
        let s = self.inverse * body.pseudo() * self.inverse.transpose() - Matrix4::identity();
        core::array::from_fn(|k| s[ENTRIES[k]] * Self::weight(k))
    }
    /// `d parameters / d x`, constant, 10 x 10.
    pub(crate) fn jacobian(&self) -> SMatrix<f64, 10, 10> {
        let zero = self.body(&[0.0; 10]).to_params();
        let mut out = SMatrix::zeros();
        for k in 0..10 {
            let mut e = [0.0; 10];
            e[k] = 1.0;
            for (i, p) in self.body(&e).to_params().iter().enumerate() {
                out[(i, k)] = p - zero[i];
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    fn body() -> Inertia<f64> {
        let i = Matrix3::new(15.0, 0.4, -0.3, 0.4, 11.0, 0.2, -0.3, 0.2, 14.0);
        Inertia::from_com(33.0, &Vector3::new(0.02, 1.07, -0.3), &i)
    }

    #[test]
    fn coordinates_and_bodies_are_inverse_and_short_steps_are_physical() {
        let a = Affine::around(&body()).unwrap();
        let x = [0.3, -0.2, 0.1, 0.25, -0.15, 0.2, 0.05, 0.3, -0.4, 0.1];
        let b = a.body(&x);
        assert_eq!(b.check(), Ok(()));
        for (u, v) in a.coordinates(&b).iter().zip(&x) {
            assert!((u - v).abs() < 1e-12);
        }
        // Linear: the Jacobian is exact for any step.
        let p = a.jacobian() * nalgebra::SVector::<f64, 10>::from_row_slice(&x);
        let (p0, p1) = (body().to_params(), b.to_params());
        for k in 0..10 {
            assert!((p[k] - (p1[k] - p0[k])).abs() < 1e-10 * (1.0 + p1[k].abs()));
        }
    }
}
