//! Where the acceleration of a joint jumps or bends, from its positions.
//!
//! A spline that the noise lets follow the motion everywhere else leaves a burst in the residuals there. With `r` the residuals of a fit and `x` the
//! column of a kink (`crate::motion::kink`), chi-squared would fall by
//!
//! ```text
//! (x^T r)^2 / (s^2 |x - P x|^2),      P x: what the spline takes up of x
//! ```
//!
//! the score test of its size. Those that stand out farthest are added, their times are refined by Gauss-Newton steps (the derivative
//! of a kink by its time is a kink of one order less), and what is left is looked at again (orthogonal matching pursuit: Pati, Rezaiifar,
//! Krishnaprasad, *Asilomar* 1993, 40). Joint after joint, and in windows, so that its time grows with the length of a record.

use crate::motion::kink::{Column, Kink};
use crate::motion::planned::{Positions, criterion};
use crate::motion::segments::Pieces;
use crate::motion::spline_basis::{Bent, SplineBasis};
use crate::motion::spline_fit::{DEGREE, FitError, JointSamples, SIXTH, is_even, sixth_differences, spans};
use crate::motion::torque_corners::Corner;
use core::ops::Range;
use nalgebra::DVector;
use std::collections::HashMap;

/// Fall of chi-squared from which a kink is one: seven deviations, for each of the many places where one may be.
const SEEN: f64 = 50.0;
/// Part of it that one which was found must keep beside the others.
const KEPT: f64 = 0.5;
/// Fall of chi-squared from which a kink is one where torques tell its instant.
const SIZED: f64 = 6.0;
/// Intervals between samples about such an instant in which another is the same.
const TAKEN: f64 = 6.0;
/// Instants that are one (s): shifted to a window and back.
const SAME: f64 = 1e-9;
/// Rounds of looking, and Gauss-Newton steps in each.
const ROUNDS: usize = 40;
const STEPS: usize = 3;
/// Longest Gauss-Newton step, in spans.
const FAR: f64 = 0.25;
/// Spans about an instant whose residuals are looked at, deviations of their sum of squares from which a kink is looked for.
const NEAR: f64 = 1.5;
const RESTLESS: f64 = 4.0;
/// Part of a window near which residuals stand out of the noise, up to which kinks are looked for one by one: what is bent everywhere has no
/// kinks, or they are known badly.
const EVERYWHERE: f64 = 0.3;
/// The same of a record, from which there may be kinks at all.
const SOMEWHERE: f64 = 0.03;
/// Spans within which one kink is taken in a round, and within which it must be no less than half of a larger one: what that leaves beside it
/// looks like others.
const APART: f64 = 1.5;
const BESIDE: f64 = 6.0;
const LESS: f64 = 0.5;
/// Phases of the knots at which squares of columns are kept.
const PHASES: f64 = 16.0;
/// Steps of an encoder that residuals about a kink reach, where it reads in steps: the saw of a slow joint is none.
const STEPPED: f64 = 2.0;
/// Part of what knots at equal distances cost besides the noise that plans must stay below: it was 0.2 at most for motions that were planned, and 0.5 to 0.8 where an encoder hides
/// that one is a plan of another kind, and torques show it; from 1 on for tones.
const PART: f64 = 0.4;
/// Kinks of a joint beyond which plans are none: their equations, of which there are some for every draw of the noise, would take minutes.
const MANY: usize = 600;
/// Factors on a spacing of knots at equal distances.
const EVEN: [f64; 7] = [1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0];
/// Spans of a window, and of its margins, whose kinks are those of its neighbours.
const WINDOW: usize = 120;
const MARGIN: f64 = 12.0;

/// What a search looks at.
pub(super) struct Search<'a> {
    pub(super) samples: &'a JointSamples<'a>,
    /// Per joint, the standard deviation of its positions, and the step in which they are read.
    pub(super) noise: &'a [f64],
    pub(super) steps: &'a [f64],
    /// Instants that the torques tell.
    pub(super) corners: &'a [Corner],
}

/// Positions, and rates where they were read, without kinks.
pub(super) struct Smooth {
    pub(super) q: Vec<f64>,
    pub(super) qd: Option<Vec<f64>>,
}

impl Search<'_> {
    /// Where the motions of joints go over from one polynomial to another, of those joints that splines with knots `spacing` apart do not follow at some
    /// places. Allocates.
    pub(super) fn pieces(&self, spacing: f64) -> Result<Vec<Kink>, FitError> {
        let s = self.samples;
        let whole = Window::new(s, spacing)?;
        let mut out = Vec::new();
        for j in (0..s.dof).filter(|&j| self.noise[j] > 0.0) {
            let sigma = self.noise[j];
            let r = whole.basis.residuals(s, j, &whole.smooth.row(j).transpose(), core::iter::empty());
            if whole.restless(&r, sigma).len() as f64 > SOMEWHERE * r.len() as f64 {
                out.extend(Pieces { times: s.times, q: &self.positions(j), sigma }.kinks(j));
            }
        }
        Ok(out)
    }
    /// Where the polynomials meet that joints move in, if all of them do, or are at rest: those of [`Positions::planned`] that take fewer numbers than the best spline with knots at equal
    /// distances, of those from `spacing` on. Allocates.
    pub(super) fn planned(&self, spacing: f64) -> Result<Option<Vec<Kink>>, FitError> {
        let s = self.samples;
        // The criterion, and what is left for each number that is not the spline's.
        let mut even = vec![(f64::INFINITY, 1.0); s.dof];
        for wider in EVEN {
            let spans = spans(s, wider * spacing);
            let basis = SplineBasis::new(s, spans, DEGREE, false)?;
            let smooth = basis.smooth(s);
            for (j, even) in even.iter_mut().enumerate() {
                let r = basis.residuals(s, j, &smooth.row(j).transpose(), core::iter::empty());
                let left: f64 = r.iter().map(|r| (r / self.noise[j]).powi(2)).sum();
                let (of_spline, free) = (spans + DEGREE, r.len().saturating_sub(spans + DEGREE));
                let cost = criterion(left, of_spline, r.len());
                if cost < even.0 {
                    *even = (cost, left / free.max(1) as f64);
                }
            }
        }
        let told: Vec<f64> = self.corners.iter().filter(|c| c.order == 3).map(|c| c.time).collect();
        let mut out = Vec::new();
        for j in (0..s.dof).filter(|&j| self.noise[j] > 0.0) {
            let (q, sigma) = (self.positions(j), self.noise[j]);
            let (cost, scale) = even[j];
            let noise = scale * s.times.len() as f64;
            let positions = Positions { times: s.times, q: &q, sigma, told: &told };
            let Some(found) = positions.planned(noise + PART * (cost - noise), scale) else { return Ok(None) };
            if found.knots.len() * found.plan.multiplicity > MANY {
                return Ok(None);
            }
            for &time in &found.knots {
                out.extend((found.plan.lowest()..=found.plan.degree).map(|order| Kink { joint: j, time, order }));
            }
        }
        Ok(Some(out))
    }
    /// These with ramps in place of jumps where positions say so ([`Pieces::ramps`]); `None` where no joint has any. Allocates.
    pub(super) fn ramps(&self, pieces: &[Kink]) -> Option<Vec<Kink>> {
        let mut any = false;
        let mut out = Vec::with_capacity(pieces.len());
        for own in pieces.chunk_by(|a, b| a.joint == b.joint) {
            let (j, mut own) = (own[0].joint, own.to_vec());
            any |= Pieces { times: self.samples.times, q: &self.positions(j), sigma: self.noise[j] }.ramps(j, &mut own);
            out.extend(own);
        }
        any.then_some(out)
    }
    /// These, and on all joints that move the instants at which torques bend, in place of bends next to them. A jump of the torques is somewhere between two
    /// readings; positions tell better when, and where torques jump often they are left to it. Allocates.
    pub(super) fn at_corners(&self, pieces: &[Kink]) -> Vec<Kink> {
        let s = self.samples;
        let next = TAKEN * s.times[s.times.len() - 1] / (s.times.len() - 1) as f64;
        let of = |order: usize| self.corners.iter().filter(move |c| c.order == order);
        if of(2).count() > of(3).count() / 2 {
            return pieces.to_vec();
        }
        let near = |time: f64| move |other: f64| (other - time).abs() < next;
        let mut out: Vec<Kink> = Vec::with_capacity(pieces.len());
        for joint in (0..s.dof).filter(|&j| self.noise[j] > 0.0) {
            let own = || pieces.iter().filter(move |k| k.joint == joint);
            let bends: Vec<&Corner> = of(3).filter(|c| !of(2).any(|other| near(c.time)(other.time))).collect();
            out.extend(own().filter(|k| !bends.iter().any(|c| near(k.time)(c.time))));
            out.extend(bends.iter().map(|c| Kink { joint, time: c.time, order: c.order }));
        }
        out
    }
    /// Of joint `j`.
    fn positions(&self, j: usize) -> Vec<f64> {
        self.samples.q.iter().skip(j).step_by(self.samples.dof).copied().collect()
    }
    /// The kinks that stand out of splines with knots `spacing` apart, of those that are `known` and beside them on the same joints. Allocates.
    pub(super) fn kinks(&self, spacing: f64, known: &[Kink]) -> Result<Vec<Kink>, FitError> {
        let s = self.samples;
        let (n, m) = (s.dof, s.times.len());
        let end = s.times[m - 1];
        let windows = (spans(s, spacing) / WINDOW).max(1);
        let length = end / windows as f64;
        let mut out = Vec::new();
        for w in 0..windows {
            let core = w as f64 * length..(w + 1) as f64 * length;
            let from = s.times.partition_point(|t| *t < core.start - MARGIN * spacing);
            let to = s.times.partition_point(|t| *t <= core.end + MARGIN * spacing);
            let begin = s.times[from];
            let times: Vec<f64> = s.times[from..to].iter().map(|t| t - begin).collect();
            let part = JointSamples { times: &times, q: &s.q[from * n..to * n], qd: None, ..*s };
            if times.len() < DEGREE + 2 {
                continue;
            }
            let mut window = Window::new(&part, spacing)?;
            window.told = self.corners.iter().filter(|c| c.order == 3).map(|c| c.time - begin).collect();
            for j in (0..n).filter(|&j| self.noise[j] > 0.0 && known.iter().any(|k| k.joint == j)) {
                let own =
                    known.iter().filter(|k| k.joint == j && (begin..=begin + times[times.len() - 1]).contains(&k.time));
                let own = own.map(|k| Kink { time: k.time - begin, ..*k }).collect();
                let found = window.kinks(j, self.noise[j], self.steps[j], own)?;
                let last = w + 1 == windows;
                let back = found.into_iter().map(|k| Kink { time: k.time + begin, ..k });
                out.extend(back.filter(|k| core.contains(&k.time) || last && k.time >= core.end));
            }
        }
        Ok(out)
    }
    /// The record without these kinks, of the sizes that they have beside a spline with such knots. Allocates.
    pub(super) fn without(&self, spacing: f64, kinks: &[Kink]) -> Result<Smooth, FitError> {
        let s = self.samples;
        let basis = SplineBasis::new(s, spans(s, spacing), DEGREE, false)?;
        let smooth = basis.smooth(s);
        let mut out = Smooth { q: s.q.to_vec(), qd: s.qd.map(<[f64]>::to_vec) };
        for j in 0..s.dof {
            let own: Vec<Kink> = kinks.iter().filter(|k| k.joint == j).copied().collect();
            let bent = basis.bend(s, j, &own, &smooth.row(j).transpose())?;
            for (column, size) in bent.columns.iter().zip(bent.sizes.iter()) {
                for i in SplineBasis::covered(s.times, column) {
                    let t = s.times[i];
                    let (first, rows) = basis.knots.local::<2>(t);
                    let at = |r: usize| size * column.at(t, r, (first, &rows[r][..=DEGREE]), 0.0);
                    out.q[i * s.dof + j] -= at(0);
                    if let Some(qd) = &mut out.qd {
                        qd[i * s.dof + j] -= at(1);
                    }
                }
            }
        }
        Ok(out)
    }
}

/// A part of a record.
struct Window<'a> {
    s: &'a JointSamples<'a>,
    spacing: f64,
    basis: SplineBasis,
    smooth: nalgebra::DMatrix<f64>,
    /// Squares of columns that the spline leaves, by order and phase.
    squares: HashMap<(usize, i64), f64>,
    /// Instants of bends that torques tell (s).
    told: Vec<f64>,
}

/// A kink that may be one.
struct Candidate {
    kink: Kink,
    fall: f64,
}

impl<'a> Window<'a> {
    fn new(s: &'a JointSamples<'a>, spacing: f64) -> Result<Self, FitError> {
        let spans = spans(s, spacing);
        let basis = SplineBasis::new(s, spans, DEGREE, false)?;
        let smooth = basis.smooth(s);
        let spacing = s.times[s.times.len() - 1] / spans as f64;
        Ok(Self { s, spacing, basis, smooth, squares: HashMap::new(), told: Vec::new() })
    }
    /// Those of joint `j`, beside those that are known.
    fn kinks(&mut self, j: usize, sigma: f64, step: f64, known: Vec<Kink>) -> Result<Vec<Kink>, FitError> {
        let mut kinks = known;
        if !kinks.is_empty() {
            self.settle(j, sigma, &mut kinks)?;
        }
        for _ in 0..ROUNDS {
            let found = self.looked(j, sigma, step, &kinks)?;
            if found.is_empty() {
                break;
            }
            let before = kinks.len();
            kinks.extend(found);
            self.settle(j, sigma, &mut kinks)?;
            if kinks.len() <= before {
                break;
            }
        }
        Ok(kinks)
    }
    fn bend(&self, j: usize, kinks: &[Kink]) -> Result<Bent, FitError> {
        self.basis.bend(self.s, j, kinks, &self.smooth.row(j).transpose())
    }
    /// Samples about this one.
    fn about(&self, i: usize) -> Range<usize> {
        let m = self.s.times.len();
        let half = ((NEAR * self.spacing * (m - 1) as f64 / self.s.times[m - 1]).ceil() as usize).max(2);
        i.saturating_sub(half)..(i + half).min(m - 1) + 1
    }
    /// Samples about which residuals stand out of the noise.
    fn restless(&self, r: &[f64], sigma: f64) -> Vec<usize> {
        let m = r.len();
        let mut sums = vec![0.0; m + 1];
        (0..m).for_each(|i| sums[i + 1] = sums[i] + (r[i] / sigma).powi(2));
        let is_restless = |i: &usize| {
            let near = self.about(*i);
            let count = near.len() as f64;
            sums[near.end] - sums[near.start] > count + RESTLESS * (2.0 * count).sqrt()
        };
        (2..m.saturating_sub(2)).filter(is_restless).collect()
    }
    /// What stands out of the residuals, the farthest first.
    fn looked(&mut self, j: usize, sigma: f64, step: f64, kinks: &[Kink]) -> Result<Vec<Kink>, FitError> {
        let (s, m) = (self.s, self.s.times.len());
        let r = if kinks.is_empty() {
            self.basis.residuals(s, j, &self.smooth.row(j).transpose(), core::iter::empty())
        } else {
            let bent = self.bend(j, kinks)?;
            let each = bent.sizes.iter().zip(&bent.columns).map(|(size, c)| (*size, self.basis.values(s.times, c)));
            self.basis.residuals(s, j, &bent.control, each)
        };
        let restless = self.restless(&r, sigma);
        if restless.len() as f64 > EVERYWHERE * m as f64 {
            return Ok(Vec::new());
        }
        let mut found: Vec<Candidate> = Vec::new();
        for i in restless {
            if r[self.about(i)].iter().fold(0.0, |l: f64, x| l.max(x.abs())) < STEPPED * step {
                continue;
            }
            for order in [2, 3] {
                let kink = Kink { joint: j, time: 0.5 * (s.times[i] + s.times[i + 1]), order };
                let (range, values) = self.basis.values(s.times, &Column::new(&self.basis.knots, kink));
                let phase = (PHASES * (kink.time / self.spacing).fract()).round() as i64;
                let left = || self.basis.squares_left(&range, &values);
                let left = *self.squares.entry((order, phase)).or_insert_with(left);
                let score: f64 = values.iter().zip(&r[range]).map(|(x, r)| x * r).sum();
                let fall = score * score / (left * sigma * sigma);
                if left > 0.0 && fall > SEEN {
                    found.push(Candidate { kink, fall });
                }
            }
        }
        found.sort_by(|a, b| b.fall.total_cmp(&a.fall));
        let mut taken: Vec<Candidate> = Vec::new();
        for c in found {
            let hidden = |t: &Candidate| {
                let apart = (t.kink.time - c.kink.time).abs() / self.spacing;
                apart < APART || apart < BESIDE && c.fall < LESS * t.fall
            };
            if !taken.iter().any(hidden) {
                taken.push(c);
            }
        }
        Ok(taken.into_iter().map(|c| c.kink).collect())
    }
    /// Refines the times of kinks, and takes out those that are none beside the others.
    fn settle(&self, j: usize, sigma: f64, kinks: &mut Vec<Kink>) -> Result<(), FitError> {
        for _ in 0..STEPS {
            self.refine(j, kinks);
        }
        loop {
            if kinks.is_empty() {
                return Ok(());
            }
            let mut out = match self.bend(j, kinks) {
                Ok(bent) => {
                    let fall = |i: usize| bent.sizes[i].powi(2) / (bent.variances[i] * sigma * sigma);
                    let least = |i: usize| if self.is_told(&kinks[i]) { SIZED } else { KEPT * SEEN };
                    let over: Vec<f64> = (0..kinks.len()).map(|i| fall(i) / least(i)).collect();
                    let mut weak: Vec<usize> = (0..kinks.len()).filter(|&i| over[i] < 1.0).collect();
                    weak.sort_by(|&a, &b| over[a].total_cmp(&over[b]));
                    // Those that are far from one another at once: one that goes leaves what it was to its neighbours.
                    let mut out: Vec<usize> = Vec::new();
                    for i in weak {
                        let beside = |&o: &usize| (kinks[o].time - kinks[i].time).abs() < BESIDE * self.spacing;
                        if !out.iter().any(beside) {
                            out.push(i);
                        }
                    }
                    if out.is_empty() {
                        return Ok(());
                    }
                    out
                }
                Err(FitError::Undetermined { time }) => {
                    let off = |i: &usize| (kinks[*i].time - time).abs();
                    vec![(0..kinks.len()).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(0)]
                }
                Err(e) => return Err(e),
            };
            out.sort_unstable();
            out.into_iter().rev().for_each(|i| {
                kinks.remove(i);
            });
        }
    }
    /// One Gauss-Newton step of the times; none where they are not told.
    fn refine(&self, j: usize, kinks: &mut [Kink]) {
        let end = self.s.times[self.s.times.len() - 1];
        let free: Vec<usize> = (0..kinks.len()).filter(|&k| !self.is_told(&kinks[k])).collect();
        if free.is_empty() {
            return;
        }
        let lower = free.iter().map(|&k| kinks[k].by_time());
        let both: Vec<Kink> = kinks.iter().copied().chain(lower).collect();
        let Ok(bent) = self.bend(j, &both) else { return };
        let count = kinks.len();
        let steps: DVector<f64> = DVector::from_fn(free.len(), |i, _| -bent.sizes[count + i] / bent.sizes[free[i]]);
        for (&k, step) in free.iter().zip(steps.iter()).filter(|(_, step)| step.is_finite()) {
            let time = kinks[k].time + step.clamp(-FAR * self.spacing, FAR * self.spacing);
            kinks[k].time = time.clamp(0.0, end);
        }
    }
    /// Whether it is a bend whose instant torques tell, which the positions then do not move.
    fn is_told(&self, kink: &Kink) -> bool {
        kink.order == 3 && self.told.iter().any(|t| (t - kink.time).abs() < SAME)
    }
}

/// Standard deviation of the positions of every joint by the middle one of their sixth differences, which bursts here and there do not raise; no more
/// than the `estimated` one, which it is at uneven times. Allocates.
pub(super) fn usual_noise(s: &JointSamples<'_>, estimated: &[f64]) -> Vec<f64> {
    /// Middle of the absolute values of a normal distribution.
    const MIDDLE: f64 = 0.674_49;
    if is_even(s.times).is_err() {
        return estimated.to_vec();
    }
    let of = |j: usize| {
        let mut all: Vec<f64> = sixth_differences(s, j).map(f64::abs).collect();
        if all.is_empty() {
            return None;
        }
        let middle = all.len() / 2;
        let middle = *all.select_nth_unstable_by(middle, f64::total_cmp).1;
        Some(middle / (MIDDLE * SIXTH.sqrt())).filter(|s| *s > 0.0)
    };
    estimated.iter().enumerate().map(|(j, &e)| of(j).map_or(e, |s| s.min(e))).collect()
}
