//! Stiffness, damping (and whatever else is chosen) from measured frequencies and damping ratios.

use crate::modal_model::load;
use ff_dynamics::Boundary;
use ff_model::{Model, Params};
use ff_spectral::ModalFit;
use ff_spectral::era::{Stabilisation, Tolerance};
use ff_spectral::modal::Mode;
use ff_testkit::assert_within;
use ident::modal::*;
use ident::parameters::select;
use nalgebra::Complex;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

const POSE: [f64; 7] = [1.57, 1.4, 0.1, -2.6, 0.2, 2.4, -0.3];

fn sigma() -> Vec<f64> {
    [[0.1; 7].as_slice(), &[1.5e-4; 3]].concat()
}

/// A fit that found these modes of a model at amplitude `joule`, `noise` deviations off.
fn measured(modes: &[ModelMode], joule: f64, deviation: (f64, f64), noise: [f64; 2]) -> ModalFit {
    let of = |(i, m): (usize, &ModelMode)| {
        let sign = if i % 2 == 0 { 1.0 } else { -0.6 };
        let a: Vec<Complex<f64>> =
            m.channels.iter().map(|x| x * joule.sqrt() * Complex::from_polar(1.0, 0.7 * i as f64)).collect();
        Mode {
            frequency: m.frequency() + sign * noise[0] * deviation.0,
            frequency_deviation: deviation.0,
            damping: m.damping() + sign * noise[1] * deviation.1,
            damping_deviation: deviation.1,
            covariance: 0.1 * deviation.0 * deviation.1,
            amplitude: a.iter().map(|x| x.norm()).collect(),
            amplitude_deviation: vec![1e-4; a.len()],
            phase: a.iter().map(|x| x.arg()).collect(),
            phase_deviation: vec![1e-3; a.len()],
            consistency: 0.98,
            snr: a.iter().zip(sigma()).map(|(a, s)| (a.norm() / s).powi(2)).sum::<f64>().sqrt(),
        }
    };
    let stabilisation = Stabilisation { orders: vec![], tolerance: Tolerance::default(), chosen: 9 };
    ModalFit {
        modes: modes.iter().enumerate().map(of).collect(),
        unresolved: vec![],
        order: 9,
        dropped: 0,
        singular_values: vec![],
        stabilisation,
        seconds: 100.0,
        df: 0.01,
        noise_ratio: 1.0,
    }
}

/// Hinges between 0.5 and 1.5 of the paper's, all unequal.
fn truth(model: &Model) -> Vec<f64> {
    let mut v = Params::<f64>::nominal(model).values().to_vec();
    for (i, d) in model.param_decls().iter().enumerate() {
        if d.name.contains(".k[") || d.name.contains(".d[") {
            v[i] *= 0.55 + 0.31 * ((i * 7) % 4) as f64;
        }
    }
    v
}

#[test]
fn hinges_come_back_from_their_modes_with_honest_deviations() {
    let l = load("flex");
    let (m, decls) = (&l.model, l.model.param_decls());
    let v = truth(m);
    let eta = vec![0.0; 4];
    let pose = HeldPose { q: &POSE, eta: &eta, boundary: Boundary::JointsHeld };
    let modes = ModalModel::new(m, &Params::from_values(m, v.clone()), &pose).unwrap();
    let selected = select(&decls, &["*.k[*]", "*.d[*]"]).unwrap();
    let start = Params::<f64>::nominal(m).values().to_vec();
    let s = sigma();
    let mut request = ModalRequest::new(m, pose, (&decls, &selected, &start), &s, 1.5);
    request.floor = (1e-12, 1e-12);
    let found = estimate_modal(&request, &measured(modes.modes(), 0.3, (1e-5, 1e-5), [0.0; 2])).unwrap();
    assert_eq!((found.matching.pairs.len(), found.matching.strays.len()), (4, 0));
    println!(
        "{} rounds, {} steps, {:?}, singular values {:?}",
        found.rounds, found.estimate.iterations, found.estimate.status, found.estimate.data_only.singular_values
    );
    for &i in &selected {
        assert_within!(
            (found.estimate.values[i] / v[i] - 1.0).abs(),
            1e-6,
            "{}: {} {}",
            decls[i].name,
            found.estimate.values[i],
            v[i]
        );
    }
    // Statistics over noise: errors in units of the stated deviations.
    let (mut rng, normal) = (ChaCha8Rng::seed_from_u64(4), Normal::new(0.0, 1.0).unwrap());
    let (mut sum, mut count) = (0.0, 0.0);
    for _ in 0..60 {
        let noise = [normal.sample(&mut rng), normal.sample(&mut rng)];
        let found = estimate_modal(&request, &measured(modes.modes(), 0.3, (2e-5, 2e-5), noise)).unwrap();
        for (p, &i) in found.estimate.parameters.iter().zip(&selected) {
            let e = (p.value - v[i]) / p.std.unwrap();
            assert!(e.abs() < 6.0, "{}: {e}", p.name);
            sum += e * e;
            count += 1.0;
        }
    }
    let rms = f64::sqrt(sum / count);
    // All modes share the two draws of a round, and shapes are exact: below 1, and never far above.
    assert!((0.2..1.3).contains(&rms), "{rms}");
}

#[test]
fn two_modes_leave_directions_open_and_say_so() {
    let l = load("flex");
    let (m, decls) = (&l.model, l.model.param_decls());
    let v = truth(m);
    let eta = vec![0.0; 4];
    let pose = HeldPose { q: &POSE, eta: &eta, boundary: Boundary::JointsHeld };
    let modes = ModalModel::new(m, &Params::from_values(m, v.clone()), &pose).unwrap();
    let selected = select(&decls, &["*.k[*]"]).unwrap();
    let s = sigma();
    let request = ModalRequest::new(m, pose, (&decls, &selected, &v), &s, 1.5);
    let found = estimate_modal(&request, &measured(&modes.modes()[1..3], 0.3, (1e-5, 1e-5), [0.3, 0.3])).unwrap();
    let u = &found.estimate.data_only;
    assert!(u.rank <= 4 && found.matching.pairs.len() == 2 && found.matching.unseen.len() == 2);
    let damping = select(&decls, &["*.k[*]", "*.d[*]"]).unwrap();
    let request = ModalRequest { selected: &damping, shapes: None, ..request };
    let found = estimate_modal(&request, &measured(&modes.modes()[1..3], 0.3, (1e-5, 1e-5), [0.3, 0.3])).unwrap();
    let u = &found.estimate.data_only;
    assert_eq!((u.rank, u.null.len()), (4, 4), "{:?}", u.singular_values);
    assert!(found.estimate.parameters.iter().filter(|p| p.std.is_none()).count() >= 5);
}

#[test]
fn what_was_not_seen_is_named_with_its_reason() {
    let l = load("flex");
    let m = &l.model;
    let p = Params::<f64>::nominal(m);
    let eta = vec![0.0; 4];
    // Straight up, the arm lies in the plane of symmetry: symmetric modes do not turn the base about the hinges.
    let pose = HeldPose { q: &[0.0, 0.8, 0.0, 0.8, 0.0, 0.5, 0.0], eta: &eta, boundary: Boundary::JointsHeld };
    let modes = ModalModel::new(m, &p, &pose).unwrap();
    let mut few = vec![modes.modes()[1].clone()];
    // A stranger at 1.21 Hz.
    let mut strange = modes.modes()[2].clone();
    strange.pole *= 1.21 / strange.frequency();
    strange.channels.reverse();
    few.push(strange);
    let mut fit = measured(&few, 0.3, (1e-5, 1e-5), [0.0; 2]);
    let mut tone = fit.modes[0].clone();
    tone.frequency *= 2.0;
    tone.snr *= 0.01;
    fit.modes.insert(1, tone);
    let got = match_modes(&fit, modes.modes(), &sigma(), &MatchSettings::up_to(0.6));
    assert_eq!(got.pairs.iter().map(|p| (p.measured, p.model)).collect::<Vec<_>>(), [(0, 1)], "{got:#?}");
    assert!(got.pairs[0].mac > 0.999);
    assert_eq!(got.strays[0], (1, Stray::Combination { of: (0, 0) }));
    assert!(matches!(got.strays[1], (2, Stray::NoCounterpart { .. })), "{:?}", got.strays);
    assert!(matches!(got.unseen[0], (0, Unseen::GyroBlind)), "{:?}", got.unseen);
    assert_eq!(
        got.unseen[0].1.words(),
        "it does not turn the base (symmetric), so the gyro cannot see it, and the torques were too faint"
    );
    assert!(got.unseen[1..].iter().all(|u| u.1 == Unseen::OutOfBand) && got.unseen.len() == 3);
}

#[test]
fn fuel_at_0_0890_hz_on_a_held_base_swings_at_0_105_to_0_109_hz_on_a_free_one_and_back() {
    let l = load("slosh");
    let (m, decls) = (&l.model, l.model.param_decls());
    let v = Params::<f64>::nominal(m).values().to_vec();
    let (q, eta) = ([0.0, 0.8, 0.0, 0.8, 0.0, 0.5, 0.0], [0.0, 0.0]);
    let held = HeldPose { q: &q, eta: &eta, boundary: Boundary::BaseHeld };
    let free = convert_modes(m, &v, &held, Boundary::JointsHeld, (&[], None)).unwrap();
    for c in &free {
        assert!((c.from - 0.0890).abs() < 5e-5 && (c.from_damping - 0.0699).abs() < 1e-3, "{c:?}");
        assert!((0.1045..0.1095).contains(&c.frequency), "{c:?}");
        // Proportional damping: zeta / omega is the same before and after.
        assert_within!((c.damping / c.frequency / (c.from_damping / c.from) - 1.0).abs(), 1e-9);
    }
    let known = ff_dynamics::modes(m, &Params::from_values(m, v.clone()), &q, &eta, Boundary::JointsHeld).unwrap();
    for (a, b) in free.iter().zip(&known) {
        assert!((a.frequency / b.frequency_hz - 1.0).abs() < 1e-9 && (a.damping / b.damping_ratio - 1.0).abs() < 1e-7);
    }
    // And back from measured free modes, by way of springs and dampers, with unequal ones for the damped problem.
    let selected = select(&decls, &["tank.k[*]", "tank.d[*]"]).unwrap();
    let mut other = v.clone();
    for (n, &i) in selected.iter().enumerate() {
        other[i] *= 0.8 + 0.17 * n as f64;
    }
    let pose = HeldPose { boundary: Boundary::JointsHeld, ..held };
    let modes = ModalModel::new(m, &Params::from_values(m, other.clone()), &pose).unwrap();
    let s = sigma();
    let mut request = ModalRequest::new(m, pose, (&decls, &selected, &v), &s, 1.5);
    request.floor = (1e-12, 1e-12);
    let found = estimate_modal(&request, &measured(modes.modes(), 0.3, (1e-4, 1e-4), [0.0; 2])).unwrap();
    let u = Some(&found.estimate.uncertainty);
    let back = convert_modes(m, &found.estimate.values, &pose, Boundary::BaseHeld, (&selected, u)).unwrap();
    let known = ff_dynamics::modes(m, &Params::from_values(m, other), &q, &eta, Boundary::BaseHeld).unwrap();
    for (a, b) in back.iter().zip(&known) {
        assert!(
            (a.frequency / b.frequency_hz - 1.0).abs() < 1e-7 && (a.damping / b.damping_ratio - 1.0).abs() < 1e-6,
            "{a:?} {b:?}"
        );
        assert!(a.frequency < a.from);
        let d = a.frequency_deviation.unwrap();
        assert!((0.5e-4..1.2e-4).contains(&d), "{d}");
    }
}
