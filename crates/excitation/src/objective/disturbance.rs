//! Leave the modes alone: how much flexible appendages disturb a record that is taken for rigid.
//!
//! Base-mounted appendages feel the arm through the base acceleration `A(t)` of the rigid robot alone. Mode `m`
//! with amplitude `x` obeys `x'' + 2 zeta w_m x' + w_m^2 x = d_m . A`, so in the spectrum
//!
//! ```text
//! x''(w) = T_m(w) (d_m . A)(w),     T_m(w) = -w^2 / (w_m^2 - w^2 + 2 i zeta w w_m).
//! ```
//!
//! What the sensors see of it, whitened, squared and summed over the samples of the record, is
//!
//! ```text
//! chi^2 = rate sum_m (1/pi) int |T_m|^2 (torque_m + gyro_m / w^2) |d_m . A|^2 dw
//! ```
//!
//! (Parseval; products of different modes are left out). A rigid fit turns it into a bias `b` with
//! `b^T M b <= chi^2`, `M` being the information matrix. Unlike the energy of joint accelerations in a band
//! ([`Quiet`](super::spectrum::Quiet)) this knows how far each joint moves the base, in which direction and at
//! which configuration, and that a mode answers below its frequency too.

use super::base::{BasePartials, BaseResponse};
use super::{Cost, Sweep, uniform_nodes};
use crate::plan::spline::SplinePlan;
use nalgebra::Vector6;
use std::f64::consts::{PI, TAU};

/// A mode that base acceleration drives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrivenMode {
    /// Natural frequency (Hz).
    pub frequency: f64,
    /// Damping ratio.
    pub damping: f64,
    /// `d_m`: modal acceleration per base acceleration, linear first (1/m, 1).
    pub drive: Vector6<f64>,
    /// Squared whitened torque, all joints together, per squared modal acceleration (s^4).
    pub torque: f64,
    /// Squared whitened base angular acceleration, per squared modal acceleration (s^2).
    pub gyro: f64,
}

/// `emphasis ln(1 + chi^2)`. `value_gradient` panics if robot and plan differ in their number of joints.
///
/// Frequencies up to 1.5 times the highest mode count, in steps of `1 / (4 T)`. The record cannot
/// resolve a peak narrower than its own duration allows and frequencies move with the configuration, so the
/// damping ratio is taken as at least `1 / (w_m T)`, with `T` the reference duration below.
#[derive(Clone, Debug)]
pub struct Disturbance<B> {
    /// The rigid robot.
    pub response: B,
    /// The modes.
    pub modes: Vec<DrivenMode>,
    /// Samples per second of the record (Hz).
    pub rate: f64,
    /// Reference duration (s) that sets the frequency step and the width of the peaks.
    pub duration: f64,
    /// Weight.
    pub emphasis: f64,
}

impl<B: BaseResponse> Disturbance<B> {
    /// Circular frequencies (rad/s) and, per frequency and mode, the weight of `|d_m . A|^2`.
    fn lines(&self) -> (Vec<f64>, Vec<Vec<f64>>) {
        let highest = self.modes.iter().map(|m| m.frequency).fold(0.0, f64::max);
        let step = 0.25 / self.duration;
        // The bound keeps senseless modes affordable.
        let count = (1.5 * highest / step).ceil().clamp(1.0, 20_000.0) as usize;
        let omegas: Vec<f64> = (0..count).map(|k| TAU * (k as f64 + 0.5) * step).collect();
        let weight = |w: f64, m: &DrivenMode| {
            let wm = TAU * m.frequency;
            let zeta = m.damping.max(1.0 / (wm * self.duration));
            let gain = w.powi(4) / ((wm * wm - w * w).powi(2) + (2.0 * zeta * w * wm).powi(2));
            self.rate * TAU * step / PI * gain * (m.torque + m.gyro / (w * w))
        };
        let weights = omegas.iter().map(|&w| self.modes.iter().map(|m| weight(w, m)).collect()).collect();
        (omegas, weights)
    }
    /// `chi^2` of the trajectory `x`. Allocates.
    ///
    /// # Panics
    /// As the cost.
    pub fn chi_square(&self, plan: &SplinePlan, x: &[f64]) -> f64 {
        let (modes, response) = (self.modes.clone(), &self.response);
        let one = Disturbance { response, modes, rate: self.rate, duration: self.duration, emphasis: 1.0 };
        one.value_gradient(plan, x, &mut vec![0.0; x.len()]).exp_m1()
    }
}

impl<B: BaseResponse> Cost for Disturbance<B> {
    fn value_gradient(&self, plan: &SplinePlan, x: &[f64], grad: &mut [f64]) -> f64 {
        assert_eq!(self.response.dof(), plan.dof(), "joints of robot and plan");
        let (omegas, weights) = self.lines();
        let mut sweep = Sweep::new(plan, x);
        let t = sweep.duration;
        // At rest at both ends, so that equal weights integrate like a Fourier series; four samples per
        // period of the highest frequency, and enough to follow the splines.
        let spans = plan.unit_knots().count() - plan.unit_knots().degree();
        let by_frequency = (4.0 * t * omegas[omegas.len() - 1] / TAU).ceil().clamp(1.0, 80_000.0) as usize;
        let nodes = uniform_nodes(plan, by_frequency.max(8 * spans) + 1);
        let n = self.modes.len();
        // D[frequency][mode] = (re, im), and the trigonometric table, which the way back needs again.
        let mut d = vec![vec![(0.0, 0.0); n]; omegas.len()];
        let mut table = Vec::with_capacity(nodes.len() * omegas.len());
        let mut y = vec![0.0; n];
        sweep.forward(&nodes, |node, s| {
            let mut a = [0.0; 6];
            self.response.base_acceleration(&s.q, &s.qd, &s.qdd, &mut a);
            let a = Vector6::from(a);
            y.iter_mut().zip(&self.modes).for_each(|(y, m)| *y = node.weight * t * m.drive.dot(&a));
            for (w, row) in omegas.iter().zip(&mut d) {
                let (sin, cos) = (w * node.s * t).sin_cos();
                table.push((sin, cos));
                for (o, y) in row.iter_mut().zip(&y) {
                    *o = (o.0 + y * cos, o.1 - y * sin);
                }
            }
        });
        let mut chi = 0.0;
        for (row, weight) in d.iter_mut().zip(&weights) {
            for ((re, im), w) in row.iter_mut().zip(weight) {
                chi += w * (*re * *re + *im * *im);
                (*re, *im) = (2.0 * w * *re, 2.0 * w * *im);
            }
        }
        let slope = self.emphasis / (1.0 + chi);
        let mut partials = BasePartials::new(plan.dof());
        let mut table = table.chunks_exact(omegas.len());
        sweep.backward(&nodes, grad, |node, s, adj| {
            let Some(table) = table.next() else { return };
            let mut a = [0.0; 6];
            self.response.partials(&s.q, &s.qd, &s.qdd, &mut a, &mut partials);
            let a = Vector6::from(a);
            let mut over_a = Vector6::zeros();
            for (k, m) in self.modes.iter().enumerate() {
                let (mut along, mut turning) = (0.0, 0.0);
                for ((w, (sin, cos)), row) in omegas.iter().zip(table).zip(&d) {
                    let (re, im) = row[k];
                    along += re * cos - im * sin;
                    turning += w * (re * sin + im * cos);
                }
                over_a += m.drive * (slope * node.weight * t * along);
                // dt = weight T and t = s T depend on the duration explicitly.
                adj.duration += slope * node.weight * m.drive.dot(&a) * (along - t * node.s * turning);
            }
            for (out, m) in [(&mut adj.q, &partials.q), (&mut adj.qd, &partials.qd), (&mut adj.qdd, &partials.qdd)] {
                for (o, column) in out.iter_mut().zip(m.column_iter()) {
                    *o += column.dot(&over_a);
                }
            }
        });
        self.emphasis * chi.ln_1p()
    }
}
