//! Ground calibration of the peers' arm and of random trees: recovery, friction, held-out prediction.

use crate::common::tree::{Draw, Sines, model};
use ff_dynamics::motion::JointMotion;
use ff_dynamics::{State, Work, rnea};
use ff_mission::urdf::{UrdfOptions, from_file};
use ff_model::{BaseKind, Model, Params};
use ident::estimate::NearRest;
use ident::parameters::offset_start;
use ident::*;
use nalgebra::{DMatrix, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const G: [f64; 3] = [1.3, -0.7, -9.6];

fn arm() -> Model {
    let path = format!("{}/../../fixtures/peers-model/arm_fixed.urdf", env!("CARGO_MANIFEST_DIR"));
    let o = UrdfOptions { base_kind: BaseKind::Fixed, ..UrdfOptions::default() };
    from_file(path.as_ref(), &o).unwrap().0.with_gravity(Vector3::from(G))
}

/// Torques of the arm with friction; noise grows from joint to joint.
fn bench(
    m: &Model,
    values: &[f64],
    friction: &[[f64; 3]],
    motion: &Sines,
    noise: f64,
    with_rates: bool,
    seed: u64,
) -> Record {
    let n = (motion.duration() / 0.01).round() as usize;
    let nj = m.nj();
    let z = DMatrix::zeros(n, nj);
    let (mut q, mut qd, mut qdd, mut tau) = (z.clone(), z.clone(), z.clone(), z);
    let (params, mut work, mut state) = (Params::from_values(m, values.to_vec()), Work::new(m), State::zero(m));
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (mut acc, mut row) = (vec![0.0; nj], vec![0.0; nj]);
    for i in 0..n {
        let State { q: x, v, .. } = &mut state;
        motion.eval(i as f64 * 0.01, x, v, &mut acc);
        rnea(m, &params, &state, &acc, &mut work, &mut row);
        for (j, [v, c, o]) in friction.iter().enumerate() {
            let e: f64 = StandardNormal.sample(&mut rng);
            let w = state.v[j];
            (q[(i, j)], qd[(i, j)], qdd[(i, j)]) = (state.q[j], w, acc[j]);
            tau[(i, j)] =
                row[j] + v * w + c * if w == 0.0 { 0.0 } else { w.signum() } + o + noise * (1.0 + j as f64) * e;
        }
    }
    let b = RecordBuilder::new(m.joint_names()).uniform(0.0, 100.0).q(q).tau(tau).fixed_base();
    if with_rates { b.qd(qd).qdd(qdd) } else { b }.build().unwrap().0
}

fn friction(nj: usize, seed: u64) -> Vec<[f64; 3]> {
    let mut s = Draw::new(seed);
    (0..nj).map(|_| [s.between(0.5, 4.0), s.between(0.3, 2.0), s.sym(1.5)]).collect()
}

fn worst_base(e: &ident::solve::LinearEstimate, m: &Model, truth: &[f64]) -> f64 {
    let decls = m.param_decls();
    // Friction and link parameters never mix: a rate is not an acceleration.
    e.base
        .iter()
        .filter(|b| !b.terms[0].0.starts_with("friction"))
        .map(|b| {
            let of = |n: &str| truth[decls.iter().position(|d| d.name == n).unwrap()];
            let t: f64 = b.terms.iter().map(|(n, f)| f * of(n)).sum();
            (b.value - t).abs() / (1.0 + t.abs())
        })
        .fold(0.0, f64::max)
}

#[test]
fn without_noise_links_and_friction_come_back() {
    for m in [arm(), model(11, 5, BaseKind::Fixed).with_gravity(Vector3::from(G))] {
        let decls = m.param_decls();
        let truth = Params::<f64>::nominal(&m).values().to_vec();
        let selected: Vec<usize> = (10..decls.len()).collect();
        let start = offset_start(&decls, &truth, &selected, 0.25, 3);
        let friction = friction(m.nj(), 9);
        let motion = Sines::new(21, m.nj(), 40.0, 1.2);
        let r = bench(&m, &truth, &friction, &motion, 0.0, true, 1);
        let ground = Ground::new(&m, Friction::ALL).unwrap();
        let e = ground.estimate(&[&r], &selected, &start).unwrap();
        let worst = worst_base(&e.fit, &m, &truth);
        let worst_friction = e.friction.iter().zip(&friction).flat_map(|(a, b)| (0..3).map(|k| (a[k] - b[k]).abs()));
        let worst_friction = worst_friction.fold(0.0, f64::max);
        println!(
            "{}: rank {} of {}, worst {worst:.1e}, friction {worst_friction:.1e}, used {:.3?}",
            m.name(),
            e.fit.uncertainty.rank,
            selected.len() + 3 * m.nj(),
            e.used
        );
        assert!(worst < 1e-6, "{worst:e}");
        assert!(e.used.iter().all(|u| (0.9..1.0).contains(u)));
        // An offset is told from gravity unless the joint turns about gravity itself.
        let told: Vec<_> = e.fit.extra.iter().zip(friction.as_flattened()).filter(|(x, _)| x.std.is_some()).collect();
        assert!(told.len() >= 3 * m.nj() - 1 && told.iter().all(|(x, f)| (x.value - **f).abs() < 1e-6));
        // Another motion is predicted.
        let other = bench(&m, &truth, &friction, &Sines::new(77, m.nj(), 15.0, 0.8), 0.0, true, 2);
        assert!(ground.held_out(&other, &e).unwrap().iter().all(|r| *r < 1e-6));
    }
}

#[test]
fn positions_alone_with_noise_give_the_noise_of_each_joint_and_predict_another_record() {
    let m = arm();
    let decls = m.param_decls();
    let truth = Params::<f64>::nominal(&m).values().to_vec();
    let selected: Vec<usize> = (10..decls.len()).collect();
    let friction = friction(7, 4);
    let r = bench(&m, &truth, &friction, &Sines::new(22, 7, 60.0, 1.2), 0.05, false, 5);
    let other = bench(&m, &truth, &friction, &Sines::new(78, 7, 20.0, 1.0), 0.05, false, 6);
    let ground = Ground::new(&m, Friction::ALL).unwrap().trim(0.5);
    let start = offset_start(&decls, &truth, &selected, 0.2, 4);
    let e = ground.estimate(&[&r], &selected, &start).unwrap();
    let held = ground.held_out(&other, &e).unwrap();
    for (j, k) in e.fit.kinds.iter().enumerate() {
        let sigma = 0.05 * (1.0 + j as f64);
        println!("{}: sigma {:.4} of {sigma:.2}, held out {:.4}", k.name, k.sigma, held[j]);
        assert!((k.sigma / sigma - 1.0).abs() < 0.04 && (held[j] / sigma - 1.0).abs() < 0.08);
    }
    // Friction within its own standard deviations.
    for (x, f) in e.fit.extra.iter().zip(friction.as_flattened()) {
        let std = x.std.unwrap_or(f64::INFINITY);
        assert!((x.value - f).abs() < 4.0 * std, "{x:?} {f}");
    }
    // Bodies of a linear estimate need not exist; which ones is said.
    println!("not physical: {:?}", e.fit.unphysical);
    // Without the friction terms the residual is friction.
    let without = Ground::new(&m, Friction::NONE).unwrap().trim(0.5).estimate(&[&r], &selected, &start).unwrap();
    assert!(without.fit.extra.is_empty() && without.fit.kinds[0].sigma > 5.0 * e.fit.kinds[0].sigma);
}

#[test]
fn samples_near_rest_are_treated_as_stated() {
    let m = arm();
    let truth = Params::<f64>::nominal(&m).values().to_vec();
    let friction = friction(7, 4);
    let r = bench(&m, &truth, &friction, &Sines::new(22, 7, 20.0, 1.0), 0.0, true, 5);
    let at = |near_rest| {
        let g = Ground::new(&m, Friction { near_rest, ..Friction::ALL }).unwrap();
        g.estimate(&[&r], &[11, 12, 13], &truth).unwrap()
    };
    let (narrow, wide) = (at(NearRest::LeaveOut(0.01)), at(NearRest::LeaveOut(0.2)));
    assert!(wide.used.iter().zip(&narrow.used).all(|(w, n)| w < n), "{:?}", wide.used);
    assert!((wide.friction[2][1] - friction[2][1]).abs() < 1e-7);
    // A smooth sign where the truth jumps leaves a residual.
    let smooth = at(NearRest::Smooth(0.05));
    assert!(smooth.used == vec![1.0; 7] && smooth.fit.kinds[2].rms > 1e3 * narrow.fit.kinds[2].rms);
    assert!(Ground::new(&m, Friction { near_rest: NearRest::Smooth(0.0), ..Friction::ALL }).is_err());
    assert!(Ground::new(&m, Friction { near_rest: NearRest::LeaveOut(f64::NAN), ..Friction::ALL }).is_err());
    assert!(
        Ground::new(&m.clone().with_base_kind(BaseKind::Floating), Friction::ALL)
            .unwrap_err()
            .to_string()
            .contains("fixed")
    );
    let g = Ground::new(&m, Friction::ALL).unwrap();
    assert!(g.estimate(&[], &[11], &truth).is_err());
    // Two records are one of twice the length.
    let two = g.estimate(&[&r, &r], &[11, 12, 13], &truth).unwrap();
    assert!((two.fit.values[11] - truth[11]).abs() < 1e-7 && two.fit.kinds[0].rows == 2 * narrow.fit.kinds[0].rows);
}
