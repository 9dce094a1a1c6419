//! Spectrum of the joint acceleration: keep out of a band, or hit a mode.
//!
//! `A_i(w) = int_0^T qdd_i(t) exp(-i w t) dt`, linear in the control points, by Gauss-Legendre quadrature on
//! the knot spans (exact to rounding, because the parts are short against the period).

use super::{Cost, Form, Node, Sweep, gauss_nodes};
use crate::plan::spline::SplinePlan;
use std::f64::consts::{PI, TAU};

/// Phase (rad) that one quadrature part may span; eight Gauss points integrate it to rounding.
const PHASE_PER_PART: f64 = 3.0;

/// `A_i(w)` for all joints and frequencies, as `[frequency][joint] = (re, im)`.
struct Transform<'a> {
    sweep: Sweep<'a>,
    nodes: Vec<Node>,
    omegas: Vec<f64>,
    a: Vec<Vec<(f64, f64)>>,
}

impl<'a> Transform<'a> {
    fn new(plan: &'a SplinePlan, x: &[f64], omegas: Vec<f64>) -> Self {
        let mut sweep = Sweep::new(plan, x);
        let t = sweep.duration;
        let spans = (plan.unit_knots().count() - plan.unit_knots().degree()) as f64;
        let fastest = omegas.iter().copied().fold(0.0, f64::max);
        // A senseless duration (NaN, huge) must not ask for endless memory.
        let parts = (fastest * t / (spans * PHASE_PER_PART)).ceil().clamp(1.0, 1000.0) as usize;
        let nodes = gauss_nodes(plan, parts);
        let mut a = vec![vec![(0.0, 0.0); plan.dof()]; omegas.len()];
        sweep.forward(&nodes, |node, s| {
            for (w, row) in omegas.iter().zip(&mut a) {
                let (sin, cos) = (w * node.s * t).sin_cos();
                for (o, acc) in row.iter_mut().zip(&s.qdd) {
                    let y = node.weight * t * acc;
                    *o = (o.0 + y * cos, o.1 - y * sin);
                }
            }
        });
        Self { sweep, nodes, omegas, a }
    }
    /// Gradient of a cost with `dJ = sum Re(conj(c) dA)`, `c` shaped like `a`.
    fn pull_back(mut self, c: &[Vec<(f64, f64)>], grad: &mut [f64]) {
        let t = self.sweep.duration;
        let omegas = &self.omegas;
        self.sweep.backward(&self.nodes, grad, |node, s, adj| {
            let dt = node.weight * t;
            for (w, row) in omegas.iter().zip(c) {
                let (sin, cos) = (w * node.s * t).sin_cos();
                for ((g, acc), (re, im)) in adj.qdd.iter_mut().zip(&s.qdd).zip(row) {
                    let along = re * cos - im * sin;
                    *g += dt * along;
                    // dt = weight T and t = s T depend on the duration explicitly.
                    adj.duration += node.weight * acc * along - dt * acc * w * node.s * (re * sin + im * cos);
                }
            }
        });
    }
}

/// Energy of the joint accelerations in a frequency band:
/// `J = (1/pi) sum_i weight_i int_band |A_i(w)|^2 dw` (Parseval: over all frequencies this is
/// `sum_i weight_i int qdd_i^2 dt`). A quadratic form in the control points.
///
/// As a penalty it keeps rigid-identification trajectories out of the flexible band (paper, Figs. 5C, 7B).
/// `value_gradient` panics unless there is one weight per joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Quiet {
    /// Lower edge of the band (Hz).
    pub low: f64,
    /// Upper edge of the band (Hz).
    pub high: f64,
    /// Frequencies of the midpoint rule over the band; a spacing below `1/(4 T)` resolves the spectrum.
    pub points: usize,
    /// Weight per joint; dimensionless.
    pub weights: Vec<f64>,
}

impl Cost for Quiet {
    fn value_gradient(&self, plan: &SplinePlan, x: &[f64], grad: &mut [f64]) -> f64 {
        assert_eq!(self.weights.len(), plan.dof(), "one weight per joint");
        let step = (self.high - self.low) / self.points.max(1) as f64;
        let omegas = (0..self.points.max(1)).map(|k| TAU * (self.low + (k as f64 + 0.5) * step)).collect();
        let tr = Transform::new(plan, x, omegas);
        let k = TAU * step / PI;
        let mut value = 0.0;
        let mut c = tr.a.clone();
        for row in &mut c {
            for ((re, im), w) in row.iter_mut().zip(&self.weights) {
                value += k * w * (*re * *re + *im * *im);
                (*re, *im) = (2.0 * k * w * *re, 2.0 * k * w * *im);
            }
        }
        tr.pull_back(&c, grad);
        value
    }
}

/// A mode to be driven.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// Frequency (Hz).
    pub frequency: f64,
    /// Weights `c_i` of the joint accelerations in the force that drives the mode (one per joint).
    pub weights: Vec<f64>,
    /// Importance of this mode; dimensionless.
    pub importance: f64,
}

/// `J = sum_m importance_m F(|G_m|^2)` with `G_m = int (c_m . qdd) exp(-i w_m t) dt`, `F` the inverse or
/// minus the logarithm: what is left of the mode after the motion is proportional to `|G_m|`
/// (`theory.md` 5.7: eq. (10) does not see the target frequency, this does). `value_gradient` panics unless
/// every target has one weight per joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Modal {
    /// Modes to drive.
    pub targets: Vec<Target>,
    /// Inverse or logarithm.
    pub form: Form,
}

impl Cost for Modal {
    fn value_gradient(&self, plan: &SplinePlan, x: &[f64], grad: &mut [f64]) -> f64 {
        let tr = Transform::new(plan, x, self.targets.iter().map(|m| TAU * m.frequency).collect());
        let mut value = 0.0;
        let mut c = tr.a.clone();
        for (m, row) in self.targets.iter().zip(&mut c) {
            assert_eq!(m.weights.len(), row.len(), "one weight per joint");
            let (mut re, mut im) = (0.0, 0.0);
            for (a, w) in row.iter().zip(&m.weights) {
                re += w * a.0;
                im += w * a.1;
            }
            let (v, slope) = self.form.apply(re * re + im * im);
            value += m.importance * v;
            let k = 2.0 * m.importance * slope;
            row.iter_mut().for_each(|o| *o = (0.0, 0.0));
            for (o, w) in row.iter_mut().zip(&m.weights) {
                *o = (k * w * re, k * w * im);
            }
        }
        tr.pull_back(&c, grad);
        value
    }
}
