//! Random feasible multisines: what a planned motion is compared with.
//!
//! `q_j(t) = q0_j + c_j g(t) sum_h a_jh sin(2 pi h t / T + phi_jh)`, harmonics 1..12, phases even over the circle and
//! amplitudes even in `0..1` divided by `h`, so that no harmonic has the speed to itself. `g` rises and falls over a tenth
//! of the time each by a quintic step (rest to rest with continuous acceleration). `c_j` is as large as position, speed
//! and acceleration allow: each joint touches one of its limits.

use crate::study::quintic::step;
use excitation::JointLimits;
use ff_dynamics::motion::JointMotion;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

const HARMONICS: usize = 12;
const TAPER: f64 = 0.1;

/// One multisine; see the module documentation.
pub(super) struct Multisine {
    start: Vec<f64>,
    duration: f64,
    /// Amplitude and phase per joint and harmonic.
    terms: Vec<Vec<(f64, f64)>>,
}

impl Multisine {
    pub(super) fn new(start: &[f64], limits: &[JointLimits], duration: f64, seed: u64, stream: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(stream);
        let mut one = |h: usize| (rng.random::<f64>() / h as f64, TAU * rng.random::<f64>());
        let terms = start.iter().map(|_| (1..=HARMONICS).map(&mut one).collect()).collect();
        let mut m = Self { start: start.to_vec(), duration, terms };
        let n = start.len();
        let (mut q, mut qd, mut qdd) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let mut worst = vec![0.0_f64; n];
        let samples = 20_000;
        for i in 0..=samples {
            m.eval(duration * f64::from(i) / f64::from(samples), &mut q, &mut qd, &mut qdd);
            for (j, l) in limits.iter().enumerate() {
                let d = q[j] - start[j];
                let room = if d > 0.0 { l.upper - start[j] } else { start[j] - l.lower };
                worst[j] =
                    worst[j].max(d.abs() / room).max(qd[j].abs() / l.velocity).max(qdd[j].abs() / l.acceleration);
            }
        }
        for (terms, worst) in m.terms.iter_mut().zip(worst) {
            terms.iter_mut().for_each(|t| t.0 *= (1.0 - 1e-6) / worst);
        }
        m
    }
}

impl JointMotion for Multisine {
    fn dof(&self) -> usize {
        self.start.len()
    }
    fn duration(&self) -> f64 {
        self.duration
    }
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        let (s, k) = (t / self.duration, 1.0 / (TAPER * self.duration));
        let g = if s < 0.5 {
            let [a, b, c] = step(s / TAPER);
            [a, b * k, c * k * k]
        } else {
            let [a, b, c] = step((1.0 - s) / TAPER);
            [a, -b * k, c * k * k]
        };
        for (j, terms) in self.terms.iter().enumerate() {
            let mut y = [0.0; 3];
            for (h, (a, phase)) in terms.iter().enumerate() {
                let w = TAU * (h + 1) as f64 / self.duration;
                let (sin, cos) = (w * t + phase).sin_cos();
                y[0] += a * sin;
                y[1] += a * w * cos;
                y[2] -= a * w * w * sin;
            }
            q[j] = self.start[j] + g[0] * y[0];
            qd[j] = g[1] * y[0] + g[0] * y[1];
            qdd[j] = g[2] * y[0] + 2.0 * g[1] * y[1] + g[0] * y[2];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_limits_and_rest() {
        let limits = vec![JointLimits { lower: -1.5, upper: 2.0, velocity: 0.17, acceleration: 0.15, jerk: None }; 3];
        let start = [0.4, -0.7, 1.1];
        let m = Multisine::new(&start, &limits, 60.0, 4, 2);
        let at = |t: f64| {
            let mut x = [[0.0; 3]; 3];
            let [q, qd, qdd] = &mut x;
            m.eval(t, q, qd, qdd);
            x
        };
        let mut touched = [0.0_f64; 3];
        for i in 0..=3000 {
            let t = 0.02 * f64::from(i);
            let [q, qd, qdd] = at(t);
            for j in 0..3 {
                touched[j] = touched[j].max(qd[j].abs() / 0.17).max(qdd[j].abs() / 0.15);
                touched[j] = touched[j]
                    .max((q[j] - start[j]).abs() / if q[j] > start[j] { 2.0 - start[j] } else { start[j] + 1.5 });
            }
        }
        assert!(touched.iter().all(|t| *t <= 1.0 && *t > 0.99), "{touched:?}");
        for t in [1.3, 3.9, 31.7, 55.2, 58.8] {
            let (a, b, c) = (at(t - 1e-4), at(t), at(t + 1e-4));
            for j in 0..3 {
                assert!((b[1][j] - (c[0][j] - a[0][j]) / 2e-4).abs() < 1e-8);
                assert!((b[2][j] - (c[1][j] - a[1][j]) / 2e-4).abs() < 1e-8);
            }
        }
        for t in [0.0, 60.0] {
            let [q, qd, qdd] = at(t);
            assert!((0..3).all(|j| (q[j] - start[j]).abs() < 1e-14 && qd[j] == 0.0 && qdd[j].abs() < 1e-12));
        }
    }
}
