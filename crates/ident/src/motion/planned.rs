//! Joint motions that a planner made of polynomials, found from noisy positions.
//!
//! Trapezoidal speeds, limited jerk, cubic and quintic polynomials through via points are splines whose knots are at times that no one has logged
//! ([`Plan`]). With `K` knots and `M` samples the one is taken for which
//!
//! ```text
//! chi^2 + ((m + 1) K + d + 1) ln M                          (G. Schwarz, *Ann. Statist.* 6, 1978, 461)
//! ```
//!
//! is least, and far below that of splines with knots at equal distances (`crate::motion::kink_search`). Such a spline takes a quarter of the numbers and less, and leaves a fifth of the error in
//! the accelerations. The search begins with pieces that do not meet, each as long as a polynomial follows. Then knots are moved, put in and
//! taken out beside a few neighbours, in turn, by what the criterion gains.

use crate::motion::free_knots::{Fit, Plan};
use crate::motion::segments::longest;
use core::ops::Range;

/// What planners join: trapezoidal speed; limited jerk, and cubic polynomials with a continuous acceleration; cubic polynomials with a continuous
/// speed; polynomials of degree five with a continuous acceleration.
const PLANS: [Plan; 4] = [
    Plan { degree: 2, multiplicity: 1 },
    Plan { degree: 3, multiplicity: 1 },
    Plan { degree: 3, multiplicity: 2 },
    Plan { degree: 5, multiplicity: 3 },
];
/// Samples of a piece on average below which there are none, and how many pieces there are before that is asked.
const SHORT: usize = 12;
const FEW: usize = 8;
/// Parts of the knots that a search begins with, and of what is left, that it may end with.
const FEWER: f64 = 0.9;
const LESS: f64 = 0.95;
/// Knots on each side of what is changed in the stretch that is looked at, and in the one that has to agree.
const NEAR: usize = 2;
const WIDE: usize = 8;
/// Intervals between samples from an end of a stretch to the next knot, and from one knot to another, at least.
const ASIDE: f64 = 4.0;
const APART: f64 = 3.0;
/// Instants of a gap at which a knot is tried; parts of the gaps beside a knot at which two are tried in its place.
const TRIED: usize = 12;
const ASUNDER: [f64; 4] = [0.1, 0.3, 0.5, 0.8];
/// Gauss-Newton steps at most; the part of a gap that one may take; the part of the interval between samples, and of chi-squared, at which they have ended.
const STEPS: usize = 12;
const FAR: f64 = 0.3;
const STILL: f64 = 1e-3;
/// Parts of a step that are tried.
const PARTS: [f64; 3] = [1.0, 0.4, 0.1];
/// Times that knots are looked at.
const ROUNDS: usize = 12;
/// What one more knot must gain and one less may lose, in what the criterion asks for; and what one at another place must gain in chi-squared.
const GAINS: f64 = 1.5;
const LOSES: f64 = 1.0;
const MOVED: f64 = 1.0;

/// Positions of one joint.
pub(super) struct Positions<'a> {
    pub(super) times: &'a [f64],
    pub(super) q: &'a [f64],
    pub(super) sigma: f64,
    /// Instants (s) at which the jerk of some joint jumps.
    pub(super) told: &'a [f64],
}

/// A plan that follows them.
pub(super) struct Planned {
    pub(super) plan: Plan,
    /// Ascending (s).
    pub(super) knots: Vec<f64>,
    left: f64,
    cost: f64,
}

/// A change of knots: these in place of those of a range, in a stretch of samples.
struct Change {
    range: Range<usize>,
    knots: Vec<f64>,
}

/// Criterion of `left` with so many numbers for so many samples.
pub(super) fn criterion(left: f64, parameters: usize, samples: usize) -> f64 {
    left + parameters as f64 * (samples as f64).ln()
}

impl Positions<'_> {
    /// The plan whose criterion is least, of those below `limit`, where a spline that follows as well leaves `scale` for each number that samples are more than its
    /// own. Allocates.
    pub(super) fn planned(&self, limit: f64, scale: f64) -> Option<Planned> {
        let begun = PLANS.into_iter().filter_map(|plan| Some((plan, self.begun(plan)?)));
        let mut begun: Vec<(Plan, Vec<f64>)> = begun.collect();
        begun.sort_by_key(|(plan, knots)| plan.parameters(knots.len()));
        let mut best: Option<Planned> = None;
        for (plan, knots) in begun {
            let free = |plan: Plan, knots: usize| self.times.len().saturating_sub(plan.parameters(knots)) as f64;
            let of = |b: &Planned| (b.left / free(b.plan, b.knots.len()), b.cost);
            let (scale, most) = best.as_ref().map_or((scale, limit), of);
            let least = |knots: usize| self.criterion(plan, knots, LESS * scale * free(plan, knots));
            if least((FEWER * knots.len() as f64) as usize) > most {
                continue;
            }
            if let Some(found) = self.settled(plan, knots, &|knots| least(knots) > most).filter(|f| f.cost < most) {
                best = Some(found);
            }
        }
        // Once more from instants that are told, of which those of other joints are taken out.
        let told = self.told_knots();
        let bends = best.as_ref().filter(|b| b.plan.lowest() == 3 && !told.is_empty());
        let found = bends.and_then(|b| self.settled(b.plan, told, &|_| false));
        if let (Some(best), Some(found)) = (&mut best, found)
            && found.cost < best.cost
        {
            *best = found;
        }
        best
    }
    /// A knot at every instant that is told.
    fn told_knots(&self) -> Vec<f64> {
        let (first, last) = (self.times[0], self.times[self.times.len() - 1]);
        let mut told: Vec<f64> = self.told.iter().copied().filter(|t| first < *t && *t < last).collect();
        told.dedup_by(|b, a| *b - *a < APART * self.dt());
        told
    }
    fn criterion(&self, plan: Plan, knots: usize, left: f64) -> f64 {
        criterion(left, plan.parameters(knots), self.times.len())
    }
    /// What the criterion asks of a knot.
    fn price(&self, plan: Plan) -> f64 {
        self.criterion(plan, 1, 0.0) - self.criterion(plan, 0, 0.0)
    }
    fn dt(&self) -> f64 {
        let m = self.times.len();
        (self.times[m - 1] - self.times[0]) / (m - 1) as f64
    }
    /// What a spline of these knots leaves of these samples.
    fn left(&self, plan: Plan, knots: &[f64], samples: &Range<usize>) -> Option<f64> {
        let read = (&self.times[samples.clone()], &self.q[samples.clone()]);
        Fit::new(plan, knots, read, self.sigma).map(|f| f.left)
    }
    /// Where pieces that do not meet end, each as long as a polynomial follows; `None` where they are too short to be any.
    fn begun(&self, plan: Plan) -> Option<Vec<f64>> {
        let mut ends = Vec::new();
        let mut from = 0;
        loop {
            let all = from..self.times.len();
            let to = longest(all, plan.degree + 3, plan.degree, |piece| self.left(plan, &[], &piece));
            if to >= self.times.len() {
                return Some(ends);
            }
            ends.push(0.5 * (self.times[to - 1] + self.times[to]));
            if ends.len() > FEW && ends.len() * SHORT > to {
                return None;
            }
            from = to;
        }
    }
    /// Knots of a plan from these on; `None` where there are too many.
    fn settled(&self, plan: Plan, mut knots: Vec<f64>, too_many: &dyn Fn(usize) -> bool) -> Option<Planned> {
        let (all, apart) = (0..self.times.len(), APART * self.dt());
        // Where knots have changed.
        let mut changed = vec![(f64::NEG_INFINITY, f64::INFINITY)];
        for _ in 0..ROUNDS {
            self.polish(plan, &mut knots, &all);
            knots.dedup_by(|b, a| *b - *a < apart);
            let mut next = Vec::new();
            for of in [Self::more, Self::two_for_one, Self::elsewhere, Self::one_for_two, Self::fewer] {
                let mut i = 0;
                while i <= knots.len() {
                    let (from, to) = self.gap(&knots, i.saturating_sub(NEAR)..i + NEAR);
                    let near = changed.iter().chain(&next).any(|c: &(f64, f64)| c.0 < to && from < c.1);
                    if let Some(change) = near.then(|| of(self, plan, &knots, i)).flatten() {
                        next.push((from, to));
                        let fewer = change.knots.len() < change.range.len();
                        knots.splice(change.range, change.knots);
                        if fewer {
                            continue;
                        }
                    }
                    i += 1;
                    if knots.len() > FEW && knots.len() * SHORT > self.times.len() {
                        return None;
                    }
                }
            }
            if too_many(knots.len()) {
                return None;
            }
            if next.is_empty() {
                break;
            }
            changed = next;
        }
        self.polish(plan, &mut knots, &all);
        let left = self.left(plan, &knots, &all)?;
        let cost = self.criterion(plan, knots.len(), left);
        Some(Planned { plan, knots, left, cost })
    }
    /// Times of the knots, or ends, beside those of this range.
    fn gap(&self, knots: &[f64], range: Range<usize>) -> (f64, f64) {
        let from = range.start.checked_sub(1).map_or(self.times[0], |i| knots[i]);
        (from, knots.get(range.end).copied().unwrap_or(self.times[self.times.len() - 1]))
    }
    /// Knots of this range and so many on each side, and the samples between those beside them: none of which is next to a knot.
    fn stretch(&self, knots: &[f64], range: &Range<usize>, beside: usize) -> (Range<usize>, Range<usize>) {
        let (mut first, mut last) = (range.start.saturating_sub(beside), (range.end + beside).min(knots.len()));
        let close = |i: usize| i > 0 && i < knots.len() && knots[i] - knots[i - 1] < ASIDE * self.dt();
        while close(first) {
            first -= 1;
        }
        while close(last) {
            last += 1;
        }
        let (from, to) = self.gap(knots, first..last);
        (first..last, self.times.partition_point(|t| *t < from)..self.times.partition_point(|t| *t <= to))
    }
    /// Moves these knots to where they leave the least of these samples.
    fn polish(&self, plan: Plan, knots: &mut [f64], samples: &Range<usize>) -> Option<f64> {
        let (times, q) = (self.times.get(samples.clone())?, self.q.get(samples.clone())?);
        let (from, to) = (*times.first()?, *times.last()?);
        if knots.iter().any(|k| *k <= from || *k >= to) {
            return None;
        }
        let (dt, mut left) = (self.dt(), self.left(plan, knots, samples)?);
        for _ in 0..STEPS {
            let Some(steps) = Fit::steps(plan, knots, (times, q), self.sigma) else { break };
            let held = |(i, step): (usize, Option<f64>)| {
                let before = i.checked_sub(1).map_or(from, |i| knots[i]);
                let room = (knots[i] - before).min(knots.get(i + 1).unwrap_or(&to) - knots[i]);
                let far = (FAR * room).min(0.5 * (room - APART * dt)).max(0.0);
                step.map_or(0.0, |s| s.clamp(-far, far))
            };
            let steps: Vec<f64> = steps.into_iter().enumerate().map(held).collect();
            if steps.iter().all(|s| s.abs() < STILL * dt) {
                break;
            }
            let tried = PARTS.iter().find_map(|part| {
                let moved: Vec<f64> = knots.iter().zip(&steps).map(|(k, s)| k + part * s).collect();
                self.left(plan, &moved, samples).filter(|l| *l < left).map(|left| (left, moved))
            });
            let Some((less, moved)) = tried else { break };
            knots.copy_from_slice(&moved);
            let still = left - less < STILL;
            left = less;
            if still {
                break;
            }
        }
        Some(left)
    }
    /// The best of these in place of the knots of a range, if it gains so much of the samples near by and of those about.
    fn best(
        &self,
        plan: Plan,
        knots: &[f64],
        range: Range<usize>,
        tried: impl Iterator<Item = Vec<f64>>,
        gains: f64,
    ) -> Option<Change> {
        let (inside, samples) = self.stretch(knots, &range, NEAR);
        let with =
            |own: &[f64], of: &Range<usize>| [&knots[of.start..range.start], own, &knots[range.end..of.end]].concat();
        let before = self.left(plan, &knots[inside.clone()], &samples)?;
        let each = tried.filter_map(|own| {
            let all = with(&own, &inside);
            self.left(plan, &all, &samples).filter(|_| self.are_apart(&all)).map(|left| (left, all))
        });
        let (_, mut all) = each.min_by(|a, b| a.0.total_cmp(&b.0))?;
        self.polish(plan, &mut all, &samples).filter(|left| before - left > gains)?;
        let (wide, samples) = self.stretch(knots, &range, WIDE);
        let new = [&knots[wide.start..inside.start], &all, &knots[inside.end..wide.end]].concat();
        let gained = self.left(plan, &knots[wide], &samples)? - self.left(plan, &new, &samples)?;
        (gained > gains && self.are_apart(&new)).then_some(Change { range: inside, knots: all })
    }
    fn are_apart(&self, knots: &[f64]) -> bool {
        // But for rounding of steps up to there.
        knots.windows(2).all(|k| k[1] - k[0] > 0.999 * APART * self.dt())
    }
    /// Instants of a gap at which a knot is tried.
    fn instants(&self, (from, to): (f64, f64)) -> impl Iterator<Item = f64> {
        let count = (((to - from) / self.dt()) as usize).min(TRIED);
        (0..count).map(move |k| from + (to - from) * (k as f64 + 0.5) / count as f64)
    }
    /// A knot in front of number `i`.
    fn more(&self, plan: Plan, knots: &[f64], i: usize) -> Option<Change> {
        let tried = self.instants(self.gap(knots, i..i)).map(|t| vec![t]);
        self.best(plan, knots, i..i, tried, GAINS * self.price(plan))
    }
    /// Two in place of number `i`.
    fn two_for_one(&self, plan: Plan, knots: &[f64], i: usize) -> Option<Change> {
        let (&at, (from, to)) = (knots.get(i)?, self.gap(knots, i..i + 1));
        let tried =
            ASUNDER.iter().flat_map(|a| ASUNDER.iter().map(move |b| vec![at - a * (at - from), at + b * (to - at)]));
        self.best(plan, knots, i..i + 1, tried, GAINS * self.price(plan))
    }
    /// Number `i` elsewhere between its neighbours.
    fn elsewhere(&self, plan: Plan, knots: &[f64], i: usize) -> Option<Change> {
        knots.get(i)?;
        let tried = self.instants(self.gap(knots, i..i + 1)).map(|t| vec![t]);
        self.best(plan, knots, i..i + 1, tried, MOVED)
    }
    /// One in place of number `i` and the next.
    fn one_for_two(&self, plan: Plan, knots: &[f64], i: usize) -> Option<Change> {
        let (&first, &next) = (knots.get(i)?, knots.get(i + 1)?);
        let tried = ASUNDER.iter().map(|a| vec![first + a * (next - first)]);
        self.best(plan, knots, i..i + 2, tried, -LOSES * self.price(plan))
    }
    /// None in place of number `i`.
    fn fewer(&self, plan: Plan, knots: &[f64], i: usize) -> Option<Change> {
        knots.get(i)?;
        self.best(plan, knots, i..i + 1, core::iter::once(Vec::new()), -LOSES * self.price(plan))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    const DT: f64 = 0.02;

    /// Readings of a joint every 20 ms whose derivatives jump: time, order, size.
    fn read(jumps: &[(f64, usize, f64)], seconds: f64, sigma: f64) -> (Vec<f64>, Vec<f64>) {
        let mut rng = ChaCha8Rng::seed_from_u64(31);
        let times: Vec<f64> = (0..(seconds / DT) as usize).map(|i| DT * i as f64).collect();
        let one = |t: f64, &(at, k, size): &(f64, usize, f64)| {
            size * (t - at).max(0.0).powi(k as i32) / (1..=k).map(|i| i as f64).product::<f64>()
        };
        let q = times.iter().map(|t| {
            let noise: f64 = StandardNormal.sample(&mut rng);
            0.41 + sigma * noise + jumps.iter().map(|j| one(*t, j)).sum::<f64>()
        });
        let q = q.collect();
        (times, q)
    }

    /// Is of this plan, with a knot at each time and nowhere else.
    fn check(jumps: &[(f64, usize, f64)], seconds: f64, (plan, sigma, within): (Plan, f64, f64)) {
        let (times, q) = read(jumps, seconds, sigma);
        let found = Positions { times: &times, q: &q, sigma, told: &[] }.planned(f64::INFINITY, 1.0).unwrap();
        let mut at: Vec<f64> = jumps.iter().map(|j| j.0).collect();
        at.dedup();
        assert_eq!((found.plan, found.knots.len()), (plan, at.len()), "{:?} {at:?}", found.knots);
        for (knot, at) in found.knots.iter().zip(&at) {
            assert!((knot - at).abs() < within, "{knot} {at}");
        }
        let free = (times.len() - plan.parameters(at.len())) as f64;
        assert!((found.left / free - 1.0).abs() < 5.0 * (2.0 / free).sqrt(), "{} of {free}", found.left);
    }

    /// Moves there and back: times of the accelerations and sizes.
    fn moves(seed: u64, count: usize) -> Vec<(f64, f64, f64, f64)> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut uniform = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
        let mut from = 0.0;
        let one = |i: usize| {
            let (up, cruise, size) = (uniform(0.6, 0.9), uniform(0.4, 1.1), uniform(0.25, 0.4));
            let at = from + uniform(0.4, 0.9);
            from = at + 2.0 * up + cruise;
            (at, up, cruise, if i.is_multiple_of(2) { size } else { -size })
        };
        (0..count).map(one).collect()
    }

    #[test]
    fn a_trapezoidal_speed_is_told_whatever_the_encoder() {
        let of = |&(at, up, cruise, a): &(f64, f64, f64, f64)| {
            let [b, c] = [at + up, at + up + cruise];
            [(at, 2, a), (b, 2, -a), (c, 2, -a), (c + up, 2, a)]
        };
        let jumps: Vec<_> = moves(5, 8).iter().flat_map(of).collect();
        let plan = Plan { degree: 2, multiplicity: 1 };
        check(&jumps, 27.0, (plan, 5e-6, 1e-3));
        check(&jumps, 27.0, (plan, 5e-5, 1e-2));
    }

    #[test]
    fn a_limited_jerk_is_told() {
        // A third of each acceleration is a ramp.
        let of = |&(at, up, cruise, a): &(f64, f64, f64, f64)| {
            let (ramp, jerk) = (up / 3.0, 3.0 * a / up);
            let [b, c] = [at + up - ramp, at + up + cruise];
            let one = |t: f64, j: f64| [(t, 3, j), (t + ramp, 3, -j)];
            [one(at, jerk), one(b, -jerk), one(c, -jerk), one(c + up - ramp, jerk)].concat()
        };
        let jumps: Vec<_> = moves(7, 8).iter().flat_map(of).collect();
        check(&jumps, 27.0, (Plan { degree: 3, multiplicity: 1 }, 3e-6, 2e-2));
    }

    #[test]
    fn polynomials_through_via_points_are_told() {
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let mut t = 0.3;
        let mut size = |scale: f64| scale * (2.0 * rng.random::<f64>() - 1.0);
        // Jumps that keep the motion within some radians: each undoes what those before have led to.
        let (mut jumps, mut state) = (Vec::new(), [0.0; 6]);
        for _ in 0..7 {
            let length = 2.6 + size(0.5);
            let goal = [size(0.5), size(0.1), size(0.1)];
            let next = quintic(&state, length, goal);
            jumps.extend((3..=5).map(|k| (t, k, next[k] - state[k])));
            state = after(&next, length);
            t += length;
        }
        let plan = Plan { degree: 5, multiplicity: 3 };
        check(&jumps, t - 0.4, (plan, 5e-6, 0.1));
        check(&jumps, t - 0.4, (plan, 3e-5, 0.2));
    }

    /// Derivatives at the end of a polynomial with these at its beginning.
    fn after(d: &[f64; 6], length: f64) -> [f64; 6] {
        core::array::from_fn(|k| {
            (k..6).map(|i| d[i] * length.powi((i - k) as i32) / (1..=i - k).map(|i| i as f64).product::<f64>()).sum()
        })
    }

    /// Derivatives at the beginning of the polynomial of degree five from a position, rate and acceleration to others.
    fn quintic(from: &[f64; 6], length: f64, to: [f64; 3]) -> [f64; 6] {
        let start = [from[0], from[1], from[2], 0.0, 0.0, 0.0];
        let columns: [[f64; 6]; 3] = core::array::from_fn(|i| {
            let mut one = [0.0; 6];
            one[3 + i] = 1.0;
            after(&one, length)
        });
        let matrix = nalgebra::Matrix3::from_fn(|r, c| columns[c][r]);
        let ends = after(&start, length);
        let x = matrix.lu().solve(&nalgebra::Vector3::from_fn(|r, _| to[r] - ends[r])).unwrap();
        [start[0], start[1], start[2], x[0], x[1], x[2]]
    }

    #[test]
    fn a_joint_at_rest_is_planned_without_knots_and_noise_alone_has_no_plan() {
        let (times, q) = read(&[], 9.0, 1e-5);
        let found = Positions { times: &times, q: &q, sigma: 1e-5, told: &[] }.planned(f64::INFINITY, 1.0).unwrap();
        assert!(found.knots.is_empty());
        assert!(Positions { times: &times, q: &q, sigma: 1e-7, told: &[] }.planned(f64::INFINITY, 1.0).is_none());
    }
}
