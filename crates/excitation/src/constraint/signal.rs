//! From a quantity over time to rows: one per channel and sample, with the chain rule to the variables of a plan.
//!
//! Samples are equally spaced over the trajectory. What a sample depends on is chained through the *drives* of the
//! signal, functions of `(q, qd, qdd)` at one sample: with `q = N P`, `qd = N' P / T`, `qdd = N'' P / T^2`, a derivative
//! `a`, `b`, `c` with respect to these becomes `a N + b N'/T + c N''/T^2` over the control points and `-(b . qd + 2 c .
//! qdd) / T` over the duration.

use super::{Channel, Constraint, Snapshot, Wanted};
use crate::plan::spline::SplinePlan;
use nalgebra::DMatrix;

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
    /// Adds to `over_u` (`drives x N`, zero) the derivatives of channel `channel` at sample `i`, and returns that
    /// with respect to `dt`. `work` is as the last [`respond`](Signal::respond), to the same drives, left it.
    fn adjoint(
        &self,
        _work: &Self::Work,
        _u: &DMatrix<f64>,
        channel: usize,
        i: usize,
        over_u: &mut DMatrix<f64>,
    ) -> f64 {
        over_u[(channel, i)] = 1.0;
        0.0
    }
    /// True when channels depend on drives at earlier samples.
    fn reaches_back(&self) -> bool {
        false
    }
    /// The value of every channel in one instant of the full simulation.
    fn measure(&self, at: &Snapshot<'_>, out: &mut [f64]);
}

/// Basis functions of one sample.
struct Node {
    first: usize,
    basis: [[f64; ff_dynamics::motion::bspline::LOCAL]; 3],
}

impl<S: Signal> Constraint for S {
    fn channels(&self) -> &[Channel] {
        Signal::channels(self)
    }
    fn samples(&self, plan: &SplinePlan) -> usize {
        let spans = plan.unit_knots().count() - plan.unit_knots().degree();
        let by_rate = (self.rate() * plan.longest()).ceil().clamp(0.0, 20_000.0) as usize;
        by_rate.max(PER_SPAN * spans) + 1
    }
    fn evaluate(&self, plan: &SplinePlan, x: &[f64], rows: &mut [f64], jacobian: Option<Wanted<'_>>) {
        let (n, t) = (plan.dof(), plan.duration(x));
        let count = self.samples(plan);
        let channels = Signal::channels(self);
        assert_eq!(rows.len(), channels.len() * count, "rows of the constraint");
        let wanted = |i: usize| {
            let pick = |w: &Wanted<'_>| (0..channels.len()).any(|c| w.rows[c * count + i]);
            jacobian.as_ref().is_some_and(|w| self.reaches_back() || pick(w))
        };
        let control = plan.control(x);
        let (p, dt) = (plan.unit_knots().degree(), t / (count - 1) as f64);
        let mut work = self.work();
        let mut u = DMatrix::zeros(self.drives(), count);
        let (mut nodes, mut states) = (Vec::with_capacity(count), Vec::with_capacity(count));
        let mut partials: Vec<Option<DMatrix<f64>>> = Vec::with_capacity(count);
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
            let drives = self.drives();
            let column = &mut u.as_mut_slice()[i * drives..(i + 1) * drives];
            let mut d = wanted(i).then(|| DMatrix::zeros(drives, 3 * n));
            self.drive(&mut work, parts, column, d.as_mut());
            // One drive after the other in memory, as they are needed below.
            partials.push(d.map(|d| d.transpose()));
            nodes.push(Node { first, basis });
            states.push(s);
        }
        let mut y = DMatrix::zeros(channels.len(), count);
        self.respond(&mut work, dt, &u, &mut y);
        for (c, channel) in channels.iter().enumerate() {
            for i in 0..count {
                rows[c * count + i] = channel.excess(y[(c, i)]) / channel.scale;
            }
        }
        let Some(Wanted { rows: wanted, jacobian }) = jacobian else { return };
        assert_eq!(jacobian.shape(), (rows.len(), plan.variables()), "Jacobian of the constraint");
        let mut over_u = DMatrix::zeros(self.drives(), count);
        let mut over_control = DMatrix::zeros(plan.unit_knots().count(), n);
        let mut gradient = vec![0.0; plan.variables()];
        let mut sum = vec![0.0; 3 * n];
        for (row, _) in wanted.iter().enumerate().filter(|(_, w)| **w) {
            let (c, at) = (row / count, row % count);
            let reach = if self.reaches_back() { 0..at + 1 } else { at..at + 1 };
            over_u.fill(0.0);
            over_control.fill(0.0);
            let mut over_duration = self.adjoint(&work, &u, c, at, &mut over_u) / (count - 1) as f64;
            for i in reach {
                let Some(partials) = &partials[i] else { continue };
                sum.fill(0.0);
                for (l, partials) in over_u.column(i).iter().zip(partials.as_slice().chunks_exact(3 * n)) {
                    if *l != 0.0 {
                        sum.iter_mut().zip(partials).for_each(|(s, p)| *s += l * p);
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
                        // Points along columns: `over_control` is transposed.
                        over_control[(first + k, j)] += a * basis[0][k] + b * basis[1][k] + c * basis[2][k];
                    }
                }
            }
            gradient.fill(0.0);
            plan.pull_back(&over_control.transpose(), &mut gradient);
            if let Some(i) = plan.duration_index() {
                gradient[i] = over_duration;
            }
            // An excess falls where the value rises if the limit is a lower one.
            let slope = (channels[c].excess(1.0) - channels[c].excess(0.0)) / channels[c].scale;
            jacobian.row_mut(row).iter_mut().zip(&gradient).for_each(|(o, g)| *o = slope * g);
        }
    }
    fn measure(&self, at: &Snapshot<'_>, out: &mut [f64]) {
        Signal::measure(self, at, out);
    }
}
