//! Instants at which the acceleration of a joint jumps or bends, and motions that have some.
//!
//! A trapezoidal speed has jumps of the acceleration, a limited jerk has kinks of it. A spline of degree 7 has neither, and bends the motion
//! around each by as far as its knots are wide. Of a spline that has a kink of order `m` at time `T` the part that the knots lack is
//!
//! ```text
//! x(t) = (t - T)_+^m / m! - sum_(i >= i0) P_i N_i(t)
//! ```
//!
//! with the polar form of that polynomial at the knots for `P_i` (L. Ramshaw, *Comput. Aided Geom. Des.* 6, 1989, 323), so that the sum is
//! the polynomial itself from a few knots behind `T` on: `x` ends there, whatever the length of the record. Added to the basis, it is a column
//! like any other.

use ff_dynamics::motion::JointMotion;
use ff_dynamics::motion::bspline::{BSplineError, BSplineMotion, Knots, MAX_DEGREE};
use nalgebra::DMatrix;

/// Where a derivative of a joint's position jumps. One time has several of them where more derivatives than one jump there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kink {
    /// Index of the joint.
    pub joint: usize,
    /// When (s).
    pub time: f64,
    /// Which derivative: 2 for the acceleration, 3 for the jerk, up to 5.
    pub order: usize,
}

impl Kink {
    /// The kink that this one changes by with its time, but for sign and size.
    pub(super) fn by_time(&self) -> Self {
        Self { order: self.order - 1, ..*self }
    }
    /// Whether lower derivatives jump at its time too, of these kinks: they then say when that is.
    fn is_above_another(&self, kinks: &[Self]) -> bool {
        kinks.iter().any(|k| k.joint == self.joint && k.time == self.time && k.order < self.order)
    }
}

/// Which of a joint's kinks tell the times, the lowest at each, and all kinks with what those change by with their times behind them. Allocates.
pub(super) fn with_times(own: &[Kink]) -> (Vec<usize>, Vec<Kink>) {
    let lowest: Vec<usize> = (0..own.len()).filter(|&i| !own[i].is_above_another(own)).collect();
    let by_time = lowest.iter().map(|&i| own[i].by_time());
    let both = own.iter().copied().chain(by_time).collect();
    (lowest, both)
}

/// What a kink adds to a spline: see the page above.
#[derive(Clone, Debug)]
pub(crate) struct Column {
    pub(crate) kink: Kink,
    /// First basis function behind the kink.
    first: usize,
    /// Coefficients of the polynomial on it and on those behind it that are mixed with others.
    polar: [f64; MAX_DEGREE],
    /// Where it is not zero (s).
    from: f64,
    to: f64,
}

const FACTORIAL: [f64; 6] = [1.0, 1.0, 2.0, 6.0, 24.0, 120.0];

impl Column {
    /// On these knots; the order of the kink is one to five, and below the degree.
    pub(crate) fn new(knots: &Knots, kink: Kink) -> Self {
        let (t, d, m) = (knots.knots(), knots.degree(), kink.order);
        let middle = |i: usize| t[i + 1..=i + d].iter().sum::<f64>() / d as f64;
        let first = (0..knots.count()).collect::<Vec<_>>().partition_point(|&i| middle(i) <= kink.time);
        let choices = (0..m).fold(1.0, |c, k| c * (d - k) as f64 / (k + 1) as f64);
        let mut polar = [0.0; MAX_DEGREE];
        for (k, p) in polar.iter_mut().enumerate().take(d) {
            if first + k < knots.count() {
                // Elementary symmetric polynomial of degree m.
                let mut e = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
                for u in &t[first + k + 1..=first + k + d] {
                    (1..=m).rev().for_each(|r| e[r] += e[r - 1] * (u - kink.time));
                }
                *p = e[m] / (choices * FACTORIAL[m]);
            }
        }
        let end = knots.duration();
        let from = t.get(first).map_or(end, |t| t.min(kink.time));
        let to = t.get(first + d).map_or(end, |t| t.max(kink.time));
        Self { kink, first, polar, from, to }
    }
    /// Whether it may be other than zero at time `t`.
    pub(crate) fn covers(&self, t: f64) -> bool {
        self.from <= t && t <= self.to
    }
    /// Where it is not zero (s).
    pub(crate) fn support(&self) -> (f64, f64) {
        (self.from, self.to)
    }
    /// Its derivative of order `r` at a time `t` that it covers, from that of the basis functions there, the first of which is number `first`. A jump
    /// of the derivative is a ramp `width` long, whose derivative is a pulse: where that is the time between samples, steps of the Runge-Kutta method
    /// of which a whole number makes a sample see its integral to the last bit.
    pub(crate) fn at(&self, t: f64, r: usize, (first, basis): (usize, &[f64]), width: f64) -> f64 {
        let (u, m) = (t - self.kink.time, self.kink.order);
        let power = match m.cmp(&r) {
            // Of a jump that is a ramp.
            core::cmp::Ordering::Less if m + 1 == r && width > 0.0 && -0.5 * width <= u && u < 0.5 * width => {
                width.recip()
            }
            core::cmp::Ordering::Less => 0.0,
            core::cmp::Ordering::Equal if width > 0.0 => (u / width + 0.5).clamp(0.0, 1.0),
            core::cmp::Ordering::Equal => f64::from(u > 0.0),
            core::cmp::Ordering::Greater if u > 0.0 => u.powi((m - r) as i32) / FACTORIAL[m - r],
            core::cmp::Ordering::Greater => 0.0,
        };
        let of_spline = basis.iter().enumerate().filter(|(k, _)| first + k >= self.first);
        power - of_spline.map(|(k, n)| n * self.polar.get(first + k - self.first).copied().unwrap_or(0.0)).sum::<f64>()
    }
}

/// A spline, and its kinks.
#[derive(Clone, Debug)]
pub struct FittedMotion {
    spline: BSplineMotion,
    /// Ascending in time where they begin.
    kinks: Vec<(Column, f64)>,
    /// The longest that one of them lasts (s).
    longest: f64,
    /// Of the ramp that stands for a jump (s).
    ramp: f64,
}

impl FittedMotion {
    /// A spline, with kinks and the size of each: what its derivative jumps by, over `ramp` (s). Allocates.
    ///
    /// # Errors
    /// [`BSplineError`] where the control points do not fit the knots.
    pub(crate) fn new(
        knots: Knots,
        control: DMatrix<f64>,
        mut kinks: Vec<(Column, f64)>,
        ramp: f64,
    ) -> Result<Self, BSplineError> {
        kinks.sort_by(|a, b| a.0.from.total_cmp(&b.0.from));
        let longest = kinks.iter().map(|k| k.0.to - k.0.from).fold(0.0, f64::max);
        Ok(Self { spline: BSplineMotion::new(knots, control)?, kinks, longest, ramp })
    }
    /// The spline without its kinks.
    pub fn spline(&self) -> &BSplineMotion {
        &self.spline
    }
    /// How long the ramp is that stands for a jump (s).
    pub(super) fn ramp(&self) -> f64 {
        self.ramp
    }
    /// The kinks, and by how much the derivative jumps at each (`rad/s^order` or `m/s^order`).
    pub fn kinks(&self) -> impl Iterator<Item = (Kink, f64)> {
        self.kinks.iter().map(|(c, size)| (c.kink, *size))
    }
    /// Derivative of order 0, 1 or 2 of all joints at time `t` (s), clamped to `[0, duration]`; `out` is `n` long, units `rad/s^order`. A jump
    /// of the acceleration is a ramp as long as the interval between samples. Does not allocate.
    ///
    /// # Panics
    /// If `out` is shorter than `n`.
    pub fn derivative(&self, t: f64, order: usize, out: &mut [f64]) {
        self.spline.derivative(t, order, out);
        if self.kinks.is_empty() {
            return;
        }
        let t = t.clamp(0.0, self.spline.knots().duration());
        let basis = self.spline.knots().derivative_at(t, order);
        self.add(t, order, (basis.first, basis.as_slice()), out);
    }
    /// Accelerations of all joints at these ascending times (instants x joints) without what changes at the kinks: each is taken off as the power of time that
    /// it is from its instant on, and all kinks that were missed are left. Allocates.
    pub(super) fn besides_kinks(&self, times: &[f64], accelerations: &[f64]) -> Vec<f64> {
        let n = self.spline.dof();
        let mut kinks: Vec<(Kink, f64)> = self.kinks().filter(|k| k.0.order >= 2).collect();
        kinks.sort_by(|a, b| a.0.time.total_cmp(&b.0.time));
        let mut begun = 0;
        let mut powers = vec![Powers::default(); n];
        let mut out = accelerations.to_vec();
        for (&t, a) in times.iter().zip(out.chunks_exact_mut(n)) {
            while let Some((k, size)) = kinks.get(begun).filter(|k| k.0.time + 0.5 * self.ramp <= t) {
                powers[k.joint].add(k, *size);
                begun += 1;
            }
            a.iter_mut().zip(&powers).for_each(|(a, p)| *a -= p.at(t));
            // Kinks that a sample is next to.
            for (k, size) in kinks[begun..].iter().take_while(|k| k.0.time - 0.5 * self.ramp < t) {
                let (u, above) = (t - k.time, k.order - 2);
                let power = u.max(0.0).powi(above as i32) / FACTORIAL[above];
                a[k.joint] -= size * if above == 0 { u / self.ramp + 0.5 } else { power };
            }
        }
        out
    }
    fn add(&self, t: f64, order: usize, basis: (usize, &[f64]), out: &mut [f64]) {
        let begin = self.kinks.partition_point(|k| k.0.from < t - self.longest);
        for (c, size) in self.kinks[begin..].iter().take_while(|k| k.0.from <= t).filter(|k| k.0.covers(t)) {
            out[c.kink.joint] += size * c.at(t, order, basis, self.ramp);
        }
    }
}

/// What kinks add to an acceleration behind them: a polynomial of the time from the last of them on, by which no digits are lost in long records.
#[derive(Clone, Copy, Default)]
struct Powers {
    from: f64,
    of: [f64; 4],
}

impl Powers {
    fn add(&mut self, kink: &Kink, size: f64) {
        let by = kink.time - self.from;
        // Taylor's shift.
        for first in 0..self.of.len() {
            (first..self.of.len() - 1).rev().for_each(|i| self.of[i] += by * self.of[i + 1]);
        }
        self.from = kink.time;
        self.of[kink.order - 2] += size / FACTORIAL[kink.order - 2];
    }
    fn at(&self, t: f64) -> f64 {
        self.of.iter().rev().fold(0.0, |sum, c| sum * (t - self.from) + c)
    }
}

impl JointMotion for FittedMotion {
    fn dof(&self) -> usize {
        self.spline.dof()
    }
    fn duration(&self) -> f64 {
        self.spline.duration()
    }
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        self.spline.eval(t, q, qd, qdd);
        let end = self.duration();
        let inside = (0.0..=end).contains(&t);
        if self.kinks.is_empty() {
            return;
        }
        let t = t.clamp(0.0, end);
        let (first, rows) = self.spline.knots().local::<3>(t);
        let local = self.spline.knots().degree() + 1;
        let each: [&mut [f64]; 3] = [q, qd, qdd];
        for (order, out) in each.into_iter().enumerate().filter(|(order, _)| inside || *order == 0) {
            self.add(t, order, (first, &rows[order][..local]), out);
        }
    }
    /// The knots and the kinks.
    fn breaks(&self) -> Vec<f64> {
        let mut all = self.spline.breaks();
        let end = self.duration();
        all.extend(self.kinks.iter().map(|k| k.0.kink.time).filter(|t| (0.0..end).contains(t)));
        all.sort_by(f64::total_cmp);
        all.dedup();
        all
    }
}

/// Change of the torques, in deviations of their sensors, from which it matters on which side of a kink a reading is.
const MATTERS: f64 = 0.5;
/// Intervals between samples about a jump within which that is not told.
const ABOUT: f64 = 0.75;
/// Intervals within which kinks of a joint are not told apart: two jumps look like the ramp between them.
const CLOSE: f64 = 10.0;

/// Stretches of time (s) near kinks where the acceleration is not told: about a jump, and from one kink to another of the same joint that is
/// close by, unless the motion is `planned`: positions then tell both. `weights` are the torques that a unit acceleration of each joint takes, in
/// deviations of their sensors; `dt` is the time between samples (s). Allocates.
pub(super) fn untold(motion: &FittedMotion, planned: bool, weights: &[f64], dt: f64) -> Vec<(f64, f64)> {
    let mut out = Vec::new();
    let close = if planned { 0.0 } else { CLOSE * dt };
    for (j, weight) in weights.iter().enumerate() {
        let own = motion.kinks().filter(|k| k.0.joint == j && (k.0.order == 2 || !planned));
        let mut own: Vec<(Kink, f64)> = own.collect();
        own.sort_by(|a, b| a.0.time.total_cmp(&b.0.time));
        for group in own.chunk_by(|a, b| b.0.time - a.0.time < close) {
            let (first, last) = (group[0].0.time, group[group.len() - 1].0.time);
            // What the acceleration changes by while a kink of its rate lasts.
            let of = |(k, size): &(Kink, f64)| if k.order == 2 { size.abs() } else { size.abs() * (last - first) };
            if weight * group.iter().map(of).fold(0.0, f64::max) > MATTERS {
                out.push((first - ABOUT * dt, last + ABOUT * dt));
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use ff_testkit::scaled;

    #[test]
    fn a_column_is_its_polynomial_less_a_spline_and_ends() {
        let knots = Knots::uniform(7, 30, 4.7).unwrap();
        for (time, order) in [(2.17, 2), (2.31, 3), (0.07, 2), (4.55, 3), (1.3, 1)] {
            let c = Column::new(&knots, Kink { joint: 0, time, order });
            let h = 4.7 / 23.0;
            let (from, to) = c.support();
            assert!(from >= time - 5.0 * h && to <= time + 5.0 * h && from < time && to > time, "{from} {to} {time}");
            // Nothing is left at its ends, of a polynomial that goes on.
            for t in [from, to] {
                let (first, [b, d, a]) = knots.local::<3>(t);
                let at = |r: usize, b: &[f64]| c.at(t, r, (first, b), 0.0);
                let left = [at(0, &b), at(1, &d), at(2, &a)];
                let inside = t > 0.0 && t < 4.7 && (t - time).abs() > 1e-9;
                assert!(!inside || left.iter().all(|x| x.abs() < 1e-9), "{t} {left:?}");
            }
            for i in 0..400 {
                let t = 4.7 * (f64::from(i) + 0.37) / 400.0;
                let (first, [b, d, a]) = knots.local::<3>(t);
                let at = |r: usize, b: &[f64]| c.at(t, r, (first, b), 0.0);
                let [_, v, w] = [at(0, &b), at(1, &d), at(2, &a)];
                if !c.covers(t) {
                    continue;
                }
                // Its derivatives are those of differences.
                let e = 1e-5;
                let beside = |t: f64| {
                    let (first, [b, d]) = knots.local::<2>(t);
                    [c.at(t, 0, (first, &b), 0.0), c.at(t, 1, (first, &d), 0.0)]
                };
                if (t - time).abs() > 2.0 * e {
                    let (low, high) = (beside(t - e), beside(t + e));
                    assert_relative_eq!((high[0] - low[0]) / (2.0 * e), v, epsilon = scaled(1e-8));
                    assert_relative_eq!((high[1] - low[1]) / (2.0 * e), w, epsilon = scaled(2e-6));
                }
            }
        }
    }

    #[test]
    fn a_jump_is_a_ramp_between_two_samples() {
        let knots = Knots::uniform(7, 8, 3.1).unwrap();
        let kink = Kink { joint: 1, time: 1.437, order: 2 };
        let column = Column::new(&knots, kink);
        let m = FittedMotion::new(knots, DMatrix::zeros(2, 8), vec![(column, 0.83)], 0.02).unwrap();
        let acceleration = |t: f64| {
            let mut a = [0.0; 2];
            m.derivative(t, 2, &mut a);
            let (mut q, mut v, mut same) = ([0.0; 2], [0.0; 2], [0.0; 2]);
            m.eval(t, &mut q, &mut v, &mut same);
            assert_eq!(a, same);
            assert_eq!((a[0], q[0], v[0]), (0.0, 0.0, 0.0));
            a[1]
        };
        assert_relative_eq!(acceleration(1.4471) - acceleration(1.4269), 0.83, epsilon = scaled(0.02));
        assert_relative_eq!(acceleration(1.437 + 1e-9) - acceleration(1.437 - 1e-9), 0.0, epsilon = 1e-6);
        assert!(m.breaks().contains(&1.437));
    }
}
