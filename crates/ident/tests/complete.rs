//! The complete form on random trees: noise-free recovery of every combination, covariance against scatter, conditioning.

use crate::common::tree::{Draw, Sines, model};
use ff_dynamics::sim::Accelerometer;
use ff_dynamics::{Drive, SimOptions, State, Trace, simulate};
use ff_model::spatial::so3::{exp_so3, quat_to_rot};
use ff_model::{BaseKind, Model, Params, Xform};
use ident::parameters::offset_start;
use ident::*;
use nalgebra::{DMatrix, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

fn fly(m: &Model, seconds: f64) -> Trace {
    let mut start = State::zero(m);
    // In motion at the start: nothing may depend on rest.
    start.v[..6].copy_from_slice(&[0.3, -0.2, 0.1, 0.02, -0.03, 0.015]);
    let motion = Sines::new(41, m.nj(), seconds, 0.9);
    let o = SimOptions { duration_s: seconds, step_s: 2e-3, sample_s: 0.01 };
    simulate(m, &Params::nominal(m), &start, &Drive::Prescribed(&motion), &o).unwrap()
}

/// What an accelerometer at `mount` reads: classical acceleration of its place, in its axes.
fn accelerometer(t: &Trace, mount: &Xform<f64>) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(t.len(), 3);
    for i in 0..t.len() {
        let row = |m: &DMatrix<f64>, k: usize| Vector3::new(m[(i, k)], m[(i, k + 1)], m[(i, k + 2)]);
        let (v, w, al) = (row(&t.twist, 0), row(&t.twist, 3), row(&t.accel, 3));
        let a = row(&t.accel, 0) + w.cross(&v) + al.cross(&mount.pos) + w.cross(&w.cross(&mount.pos));
        out.set_row(i, &(mount.rot.transpose() * a).transpose());
    }
    out
}

struct Noise3(f64, f64, f64);
fn record(m: &Model, t: &Trace, mount: &Xform<f64>, noise: &Noise3, seed: u64) -> Record {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut add = |x: &DMatrix<f64>, s: f64| {
        x.map(|v| {
            let z: f64 = StandardNormal.sample(&mut rng);
            v + s * z
        })
    };
    RecordBuilder::new(m.joint_names())
        .uniform(0.0, 100.0)
        .q(t.q.clone())
        .qd(t.qd.clone())
        .qdd(t.qdd.clone())
        .tau(add(&t.tau, noise.0))
        .gyro(add(&t.gyro(), noise.1))
        .acc(add(&accelerometer(t, mount), noise.2))
        .build()
        .unwrap()
        .0
}

#[test]
fn without_noise_every_combination_that_the_data_see_comes_back() {
    for (seed, joints) in [(3, 4), (8, 6)] {
        let m = model(seed, joints, BaseKind::Floating);
        let t = fly(&m, 20.0);
        let mut s = Draw::new(seed);
        let mount = Xform::new(quat_to_rot(&exp_so3(&s.vec3(1.5))), s.vec3(0.7));
        let r = record(&m, &t, &mount, &Noise3(0.0, 0.0, 0.0), 1);
        let options = CompleteOptions { accelerometer: Accelerometer { mount }, trim_s: 0.5, ..Default::default() };
        let complete = Complete::new(&m, &r, &options).unwrap();
        let decls = m.param_decls();
        let truth = Params::<f64>::nominal(&m).values().to_vec();
        let all: Vec<usize> = (0..decls.len()).collect();
        let start = offset_start(&decls, &truth, &all, 0.25, seed);
        let e = complete.estimate(&all, &start).unwrap();
        let errors: Vec<f64> = e.values.iter().zip(&truth).map(|(a, b)| a - b).collect();
        let (known, worst) = e.uncertainty.worst_combination(&errors, 1e9);
        // A hinge hides three inertia transfers; a body that slides never turns against its parent and hides six.
        println!("{joints} joints: rank {} of {}, worst {worst:.1e}, {:?}", e.uncertainty.rank, all.len(), e.kinds[0]);
        let worst_base = e
            .base
            .iter()
            .map(|b| {
                let of = |n: &str| truth[decls.iter().position(|d| d.name == n).unwrap()];
                let t: f64 = b.terms.iter().map(|(n, f)| f * of(n)).sum();
                (b.value - t).abs() / (1.0 + t.abs())
            })
            .fold(0.0, f64::max);
        println!("base parameters {}: worst {worst_base:.1e}", e.base.len());
        assert_eq!(e.base.len(), e.uncertainty.rank);
        assert_eq!(known, e.uncertainty.rank);
        let sliding = (0..joints).filter(|j| j % 4 == 3).count();
        assert_eq!(e.uncertainty.rank, 10 * (joints + 1) - 3 * (joints - sliding) - 6 * sliding);
        assert!(worst < 1e-6 && worst_base < 1e-6, "{worst:e} {worst_base:e}");
    }
}

#[test]
fn the_covariance_is_the_scatter_of_the_estimates() {
    // Noise of the torques alone, which stands on the right side; rows of the base all but switched off.
    let m = model(5, 4, BaseKind::Floating);
    let t = fly(&m, 10.0);
    let mount = Xform::identity();
    let decls = m.param_decls();
    let truth = Params::<f64>::nominal(&m).values().to_vec();
    let selected = ident::parameters::select(&decls, &["l2.*", "l3.*"]).unwrap();
    let weights = ident::solve::Weights::Given([&[1e7, 1e7][..], &[0.05; 4]].concat());
    let options = CompleteOptions { weights, trim_s: 0.2, ..Default::default() };
    let (mut sum, mut count, mut chi2, mut bias) = (0.0, 0.0, 0.0, 0.0f64);
    const RUNS: u64 = 60;
    let mut mean: Vec<f64> = vec![];
    for seed in 0..RUNS {
        let r = record(&m, &t, &mount, &Noise3(0.05, 0.0, 0.0), 100 + seed);
        let e = Complete::new(&m, &r, &options).unwrap().estimate(&selected, &truth).unwrap();
        mean.resize(e.base.len(), 0.0);
        for (k, b) in e.base.iter().enumerate() {
            let of = |n: &str| truth[decls.iter().position(|d| d.name == n).unwrap()];
            let exact: f64 = b.terms.iter().map(|(n, f)| f * of(n)).sum();
            let z = (b.value - exact) / b.std;
            (sum, count) = (sum + z * z, count + 1.0);
            mean[k] += z / RUNS as f64;
        }
        // Rows of the base count among the degrees of freedom, and hold next to nothing.
        chi2 += e.kinds[2..].iter().map(|k| (k.rms / 0.05).powi(2)).sum::<f64>() / 4.0 / RUNS as f64;
    }
    mean.iter().for_each(|z| bias = bias.max(z.abs()));
    println!(
        "mean square of errors over their deviation {:.3}, worst mean {bias:.2}, torque variance {chi2:.3}",
        sum / count
    );
    assert!((0.85..1.15).contains(&(sum / count)), "{}", sum / count);
    assert!(bias < 4.0 / (RUNS as f64).sqrt() && (chi2 - 1.0).abs() < 0.03);
}

#[test]
fn every_sensor_noisy_the_weights_come_from_the_residuals() {
    let m = model(5, 4, BaseKind::Floating);
    let t = fly(&m, 30.0);
    let r = record(&m, &t, &Xform::identity(), &Noise3(0.05, 1e-5, 1e-4), 7);
    let decls = m.param_decls();
    let truth = Params::<f64>::nominal(&m).values().to_vec();
    let selected = ident::parameters::select(&decls, &["base.*"]).unwrap();
    let e = Complete::new(&m, &r, &CompleteOptions { trim_s: 0.5, ..Default::default() }).unwrap();
    let e = e.estimate(&selected, &truth).unwrap();
    for (k, sigma) in e.kinds[2..].iter().map(|k| (k, 0.05)) {
        assert!((k.sigma / sigma - 1.0).abs() < 0.15, "{k:?}");
    }
    let worst = e
        .parameters
        .iter()
        .zip(&selected)
        .map(|(p, &i)| (p.value - truth[i]).abs() / ident::parameters::sizes(&decls, &truth)[i])
        .fold(0.0, f64::max);
    println!(
        "base to {worst:.1e} of its size; chi2 {:.3}; force on the base known to {:.3} N",
        e.chi2_per_dof, e.kinds[0].sigma
    );
    assert!(worst < 0.02 && (e.chi2_per_dof - 1.0).abs() < 0.05, "{worst}");
}

#[test]
fn what_is_missing_is_said() {
    let m = model(5, 3, BaseKind::Floating);
    let t = fly(&m, 2.0);
    let plain =
        RecordBuilder::new(m.joint_names()).uniform(0.0, 100.0).q(t.q.clone()).tau(t.tau.clone()).gyro(t.gyro());
    let plain = plain.build().unwrap().0;
    let options = CompleteOptions::default();
    let text = |m: &Model, r: &Record, o: &CompleteOptions| Complete::new(m, r, o).unwrap_err().to_string();
    assert!(text(&m, &plain, &options).contains("accelerometer"));
    assert!(text(&m.clone().with_base_kind(BaseKind::Fixed), &plain, &options).contains("floating"));
    let r = record(&m, &t, &Xform::identity(), &Noise3(0.0, 0.0, 0.0), 1);
    assert!(text(&m, &r, &CompleteOptions { trim_s: 1.1, ..options.clone() }).contains("half"));
    let values = Params::<f64>::nominal(&m).values().to_vec();
    let c = Complete::new(&m, &r, &options).unwrap();
    assert!(c.estimate(&[], &values).is_err() && c.estimate(&[3, 2], &values).is_err());
    assert!(c.estimate(&[0], &values[1..]).is_err());
    let mut wrong = values.clone();
    wrong[2] = f64::NAN;
    assert!(c.estimate(&[0], &wrong).unwrap_err().to_string().contains("non-finite"));
    let weights = ident::solve::Weights::Given(vec![1.0; 4]);
    let c = Complete::new(&m, &r, &CompleteOptions { weights, ..options }).unwrap();
    assert!(c.estimate(&[0], &values).unwrap_err().to_string().contains("5 kinds"));
}
