//! A spline is loose at its ends: how much noise of the positions its accelerations hold there.
//!
//! With the basis `b` and the normal matrix N of a least-squares spline, noise of unit deviation in the positions leaves in the
//! acceleration at time t the variance
//!
//! ```text
//! A(t) = b''(t)^T N^-1 b''(t)
//! ```
//!
//! which at the last sample is hundreds of times that inside. It decays within a few spans, so that the spans next to an end tell it.

use crate::motion::banded::Banded;
use crate::motion::spline_basis::HELD;
use crate::motion::spline_fit::DEGREE;
use ff_dynamics::motion::bspline::Knots;

/// Spans next to an end that decide its variance.
const NEXT: usize = 24;
/// Spans from an end within which it is loose.
const LOOSE: f64 = 3.0;
/// Variance, in that of the torque sensors, below which noise of the motion is left to the tests.
const MINOR: f64 = 0.05;

/// `A` (1/s^4) at those of the times (s from the end of the spline) that are within its loose part; `held`: the rate there is held at zero.
/// `None` where the samples do not determine a spline. Allocates.
pub(super) fn end_variance(times: &[f64], spacing: f64, held: bool) -> Option<Vec<f64>> {
    let last = *times.last()?;
    let spans = ((last / spacing).round() as usize).clamp(1, NEXT);
    let end = spans as f64 * spacing;
    let knots = Knots::uniform(DEGREE, spans + DEGREE, end).ok()?;
    let mut normal = Banded::zeros(knots.count());
    for &t in times.iter().take_while(|t| **t <= end) {
        let (first, [b]) = knots.local::<1>(t);
        normal.add_outer(first, &b[..=DEGREE], 1.0);
    }
    if held {
        let (first, [_, rate]) = knots.local::<2>(0.0);
        normal.hold(first, &rate[..=DEGREE], HELD);
    }
    normal.factor().ok()?;
    let of = |t: f64| {
        let (first, [_, _, second]) = knots.local::<3>(t);
        let mut x = nalgebra::DMatrix::zeros(1, knots.count());
        (0..=DEGREE).for_each(|a| x[(0, first + a)] = second[a]);
        normal.solve(&mut x);
        (0..=DEGREE).map(|a| second[a] * x[(0, first + a)]).sum::<f64>()
    };
    Some(times.iter().take_while(|t| **t <= (LOOSE * spacing).min(end)).map(|t| of(*t)).collect())
}

/// Variance that noise of the motion adds to the torques next to both ends, in that of their sensors, and where kinks leave them open.
#[derive(Clone, Debug, Default)]
pub(crate) struct LooseEnds {
    /// Times (s) and variances, ascending in time.
    ends: [Vec<(f64, f64)>; 2],
    /// Stretches of time (s) near kinks, ascending, where torques are not told.
    untold: Vec<(f64, f64)>,
}

impl LooseEnds {
    /// Of a spline with these knots through positions at these times, whose accelerations of unit variance of position add so much to
    /// the torques (s^4). Allocates.
    pub(super) fn new(times: &[f64], spacing: f64, from_rest: bool, worth: f64) -> Self {
        let Some(&last) = times.last() else { return Self::default() };
        let backwards: Vec<f64> = times.iter().rev().map(|t| last - t).collect();
        let of = |times: &[f64], held: bool| -> Vec<(f64, f64)> {
            let found = end_variance(times, spacing, held).unwrap_or_default();
            times.iter().copied().zip(found.into_iter().map(|a| worth * a)).collect()
        };
        let mut end: Vec<(f64, f64)> = of(&backwards, false).into_iter().map(|(t, v)| (last - t, v)).collect();
        end.reverse();
        Self { ends: [of(times, from_rest), end], ..Self::default() }
    }
    /// With stretches (s) where torques are not told. Allocates.
    pub(super) fn with_untold(self, mut untold: Vec<(f64, f64)>) -> Self {
        untold.sort_by(|a, b| a.0.total_cmp(&b.0));
        untold.dedup_by(|next, kept| {
            let meets = next.0 <= kept.1;
            if meets {
                kept.1 = kept.1.max(next.1);
            }
            meets
        });
        Self { untold, ..self }
    }
    /// Whether torques are not told at time `t` (s).
    pub(crate) fn is_untold(&self, t: f64) -> bool {
        let after = self.untold.partition_point(|u| u.0 <= t);
        after > 0 && t < self.untold[after - 1].1
    }
    /// What a reading at time `t` counts for: one over the root of one and that variance.
    pub(crate) fn weight(&self, t: f64) -> f64 {
        let variance = self.ends.iter().map(|end| within(end, t)).fold(0.0, f64::max);
        if variance > MINOR { (1.0 + variance).sqrt().recip() } else { 1.0 }
    }
}

/// At one of them, or between neighbours the larger of the two; zero outside.
fn within(end: &[(f64, f64)], t: f64) -> f64 {
    let (Some(first), Some(last)) = (end.first(), end.last()) else { return 0.0 };
    if t < first.0 || t > last.0 {
        return 0.0;
    }
    let after = end.partition_point(|e| e.0 < t).min(end.len() - 1);
    let (before, after) = (end[after.saturating_sub(1)], end[after]);
    let at = |e: (f64, f64)| (t - e.0).abs() < 1e-6 * (after.0 - before.0);
    if at(before) {
        before.1
    } else if at(after) {
        after.1
    } else {
        before.1.max(after.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::spline_fit::{JointSamples, fit_motion, fit_motion_from_rest};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn variances_are_those_of_splines_through_noise() {
        let (dt, count, spacing) = (0.02, 601, 0.16);
        let times: Vec<f64> = (0..count).map(|i| dt * f64::from(i)).collect();
        let draws = 300;
        for held in [false, true] {
            let ends = LooseEnds::new(&times, spacing, held, 1.0);
            let mut sums = [0.0; 4];
            let at = [0.0, 0.1, 11.9, 12.0];
            for k in 0..draws {
                let mut rng = ChaCha8Rng::seed_from_u64(k);
                let q: Vec<f64> = times.iter().map(|_| StandardNormal.sample(&mut rng)).collect();
                let s = JointSamples { dof: 1, times: &times, q: &q, qd: None, rate_weight: 0.0 };
                let fit = if held { fit_motion_from_rest(&s, spacing) } else { fit_motion(&s, spacing) };
                let motion = fit.unwrap().motion;
                for (sum, t) in sums.iter_mut().zip(at) {
                    let mut a = [0.0];
                    motion.derivative(t, 2, &mut a);
                    *sum += a[0] * a[0] / draws as f64;
                }
            }
            for (sum, t) in sums.iter().zip(at) {
                let weight = ends.weight(t);
                let variance = weight.powi(-2) - 1.0;
                assert!((sum / variance - 1.0).abs() < 0.35, "{held} {t}: {sum} {variance}");
            }
            assert!(ends.weight(6.0) == 1.0 && ends.weight(12.0) < 0.3 * ends.weight(11.8));
        }
    }
}
