//! Joint limits and bounds of the duration, linearised at an iterate.

use crate::plan::spline::Duration;
use crate::solve::problem::Problem;
use crate::solve::qp::Inequality;

/// Distance (relative to the limit) that steps keep from limits, so that solver tolerance cannot break them.
const INSIDE: f64 = 1e-8;

/// Joint and order of derivative that a limit belongs to.
pub(crate) type JointOrder = (usize, i32);

/// Limits linearised at one iterate, over scaled steps, relative to the limits.
pub(crate) struct JointLimitRows {
    /// One inequality per limit.
    pub(crate) rows: Vec<Inequality>,
    /// True room left in each row.
    rooms: Vec<f64>,
    /// Joint and order of derivative of each row; `None` for the duration.
    pub(crate) names: Vec<Option<JointOrder>>,
}

impl JointLimitRows {
    /// Linearises the limits of `problem` at `x`; `scale` is the natural size of each variable. Allocates.
    pub(crate) fn new(problem: &Problem<'_>, x: &[f64], scale: &[f64]) -> Self {
        let plan = problem.plan;
        let t = plan.duration(x);
        let index = plan.duration_index();
        let (mut rows, mut rooms, mut names) = (Vec::new(), Vec::new(), Vec::new());
        let mut push = |columns, slack: f64, name| {
            // At or inside the safety distance the step may only lead away.
            let bound = (slack - INSIDE).max(0.0);
            rows.push(Inequality { columns, bound });
            // Half of the safety distance may be used up.
            rooms.push(bound + (slack - bound).clamp(0.0, 0.5 * INSIDE));
            names.push(name);
        };
        for r in plan.rows.iter().filter(|r| !problem.is_freed(r.joint, r.power)) {
            let s = r.scale * t.powi(r.power);
            let mut columns: Vec<_> = r.columns.iter().map(|(c, v)| (*c, v * scale[*c] / s)).collect();
            if let Some(i) = index.filter(|_| r.power > 0) {
                columns.push((i, -r.limit * f64::from(r.power) * t.powi(r.power - 1) * scale[i] / s));
            }
            push(columns, r.slack(x, t), Some((r.joint, r.power)));
        }
        if let (Some(i), Duration::Free { min, max }) = (index, plan.spec().duration) {
            push(vec![(i, scale[i] / max)], (max - t) / max, None);
            push(vec![(i, -scale[i] / min)], (t - min) / min, None);
        }
        Self { rows, rooms, names }
    }
    /// The part of step `d`, at most all, that keeps every row: solver tolerance may overshoot slightly.
    pub(crate) fn longest_step(&self, d: &[f64]) -> f64 {
        self.rows.iter().zip(&self.rooms).fold(1.0, |alpha: f64, (r, room)| {
            let growth: f64 = r.columns.iter().map(|(c, v)| v * d[*c]).sum();
            if growth > *room { alpha.min(room / growth) } else { alpha }
        })
    }
}
