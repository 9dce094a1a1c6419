//! Attitude of the base since the start of a record, and how its derivatives go through a step.
//!
//! The step is that of [`crate::sim::integrate::Rkmk4`]: `att_1 = att_0 exp(u)`, `u = h sum b_s K_s`,
//! `K_s = D(u_s, w_s)`, `u_s = c_s h K_{s-1}` with `D(u, w) = w + u x w / 2 + u x (u x w) / 12`. A variation
//! `att = att exp(dt)` in body axes obeys
//!
//! ```text
//! dt_1 = exp(u)^T dt_0 + J(u) du,    J(u) = 1 - (1 - cos|u|)/|u|^2 [u]x + (|u| - sin|u|)/|u|^3 [u]x^2,
//! ```
//!
//! (right Jacobian of the exponential; T. Barfoot, *State Estimation for Robotics*, 2017, eq. (7.77) for the left one),
//! and `du` is linear in the variations of the four stage rates: four 3 x 3 matrices per step serve all columns.

use crate::reduced::system::{STAGE, WEIGHT};
use ff_model::scalar::LaneScalar;
use ff_model::spatial::so3::{
    Quat, dexp_inv_body, exp_so3, quat_identity, quat_mul, quat_normalize, quat_to_rot, right_jacobian,
};
use nalgebra::{DMatrix, Matrix3, Vector3};

/// Attitude of the base at the samples of a record.
#[derive(Clone, Debug, PartialEq)]
pub struct Attitude {
    /// Rotation of the base since the start, `[w, x, y, z]`, `N x 4`.
    pub att: DMatrix<f64>,
    /// Its derivatives as rotation vectors in base axes (rad per unit), `(N 3) x P`.
    pub d: DMatrix<f64>,
}

impl Attitude {
    pub(crate) fn new(samples: usize, columns: usize) -> Self {
        Self { att: DMatrix::zeros(samples, 4), d: DMatrix::zeros(samples * 3, columns) }
    }
    pub(crate) fn write(&mut self, i: usize, track: &AttitudeTrack, d: &[f64], width: usize, columns: usize) {
        for k in 0..4 {
            self.att[(i, k)] = track.att[k];
        }
        for c in 0..columns {
            (0..3).for_each(|k| self.d[(3 * i + k, c)] = d[k * width + c]);
        }
    }
}

/// The attitude as it is integrated.
#[derive(Clone, Debug)]
pub(crate) struct AttitudeTrack {
    att: Quat<f64>,
}

impl Default for AttitudeTrack {
    fn default() -> Self {
        Self { att: quat_identity() }
    }
}

/// What a step does to derivatives of the attitude: `dt_1 = back dt_0 + sum_s by_s dw_s`.
#[derive(Clone, Debug)]
pub(crate) struct Turned {
    back: Matrix3<f64>,
    by: [Matrix3<f64>; 4],
}

impl AttitudeTrack {
    /// One step of length `h` (s) with the base rates at the four stages (rad/s).
    pub(crate) fn step(&mut self, h: f64, rates: [[f64; 3]; 4]) -> Turned {
        let (mut k, mut u) = (Vector3::zeros(), Vector3::zeros());
        // Derivatives of K_s with respect to the rates of stages 0..=s.
        let mut e = [Matrix3::zeros(); 4];
        let (mut sum, mut by) = (Vector3::zeros(), [Matrix3::zeros(); 4]);
        for s in 0..4 {
            let w = Vector3::from(rates[s]);
            let c = 0.5 * h * STAGE[s] as f64;
            if s > 0 {
                u = k * c;
            }
            k = dexp_inv_body(&u, &w);
            let (ux, wx) = (u.cross_matrix(), w.cross_matrix());
            let along = wx * -0.5 - (u.cross(&w).cross_matrix() + ux * wx) / 12.0;
            for e in &mut e[..s] {
                *e = along * *e * c;
            }
            e[s] = Matrix3::identity() + ux * 0.5 + ux * ux / 12.0;
            let weight = WEIGHT[s] * h;
            sum += k * weight;
            by.iter_mut().zip(&e).for_each(|(b, e)| *b += e * weight);
        }
        let turn = exp_so3(&sum);
        let right = right_jacobian(&sum);
        self.att = quat_normalize(&quat_mul(&self.att, &turn));
        Turned { back: quat_to_rot(&turn).transpose(), by: by.map(|b| right * b) }
    }
}

impl Turned {
    /// `back dt_0` of one block of columns.
    #[inline(always)]
    pub(crate) fn carried<L: LaneScalar>(&self, dtheta: &[f64], width: usize, block: usize) -> [L; 3] {
        let at = |i: usize| &dtheta[i * width + block..];
        let x = [L::load(at(0)), L::load(at(1)), L::load(at(2))];
        let mut y = [L::zero(); 3];
        multiply_add(&self.back, &x, &mut y);
        y
    }
    /// Adds the part of a stage's rates.
    #[inline(always)]
    pub(crate) fn add<L: LaneScalar>(&self, theta: &mut [L; 3], stage: usize, dw: &[L]) {
        multiply_add(&self.by[stage], dw, theta);
    }
}

/// `y += m x`.
#[inline(always)]
fn multiply_add<L: LaneScalar>(m: &Matrix3<f64>, x: &[L], y: &mut [L; 3]) {
    let m = &m.data.0;
    for i in 0..3 {
        for j in 0..3 {
            y[i] = crate::linalg::rows::fma(L::splat(m[j][i]), x[j], y[i]);
        }
    }
}
