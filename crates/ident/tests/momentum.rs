//! Momentum estimator on random trees: recovery, the conserved constant, scale, scatter.

use crate::common::tree::{Sines, model};
use ff_dynamics::{Drive, SimOptions, State, Trace, simulate};
use ff_model::spatial::so3::exp_so3;
use ff_model::{BaseKind, Model, Params};
use ident::estimate::{Momentum, MomentumOptions};
use ident::parameters::offset_start;
use ident::*;
use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

fn fly(m: &Model, seconds: f64, turning: bool) -> Trace {
    let mut start = State::zero(m);
    start.att = exp_so3(&Vector3::new(0.4, -0.9, 0.3));
    if turning {
        start.v[..6].copy_from_slice(&[0.3, -0.2, 0.1, 0.02, -0.03, 0.015]);
    }
    let motion = Sines::new(41, m.nj(), seconds, 0.9);
    let o = SimOptions { duration_s: seconds, step_s: 2e-3, sample_s: 0.01 };
    simulate(m, &Params::nominal(m), &start, &Drive::Prescribed(&motion), &o).unwrap()
}
fn record(m: &Model, t: &Trace, gyro: f64, with_attitude: bool, seed: u64) -> Record {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let noisy = t.gyro().map(|x| {
        let z: f64 = StandardNormal.sample(&mut rng);
        x + gyro * z
    });
    let b = RecordBuilder::new(m.joint_names()).uniform(0.0, 100.0).q(t.q.clone()).qd(t.qd.clone()).qdd(t.qdd.clone());
    let b = b.tau(t.tau.clone()).gyro(noisy);
    if with_attitude { b.att(t.att.clone()) } else { b }.build().unwrap().0
}

#[test]
fn without_noise_the_base_comes_back_with_and_without_attitude_and_the_constant_is_the_momentum() {
    for (seed, joints, turning, with_attitude) in [(3, 4, true, true), (3, 4, true, false), (8, 5, false, true)] {
        let m = model(seed, joints, BaseKind::Floating);
        let t = fly(&m, 20.0, turning);
        let r = record(&m, &t, 0.0, with_attitude, 1);
        let decls = m.param_decls();
        let params = Params::<f64>::nominal(&m);
        let truth = params.values().to_vec();
        let selected = ident::parameters::select(&decls, &["base.*"]).unwrap();
        let start = offset_start(&decls, &truth, &selected, 0.25, seed);
        let e = Momentum::new(&m, &r, &MomentumOptions::new(1e-5)).unwrap().estimate(&selected, &start).unwrap();
        let errors: Vec<f64> = selected.iter().map(|&i| e.fit.values[i] - truth[i]).chain([0.0; 3]).collect();
        let (known, worst) = e.fit.uncertainty.worst_combination(&errors, 1e9);
        println!(
            "{} joints, attitude {with_attitude}: rank {} of 13 after {} steps, worst {worst:.1e}",
            joints, e.fit.uncertainty.rank, e.steps
        );
        assert!(e.settled && worst < 1e-6 && known == e.fit.uncertainty.rank && known >= 12, "{worst:e} {known}");
        if with_attitude {
            let l = t.budget(&m, &params, 0).angular_com;
            for k in 0..3 {
                let size = 1.0 + l.norm();
                assert!((e.fit.extra[k].value - l[k]).abs() < 1e-6 * size, "{:?} {l}", e.fit.extra);
            }
        }
    }
}

#[test]
fn scatter_under_gyro_noise_is_what_the_covariance_says() {
    let m = model(3, 4, BaseKind::Floating);
    let t = fly(&m, 20.0, true);
    let decls = m.param_decls();
    let truth = Params::<f64>::nominal(&m).values().to_vec();
    let selected = ident::parameters::select(&decls, &["base.i_*", "base.h_*"]).unwrap();
    let (mut sum, mut chi2) = (0.0, 0.0);
    const RUNS: u64 = 40;
    for seed in 0..RUNS {
        let r = record(&m, &t, 2e-5, true, 50 + seed);
        let e = Momentum::new(&m, &r, &MomentumOptions::new(2e-5)).unwrap().estimate(&selected, &truth).unwrap();
        let z = e.fit.parameters.iter().zip(&selected).map(|(p, &i)| (p.value - truth[i]) / p.std.unwrap());
        sum += z.map(|z| z * z).sum::<f64>() / (selected.len() as f64 * RUNS as f64);
        chi2 += e.fit.chi2_per_dof / RUNS as f64;
    }
    println!("mean square of errors over their deviation {sum:.2}, chi-square {chi2:.3}");
    assert!((0.75..1.3).contains(&sum) && (chi2 - 1.0).abs() < 0.02, "{sum} {chi2}");
}

#[test]
fn without_anything_known_there_is_no_scale() {
    let m = model(5, 3, BaseKind::Floating);
    let t = fly(&m, 3.0, true);
    let r = record(&m, &t, 0.0, true, 1);
    let truth = Params::<f64>::nominal(&m).values().to_vec();
    let all: Vec<usize> = (0..truth.len()).collect();
    let momentum = Momentum::new(&m, &r, &MomentumOptions::new(1e-5)).unwrap();
    assert!(momentum.estimate(&all, &truth).unwrap_err().to_string().contains("keep a body known"));
    let mut negative = truth.clone();
    negative[0] = -1e3;
    assert!(momentum.estimate(&all[..10], &negative).unwrap_err().to_string().contains("not positive"));
    assert!(Momentum::new(&m, &r, &MomentumOptions::new(0.0)).is_err());
    assert!(Momentum::new(&m.clone().with_base_kind(BaseKind::Fixed), &r, &MomentumOptions::new(1e-5)).is_err());
}
