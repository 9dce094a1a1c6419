//! What the joint motion is off by where the encoder of one joint is late.

use ff_dynamics::motion::JointMotion;
use std::sync::Arc;

/// The change of a motion per second by which the encoder of one of its joints is late. That reads `q(t - lag)` at time `t`, so that the joint is ahead
/// of its readings by `lag qd`, to first order; what is left out is `lag^2 qdd / 2`.
pub(crate) struct LateEncoder {
    motion: Arc<dyn JointMotion>,
    joint: usize,
    /// Time between samples (s), over which the third derivative is a difference.
    dt: f64,
}

impl LateEncoder {
    pub(crate) fn new(motion: Arc<dyn JointMotion>, joint: usize, dt: f64) -> Self {
        Self { motion, joint, dt }
    }
}

impl JointMotion for LateEncoder {
    fn dof(&self) -> usize {
        self.motion.dof()
    }
    fn duration(&self) -> f64 {
        self.motion.duration()
    }
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        let (n, j) = (self.dof(), self.joint);
        let mut at = |t: f64| {
            self.motion.eval(t, q, qd, qdd);
            (qd[j], qdd[j])
        };
        let ends = [(t - 0.5 * self.dt).max(0.0), (t + 0.5 * self.dt).min(self.duration())];
        let [(_, before), (_, behind)] = ends.map(&mut at);
        let (rate, acceleration) = at(t);
        for x in [&mut *q, &mut *qd, &mut *qdd] {
            x[..n].fill(0.0);
        }
        (q[j], qd[j], qdd[j]) = (rate, acceleration, (behind - before) / (ends[1] - ends[0]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ff_dynamics::motion::FnMotion;

    /// Readings of a joint that is ahead of them, by the lag times the change.
    #[test]
    fn a_late_encoder_is_behind_by_its_lag() {
        let of = |t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]| {
            for (j, w) in [0.7, 1.3].into_iter().enumerate() {
                let (sin, cos) = (w * t + 0.4).sin_cos();
                (q[j], qd[j], qdd[j]) = (sin, w * cos, -w * w * sin);
            }
        };
        let motion: Arc<dyn JointMotion> = Arc::new(FnMotion::new(2, 10.0, of).unwrap());
        let late = LateEncoder::new(Arc::clone(&motion), 1, 0.01);
        let all = |m: &dyn JointMotion, t: f64| {
            let mut x = [[0.0; 2]; 3];
            let [q, qd, qdd] = &mut x;
            m.eval(t, q, qd, qdd);
            x
        };
        let (lag, t) = (1e-4, 3.7);
        let (read, ahead, change) = (all(&*motion, t - lag), all(&*motion, t), all(&late, t));
        for k in 0..3 {
            assert_eq!(change[k][0], 0.0);
            let off = ahead[k][1] - read[k][1] - lag * change[k][1];
            assert!(off.abs() < 2e-8 && change[k][1].abs() > 0.1, "{k}: {off}");
        }
        // At the ends too.
        assert!(all(&late, 0.0).iter().chain(&all(&late, 10.0)).flatten().all(|x| x.is_finite()));
    }
}
