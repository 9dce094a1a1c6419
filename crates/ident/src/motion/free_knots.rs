//! Splines with knots anywhere, of any multiplicity, through some samples.
//!
//! Between knots that are `m`-fold a spline of degree `d` has `d - m` continuous derivatives. Its control points follow from the samples by banded least
//! squares, with de Boor's recurrence for the basis (C. de Boor, *A Practical Guide to Splines*, 1978, ch. X). Where a knot is moved by `dT`, the
//! spline changes to first order by one with that knot `m + 1`-fold: with `J_r` the jump of derivative `r` at it in a fit of those,
//!
//! ```text
//! dT = - J_(r-1) / J_r,      r = d - m + 1: the lowest derivative that jumps
//! ```
//!
//! is its Gauss-Newton step (D. L. B. Jupp, *SIAM J. Numer. Anal.* 15, 1978, 328).

use crate::motion::banded::Banded;
use nalgebra::DMatrix;

/// Degree at most; the least is two.
const MOST: usize = 5;

/// Polynomials of one degree, and how they meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Plan {
    /// Of the polynomials.
    pub(super) degree: usize,
    /// How many derivatives may jump where two meet, the highest ones.
    pub(super) multiplicity: usize,
}

impl Plan {
    /// Lowest derivative that may jump.
    pub(super) fn lowest(self) -> usize {
        self.degree - self.multiplicity + 1
    }
    /// Numbers that a spline takes, with the times of so many knots.
    pub(super) fn parameters(self, knots: usize) -> usize {
        (self.multiplicity + 1) * knots + self.degree + 1
    }
    fn looser(self) -> Self {
        Self { multiplicity: self.multiplicity + 1, ..self }
    }
}

/// A spline, and what it leaves.
pub(super) struct Fit {
    plan: Plan,
    /// Each as often as it counts, with those at the ends.
    knots: Vec<f64>,
    control: Vec<f64>,
    /// Sum of the squares of what is left, in that of the noise.
    pub(super) left: f64,
}

/// Values of the basis functions that are not zero in a span.
fn basis<const DEGREE: usize>(knots: &[f64], span: usize, t: f64) -> [f64; MOST + 1] {
    let near = &knots[span + 1 - DEGREE..=span + DEGREE];
    let mut b = [0.0; MOST + 1];
    b[0] = 1.0;
    for k in 1..=DEGREE {
        let mut carried = 0.0;
        for i in 0..k {
            let (left, right) = (near[DEGREE + i - k], near[DEGREE + i]);
            let x = b[i] / (right - left);
            b[i] = carried + (right - t) * x;
            carried = (t - left) * x;
        }
        b[k] = carried;
    }
    b
}

/// Of a degree that is known later.
fn basis_of(degree: usize, knots: &[f64], span: usize, t: f64) -> [f64; MOST + 1] {
    match degree {
        0 => [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        1 => basis::<1>(knots, span, t),
        2 => basis::<2>(knots, span, t),
        3 => basis::<3>(knots, span, t),
        4 => basis::<4>(knots, span, t),
        _ => basis::<5>(knots, span, t),
    }
}

/// Control points by least squares on these knots, each as often as it counts, and the sum of squares that they leave.
fn solved<const DEGREE: usize>(all: &[f64], (times, q): (&[f64], &[f64]), sigma: f64) -> Option<(Vec<f64>, f64)> {
    let count = all.len() - DEGREE - 1;
    let mut normal = Banded::zeros(count);
    let mut control = DMatrix::zeros(1, count);
    // Digits are for what changes.
    let origin = *q.first()?;
    let mut rows = Vec::with_capacity(times.len());
    let mut span = DEGREE;
    for (t, q) in times.iter().zip(q) {
        while span + 1 < count && all[span + 1] <= *t {
            span += 1;
        }
        let (b, y) = (basis::<DEGREE>(all, span, *t), (q - origin) / sigma);
        normal.add_outer(span - DEGREE, &b[..=DEGREE], 1.0);
        (0..=DEGREE).for_each(|i| control[(0, span - DEGREE + i)] += b[i] * y);
        rows.push((span - DEGREE, b, y));
    }
    normal.factor().ok()?;
    normal.solve(&mut control);
    let control: Vec<f64> = control.iter().copied().collect();
    let of = |(from, b, y): &(usize, [f64; MOST + 1], f64)| {
        let c = &control[*from..=from + DEGREE];
        y - (0..=DEGREE).map(|i| b[i] * c[i]).sum::<f64>()
    };
    let left: f64 = rows.iter().map(|row| of(row).powi(2)).sum();
    left.is_finite().then_some((control, left))
}

impl Fit {
    /// The spline of a plan through positions `q` with noise `sigma` at ascending `times`, with those of the knots that are between the first and the last; `None`
    /// where the samples do not tell it. Allocates.
    pub(super) fn new(plan: Plan, knots: &[f64], (times, q): (&[f64], &[f64]), sigma: f64) -> Option<Self> {
        let (first, last, d) = (*times.first()?, *times.last()?, plan.degree);
        let mut all = vec![first; d + 1];
        for &k in knots.iter().filter(|k| first < **k && **k < last) {
            all.extend(core::iter::repeat_n(k, plan.multiplicity));
        }
        all.extend(core::iter::repeat_n(last, d + 1));
        let count = all.len() - d - 1;
        if count > times.len() {
            return None;
        }
        let (control, left) = match d {
            2 => solved::<2>(&all, (times, q), sigma),
            3 => solved::<3>(&all, (times, q), sigma),
            4 => solved::<4>(&all, (times, q), sigma),
            5 => solved::<5>(&all, (times, q), sigma),
            _ => None,
        }?;
        Some(Self { plan, knots: all, control, left })
    }
    /// Gauss-Newton steps of the knots in the fit of a plan whose knots are one less multiple: `None` for one that is not told. Allocates.
    pub(super) fn steps(plan: Plan, knots: &[f64], samples: (&[f64], &[f64]), sigma: f64) -> Option<Vec<Option<f64>>> {
        let looser = Self::new(plan.looser(), knots, samples, sigma)?;
        let m = plan.multiplicity + 1;
        let first = |i: usize| plan.degree + 1 + i * m;
        if looser.knots.len() != first(knots.len()) + plan.degree + 1 {
            return None;
        }
        let step = |i: usize| {
            let jump = |order: usize| {
                let t = looser.knots[first(i)];
                looser.derivative(first(i) + m - 1, t, order) - looser.derivative(first(i) - 1, t, order)
            };
            Some(-jump(plan.lowest() - 1) / jump(plan.lowest())).filter(|s| s.is_finite())
        };
        Some((0..knots.len()).map(step).collect())
    }
    /// Derivative of this order of the polynomial of a span, in deviations over `s^order`.
    fn derivative(&self, span: usize, t: f64, order: usize) -> f64 {
        let d = self.plan.degree;
        let mut c = [0.0; MOST + 1];
        c[..=d].copy_from_slice(&self.control[span - d..=span]);
        for k in (d - order + 1..=d).rev() {
            for i in 0..k {
                let (a, b) = (span + 1 + i - k, span + 1 + i);
                c[i] = k as f64 * (c[i + 1] - c[i]) / (self.knots[b] - self.knots[a]);
            }
        }
        let b = basis_of(d - order, &self.knots, span, t);
        (0..=d - order).map(|i| c[i] * b[i]).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use ff_testkit::scaled;

    /// `1.3 - 0.4 t + sum of c (t - T)_+^k / k!` over jumps `c` of derivatives `k` at times `T`.
    fn of(jumps: &[(f64, usize, f64)], t: f64) -> f64 {
        let one = |&(at, k, c): &(f64, usize, f64)| {
            c * (t - at).max(0.0).powi(k as i32) / (1..=k).map(|i| i as f64).product::<f64>()
        };
        1.3 - 0.4 * t + jumps.iter().map(one).sum::<f64>()
    }

    const JUMPS: [(f64, usize, f64); 5] =
        [(0.71, 3, 1.9), (0.71, 4, -2.3), (0.71, 5, 7.1), (1.63, 3, -0.8), (1.63, 5, 3.7)];

    fn samples() -> (Vec<f64>, Vec<f64>) {
        // At uneven times.
        let times: Vec<f64> = (0..120).map(|i| 0.02 * f64::from(i) + 0.003 * (1.7 * f64::from(i)).sin()).collect();
        let q = times.iter().map(|t| of(&JUMPS, *t)).collect();
        (times, q)
    }

    #[test]
    fn a_spline_of_the_same_knots_is_the_motion_and_its_derivatives() {
        let (times, q) = samples();
        let plan = Plan { degree: 5, multiplicity: 3 };
        let fit = Fit::new(plan, &[0.71, 1.63], (&times, &q), 0.37).unwrap();
        assert!(fit.left < 1e-20, "{}", fit.left);
        for (i, at) in [0.71, 1.63].into_iter().enumerate() {
            for order in 0..=5 {
                let first = 6 + 3 * i;
                let jump = fit.derivative(first + 2, at, order) - fit.derivative(first - 1, at, order);
                let expected = JUMPS.iter().find(|j| j.0 == at && j.1 == order).map_or(0.0, |j| j.2);
                assert_relative_eq!(0.37 * jump, expected, epsilon = scaled(2e-6));
            }
        }
    }

    #[test]
    fn steps_lead_to_where_the_knots_are() {
        let (times, q) = samples();
        let plan = Plan { degree: 5, multiplicity: 3 };
        let mut knots = vec![0.735, 1.59];
        let mut left = vec![Fit::new(plan, &knots, (&times, &q), 1e-5).unwrap().left];
        for _ in 0..6 {
            let steps = Fit::steps(plan, &knots, (&times, &q), 1e-5).unwrap();
            knots.iter_mut().zip(steps).for_each(|(k, s)| *k += s.unwrap());
            left.push(Fit::new(plan, &knots, (&times, &q), 1e-5).unwrap().left);
        }
        assert_relative_eq!(knots[0], 0.71, epsilon = scaled(1e-7));
        assert_relative_eq!(knots[1], 1.63, epsilon = scaled(1e-7));
        assert!(left[0] > 1e2 && left[6] < 1e-6, "{left:?}");
    }

    #[test]
    fn knots_that_no_sample_tells_apart_are_no_fit() {
        let (times, q) = samples();
        let plan = Plan { degree: 2, multiplicity: 1 };
        assert!(Fit::new(plan, &[0.7101, 0.7102, 0.7103, 0.7104, 0.7105], (&times, &q), 1e-5).is_none());
        assert!(Fit::new(plan, &[], (&times[..2], &q[..2]), 1e-5).is_none());
        assert!(Fit::new(plan, &[], (&[], &[]), 1e-5).is_none());
    }
}
