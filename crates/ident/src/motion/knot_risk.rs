//! What a knot spacing costs in acceleration: noise let through, and motion bent.
//!
//! Torques follow accelerations, so that knots are judged by accelerations, not by how near the spline is to the positions: an
//! error of `1e-6` rad at 3 Hz is nothing in position, and 4e-4 rad/s^2 times an inertia of 150 kg m^2 in torque.
//!
//! **Noise.** A least-squares spline of degree `p` with a knot every `h` is the projection onto the splines (many samples per
//! knot). White noise of deviation `s`, sampled every `dt`, has in the second derivative the variance, averaged over a span,
//!
//! ```text
//! V(h) = s^2 dt / h^5 (1 / 2 pi) int_-pi^pi  S4(w) / (S0(w) + (rho/h)^2 S2(w)) dw,
//! Sk(w) = sum_l (w + 2 pi l)^k sinc((w + 2 pi l) / 2)^(2 p + 2)
//! ```
//!
//! with `rho` the deviation of positions over that of rates (0 without rates); `V = 20.1 s^2 dt / h^5` for degree 7 and no rates.
//!
//! **Bias.** What finer knots change beyond their own noise must have been bent (Goldenshluger, Lepski, *Ann. Statist.* 39, 2011, 1608,
//! here with the mean square over the record):
//!
//! ```text
//! B^2(h) = max over h' < h of [ mean |a_h - a_h'|^2 - kappa V(h') ]_+
//! ```
//!
//! A bias below the noise of all finer knots is not seen so, but it is the same at all samples, and the tests of a fit see it. Where
//! sensors judge, what coarser knots are seen to bend stands for it: it is taken to fall no faster than that of a smooth motion with fine knots,
//! whose accelerations the splines that judge, of degree 5, bend by `h^4`, so that `B^2(h) >= B^2(2^(1/2) h) 2^-4`.
//!
//! Rates weigh beside accelerations where a gyro feels them: their variance is the same integral over `S2` and `h^3`.

use crate::motion::knot_spectrum::Stake;
use crate::motion::spline_fit::{DEGREE, MotionFit};
use core::f64::consts::{PI, TAU};
use ff_dynamics::motion::JointMotion;

/// Variance of derivative number `order` (1: rate, 2: acceleration) of a least-squares spline with knots `spacing` (s) apart, for samples
/// every `dt` (s) with white noise of unit deviation in position, and of `1 / rho` in rate (`rho` in s; 0 for no rates). In
/// `1 / s^(2 order)`. Equation in the page above.
pub(crate) fn variance_of(order: i32, spacing: f64, dt: f64, rho: f64) -> f64 {
    const POINTS: usize = 48;
    const ALIASES: i32 = 4;
    let power = 2 * (DEGREE as i32 + 1);
    let ratio = (rho / spacing).powi(2);
    let at = |w: f64| {
        let (mut low, mut high) = (0.0, 0.0);
        for l in -ALIASES..=ALIASES {
            let x = w + TAU * f64::from(l);
            let b = ((0.5 * w).sin() / (0.5 * x)).powi(power);
            low += (1.0 + ratio * x * x) * b;
            high += x.powi(2 * order) * b;
        }
        high / low
    };
    let mean = (0..POINTS).map(|i| at(PI * (i as f64 + 0.5) / POINTS as f64)).sum::<f64>() / POINTS as f64;
    mean * dt / spacing.powi(2 * order + 1)
}

/// Part of the gaps between readings that are whole multiples of a step, where others were put in place of a few.
const WHOLE: f64 = 0.98;

/// Step of a channel whose readings, but for some that were put in place of others, are whole multiples of one, counted from the first; `None` for one that is not
/// quantised. Allocates.
pub(crate) fn quantum(x: impl Iterator<Item = f64>) -> Option<f64> {
    let mut sorted: Vec<f64> = x.collect();
    sorted.sort_by(f64::total_cmp);
    let largest = sorted.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let mut gaps: Vec<f64> = sorted.windows(2).map(|w| w[1] - w[0]).filter(|g| *g > 1e-13 * largest).collect();
    gaps.sort_by(f64::total_cmp);
    // A reading that was put in may be nearer to another than a step.
    let others = ((1.0 - WHOLE) * gaps.len() as f64) as usize;
    let first = core::iter::once(0).chain(core::iter::successors(Some(1), |k| Some(2 * k)));
    let steps = first.take_while(|k| *k <= others && gaps.len() > 8).map(|k| gaps[k]);
    let is_step = |step: &f64| {
        // One gap is always a multiple of itself; the rounding of readings leaves a little of every other.
        let slack = 0.01 + 1e-14 * largest / step;
        let whole = |g: &&f64| (*g / step - (*g / step).round()).abs() < slack && **g > 0.5 * step;
        slack < 0.1 && gaps.iter().filter(whole).count() as f64 >= WHOLE * gaps.len() as f64
    };
    // The largest: readings that were put in may be at tenths of it.
    steps.filter(is_step).reduce(f64::max)
}

/// A fit with what its motion is worth at instants that all fits share.
pub(crate) struct Candidate {
    pub(crate) fit: MotionFit,
    /// Accelerations and then rates, each times its weight, instant after instant.
    worth: Vec<f64>,
    /// Weighted variance of both.
    pub(crate) variance: f64,
}

impl Candidate {
    /// `variance` is the sum over joints, each with its weight squared.
    pub(crate) fn new(fit: MotionFit, instants: &[f64], variance: f64, stake: &Stake) -> Self {
        let n = fit.motion.dof();
        let (mut q, mut qd, mut qdd) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let mut worth = Vec::with_capacity(2 * n * instants.len());
        for t in instants {
            fit.motion.eval(*t, &mut q, &mut qd, &mut qdd);
            worth.extend(qdd.iter().zip(&stake.weights).map(|(a, w)| w * a));
            let rates = qd.iter().zip(stake.rates.iter().chain(std::iter::repeat(&0.0)));
            worth.extend(rates.map(|(v, w)| w * v));
        }
        Self { fit, worth, variance }
    }
    /// Weighted mean square of the difference to a finer fit, two spans off the ends, where splines are loose.
    fn difference(&self, finer: &Self, instants: &[f64]) -> f64 {
        let end = self.fit.motion.duration();
        let each = self.worth.len() / instants.len().max(1);
        let inside = 2.0 * self.fit.spacing..end - 2.0 * self.fit.spacing;
        let (mut sum, mut count) = (0.0, 0usize);
        let both = self.worth.chunks_exact(each).zip(finer.worth.chunks_exact(each));
        for (_, (a, b)) in instants.iter().zip(both).filter(|(t, _)| inside.contains(*t)) {
            sum += a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
            count += 1;
        }
        sum / count.max(1) as f64
    }
}

/// How much more a bias counts than noise of the same size: it does not average out.
const BIAS_COUNTS: f64 = 4.0;

/// `B^2` of every candidate, coarse to fine: see the page above. The finest has none to be compared with.
pub(crate) fn biases(candidates: &[Candidate], instants: &[f64]) -> Vec<f64> {
    let of = |i: usize| {
        let finer = candidates[i + 1..].iter();
        let excess = finer.map(|f| {
            let points = (f.fit.motion.duration() / f.fit.spacing).max(1.0);
            // Four deviations of a mean of that many squares, and a tenth for noise figures a little too low.
            let kappa = 1.2 + 4.0 * (2.0 / points).sqrt();
            candidates[i].difference(f, instants) - kappa * f.variance
        });
        excess.fold(0.0, f64::max)
    };
    (0..candidates.len()).map(of).collect()
}

/// Degree of the splines that spacings are judged by, two less than that of the motion: a kink in the accelerations is bent as far as the knots are wide, and
/// too little of the record to be seen in its mean; what a lower degree bends elsewhere keeps knots near enough.
pub(crate) const JUDGED: usize = 5;

/// What is seen of the biases, bounded from below by what coarser knots are seen to bend: see the page above.
fn bounded(candidates: &[Candidate], seen: &[f64]) -> Vec<f64> {
    let mut all = seen.to_vec();
    for i in 1..all.len() {
        let finer = candidates[i].fit.spacing / candidates[i - 1].fit.spacing;
        all[i] = all[i].max(all[i - 1] * finer.powi(2 * (JUDGED as i32 - 1)));
    }
    all
}

/// `4 B^2 + max(V, free)` of every candidate: noise up to `free` costs nothing. Without noise that is free no sensor judges, and biases count as far
/// as they are seen.
pub(crate) fn cost(candidates: &[Candidate], seen: &[f64], free: f64) -> Vec<f64> {
    let biases = if free > 0.0 { bounded(candidates, seen) } else { seen.to_vec() };
    candidates.iter().zip(biases).map(|(c, b)| BIAS_COUNTS * b + c.variance.max(free)).collect()
}

/// The candidate, from number `follow` on, with the smallest cost; the finest of equals is taken.
pub(crate) fn best(candidates: &[Candidate], seen: &[f64], follow: usize, free: f64) -> usize {
    let cost = cost(candidates, seen, free);
    (follow..candidates.len()).fold(follow, |best, i| if cost[i] <= cost[best] { i } else { best })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::spline_fit::{JointSamples, fit_motion};
    use approx::assert_relative_eq;
    use ff_testkit::scaled;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, Normal};

    /// Variances of the rates and accelerations fitted to noise, away from the ends.
    fn measured(rates: Option<f64>) -> [f64; 2] {
        const N: usize = 40_000;
        let (mut rng, normal) = (ChaCha8Rng::seed_from_u64(5), Normal::new(0.0, 1.0).unwrap());
        let times: Vec<f64> = (0..N).map(|i| 0.01 * i as f64).collect();
        let q: Vec<f64> = times.iter().map(|_| normal.sample(&mut rng)).collect();
        let qd: Vec<f64> = times.iter().map(|_| normal.sample(&mut rng) / rates.unwrap_or(1.0)).collect();
        let rate_weight = rates.unwrap_or(1.0);
        let s = JointSamples { dof: 1, times: &times, q: &q, qd: rates.map(|_| &qd[..]), rate_weight };
        let fit = fit_motion(&s, 0.16).unwrap();
        let stake = Stake { weights: vec![1.0], rates: vec![1.0], free: 0.0, kinks: false, corners: Vec::new() };
        let c = Candidate::new(fit, &times, 0.0, &stake);
        let inner = &c.worth[400..2 * (N - 200)];
        let of = |k: usize| inner.iter().skip(k).step_by(2).map(|a| a * a).sum::<f64>() / (inner.len() / 2) as f64;
        [of(1), of(0)]
    }

    #[test]
    fn noise_in_rates_and_accelerations_is_as_the_formula_says() {
        assert_relative_eq!(variance_of(2, 1.0, 1.0, 0.0), 20.1063, max_relative = scaled(1e-4));
        let rho = 0.05;
        for (rates, ratio) in [(None, 0.0), (Some(rho), rho)] {
            for (order, measured) in [1, 2].into_iter().zip(measured(rates)) {
                assert_relative_eq!(measured, variance_of(order, 0.16, 0.01, ratio), max_relative = scaled(0.08));
            }
        }
        assert!(variance_of(2, 0.16, 0.01, rho) < 0.8 * variance_of(2, 0.16, 0.01, 0.0));
    }

    #[test]
    fn the_step_of_an_encoder_is_found_and_noise_has_none() {
        let step = TAU / f64::from(1 << 20);
        let q = |i: usize| 0.83 + 0.21 * (0.013 * i as f64).sin();
        let quantised = (0..3000).map(|i| (q(i) / step).round() * step);
        assert_relative_eq!(quantum(quantised).unwrap(), step, max_relative = scaled(1e-3));
        assert_eq!(quantum((0..3000).map(q)), None);
        assert_eq!(quantum([0.3; 40].into_iter()), None);
    }
}
