//! A low-pass filter that shifts nothing in time and keeps every sample: Butterworth, run forwards and backwards.

use ff_testkit::assert_within;
use ident::motion::*;
use std::f64::consts::PI;

/// Amplitude and largest error of a filtered sine in the middle of a record.
fn sine(z: &ZeroPhase, rate: f64, hz: f64) -> (f64, f64) {
    let wave = |i: usize| (2.0 * PI * hz * i as f64 / rate + 0.7).sin();
    let mut x: Vec<f64> = (0..12_000).map(wave).collect();
    z.run(&mut x);
    let middle = 5000..7000;
    let (mut top, mut bottom) = (0.0, 0.0);
    middle.clone().for_each(|i| (top, bottom) = (top + x[i] * wave(i), bottom + wave(i) * wave(i)));
    let gain: f64 = top / bottom;
    (gain, middle.map(|i| (x[i] - gain * wave(i)).abs()).fold(0.0, f64::max))
}

#[test]
fn the_gain_is_that_of_a_butterworth_filter_twice_and_nothing_is_shifted() {
    for (rate, cutoff) in [(250.0, 8.0), (1000.0, 4.0), (100.0, 10.0)] {
        let z = ZeroPhase::new(rate, cutoff).unwrap();
        for part in [0.1, 0.5, 0.9, 1.0, 1.3, 3.0] {
            let hz = part * cutoff;
            let ratio: f64 = (PI * hz / rate).tan() / (PI * cutoff / rate).tan();
            let (gain, error) = sine(&z, rate, hz);
            let want = 1.0 / (1.0 + ratio.powi(8));
            assert!((gain - want).abs() < 1e-6 && error < 1e-6, "{hz} of {cutoff} Hz: {gain}, {want}, {error:e}");
        }
    }
}

#[test]
fn lines_pass_unchanged_to_their_ends_and_white_noise_by_its_share() {
    let z = ZeroPhase::new(250.0, 8.0).unwrap();
    let line = |i: usize| 3.7 - 0.013 * i as f64;
    let mut x: Vec<f64> = (0..2000).map(line).collect();
    z.run(&mut x);
    assert!(x.iter().enumerate().all(|(i, v)| (v - line(i)).abs() < 1e-6));
    // int_0^inf 1 / (1 + u^8)^2 du = 7/8 pi/8 / sin(pi/8) of the cutoff, for a cutoff far below the rate.
    let slow = ZeroPhase::new(1000.0, 2.0).unwrap();
    let share = 2.0 * 2.0 / 1000.0 * 7.0 / 8.0 * (PI / 8.0) / (PI / 8.0).sin();
    assert_within!((slow.noise_gain() / share - 1.0).abs(), 1e-3, "{} {share}", slow.noise_gain());
    // What happens beyond the transient of an end does not touch it.
    let wave = |i: usize| (0.02 * i as f64).sin() + (0.9 * i as f64).cos();
    let (mut whole, mut part): (Vec<f64>, Vec<f64>) = ((0..3000).map(wave).collect(), (700..2300).map(wave).collect());
    z.run(&mut whole);
    z.run(&mut part);
    let worst = |cut: usize| (cut..1600 - cut).map(|i| (part[i] - whole[700 + i]).abs()).fold(0.0, f64::max);
    assert!(worst(z.transient()) < 0.02 && worst(4 * z.transient()) < 1e-6, "{}", worst(z.transient()));
}

#[test]
fn short_signals_and_cutoffs_out_of_range() {
    for (rate, cutoff) in [(250.0, 26.0), (250.0, 0.0), (250.0, f64::NAN), (0.0, 1.0), (1e6, 1.0)] {
        assert_eq!(ZeroPhase::new(rate, cutoff), None, "{cutoff} of {rate}");
    }
    let z = ZeroPhase::new(100.0, 5.0).unwrap();
    for n in 0..5 {
        let mut x = vec![0.75; n];
        z.run(&mut x);
        assert!(x.iter().all(|v| (v - 0.75).abs() < 1e-12), "{x:?}");
    }
}
