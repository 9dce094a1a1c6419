//! The joint motion of every whole-task run (`peers/src/traj.hpp`).

use ff_dynamics::motion::JointMotion;
use ff_model::Scalar;
use std::f64::consts::TAU;

/// `q_j = q0 + A (1 - cos 2 pi f t) + B (1 - cos 2 pi g t)`: at rest at the start.
pub(crate) struct Manoeuvre {
    pub(crate) duration: f64,
}

const START: [f64; 7] = [0.0, 0.6, 0.0, -1.2, 0.0, 0.8, 0.0];
const SLOW: ([f64; 7], [f64; 7]) =
    ([0.4, 0.5, -0.3, -0.6, 0.35, 0.45, -0.5], [0.05, 0.11, 0.07, 0.09, 0.06, 0.13, 0.10]);
const FAST: ([f64; 7], [f64; 7]) =
    ([0.03, 0.04, -0.03, 0.05, 0.02, -0.04, 0.05], [0.45, 0.68, 0.5, 0.72, 0.6, 0.8, 0.55]);

impl JointMotion for Manoeuvre {
    fn dof(&self) -> usize {
        7
    }
    fn duration(&self) -> f64 {
        self.duration
    }
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        for j in 0..7 {
            let (a, w, b, u) = (SLOW.0[j], TAU * SLOW.1[j], FAST.0[j], TAU * FAST.1[j]);
            let ((sw, cw), (su, cu)) = (Scalar::sin_cos(w * t), Scalar::sin_cos(u * t));
            q[j] = START[j] + a * (1.0 - cw) + b * (1.0 - cu);
            qd[j] = a * w * sw + b * u * su;
            qdd[j] = a * w * w * cw + b * u * u * cu;
        }
    }
}
