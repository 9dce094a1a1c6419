//! Clocks that do not agree: offset and skew of the torque or gyro channels against the joint encoders.

use crate::modal_model::load;
use ff_dynamics::{Prescribed, Sampling, simulate_reduced};
use ff_model::Params;
use ff_records::Record;
use ff_records::RecordBuilder;
use ff_records::clock::correct_clocks;
use ff_records::clock::{ClockEstimate, Clocks};
use ident::checks::*;
use ident::estimate::Noise;
use ident::motion::joint_motion;
use nalgebra::DMatrix;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

/// Three smooth channels, as at time t.
fn signal(t: f64, j: usize) -> f64 {
    let k = j as f64;
    1.3 * (1.1 * t + 0.4 * k).sin() + 0.6 * ((2.3 + 0.2 * k) * t).cos() + 0.2 * (0.4 * t * (1.0 + k)).sin()
}

/// Readings that are `offset` late at mid-record and drift, with gain errors, biases and noise.
fn readings(offset: f64, skew: f64, seed: u64) -> DMatrix<f64> {
    let (mut rng, normal) = (ChaCha8Rng::seed_from_u64(seed), Normal::new(0.0, 0.1).unwrap());
    DMatrix::from_fn(3000, 3, |i, j| {
        let t = 0.01 * i as f64;
        (0.9 + 0.07 * j as f64) * signal(t - offset - skew * (t - 14.995), j) + 0.3 * j as f64 - 0.2
            + normal.sample(&mut rng)
    })
}

fn sure(channels: &DMatrix<f64>) -> Predicted<'_> {
    Predicted { channels, errors: &[] }
}

fn predicted() -> DMatrix<f64> {
    DMatrix::from_fn(3000, 3, |i, j| signal(0.01 * i as f64, j))
}

#[test]
#[ignore = "full tier: 2 s"]
fn offset_and_skew_are_found_within_honest_deviations() {
    let p = predicted();
    for (offset, skew) in [(0.0031, 0.0), (-0.0274, 3e-4), (0.117, -1.7e-4)] {
        let (mut sum, mut stated, n) = ([0.0f64; 2], [0.0f64; 2], 60);
        for seed in 0..n {
            let e = estimate_clock("torque", &sure(&p), &readings(offset, skew, seed), &[0.1; 3], 0.01, 0.3).unwrap();
            for (k, (x, d)) in
                [(e.offset - offset, e.offset_deviation), (e.skew - skew, e.skew_deviation)].into_iter().enumerate()
            {
                sum[k] += x * x;
                stated[k] += d * d;
            }
            assert!((e.misfit - 1.0).abs() < 0.05 && (e.gain[2] - 1.04).abs() < 0.02);
        }
        for k in 0..2 {
            let ratio = (stated[k] / sum[k]).sqrt();
            // Sixty values tell their scatter to 9 %; the larger of two deviations is a little on the safe side.
            assert!((0.75..1.6).contains(&ratio), "offset {offset}, skew {skew}: {k} stated / found {ratio}");
        }
        assert!((stated[0] / n as f64).sqrt() < 0.1 * 0.01);
    }
}

#[test]
fn what_cannot_be_told_is_refused_with_code_13() {
    let p = predicted();
    let still = DMatrix::from_fn(3000, 3, |i, j| 0.1 * ((i * 37 + j * 11) as f64 * 0.618).fract() + j as f64);
    let e = estimate_clock("gyro", &sure(&p), &still, &[0.1; 3], 0.01, 0.3).unwrap_err();
    assert!(e.exit_code() == 13 && e.to_string().starts_with("Data::ClockNotEstimable: gyro"), "{e}");
    // Drowned in noise: the offset is there, but not to half a sample.
    let e = estimate_clock(
        "gyro",
        &sure(&p),
        &(readings(0.02, 0.0, 3) + still.map(|x| 300.0 * (x.fract() - 0.05))),
        &[10.0; 3],
        0.01,
        0.3,
    );
    assert!(e.is_err_and(|e| e.exit_code() == 13));
    let e = estimate_clock("gyro", &sure(&p), &readings(0.5, 0.0, 1), &[0.1; 3], 0.01, 0.2).unwrap_err();
    assert_eq!(e.exit_code(), 13);
    assert!(matches!(estimate_clock("gyro", &sure(&p), &still, &[0.1; 2], 0.01, 0.2), Err(ClockError::Shape(_))));
    let mut bad = readings(0.0, 0.0, 1);
    bad[(7, 1)] = f64::NAN;
    assert!(matches!(estimate_clock("gyro", &sure(&p), &bad, &[0.1; 3], 0.01, 0.2), Err(ClockError::Linalg(_))));
}

/// A record of the flexible satellite at 1 kHz, thinned to 100 Hz with the torques 23 ms and the gyro 2 ms late.
fn late_record() -> (ff_mission::Loaded, Record) {
    let l = load("flex");
    let m = &l.model;
    let build =
        |rate: f64, q: DMatrix<f64>, qd: DMatrix<f64>, qdd: DMatrix<f64>, tau: DMatrix<f64>, gyro: DMatrix<f64>| {
            let b = RecordBuilder::new(m.joint_names()).uniform(0.0, rate).allow("Data::Stuck");
            b.q(q).qd(qd).qdd(qdd).tau(tau).gyro(gyro).build().unwrap().0
        };
    // From rest: ramped sines.
    let motion = |order: usize| {
        DMatrix::from_fn(20_100, 7, |i, j| {
            let (t, w) = (1e-3 * i as f64, 0.5 + 0.17 * j as f64);
            let a = 0.12;
            match order {
                0 => 0.3 * (j as f64 - 2.6) + a * (t - (w * t).sin() / w),
                1 => a * (1.0 - (w * t).cos()),
                _ => a * w * (w * t).sin(),
            }
        })
    };
    let (q, qd, qdd) = (motion(0), motion(1), motion(2));
    let fine = build(1000.0, q.clone(), qd.clone(), qdd.clone(), DMatrix::zeros(20_100, 7), DMatrix::zeros(20_100, 3));
    let p = Params::nominal(m);
    let driven = joint_motion(m, &fine).unwrap();
    let sampling = Sampling { samples: fine.samples(), sample_s: fine.dt(), substeps: 1 };
    let y = simulate_reduced(m, &p, &Prescribed::new(m, &p, &*driven, &sampling, &[]), &[0.0; 14]).unwrap();
    let (mut rng, normal) = (ChaCha8Rng::seed_from_u64(8), Normal::new(0.0, 1.0).unwrap());
    let thin = |x: &DMatrix<f64>| DMatrix::from_fn(2000, x.ncols(), |i, j| x[(10 * i, j)]);
    let mut late = |x: DMatrix<f64>, by: usize, s: f64| {
        DMatrix::from_fn(2000, x.ncols(), |i, j| x[((10 * i).saturating_sub(by), j)] + s * normal.sample(&mut rng))
    };
    let tau = late(y.tau.clone(), 23, 0.1);
    let gyro = late(y.twist.columns(3, 3).into_owned(), 2, 1.5e-4);
    let record = build(100.0, thin(&q), thin(&qd), thin(&qdd), tau, gyro);
    (l, record)
}

#[test]
fn late_torques_of_a_flexible_satellite_are_found_with_a_model_that_is_known_to_a_per_cent_and_put_right() {
    let (l, record) = late_record();
    let decls = l.model.param_decls();
    let noise = Noise { torque: 0.1, gyro: 1.5e-4 };
    // Base too heavy, hinges too soft by half a per cent, and known to one.
    let mut v = Params::<f64>::nominal(&l.model).values().to_vec();
    let mut uncertain = Vec::new();
    for (i, (x, d)) in v.iter_mut().zip(&decls).enumerate() {
        let part = if d.name.starts_with("base.") {
            1.005
        } else if d.name.contains(".k[") {
            0.995
        } else {
            1.0
        };
        *x *= part;
        if part != 1.0 && *x != 0.0 {
            uncertain.push((i, 0.01 * x.abs()));
        }
    }
    let rough = Params::from_values(&l.model, v);
    let near = |e: &ClockEstimate, late: f64| (e.offset - late).abs() < 5.0 * e.offset_deviation;
    let c = estimate_clocks(&l.model, &rough, &record, &noise, &uncertain, 0.2).unwrap();
    println!("{c:?}");
    assert!(near(&c.torque, 0.023) && near(&c.gyro, 0.002), "{c:?}");
    // Taken for exact, the same model would pass its slower oscillations off as a clock.
    let wrong = estimate_clocks(&l.model, &rough, &record, &noise, &[], 0.2);
    assert!(wrong.is_err() || wrong.is_ok_and(|w| !near(&w.gyro, 0.002)));
    let exact = estimate_clocks(&l.model, &Params::nominal(&l.model), &record, &noise, &[], 0.2).unwrap();
    assert!(near(&exact.torque, 0.023) && exact.torque.offset_deviation < 5e-4, "{:?}", exact.torque);
    let (fixed, mask, problems) = correct_clocks(&record, &exact);
    // 2 ms is less than half a sample: the gyro stays as it is.
    assert!(
        problems.0.len() == 1
            && problems.0[0].code == "Data::ClockOffset"
            && problems.0[0].object.as_deref() == Some("torque"),
        "{problems:?}"
    );
    assert_eq!(fixed.gyro(), record.gyro());
    assert!(mask.lost() > 0.0 && mask.lost() < 0.01 && mask.gyro.iter().all(|w| *w == 1.0));
    let again = estimate_clocks(&l.model, &Params::nominal(&l.model), &fixed, &noise, &[], 0.2).unwrap();
    assert!(again.torque.offset.abs() < 5.0 * exact.torque.offset_deviation, "{:?}", again.torque);
}

#[test]
fn a_clock_that_drifts_is_named_and_mended() {
    let p = predicted();
    let y = readings(0.002, 6e-4, 5);
    let q = DMatrix::from_fn(3000, 3, |i, j| signal(0.01 * i as f64, j + 4));
    let gyro = predicted();
    let record = RecordBuilder::new(["a", "b", "c"]).uniform(0.0, 100.0).q(q).tau(y).gyro(gyro).build().unwrap().0;
    let torque = estimate_clock("torque", &sure(&p), record.tau(), &[0.1; 3], 0.01, 0.1).unwrap();
    let gyro = estimate_clock("gyro", &sure(&p), record.gyro(), &[0.1; 3], 0.01, 0.1).unwrap();
    assert!(gyro.offset.abs() < 1e-9 && gyro.skew.abs() < 1e-9, "{gyro:?}");
    let (fixed, _, problems) = correct_clocks(&record, &Clocks { torque, gyro });
    let codes: Vec<&str> = problems.0.iter().map(|p| p.code).collect();
    assert_eq!(codes, ["Data::ClockSkew"], "{problems:?}");
    let left = estimate_clock("torque", &sure(&p), fixed.tau(), &[0.1; 3], 0.01, 0.1).unwrap();
    assert!(left.skew.abs() < 5.0 * left.skew_deviation && left.offset.abs() < 5.0 * left.offset_deviation, "{left:?}");
}
