//! Joint motions with exact derivatives.

use crate::random::{rng, symmetric, uniform};
use ff_dynamics::motion::JointMotion;
use std::f64::consts::TAU;

/// A smooth, general joint motion: every joint its own two sines, in motion from the start.
pub struct Wave(
    /// Joints.
    pub usize,
);

impl JointMotion for Wave {
    fn dof(&self) -> usize {
        self.0
    }
    fn duration(&self) -> f64 {
        1e3
    }
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        for j in 0..self.0 {
            let (a, w, f) = (0.12 + 0.03 * j as f64, 0.9 + 0.31 * j as f64, 0.4 * j as f64);
            let (b, v, g) = (0.05, 2.3 - 0.17 * j as f64, 1.0 - 0.3 * j as f64);
            q[j] = 0.3 * (j as f64 - 2.5) + a * (w * t + f).sin() + b * (v * t + g).sin();
            qd[j] = a * w * (w * t + f).cos() + b * v * (v * t + g).cos();
            qdd[j] = -a * w * w * (w * t + f).sin() - b * v * v * (v * t + g).sin();
        }
    }
}

/// Joints that swing from rest: `q_j = rest + a_j (1 - cos w_j t)`.
pub struct Swing {
    /// Duration (s).
    pub seconds: f64,
    /// Position at the start (rad or m).
    pub rest: f64,
    /// Amplitude `a_j` (rad or m) and angular frequency `w_j` (rad/s) of every joint.
    pub joints: Vec<(f64, f64)>,
}

impl JointMotion for Swing {
    fn dof(&self) -> usize {
        self.joints.len()
    }
    fn duration(&self) -> f64 {
        self.seconds
    }
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        for (j, &(a, w)) in self.joints.iter().enumerate() {
            let (s, c) = (w * t).sin_cos();
            (q[j], qd[j], qdd[j]) = (self.rest + a * (1.0 - c), a * w * s, a * w * w * c);
        }
    }
}

/// Two random sines per joint, from rest.
pub struct Sines {
    terms: Vec<[(f64, f64); 2]>,
    seconds: f64,
    reach: f64,
}

impl Sines {
    /// Of a seed; amplitudes are multiples of `reach` (rad or m).
    pub fn new(seed: u64, joints: usize, seconds: f64, reach: f64) -> Self {
        let mut r = rng(seed);
        let mut sine = |a: f64, (low, high): (f64, f64)| {
            let a = symmetric(&mut r, a);
            (a, uniform(&mut r, low, high))
        };
        let terms = (0..joints).map(|_| [sine(1.0, (0.05, 0.25)), sine(0.4, (0.2, 0.5))]).collect();
        Self { terms, seconds, reach }
    }
}

impl JointMotion for Sines {
    fn dof(&self) -> usize {
        self.terms.len()
    }
    fn duration(&self) -> f64 {
        self.seconds
    }
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        for (j, terms) in self.terms.iter().enumerate() {
            (q[j], qd[j], qdd[j]) = (0.3 - 0.1 * j as f64, 0.0, 0.0);
            for &(a, f) in terms {
                let (a, w) = (a * self.reach, TAU * f);
                let (s, c) = (w * t).sin_cos();
                q[j] += a * (1.0 - c);
                qd[j] += a * w * s;
                qdd[j] += a * w * w * c;
            }
        }
    }
}
