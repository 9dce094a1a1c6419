//! Motions whose acceleration jumps (trapezoidal speed) or bends (limited jerk), from positions with noise alone.

use ff_dynamics::motion::JointMotion;
use ident::motion::{Corner, JointSamples, SpectralFit, Stake, fit_at_stake};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const JOINTS: usize = 3;
const DT: f64 = 0.01;
const SECONDS: f64 = 24.0;
const SIGMA: f64 = 5e-6;

/// Position, rate and acceleration that start at rest, with jumps of a derivative.
struct Pieces {
    /// Time and size of the jumps of the derivative of this order, per joint.
    jumps: Vec<Vec<(f64, f64)>>,
    order: i32,
}

impl Pieces {
    /// Moves one after another, each from rest to rest.
    fn moves(order: i32, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut uniform = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
        let mut of_joint = || {
            let (mut all, mut t) = (Vec::new(), uniform(0.3, 0.9));
            loop {
                let (up, cruise, size) = (uniform(0.3, 0.7), uniform(0.4, 1.2), uniform(0.4, 0.9));
                let sign = if uniform(0.0, 1.0) > 0.5 { 1.0 } else { -1.0 };
                let whole = 2.0 * up + cruise;
                if t + 1.3 * whole > SECONDS - 1.0 {
                    break all;
                }
                // A ramp of the acceleration is made of two jumps of the jerk.
                let mut ramp = |at: f64, size: f64| match order {
                    2 => all.push((at, size)),
                    _ => all.extend([(at, size / 0.17), (at + 0.17, -size / 0.17)]),
                };
                let long = up + if order == 2 { 0.0 } else { 0.17 };
                for (at, s) in [(0.0, 1.0), (long, -1.0), (long + cruise, -1.0), (2.0 * long + cruise, 1.0)] {
                    ramp(t + at, sign * s * size);
                }
                t += 1.3 * whole + uniform(0.2, 0.8);
            }
        };
        Self { jumps: (0..JOINTS).map(|_| of_joint()).collect(), order }
    }
    fn derivative(&self, j: usize, t: f64, r: i32) -> f64 {
        let factorial = |n: i32| (1..=n).map(f64::from).product::<f64>();
        let left = self.order - r;
        let of = |&(at, size): &(f64, f64)| if t > at { size * (t - at).powi(left) / factorial(left) } else { 0.0 };
        self.jumps[j].iter().map(of).sum()
    }
}

fn read(of: impl Fn(usize, f64) -> f64, seed: u64) -> (Vec<f64>, Vec<f64>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let times: Vec<f64> = (0..=(SECONDS / DT) as usize).map(|i| DT * i as f64).collect();
    let mut noise = || -> f64 { StandardNormal.sample(&mut rng) };
    let q = times.iter().flat_map(|&t| (0..JOINTS).map(|j| of(j, t)).collect::<Vec<_>>()).map(|q| q + SIGMA * noise());
    let q = q.collect();
    (times, q)
}

fn fitted(times: &[f64], q: &[f64], kinks: bool) -> SpectralFit {
    fitted_with(times, q, kinks, Vec::new())
}

fn fitted_with(times: &[f64], q: &[f64], kinks: bool, corners: Vec<Corner>) -> SpectralFit {
    let s = JointSamples { dof: JOINTS, times, q, qd: None, rate_weight: 0.0 };
    let stake = Stake { weights: vec![170.0; JOINTS], rates: Vec::new(), free: 1e-3 * JOINTS as f64, kinks, corners };
    fit_at_stake(&s, None, &stake).unwrap()
}

/// Mean square of the error of the acceleration two samples and more from any kink.
fn error(fit: &SpectralFit, truth: &Pieces) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    let mut x = [[0.0; JOINTS]; 3];
    for i in 0..4000 {
        let t = 0.5 + (SECONDS - 1.0) * (f64::from(i) + 0.31) / 4000.0;
        if truth.jumps.iter().flatten().any(|k| (k.0 - t).abs() < 2.0 * DT) {
            continue;
        }
        let [q, qd, qdd] = &mut x;
        fit.fit.motion.eval(t, q, qd, qdd);
        sum += (0..JOINTS).map(|j| (x[2][j] - truth.derivative(j, t, 2)).powi(2)).sum::<f64>();
        count += JOINTS;
    }
    sum / f64::from(u32::try_from(count).unwrap())
}

#[test]
fn jumps_of_the_acceleration_are_found_in_positions_to_a_millisecond() {
    let truth = Pieces::moves(2, 3);
    let (times, q) = read(|j, t| truth.derivative(j, t, 0), 7);
    let (without, with) = (fitted(&times, &q, false), fitted(&times, &q, true));
    let expected: usize = truth.jumps.iter().map(Vec::len).sum();
    let found: Vec<_> = with.fit.motion.kinks().collect();
    eprintln!("{} of {expected} kinks, knots {} s for {} s", found.len(), with.fit.spacing, without.fit.spacing);
    for (j, all) in truth.jumps.iter().enumerate() {
        for (at, size) in all {
            let near = found.iter().filter(|(k, _)| k.joint == j && k.order == 2);
            let off = |k: &ident::motion::Kink| (k.time - at).abs();
            let nearest = near.min_by(|a, b| off(&a.0).total_cmp(&off(&b.0))).unwrap();
            assert!(off(&nearest.0) < 1e-3 && (nearest.1 / size - 1.0).abs() < 0.05, "{j} {at} {size}: {nearest:?}");
        }
    }
    assert_eq!(found.len(), expected);
    let (before, now) = (error(&without, &truth), error(&with, &truth));
    eprintln!("acceleration {} and {} rad/s^2", before.sqrt(), now.sqrt());
    // A thousandth of what the torque sensors see, by the stake.
    assert!(now < 0.01 * before && 170.0 * now.sqrt() < 0.3, "{before:e} {now:e}");
}

#[test]
fn bends_of_the_acceleration_are_found_and_what_is_smooth_has_none() {
    let truth = Pieces::moves(3, 5);
    let (times, q) = read(|j, t| truth.derivative(j, t, 0), 9);
    let (without, with) = (fitted(&times, &q, false), fitted(&times, &q, true));
    let (before, now) = (error(&without, &truth), error(&with, &truth));
    eprintln!("{} kinks, acceleration {} and {} rad/s^2", with.fit.motion.kinks().count(), before.sqrt(), now.sqrt());
    assert!(now < 0.05 * before, "{before:e} {now:e}");
    let tones = |j: usize, t: f64| {
        let w = 2.1 + 0.7 * j as f64;
        0.4 * (w * t).sin() + 0.11 * (2.3 * w * t + 0.6).cos()
    };
    let (times, q) = read(tones, 11);
    let (without, with) = (fitted(&times, &q, false), fitted(&times, &q, true));
    assert_eq!(with.fit.motion.kinks().count(), 0);
    assert_eq!((with.fit.spacing, with.fit.motion.spline()), (without.fit.spacing, without.fit.motion.spline()));
}

/// With encoders ten times worse bends hide in the noise; instants that torques tell bring them back, on the joints that they are of.
#[test]
#[ignore = "full tier: 8 s"]
fn instants_that_torques_tell_are_taken_and_sized_by_positions() {
    let truth = Pieces::moves(3, 5);
    let (times, q) = read(|j, t| truth.derivative(j, t, 0), 9);
    let mut rng = ChaCha8Rng::seed_from_u64(21);
    let noisy: Vec<f64> =
        q.iter().map(|q| q + 10.0 * SIGMA * Distribution::<f64>::sample(&StandardNormal, &mut rng)).collect();
    // Torques tell instants to a part of an interval.
    let mut corners: Vec<Corner> = truth
        .jumps
        .iter()
        .flatten()
        .map(|k| Corner { time: k.0 + 0.2 * DT * (rng.random::<f64>() - 0.5), order: 3 })
        .collect();
    corners.sort_by(|a, b| a.time.total_cmp(&b.time));
    let (without, with) = (fitted(&times, &noisy, true), fitted_with(&times, &noisy, true, corners.clone()));
    let (before, now) = (error(&without, &truth), error(&with, &truth));
    let found: Vec<_> = with.fit.motion.kinks().collect();
    eprintln!("{} kinks, acceleration {} and {} rad/s^2", found.len(), before.sqrt(), now.sqrt());
    // Less than a deviation of what the torque sensors see, by the stake.
    assert!(now < 0.8 * before && 170.0 * now.sqrt() < 1.0, "{before:e} {now:e}");
    let own = |k: &ident::motion::Kink| truth.jumps[k.joint].iter().any(|t| (t.0 - k.time).abs() < DT);
    let strangers = found.iter().filter(|(k, _)| !own(k)).count();
    assert!(strangers * 4 < found.len(), "{strangers} of {}", found.len());
    // Corners of the torques that are none of the motion, such as those of friction, find no size.
    let tones = |j: usize, t: f64| 0.4 * ((2.1 + 0.7 * j as f64) * t).sin();
    let (times, q) = read(tones, 11);
    let with = fitted_with(&times, &q, true, corners);
    assert_eq!(with.fit.motion.kinks().count(), 0);
}
