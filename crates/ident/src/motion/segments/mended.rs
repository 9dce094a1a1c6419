//! Kinks that a few samples hold together.
//!
//! A piece of fewer samples than a polynomial needs is none ([`super::Pieces::kinks`]), so that two jumps close by are found as one, where neither of them is. Kinks
//! are first put where they leave the least beside their neighbours; where residuals then stand out of the noise, two kinks in place of one are tried at all
//! samples about it, and kept where chi-squared falls by [`SPLIT`]. Two that follow no better than one become that.

use super::{Beside, DEGREE, LEAVES, Pieces, RAMP, SPLIT, SWEEPS, in_order};
use crate::motion::kink::Kink;
use core::ops::Range;

/// Times that kinks which do not follow are looked at.
const MENDED: usize = 4;
/// By how much chi-squared may rise with one kink in place of two: the acceleration between two is taken as unknown (`crate::motion::kink`), beside one it is not.
const ALIKE: f64 = 8.0;
/// Orders of two kinks.
const PAIRS: [[usize; 2]; 4] = [[2, 2], [3, 3], [2, 3], [3, 2]];

impl Pieces<'_> {
    /// Puts kinks where they are between samples, two in place of one and one in place of two. Allocates.
    pub(super) fn mend(&self, kinks: &mut Vec<Kink>) {
        for _ in 0..MENDED {
            self.polish(kinks);
            let split = self.split_unfollowed(kinks);
            if !(self.merge(kinks) || split) {
                return;
            }
        }
        self.polish(kinks);
    }
    /// Every kink at the time that leaves the least beside its neighbours.
    fn polish(&self, kinks: &mut [Kink]) {
        for _ in 0..SWEEPS {
            for i in 0..kinks.len() {
                let Beside { range, near: mut all, .. } = self.beside(kinks, i);
                let count = all.len();
                all.push(kinks[i]);
                if self.polished(&range, &mut all, count).is_some() {
                    kinks[i] = all[count];
                }
            }
            in_order(kinks);
        }
    }
    /// Two kinks in place of those that do not follow; whether there are any.
    fn split_unfollowed(&self, kinks: &mut Vec<Kink>) -> bool {
        let (mut any, mut i) = (false, 0);
        while i < kinks.len() {
            match self.pair(kinks, i) {
                Some((inside, better)) => {
                    any = true;
                    i = inside.start + better.len();
                    kinks.splice(inside, better);
                }
                None => i += 1,
            }
        }
        in_order(kinks);
        any
    }
    /// Of kinks about the `i`th that do not follow, their range, and as many and one that do.
    fn pair(&self, kinks: &[Kink], i: usize) -> Option<(Range<usize>, Vec<Kink>)> {
        let range = self.beside(kinks, i).range;
        let inside = |k: &usize| self.tells(&range, &kinks[*k]);
        let first = (i.saturating_sub(1)..=i).find(inside)?;
        let last = (i..(i + 2).min(kinks.len())).rev().find(inside)?;
        let own = kinks.get(first..=last)?;
        let mut all = own.to_vec();
        let before = self.polished(&range, &mut all, 0)?;
        if self.follows(&range, &all, self.at(&kinks[i])) {
            return None;
        }
        let mut best = (before - SPLIT, None);
        for (r, of) in own.iter().enumerate() {
            let at = self.at(of);
            let (from, to) = (at.saturating_sub(RAMP).max(range.start + 2), (at + RAMP).min(range.end - 1));
            let kept = [&own[..r], &own[r + 1..]].concat();
            for orders in PAIRS {
                let kink = |k: usize, order: usize| {
                    let time = 0.5 * (self.times[k - 1] + self.times[k]);
                    Kink { time, order, ..*of }
                };
                let mut least = (f64::INFINITY, None);
                for a in from..=at {
                    for b in at.max(a + 1)..to {
                        let all = [&kept[..], &[kink(a, orders[0]), kink(b, orders[1])]].concat();
                        if let Some(left) = self.left(range.clone(), &all).filter(|left| *left < least.0) {
                            least = (left, Some(all));
                        }
                    }
                }
                let Some(mut all) = least.1 else { continue };
                let left = self.polished(&range, &mut all, 0);
                in_order(&mut all);
                let apart = all.windows(2).all(|k| k[0].time < k[1].time);
                if let Some(left) = left.filter(|left| apart && *left < best.0) {
                    best = (left, Some(all));
                }
            }
        }
        best.1.map(|all| (first..last + 1, all))
    }
    /// One kink in place of two, where it follows as well; whether there are any.
    fn merge(&self, kinks: &mut Vec<Kink>) -> bool {
        let (count, mut i) = (kinks.len(), 1);
        while i < kinks.len() {
            let close = self.at(&kinks[i]).saturating_sub(self.at(&kinks[i - 1])) <= 2 * RAMP;
            match close.then(|| self.one(kinks, i)).flatten() {
                Some(one) => {
                    kinks.splice(i - 1..=i, [one]);
                }
                None => i += 1,
            }
        }
        kinks.len() < count
    }
    /// In place of the `i`th kink and the one before.
    fn one(&self, kinks: &[Kink], i: usize) -> Option<Kink> {
        let (range, near) = self.about_both(kinks, i);
        let (pair, count) = ([kinks[i - 1], kinks[i]], near.len());
        let both = self.polished(&range, &mut [&near[..], &pair].concat(), count)?;
        let mut best = (both + ALIKE, None);
        for time in [pair[0].time, 0.5 * (pair[0].time + pair[1].time), pair[1].time] {
            for order in [2, 3] {
                let mut all = near.clone();
                all.push(Kink { time, order, ..pair[0] });
                if let Some(left) = self.polished(&range, &mut all, count).filter(|left| *left < best.0) {
                    best = (left, Some(all[count]));
                }
            }
        }
        best.1
    }
    /// Whether these kinks leave no more than noise of a stretch, and of what is next to this sample.
    fn follows(&self, range: &Range<usize>, kinks: &[Kink], at: usize) -> bool {
        let Some(left) = self.residuals(range, kinks) else { return true };
        let free = (left.len() as f64 - (DEGREE + 1 + 2 * kinks.len()) as f64).max(1.0) / left.len() as f64;
        let next = at.saturating_sub(RAMP).max(range.start) - range.start..(at + RAMP).min(range.end) - range.start;
        [&left[..], &left[next]].iter().all(|r| {
            let n = free * r.len() as f64;
            r.iter().map(|r| r * r).sum::<f64>() < n + LEAVES * (2.0 * n).sqrt()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    const SIGMA: f64 = 5e-6;

    /// Kinks of a joint that is read every 20 ms, whose derivatives of these orders jump by these sizes at these times.
    fn found(truth: &[(f64, usize, f64)], seed: u64) -> Vec<Kink> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let times: Vec<f64> = (0..600).map(|i| 0.02 * f64::from(i)).collect();
        let read = |t: &f64| {
            let noise: f64 = StandardNormal.sample(&mut rng);
            let of = |&(at, order, size): &(f64, usize, f64)| {
                let u = (t - at).max(0.0);
                size * if order == 2 { u * u / 2.0 } else { u.powi(3) / 6.0 }
            };
            0.37 + SIGMA * noise + truth.iter().map(of).sum::<f64>()
        };
        let q: Vec<f64> = times.iter().map(read).collect();
        Pieces { times: &times, q: &q, sigma: SIGMA }.kinks(3)
    }

    /// Each is found, of its order and no farther than this, and nothing else is.
    fn check(truth: &[(f64, usize, f64)], tolerance: &dyn Fn(f64) -> f64) {
        for seed in 0..4 {
            let found = found(truth, seed);
            assert_eq!(found.len(), truth.len(), "{seed}: {found:?}");
            for (f, t) in found.iter().zip(truth) {
                assert!(f.joint == 3 && f.order == t.1 && (f.time - t.0).abs() < tolerance(t.0), "{seed}: {f:?} {t:?}");
            }
        }
    }

    #[test]
    fn jumps_are_told_far_better_than_the_time_between_samples() {
        let truth = [(1.7258, 2, 0.32), (2.3031, 2, -0.32), (4.4127, 2, -0.32), (4.99, 2, 0.32), (7.3647, 2, 0.21)];
        check(&truth, &|_| 1.2e-3);
    }

    #[test]
    fn two_jumps_between_a_few_samples_are_two() {
        // From down to up within three intervals.
        let close = [(2.1166, 2, -0.2223), (2.1682, 2, 0.3262)];
        let stairs = [(7.2751, 2, -0.382), (7.4322, 2, -0.382)];
        check(&[close, stairs].concat(), &|t| if t < 3.0 { 0.012 } else { 2e-3 });
    }

    #[test]
    fn bends_are_found_where_pieces_are_short() {
        let truth =
            [(2.3865, 3, -0.575), (2.5814, 3, -0.575), (4.1147, 3, 0.575), (4.9781, 3, 0.8585), (5.3124, 3, 0.8585)];
        check(&truth, &|_| 0.02);
    }
}
