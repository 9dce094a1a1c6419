//! From a quantity over time to rows: samples, windows, and a smooth maximum from above.
//!
//! Samples are equally spaced over the trajectory. In every window (one per knot span) the relative excesses
//! `e_i` are aggregated by the function of Kreisselmeier and Steinhauser (1979),
//!
//! ```text
//! g = max_i e_i + (1/rho) ln sum_i exp(rho (e_i - max e)),    max e <= g <= max e + ln(N) / rho,
//! ```
//!
//! so that `g <= 0` holds all samples of the window below the limit, at the price of at most `ln(N) / rho` of it.
//! The derivative weighs the samples by `exp(rho (e_i - g))`; what a sample depends on is chained through the
//! *drives* of the signal, functions of `(q, qd, qdd)` at one sample.

use super::{Channel, Constraint, Sense, Snapshot};
use crate::spline_plan::SplinePlan;
use nalgebra::DMatrix;
use std::ops::Range;

/// `rho`: with 40 samples in a window the aggregate is at most 1 % above the maximum.
const SHARPNESS: f64 = 400.0;
/// Fewest samples in a knot span, over which a quintic acceleration turns at most three times.
pub(crate) const PER_SPAN: usize = 12;

/// A quantity over time; [`Constraint`] follows from it.
///
/// Most quantities are functions of the instant: drive `k` is channel `k`. A history (attitude, deflection) has
/// drives of its own, from which [`respond`](Signal::respond) makes the channels.
pub trait Signal: Send + Sync {
    /// Buffers of one evaluation.
    type Work;
    /// What is limited.
    fn channels(&self) -> &[Channel];
    /// Fewest samples per second that resolve the quantity (Hz), 0 if the knot spans decide.
    fn rate(&self) -> f64 {
        0.0
    }
    /// Number of drives.
    fn drives(&self) -> usize {
        self.channels().len()
    }
    /// Makes the buffers.
    fn work(&self) -> Self::Work;
    /// Drives of one sample `(q, qd, qdd)`, and with `partials` (`drives x 3 n`: positions, rates,
    /// accelerations) their derivatives.
    fn drive(&self, work: &mut Self::Work, s: [&[f64]; 3], u: &mut [f64], partials: Option<&mut DMatrix<f64>>);
    /// Channels (`channels x N`) from drives (`drives x N`), samples `dt` apart.
    fn respond(&self, _work: &mut Self::Work, _dt: f64, u: &DMatrix<f64>, y: &mut DMatrix<f64>) {
        y.copy_from(u);
    }
    /// Adds to `over_u` (`drives x N`, zero) the derivatives of `sum_i weights_i y_(channel,i)`, `i` from
    /// `window.start` on, and returns that with respect to `dt`. `work` is as the last [`respond`](Signal::respond),
    /// to the same drives, left it.
    fn adjoint(
        &self,
        _work: &Self::Work,
        _u: &DMatrix<f64>,
        channel: usize,
        window: Range<usize>,
        weights: &[f64],
        over_u: &mut DMatrix<f64>,
    ) -> f64 {
        for (i, w) in window.zip(weights) {
            over_u[(channel, i)] = *w;
        }
        0.0
    }
    /// True when channels depend on drives at earlier samples.
    fn reaches_back(&self) -> bool {
        false
    }
    /// The value of every channel in one instant of the full simulation.
    fn measure(&self, at: &Snapshot<'_>, out: &mut [f64]);
}

fn spans(plan: &SplinePlan) -> usize {
    plan.unit_knots().count() - plan.unit_knots().degree()
}

/// Samples of a window; neighbours share the sample between them.
fn window(w: usize, windows: usize, samples: usize) -> Range<usize> {
    let edge = |k: usize| k * (samples - 1) / windows;
    edge(w)..edge(w + 1) + 1
}

/// Basis functions of one sample.
struct Node {
    first: usize,
    basis: [[f64; ff_dynamics::bspline::LOCAL]; 3],
}

impl<S: Signal> Constraint for S {
    fn channels(&self) -> &[Channel] {
        Signal::channels(self)
    }
    fn windows(&self, plan: &SplinePlan) -> usize {
        spans(plan)
    }
    fn samples(&self, plan: &SplinePlan) -> usize {
        let longest = plan.longest();
        let by_rate = (self.rate() * longest).ceil().clamp(0.0, 20_000.0) as usize;
        by_rate.max(PER_SPAN * spans(plan)) + 1
    }
    fn evaluate(&self, plan: &SplinePlan, x: &[f64], rows: &mut [f64], jacobian: Option<&mut DMatrix<f64>>) {
        let (n, t) = (plan.dof(), plan.duration(x));
        let (count, windows) = (self.samples(plan), self.windows(plan));
        let channels = Signal::channels(self);
        assert_eq!(rows.len(), channels.len() * windows, "rows of the constraint");
        let control = plan.control(x);
        let (p, dt) = (plan.unit_knots().degree(), t / (count - 1) as f64);
        let mut work = self.work();
        let mut u = DMatrix::zeros(self.drives(), count);
        let (mut nodes, mut states) = (Vec::with_capacity(count), Vec::with_capacity(count));
        let mut partials = Vec::with_capacity(if jacobian.is_some() { count } else { 0 });
        for i in 0..count {
            let (first, basis) = plan.unit_knots().local::<3>(i as f64 / (count - 1) as f64);
            let mut s = vec![0.0; 3 * n];
            for j in 0..n {
                // Relative to one point, so that a joint at rest has rates of exactly zero.
                let origin = control[(j, first)];
                for k in 0..=p {
                    let c = control[(j, first + k)] - origin;
                    s[j] += basis[0][k] * c;
                    s[n + j] += basis[1][k] * c / t;
                    s[2 * n + j] += basis[2][k] * c / (t * t);
                }
                s[j] += origin;
            }
            let parts = [&s[..n], &s[n..2 * n], &s[2 * n..]];
            let column = &mut u.as_mut_slice()[i * self.drives()..(i + 1) * self.drives()];
            if jacobian.is_some() {
                let mut d = DMatrix::zeros(self.drives(), 3 * n);
                self.drive(&mut work, parts, column, Some(&mut d));
                partials.push(d);
            } else {
                self.drive(&mut work, parts, column, None);
            }
            nodes.push(Node { first, basis });
            states.push(s);
        }
        let mut y = DMatrix::zeros(channels.len(), count);
        self.respond(&mut work, dt, &u, &mut y);
        let mut weights = vec![Vec::new(); rows.len()];
        for (c, channel) in channels.iter().enumerate() {
            for w in 0..windows {
                let excess: Vec<f64> =
                    window(w, windows, count).map(|i| channel.excess(y[(c, i)]) / channel.scale).collect();
                let row = c * windows + w;
                (rows[row], weights[row]) = aggregate(&excess);
                let sign = if channel.sense == Sense::AtMost { 1.0 } else { -1.0 } / channel.scale;
                weights[row].iter_mut().for_each(|v| *v *= sign);
            }
        }
        let Some(jacobian) = jacobian else { return };
        assert_eq!(jacobian.shape(), (rows.len(), plan.variables()), "Jacobian of the constraint");
        jacobian.fill(0.0);
        let mut over_u = DMatrix::zeros(self.drives(), count);
        let mut over_control = DMatrix::zeros(n, plan.unit_knots().count());
        let mut gradient = vec![0.0; plan.variables()];
        let mut sum = vec![0.0; 3 * n];
        for (row, weights) in weights.iter().enumerate() {
            let (c, here) = (row / windows, window(row % windows, windows, count));
            let reach = if self.reaches_back() { 0..here.end } else { here.clone() };
            over_u.fill(0.0);
            over_control.fill(0.0);
            let over_dt = self.adjoint(&work, &u, c, here, weights, &mut over_u);
            let mut over_duration = over_dt / (count - 1) as f64;
            for i in reach {
                sum.fill(0.0);
                for d in 0..self.drives() {
                    let l = over_u[(d, i)];
                    if l != 0.0 {
                        (0..3 * n).for_each(|k| sum[k] += l * partials[i][(d, k)]);
                    }
                }
                let Node { first, basis } = &nodes[i];
                for j in 0..n {
                    let (a, b, c) = (sum[j], sum[n + j], sum[2 * n + j]);
                    if a == 0.0 && b == 0.0 && c == 0.0 {
                        continue;
                    }
                    over_duration -= (b * states[i][n + j] + 2.0 * c * states[i][2 * n + j]) / t;
                    let (b, c) = (b / t, c / (t * t));
                    for k in 0..=p {
                        over_control[(j, first + k)] += a * basis[0][k] + b * basis[1][k] + c * basis[2][k];
                    }
                }
            }
            gradient.fill(0.0);
            plan.pull_back(&over_control, &mut gradient);
            if let Some(i) = plan.duration_index() {
                gradient[i] = over_duration;
            }
            jacobian.row_mut(row).iter_mut().zip(&gradient).for_each(|(o, g)| *o = *g);
        }
    }
    fn measure(&self, at: &Snapshot<'_>, out: &mut [f64]) {
        Signal::measure(self, at, out);
    }
}

/// The smooth maximum and its derivatives, which sum to one.
fn aggregate(e: &[f64]) -> (f64, Vec<f64>) {
    let most = e.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !most.is_finite() || e.iter().any(|x| x.is_nan()) {
        return (f64::NAN, vec![f64::NAN; e.len()]);
    }
    let mut weights: Vec<f64> = e.iter().map(|x| (SHARPNESS * (x - most)).exp()).collect();
    let sum: f64 = weights.iter().sum();
    // Below 1e-12 of the whole a sample does not count.
    weights.iter_mut().for_each(|w| *w = if *w < 1e-12 * sum { 0.0 } else { *w / sum });
    (most + sum.ln() / SHARPNESS, weights)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_aggregate_is_never_below_the_maximum() {
        let e = [-0.3, 0.012, 0.011, 0.0123, -0.02];
        let (g, w) = aggregate(&e);
        assert!(g >= 0.0123 && g <= 0.0123 + 5f64.ln() / SHARPNESS);
        assert!((w.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(aggregate(&[0.1, f64::NAN]).0.is_nan());
    }

    #[test]
    fn windows_cover_every_sample() {
        for (windows, samples) in [(11, 133), (7, 100), (9, 109)] {
            let mut next = 0;
            for w in 0..windows {
                let r = window(w, windows, samples);
                assert_eq!(r.start, next);
                next = r.end - 1;
            }
            assert_eq!(next, samples - 1);
        }
    }
}
