//! The largest response of chosen modes, robust to what their frequencies are not known to (goal (b)).
//!
//! The base acceleration `A(t)` of the rigid robot drives mode `m` by `x'' + 2 zeta w x' + w^2 x = d_m . A(t)`
//! ([`driven_modes`](crate::system::modal_response::driven_modes)), so that after the motion it swings with the rate amplitude `|G|`,
//!
//! ```text
//! G_m(w) = int_0^T d_m . A(t) exp(-zeta w (T - t)) exp(-i w t) dt.
//! ```
//!
//! The drive `d_m` of an antisymmetric pair of wings is a rotation of the base, that of a symmetric pair a translation
//! (`theory.md` 5.6): which of the two a mode needs is not chosen but follows. `A` has all the dynamics of the rigid robot
//! along the motion, so that directions and inertia are those of the configuration at every instant. Frequencies are
//! known to some percent only, and differ along the motion: `S = |G|^2` is taken at several within `1 +- spread`, and
//! their sum or, smoothed, the worst of them counts.

use super::base::{BasePartials, BaseResponse};
use super::disturbance::DrivenMode;
use super::{Cost, Sweep, uniform_nodes};
use crate::plan::spline::{Duration, SplinePlan};
use nalgebra::Vector6;
use std::f64::consts::TAU;

/// What counts of the frequencies that a mode may have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Robust {
    /// `-log` of the mean of `S`.
    Mean,
    /// `-log` of the least `S`, smoothed: `log (mean S^-p)^(1/p)`.
    Worst {
        /// `p >= 1`; 4 is sharp enough.
        power: f64,
    },
}

/// A mode to be driven.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResponseTarget {
    /// The mode; with damping zero the whole motion counts alike.
    pub mode: DrivenMode,
    /// Relative half width of the fan of frequencies, such as 0.05.
    pub spread: f64,
    /// Importance of this mode; dimensionless.
    pub importance: f64,
}

/// `sum_m importance_m J_m`, `J_m` as [`Robust`] says, over `fan` frequencies per mode. Infinite without any motion.
/// `value_gradient` panics if robot and plan differ in their number of joints.
#[derive(Clone, Debug)]
pub struct ModalResponse<B> {
    /// The rigid robot.
    pub response: B,
    /// The modes.
    pub targets: Vec<ResponseTarget>,
    /// Frequencies per mode, at least 1; they are spread evenly.
    pub fan: usize,
    /// What counts of them.
    pub robust: Robust,
}

impl<B: BaseResponse> ModalResponse<B> {
    /// Frequencies (Hz) of a target.
    fn frequencies(&self, t: &ResponseTarget) -> Vec<f64> {
        let n = self.fan.max(1);
        let at = |i: usize| if n == 1 { 0.0 } else { 2.0 * i as f64 / (n - 1) as f64 - 1.0 };
        (0..n).map(|i| t.mode.frequency * (1.0 + t.spread * at(i))).collect()
    }
    /// Rate amplitudes `|G|` left over, per target and frequency of its fan. Allocates.
    ///
    /// # Panics
    /// As the cost.
    pub fn amplitudes(&self, plan: &SplinePlan, x: &[f64]) -> Vec<Vec<f64>> {
        let lines = self.lines();
        let gains = self.gains(plan, &mut Sweep::new(plan, x), &lines);
        gains.chunks(self.fan.max(1)).map(|c| c.iter().map(|(re, im)| re.hypot(*im)).collect()).collect()
    }
    /// Drive, circular frequency and decay rate of every line.
    fn lines(&self) -> Vec<(Vector6<f64>, f64, f64)> {
        let line = |t: &ResponseTarget, f: f64| (t.mode.drive, TAU * f, TAU * f * t.mode.damping);
        self.targets.iter().flat_map(|t| self.frequencies(t).into_iter().map(move |f| line(t, f))).collect()
    }
    /// Sixteen samples per period and eight per span: the smooth integrand vanishes at both ends.
    fn samples(&self, plan: &SplinePlan, lines: &[(Vector6<f64>, f64, f64)]) -> usize {
        let (Duration::Fixed(t) | Duration::Free { max: t, .. }) = plan.spec().duration;
        let fastest = lines.iter().map(|l| l.1).fold(0.0, f64::max);
        let spans = plan.unit_knots().count() - plan.unit_knots().degree();
        // The bound keeps senseless modes affordable.
        ((16.0 * t * fastest / TAU).ceil().clamp(1.0, 80_000.0) as usize).max(8 * spans) + 1
    }
    fn gains(&self, plan: &SplinePlan, sweep: &mut Sweep, lines: &[(Vector6<f64>, f64, f64)]) -> Vec<(f64, f64)> {
        let nodes = uniform_nodes(plan, self.samples(plan, lines));
        let t = sweep.duration;
        let mut gains = vec![(0.0, 0.0); lines.len()];
        sweep.forward(&nodes, |node, s| {
            let mut a = [0.0; 6];
            self.response.base_acceleration(&s.q, &s.qd, &s.qdd, &mut a);
            let a = Vector6::from(a);
            for ((drive, w, decay), g) in lines.iter().zip(&mut gains) {
                let (sin, cos) = (w * node.s * t).sin_cos();
                let y = node.weight * t * (decay * t * (node.s - 1.0)).exp() * drive.dot(&a);
                *g = (g.0 + y * cos, g.1 - y * sin);
            }
        });
        gains
    }
}

impl<B: BaseResponse> Cost for ModalResponse<B> {
    fn value_gradient(&self, plan: &SplinePlan, x: &[f64], grad: &mut [f64]) -> f64 {
        assert_eq!(self.response.dof(), plan.dof(), "joints of robot and plan");
        let lines = self.lines();
        let mut sweep = Sweep::new(plan, x);
        let gains = self.gains(plan, &mut sweep, &lines);
        let t = sweep.duration;
        // dJ/dS per line.
        let mut slopes = Vec::with_capacity(lines.len());
        let mut value = 0.0;
        for (target, gains) in self.targets.iter().zip(gains.chunks(self.fan.max(1))) {
            let s: Vec<f64> = gains.iter().map(|(re, im)| re * re + im * im).collect();
            let n = s.len() as f64;
            match self.robust {
                Robust::Mean => {
                    let sum: f64 = s.iter().sum();
                    value -= target.importance * (sum / n).ln();
                    slopes.extend(s.iter().map(|_| -target.importance / sum));
                }
                Robust::Worst { power } => {
                    let least = s.iter().copied().fold(f64::INFINITY, f64::min);
                    let sum: f64 = s.iter().map(|s| (least / s).powf(power)).sum();
                    value += target.importance * ((sum / n).ln() / power - least.ln());
                    slopes.extend(s.iter().map(|s| -target.importance * (least / s).powf(power) / (s * sum)));
                }
            }
        }
        if !value.is_finite() {
            return f64::INFINITY;
        }
        let nodes = uniform_nodes(plan, self.samples(plan, &lines));
        let mut partials = BasePartials::new(plan.dof());
        sweep.backward(&nodes, grad, |node, s, adj| {
            let mut a = [0.0; 6];
            self.response.partials(&s.q, &s.qd, &s.qdd, &mut a, &mut partials);
            let a = Vector6::from(a);
            let mut over_a = Vector6::zeros();
            for (((drive, w, decay), (re, im)), slope) in lines.iter().zip(&gains).zip(&slopes) {
                let (sin, cos) = (w * node.s * t).sin_cos();
                let k = 2.0 * slope * node.weight * (decay * t * (node.s - 1.0)).exp();
                let (along, turning) = (re * cos - im * sin, re * sin + im * cos);
                over_a += drive * (k * t * along);
                // dt = weight T, the phase and the decay depend on the duration explicitly.
                let y = drive.dot(&a);
                adj.duration += k * y * (along * (1.0 + decay * t * (node.s - 1.0)) - w * node.s * t * turning);
            }
            for (out, m) in [(&mut adj.q, &partials.q), (&mut adj.qd, &partials.qd), (&mut adj.qdd, &partials.qdd)] {
                for (o, column) in out.iter_mut().zip(m.column_iter()) {
                    *o += column.dot(&over_a);
                }
            }
        });
        value
    }
}
