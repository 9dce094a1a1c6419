//! Disturbances of the joint motion and wrenches on the base: the record that they give against simulations that know nothing of
//! tables, and its derivatives with respect to their sizes against differences.

// Helpers may unwrap like the tests they serve.
#![allow(clippy::unwrap_used)]

use crate::common::*;
use crate::record::{SAMPLING, general, start, state_of};
use ff_dynamics::motion::{FnMotion, JointMotion};
use ff_dynamics::reduced::{Disturbance, Disturbances, TableKey};
use ff_dynamics::sim::inputs::{AppliedWrench, Axes, Signal};
use ff_dynamics::sim::simulate_with;
use ff_dynamics::*;
use ff_model::*;
use std::sync::Arc;

const WRENCH: [f64; 6] = [0.7, -1.3, 2.1, 0.9, 1.7, -0.6];

/// A deflection of every joint, as of elastic gears.
fn deflection(joints: usize) -> impl Fn(f64, &mut [f64], &mut [f64], &mut [f64]) + Copy {
    move |t, q, qd, qdd| {
        for j in 0..joints {
            let (a, w, f) = (0.7 - 0.2 * j as f64, 1.1 + 0.4 * j as f64, 0.3 + j as f64);
            let (sin, cos) = (w * t + f).sin_cos();
            (q[j], qd[j], qdd[j]) = (a * sin, a * w * cos, -a * w * w * sin);
        }
    }
}

/// A deflection, a steady wrench, and one that swings.
fn all(joints: usize) -> Vec<Disturbance> {
    let swings = |t: f64| core::array::from_fn(|i| (1.7 * t + 0.9 * i as f64).cos());
    vec![
        Disturbance::Motion(Arc::new(FnMotion::new(joints, 1e3, deflection(joints)).unwrap())),
        Disturbance::Wrench(Arc::new(|_| WRENCH)),
        Disturbance::Wrench(Arc::new(swings)),
    ]
}

fn table(m: &Model, sizes: &[f64], wanted: &Wanted) -> Prescribed {
    let (p, k) = (Params::<f64>::nominal(m), Kinematics::fixed(m));
    let d = Disturbances::new(all(m.nj()), sizes.to_vec());
    Prescribed::disturbed(m, &p, (&k, &d), &Wave(m.nj()), &SAMPLING, 0..SAMPLING.samples, wanted)
}

fn response(m: &Model, sizes: &[f64]) -> Response {
    simulate_reduced(m, &Params::nominal(m), &table(m, sizes, &Wanted::default()), &start(m)).unwrap()
}

#[test]
fn a_disturbed_record_is_that_of_the_full_dynamics_under_the_same_motion_and_wrench() {
    let m = general();
    let p = Params::<f64>::nominal(&m);
    let got = response(&m, &[0.03, 0.8, 0.0]);
    let (wave, change) = (Wave(m.nj()), deflection(m.nj()));
    let moved = FnMotion::new(m.nj(), 1e3, move |t, q, qd, qdd| {
        wave.eval(t, q, qd, qdd);
        let n = q.len();
        let (mut dq, mut dqd, mut dqdd) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        change(t, &mut dq, &mut dqd, &mut dqdd);
        for (x, dx) in [(q, dq), (qd, dqd), (qdd, dqdd)] {
            x.iter_mut().zip(dx).for_each(|(x, dx)| *x += 0.03 * dx);
        }
    });
    let moved = moved.unwrap();
    let push = AppliedWrench { body: 0, axes: Axes::Body, wrench: Signal::constant(WRENCH.map(|x| 0.8 * x)).unwrap() };
    let o = SimOptions { duration_s: 0.4, step_s: 0.01, sample_s: 0.05 };
    let start = state_of(&m, &start(&m));
    let want = simulate_with(&m, &p, &start, &Drive::Prescribed(&moved), &[&push], &o).unwrap();
    let alone = simulate(&m, &p, &start, &Drive::Prescribed(&moved), &o).unwrap();
    let push_shows = (want.gyro() - alone.gyro()).amax() / want.gyro().amax();
    assert!(push_shows > 1e-3, "{push_shows:e}");
    for (what, got, want) in [("torque", &got.tau, &want.tau), ("gyro", &got.gyro(), &want.gyro())] {
        let e = (got - want).amax() / want.amax();
        assert_within!(e, 1e-7, "{what}: {e:e}");
    }
}

#[test]
fn sizes_of_disturbances_have_the_columns_of_central_differences() {
    let m = general();
    let (p, z0, at) = (Params::<f64>::nominal(&m), start(&m), [0.02, 0.6, -0.4]);
    // Placements before them, an initial state behind.
    let wanted = Wanted {
        params: vec![3],
        kinematics: vec![1, 8],
        disturbances: vec![2, 0, 1],
        initial: vec![4],
        ..Wanted::default()
    };
    let (r, s) = sensitivities(&m, &p, &table(&m, &at, &wanted), &z0, &wanted).unwrap();
    assert_eq!(r, response(&m, &at));
    for (c, &k) in wanted.disturbances.iter().enumerate() {
        let (col, h) = (3 + c, [2e-3, 1e-2, 1e-2][k]);
        let runs = [-2.0, -1.0, 1.0, 2.0].map(|step| {
            let mut sizes = at;
            sizes[k] += step * h;
            response(&m, &sizes)
        });
        let difference = |of: &dyn Fn(usize) -> f64| (of(0) - of(3) + 8.0 * (of(2) - of(1))) / (12.0 * h);
        let (mut error, mut size) = ([0.0f64; 2], [1e-3f64; 2]);
        for i in 0..SAMPLING.samples {
            let torques = (0..m.nj()).map(|j| (0, s.tau[(i * m.nj() + j, col)], difference(&|k| runs[k].tau[(i, j)])));
            let rates = (0..3).map(|j| (1, s.gyro[(3 * i + j, col)], difference(&|k| runs[k].twist[(i, 3 + j)])));
            for (group, got, want) in torques.chain(rates) {
                error[group] = error[group].max((got - want).abs());
                size[group] = size[group].max(want.abs());
            }
        }
        for group in 0..2 {
            let e = error[group] / size[group];
            assert_within!(e, 1e-7, "disturbance {k}, sensor {group}: {e:e} of {:e}", size[group]);
        }
    }
}

#[test]
fn a_table_of_other_sizes_or_without_their_derivatives_does_not_serve() {
    let m = general();
    let (p, k) = (Params::<f64>::nominal(&m), Kinematics::fixed(&m));
    let with = Wanted { disturbances: vec![0, 2], ..Wanted::default() };
    let key = |w: &Wanted, sizes: &[f64]| TableKey::new(&m, &p, &k, &SAMPLING, w).disturbed(sizes);
    let kept = key(&with, &[0.1, 0.2, 0.3]);
    assert!(kept.serves(&key(&Wanted::default(), &[0.1, 0.2, 0.3])));
    assert!(!kept.serves(&key(&with, &[0.1, 0.2, 0.4])));
    assert!(!kept.serves(&key(&Wanted { disturbances: vec![1], ..Wanted::default() }, &[0.1, 0.2, 0.3])));
}
