//! How dense the knots of a fitted joint motion need be.

use ff_dynamics::motion::JointMotion;
use ff_testkit::assert_within;
use ident::motion::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

const RATE: f64 = 50.0;
const N: usize = 2000;

/// Two joints: a slow ramped sine and one with a tone at 0.9 Hz; noise `s`, coloured by `a`.
fn positions(s: f64, a: f64, seed: u64) -> (Vec<f64>, Vec<f64>) {
    let (mut rng, normal) = (ChaCha8Rng::seed_from_u64(seed), Normal::new(0.0, 1.0).unwrap());
    let times: Vec<f64> = (0..N).map(|i| i as f64 / RATE).collect();
    let mut c = [0.0; 2];
    let mut q = Vec::new();
    for t in &times {
        for (j, c) in c.iter_mut().enumerate() {
            *c = a * *c + (1.0 - a * a).sqrt() * normal.sample(&mut rng);
            q.push(truth(*t, j) + s * *c);
        }
    }
    (times, q)
}
fn truth(t: f64, j: usize) -> f64 {
    let tone = if j == 1 { 0.004 * (core::f64::consts::TAU * 0.9 * t).sin() } else { 0.0 };
    0.3 * (0.4 * t + j as f64).sin() + 0.01 * t + tone
}

#[test]
fn the_band_ends_at_the_fastest_motion_and_the_acceleration_follows_it() {
    let (times, q) = positions(2e-5, 0.0, 1);
    let s = JointSamples { dof: 2, times: &times, q: &q, qd: None, rate_weight: 0.0 };
    let f = fit_by_spectrum(&s, None).unwrap();
    // The window of 16 s spreads a line that stands 200 deviations out over a few tenths of a hertz.
    assert!((0.9..1.4).contains(&f.bands[1]) && f.bands[0] < 0.7, "{:?}", f.bands);
    assert_eq!(f.reason, KnotReason::AccelerationsSettled);
    let (mut y, mut yd, mut ydd) = ([0.0; 2], [0.0; 2], [0.0; 2]);
    let mut worst = 0.0f64;
    for i in 100..N - 100 {
        let t = times[i] + 0.004;
        f.fit.motion.eval(t, &mut y, &mut yd, &mut ydd);
        let w = core::f64::consts::TAU * 0.9;
        let exact = -0.3 * 0.16 * (0.4 * t + 1.0).sin() - 0.004 * w * w * (w * t).sin();
        worst = worst.max((ydd[1] - exact).abs());
    }
    assert!(worst < 0.04 * 0.004 * 32.0, "{worst}");
}

#[test]
fn a_noise_figure_a_tenth_too_low_does_not_drive_the_knots_to_the_samples() {
    let (times, q) = positions(1e-4, 0.0, 2);
    let s = JointSamples { dof: 2, times: &times, q: &q, qd: None, rate_weight: 0.0 };
    let low = [9e-5, 9e-5];
    let free = ident::motion::choose_knots(&s, Some(&low)).unwrap();
    let f = fit_by_spectrum(&s, Some(&low)).unwrap();
    assert!(f.fit.spacing > 2.0 * free.spacing, "{} {}", f.fit.spacing, free.spacing);
    let right = fit_by_spectrum(&s, Some(&[1e-4, 1e-4])).unwrap();
    assert_eq!((right.fit.spacing, right.reason), (f.fit.spacing, KnotReason::AccelerationsSettled));
}

#[test]
fn slow_noise_is_not_followed() {
    // Noise that is mostly below 1 Hz: differences see a tenth of it, and would have the knots follow it.
    let (times, q) = positions(3e-4, 0.95, 2);
    let s = JointSamples { dof: 2, times: &times, q: &q, qd: None, rate_weight: 0.0 };
    let free = ident::motion::choose_knots(&s, Some(&[1e-5, 1e-5])).unwrap();
    let f = fit_by_spectrum(&s, Some(&[3e-4, 3e-4])).unwrap();
    assert!(f.fit.spacing > 3.0 * free.spacing, "{} {}", f.fit.spacing, free.spacing);
}

#[test]
fn too_few_samples_and_wrong_noise_are_refused() {
    let (times, q) = positions(1e-4, 0.0, 3);
    let s = JointSamples { dof: 2, times: &times[..40], q: &q[..80], qd: None, rate_weight: 0.0 };
    assert!(matches!(fit_by_spectrum(&s, None), Err(KnotError::Fit(FitError::Length { got: 40, .. }))));
    let s = JointSamples { times: &times, q: &q, ..s };
    assert!(fit_by_spectrum(&s, Some(&[1e-4])).is_err());
    // Without noise, all there is to follow is followed.
    let (times, q) = positions(0.0, 0.0, 3);
    let s = JointSamples { times: &times, q: &q, ..s };
    let f = fit_by_spectrum(&s, None).unwrap();
    assert_within!(f.fit.residual[1], 1e-7, "{:?} {:?}", f.fit.residual, f.reason);
}
