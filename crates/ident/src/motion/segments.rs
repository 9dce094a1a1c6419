//! The pieces that the motion of a joint is made of, where it is made of polynomials: what controllers plan with.
//!
//! From the first sample on, pieces are made as long as a polynomial of degree 3 follows them to the noise. The kink between two of them is
//! where that polynomial and one kink follow both best:
//!
//! ```text
//! q(t) = p(t) + c (t - T)_+^m,   m = 2: a jump of the acceleration, 3: of the jerk
//! ```

use crate::motion::kink::Kink;
use core::ops::Range;
use nalgebra::{DMatrix, DVector};

/// Degree of the pieces: jerk that is constant in each.
const DEGREE: usize = 3;
/// Columns of a stretch at most: a polynomial, two kinks, their derivatives by time, and the kinks beside them.
const MOST: usize = DEGREE + 7;
/// Deviations of a sum of squares from which a piece does not follow.
const LEAVES: f64 = 4.0;
/// Samples of the shortest piece.
const SHORTEST: usize = 6;
/// Pieces of a joint beyond which there are none, and samples of each on average below which there are none: noise is larger than it is said to be, or
/// the motion is made of something else. The equations of so many kinks take some seconds.
const MANY: usize = 600;
const SHORT: usize = 12;
/// Instants between two samples at which a kink is tried.
const BETWEEN: usize = 2;
/// Longest stretch on each side of a kink by which it is placed, in samples.
const ASIDE: usize = 60;
/// Times that every kink is placed anew beside its neighbours, and samples by which it may move.
const SWEEPS: usize = 3;
const MOVED: usize = 8;
/// Samples on each side of a jump that may be a ramp, and by how much chi-squared must fall if it is one.
const RAMP: usize = 10;
const SPLIT: f64 = 30.0;
/// Parts of the time between two neighbours by which both are moved inwards where other orders are tried, and by how much chi-squared must differ.
const INWARDS: [f64; 4] = [0.0, 0.2, 0.35, -0.2];
const DIFFERS: f64 = 0.5;
/// Gauss-Newton steps, and the longest of them in samples.
const POLISHED: usize = 5;
const FAR: f64 = 1.0;

fn in_order(kinks: &mut [Kink]) {
    kinks.sort_by(|a, b| a.time.total_cmp(&b.time));
}

/// One behind the last of these samples that a polynomial of this degree follows from the first on, `shortest` of them at least; `left` is the sum of squares that one leaves
/// of a stretch, in that of the noise.
pub(super) fn longest(
    samples: Range<usize>,
    shortest: usize,
    degree: usize,
    left: impl Fn(Range<usize>) -> Option<f64>,
) -> usize {
    let (from, m) = (samples.start, samples.end);
    let follows = |to: usize| {
        let free = ((to - from) as f64 - degree as f64 - 1.0).max(1.0);
        left(from..to).is_some_and(|left| left < free + LEAVES * (2.0 * free).sqrt())
    };
    let (mut good, mut step) = ((from + shortest).min(m), shortest);
    let mut bad = loop {
        let next = (good + step).min(m);
        if next == good {
            return m;
        }
        if !follows(next) {
            break next;
        }
        good = next;
        step *= 2;
    };
    while bad - good > 1 {
        let middle = usize::midpoint(good, bad);
        if follows(middle) {
            good = middle;
        } else {
            bad = middle;
        }
    }
    good
}

/// What surrounds a kink: the samples from the one before its neighbour to the one behind the other, its neighbours, and the samples between these.
struct Beside {
    range: Range<usize>,
    near: Vec<Kink>,
    between: Range<usize>,
}

/// Positions of one joint.
pub(super) struct Pieces<'a> {
    pub(super) times: &'a [f64],
    pub(super) q: &'a [f64],
    pub(super) sigma: f64,
}

impl Pieces<'_> {
    /// The kinks between the pieces, as those of joint `j`. Allocates.
    pub(super) fn kinks(&self, j: usize) -> Vec<Kink> {
        let mut ends = vec![0];
        while let Some(&from) = ends.last() {
            let to = self.longest(from);
            if to >= self.times.len() {
                break;
            }
            ends.push(to);
            if ends.len() > MANY || ends.len() * SHORT > self.times.len() + MANY {
                return Vec::new();
            }
        }
        ends.remove(0);
        // Behind the end of a piece by what a polynomial follows of the next.
        let mut out: Vec<Kink> = Vec::new();
        for (i, &end) in ends.iter().enumerate() {
            let next = ends.get(i + 1).copied().unwrap_or(self.times.len());
            let known = out.last().map_or(0, |k| self.at(k));
            let range = known.max(end.saturating_sub(2 * ASIDE))..next.min(end + ASIDE);
            let within = range.start + 2..(end + 3).min(next);
            out.extend(self.placed(j, range, &[], within));
        }
        self.sweep(j, &mut out);
        self.reorder(&mut out);
        out
    }
    /// Puts two kinks with a ramp between them in place of jumps that are one; whether any is. Allocates.
    pub(super) fn ramps(&self, j: usize, kinks: &mut Vec<Kink>) -> bool {
        let any = self.split(j, kinks);
        if any {
            self.reorder(kinks);
            self.sweep(j, kinks);
        }
        any
    }
    /// Places every kink anew beside its neighbours.
    fn sweep(&self, j: usize, kinks: &mut [Kink]) {
        for _ in 0..SWEEPS {
            for i in 0..kinks.len() {
                let Beside { range, near, between } = self.beside(kinks, i);
                let end = self.at(&kinks[i]);
                let within = between.start.max(end.saturating_sub(MOVED))..between.end.min(end + MOVED);
                if let Some(kink) = self.placed(j, range, &near, within) {
                    kinks[i] = kink;
                }
            }
            in_order(kinks);
        }
    }
    /// Jumps that are two kinks, a ramp between them; whether there are any.
    fn split(&self, j: usize, kinks: &mut Vec<Kink>) -> bool {
        let mut pairs = Vec::new();
        for i in (0..kinks.len()).filter(|&i| kinks[i].order == 2) {
            let Beside { range, mut near, between } = self.beside(kinks, i);
            let (end, count) = (self.at(&kinks[i]), near.len());
            near.push(kinks[i]);
            let before = self.polished(&range, &mut near.clone(), count).unwrap_or(f64::INFINITY);
            let kink = |k: usize| Kink { joint: j, time: self.times[k], order: 3 };
            let mut best = (before - SPLIT, None);
            for from in between.start.max(end.saturating_sub(RAMP))..end {
                for to in end..between.end.min(end + RAMP) {
                    near.truncate(count);
                    near.extend([kink(from), kink(to)]);
                    if let Some(left) = self.left(range.clone(), &near).filter(|left| *left < best.0) {
                        best = (left, Some([kink(from), kink(to)]));
                    }
                }
            }
            pairs.extend(best.1.map(|pair| (i, pair)));
        }
        for (i, pair) in pairs.iter().rev() {
            kinks.splice(i..=i, *pair);
        }
        in_order(kinks);
        !pairs.is_empty()
    }
    /// Neighbours a few samples apart, of other orders and moved a little: two jumps look like a ramp.
    fn reorder(&self, kinks: &mut [Kink]) {
        for i in 1..kinks.len() {
            let pair = [kinks[i - 1], kinks[i]];
            if self.at(&pair[1]).saturating_sub(self.at(&pair[0])) > 2 * RAMP {
                continue;
            }
            let (first, last) = (self.beside(kinks, i - 1), self.beside(kinks, i));
            let range = first.range.start..last.range.end;
            let near = [i.checked_sub(2), (i + 1 < kinks.len()).then_some(i + 1)];
            let near: Vec<Kink> = near.into_iter().flatten().map(|k| kinks[k]).collect();
            let mut best: Option<(f64, [Kink; 2])> = None;
            for orders in [[pair[0].order, pair[1].order], [2, 2], [3, 3], [2, 3], [3, 2]] {
                for inwards in INWARDS {
                    let by = inwards * (pair[1].time - pair[0].time);
                    let mut all = near.clone();
                    all.push(Kink { time: pair[0].time + by, order: orders[0], ..pair[0] });
                    all.push(Kink { time: pair[1].time - by, order: orders[1], ..pair[1] });
                    let Some(left) = self.polished(&range, &mut all, near.len()) else { continue };
                    let found = [all[near.len()], all[near.len() + 1]];
                    let apart = found[1].time > found[0].time;
                    if apart && best.as_ref().is_none_or(|b| left < b.0 - DIFFERS) {
                        best = Some((left, found));
                    }
                }
            }
            if let Some((_, [one, other])) = best {
                (kinks[i - 1], kinks[i]) = (one, other);
            }
        }
        in_order(kinks);
    }
    /// What these kinks leave of a stretch, with the times of those behind the first `fixed` where that is least (Gauss-Newton steps).
    fn polished(&self, range: &Range<usize>, kinks: &mut [Kink], fixed: usize) -> Option<f64> {
        let stretch = self.times.get(range.clone())?;
        let (from, to) = (*stretch.first()?, *stretch.last()?);
        let far = FAR * (to - from) / range.len() as f64;
        for _ in 0..POLISHED {
            let both: Vec<Kink> = kinks.iter().copied().chain(kinks[fixed..].iter().map(Kink::by_time)).collect();
            let sizes = self.solve(range.clone(), &both)?.1;
            let count = kinks.len();
            for (i, k) in kinks[fixed..].iter_mut().enumerate() {
                let step = -sizes[count + i] / sizes[fixed + i];
                if step.is_finite() {
                    k.time = (k.time + step.clamp(-far, far)).clamp(from, to);
                }
            }
        }
        self.left(range.clone(), kinks)
    }
    /// The first sample behind a kink.
    fn at(&self, kink: &Kink) -> usize {
        self.times.partition_point(|t| *t <= kink.time)
    }
    fn beside(&self, kinks: &[Kink], i: usize) -> Beside {
        let end = self.at(&kinks[i]);
        let (before, after) = (|k: usize| i.checked_sub(k), |k: usize| Some(i + k).filter(|k| *k < kinks.len()));
        let first = |k: Option<usize>| k.map_or(0, |k| self.at(&kinks[k]));
        let last = |k: Option<usize>| k.map_or(self.times.len(), |k| self.at(&kinks[k]));
        let range = first(before(2)).max(end.saturating_sub(2 * ASIDE))..last(after(2)).min(end + 2 * ASIDE);
        let near = [before(1), after(1)].into_iter().flatten().map(|k| kinks[k]).collect();
        let between = first(before(1)).max(range.start + 1)..last(after(1)).min(range.end.saturating_sub(1));
        Beside { range, near, between }
    }
    /// One behind the last sample that a polynomial follows from sample `from` on.
    fn longest(&self, from: usize) -> usize {
        longest(from..self.times.len(), SHORTEST, DEGREE, |piece| self.left(piece, &[]))
    }
    /// The kink at one of the samples `within`, or between two, that leaves the least of a stretch, beside others.
    fn placed(&self, j: usize, range: Range<usize>, near: &[Kink], within: Range<usize>) -> Option<Kink> {
        let mut best: Option<(f64, Kink)> = None;
        let mut kinks = near.to_vec();
        for i in within.start..within.end.min(self.times.len() - 1) {
            for part in 0..BETWEEN {
                let time = self.times[i] + (part as f64 / BETWEEN as f64) * (self.times[i + 1] - self.times[i]);
                for order in [2, 3] {
                    let kink = Kink { joint: j, time, order };
                    kinks.truncate(near.len());
                    kinks.push(kink);
                    let left = self.left(range.clone(), &kinks);
                    if let Some(left) = left.filter(|l| best.as_ref().is_none_or(|b| *l < b.0)) {
                        best = Some((left, kink));
                    }
                }
            }
        }
        best.map(|b| b.1)
    }
    /// Sum of squares that a polynomial leaves of this stretch, in that of the noise; with these kinks.
    fn left(&self, range: Range<usize>, kinks: &[Kink]) -> Option<f64> {
        self.solve(range, kinks).map(|s| s.0)
    }
    /// The same, and the sizes of the kinks, in deviations over `s^order`.
    fn solve(&self, range: Range<usize>, kinks: &[Kink]) -> Option<(f64, Vec<f64>)> {
        let (times, q) = (self.times.get(range.clone())?, self.q.get(range)?);
        let (first, last) = (*times.first()?, *times.last()?);
        let (middle, half) = (0.5 * (first + last), 0.5 * (last - first));
        let smooth = DEGREE + 1;
        let columns = smooth + kinks.len();
        let mut normal = DMatrix::<f64>::zeros(columns, columns);
        let mut read = DVector::<f64>::zeros(columns);
        let mut squares = 0.0;
        let mut row = [0.0; MOST];
        for (t, q) in times.iter().zip(q) {
            let x = (t - middle) / half;
            (row[0], row[1]) = (1.0, x);
            for k in 2..smooth {
                // Legendre's recurrence.
                let a = k as f64;
                row[k] = ((2.0 * a - 1.0) * x * row[k - 1] - (a - 1.0) * row[k - 2]) / a;
            }
            for (row, kink) in row[smooth..].iter_mut().zip(kinks) {
                *row = ((t - kink.time) / half).max(0.0).powi(kink.order as i32);
            }
            let y = (q - self.q[0]) / self.sigma;
            squares += y * y;
            for a in 0..columns {
                read[a] += row[a] * y;
                (0..=a).for_each(|b| normal[(a, b)] += row[a] * row[b]);
            }
        }
        let factor = normal.cholesky()?;
        let x = factor.solve(&read);
        let left = squares - read.dot(&x);
        // Of (t - T)_+^m over its factorial.
        let size =
            |(k, kink): (usize, &Kink)| x[smooth + k] * (1..=kink.order).map(|m| m as f64 / half).product::<f64>();
        left.is_finite().then(|| (left, kinks.iter().enumerate().map(size).collect()))
    }
}
