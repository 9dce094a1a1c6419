//! A planned motion with the modes shaken beside it.
//!
//! A plan for the base with a control point every second or two reaches no mode at 0.7 Hz. Here every joint follows it at 0.75 of
//! its size and adds tones at natural frequencies of the model, which take a fifth of its acceleration limit together:
//! `q = q0 + 0.75 (plan - q0) + g(t) sum_m a_m / (2 pi f_m)^2 cos(2 pi f_m t + phi_jm)`. The tones rise over the first tenth
//! of the time and fall over the last. Limits hold because they are linear in the motion: three quarters of them for the plan, the
//! rest for the tones.

use crate::study::quintic::step;
use ff_dynamics::motion::JointMotion;
use ff_dynamics::motion::bspline::BSplineMotion;
use std::f64::consts::TAU;

/// Part of the plan.
const SHARE: f64 = 0.75;
/// Part of the acceleration limit that the tones take together.
const TONES: f64 = 0.22;

/// See the module documentation.
pub(super) struct Shaken {
    plan: BSplineMotion,
    start: Vec<f64>,
    frequencies: Vec<f64>,
    /// Acceleration of one tone (rad/s^2), per joint.
    each: Vec<f64>,
}

impl Shaken {
    /// The plan with tones at these frequencies (Hz) under these acceleration limits.
    pub(super) fn new(plan: BSplineMotion, frequencies: Vec<f64>, acceleration: &[f64]) -> Self {
        let n = plan.dof();
        let (mut q, mut qd, mut qdd) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        plan.eval(0.0, &mut q, &mut qd, &mut qdd);
        let each = acceleration.iter().map(|a| TONES * a / frequencies.len().max(1) as f64).collect();
        Self { plan, start: q, frequencies, each }
    }
}

impl JointMotion for Shaken {
    fn dof(&self) -> usize {
        self.plan.dof()
    }
    fn duration(&self) -> f64 {
        self.plan.duration()
    }
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        self.plan.eval(t, q, qd, qdd);
        let ramp = 0.1 * self.duration();
        let (up, down) = (step(t / ramp), step((self.duration() - t) / ramp));
        let [g, g1, g2] = [
            up[0] * down[0],
            (up[1] * down[0] - up[0] * down[1]) / ramp,
            (up[2] * down[0] - 2.0 * up[1] * down[1] + up[0] * down[2]) / (ramp * ramp),
        ];
        for j in 0..self.dof() {
            q[j] = self.start[j] + SHARE * (q[j] - self.start[j]);
            (qd[j], qdd[j]) = (SHARE * qd[j], SHARE * qdd[j]);
            for (m, f) in self.frequencies.iter().enumerate() {
                let w = TAU * f;
                let a = self.each[j] / (w * w);
                // Phases unlike each other from joint to joint.
                let (s, c) = (w * t + 1.9 * j as f64 + 0.7 * m as f64).sin_cos();
                q[j] += a * g * c;
                qd[j] += a * (g1 * c - g * w * s);
                qdd[j] += a * (g2 * c - 2.0 * g1 * w * s - g * w * w * c);
            }
        }
    }
    fn breaks(&self) -> Vec<f64> {
        // The third derivative of the quintic step jumps at its ends.
        let ramp = 0.1 * self.duration();
        let mut out = self.plan.breaks();
        out.extend([ramp, self.duration() - ramp]);
        out.sort_by(f64::total_cmp);
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ff_dynamics::motion::bspline::Knots;
    use nalgebra::DMatrix;

    #[test]
    fn rates_are_derivatives_and_limits_hold() {
        let control = DMatrix::from_fn(2, 9, |j, k| 0.2 + 0.15 * (1.3 * k as f64 + 0.9 * j as f64).sin());
        let plan = BSplineMotion::new(Knots::uniform(5, 9, 20.0).unwrap(), control).unwrap();
        let (mut worst, mut most) = (0.0f64, 0.0f64);
        let at = |m: &dyn JointMotion, t: f64| {
            let (mut q, mut qd, mut qdd) = (vec![0.0; 2], vec![0.0; 2], vec![0.0; 2]);
            m.eval(t, &mut q, &mut qd, &mut qdd);
            (q, qd, qdd)
        };
        for k in 1..400 {
            most = most.max(at(&plan, 0.05 * f64::from(k)).2.iter().fold(0.0, |m, x| m.max(x.abs())));
        }
        let s = Shaken::new(plan, vec![0.23, 0.7], &[most, most]);
        for k in 1..399 {
            // Beside the instants at which the third derivative jumps.
            let (t, h) = (0.05 * f64::from(k) + 0.013, 1e-4);
            let (a, b, c) = (at(&s, t - h), at(&s, t), at(&s, t + h));
            for j in 0..2 {
                assert!((b.1[j] - (c.0[j] - a.0[j]) / (2.0 * h)).abs() < 1e-7);
                assert!((b.2[j] - (c.1[j] - a.1[j]) / (2.0 * h)).abs() < 1e-6);
                worst = worst.max(b.2[j].abs());
            }
        }
        assert!(worst <= most && worst > 0.9 * SHARE * most, "{worst} {most}");
    }
}
