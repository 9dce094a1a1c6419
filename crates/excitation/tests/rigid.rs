//! The rigid model at zero momentum against the dynamics crate and against differences, on the paper's robot.

use crate::common::{Numeric, numbers, paper};
use excitation::objective::{BasePartials, BaseResponse, SampleInformation};
use excitation::system::rigid::{RigidBase, RigidError};
use excitation::*;
use ff_dynamics::Wanted;
use ff_dynamics::analysis::budget;
use ff_dynamics::motion::JointMotion;
use ff_dynamics::{Prescribed, Sampling, State, Work, hybrid_dynamics, reduced_torques};
use ff_model::{Model, Params};
use ff_testkit::assert_within;
use nalgebra::DMatrix;

const NOISE: SensorNoise = SensorNoise { torque: 0.1, gyro: Some(1.5e-4), rate: 100.0 };

/// A general state of `n` joints: positions, rates and accelerations all far from zero.
fn state(n: usize, seed: u64) -> [Vec<f64>; 3] {
    [numbers(n, 2.5, seed), numbers(n, 0.9, seed + 100), numbers(n, 1.3, seed + 200)]
}

/// One instant as a motion, for the tables of the dynamics crate.
struct Instant<'a>(&'a [Vec<f64>; 3]);

impl JointMotion for Instant<'_> {
    fn dof(&self) -> usize {
        self.0[0].len()
    }
    fn duration(&self) -> f64 {
        0.0
    }
    fn eval(&self, _t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        q.copy_from_slice(&self.0[0]);
        qd.copy_from_slice(&self.0[1]);
        qdd.copy_from_slice(&self.0[2]);
    }
}

fn rigid() -> (Model, Params<f64>) {
    let model = paper("flex.toml").model.without_appendages();
    let params = Params::nominal(&model);
    (model, params)
}

/// Joints that follow others, one of them a joint further out.
fn couple(model: &mut Model) {
    model.couple(3, 5, -0.7, 0.2).unwrap();
    model.couple(6, 3, 1.4, -0.1).unwrap();
}

/// The robot, and the same with coupled joints.
fn both() -> [(Model, Params<f64>); 2] {
    let (model, params) = rigid();
    let mut coupled = model.clone();
    couple(&mut coupled);
    [(model, params.clone()), (coupled, params)]
}

#[test]
fn base_motion_is_that_of_the_dynamics_crate_at_zero_momentum() {
    for (seed, (model, params)) in (0..20).zip(both().iter().cycle()) {
        let robot = RigidBase::new(model, params).unwrap();
        let [q, qd, qdd] = state(model.nj(), seed);
        let twist = robot.base_twist(&q, &qd);
        let mut s = State::zero(model);
        s.q.copy_from_slice(&q);
        s.v[..6].copy_from_slice(twist.as_slice());
        s.qd_mut().copy_from_slice(&qd);
        let mut work = Work::new(model);
        let b = budget(model, params, &s, &mut work);
        assert_within!(b.momentum.to_vector().norm(), 1e-12 * 600.0, "{:?}", b.momentum);
        let (mut a, mut tau) = (vec![0.0; model.nv()], vec![0.0; model.nj()]);
        hybrid_dynamics(model, params, &s, &qdd, &mut work, &mut a, &mut tau).unwrap();
        let mut out = [0.0; 6];
        robot.base_acceleration(&q, &qd, &qdd, &mut out);
        for i in 0..6 {
            assert_within!((out[i] - a[i]).abs(), 1e-13, "{out:?} against {a:?}");
        }
    }
}

#[test]
fn partials_match_differences() {
    for (seed, (model, params)) in (0..10).zip(both().iter().cycle()) {
        let robot = RigidBase::new(model, params).unwrap();
        let n = model.nj();
        let at = state(n, seed);
        let (mut out, mut partials) = ([0.0; 6], BasePartials::new(n));
        robot.partials(&at[0], &at[1], &at[2], &mut out, &mut partials);
        for (k, exact) in [&partials.q, &partials.qd, &partials.qdd].into_iter().enumerate() {
            for j in 0..n {
                let value = |d: f64| {
                    let mut x = at.clone();
                    x[k][j] += d;
                    let mut out = [0.0; 6];
                    robot.base_acceleration(&x[0], &x[1], &x[2], &mut out);
                    out
                };
                let h = 1e-3;
                let (p, m, pp, mm) = (value(h), value(-h), value(2.0 * h), value(-2.0 * h));
                for i in 0..6 {
                    let num = (8.0 * (p[i] - m[i]) - (pp[i] - mm[i])) / (12.0 * h);
                    assert_within!((exact[(i, j)] - num).abs(), 1e-9, "{k} {j} {i}: {} against {num}", exact[(i, j)]);
                }
            }
        }
    }
}

#[test]
fn rows_are_the_rda_jacobian_and_the_rate_sensitivity() {
    let all: Vec<usize> = (0..10).collect();
    let sampling = Sampling { samples: 1, sample_s: 0.01, substeps: 1 };
    for (seed, (model, params)) in (0..10).zip(both().iter().cycle()) {
        let info = RigidInformation::new(model, params, &all, NOISE).unwrap();
        let n = model.nj();
        let at = state(n, seed);
        let mut rows = DMatrix::zeros(n + 3, 10);
        info.rows_at(&at[0], &at[1], &at[2], &mut rows);
        let rate = info.robot().base_twist(&at[0], &at[1]).fixed_rows::<3>(3).transpose();
        let table = Prescribed::new(model, params, &Instant(&at), &sampling, &[]);
        let wanted = Wanted { params: all.clone(), initial: Vec::new(), ..Wanted::default() };
        let rates = DMatrix::from_row_slice(1, 3, rate.as_slice());
        let (_, jacobian) = reduced_torques(model, params, &table, &rates, &wanted).unwrap();
        for k in 0..10 {
            for j in 0..n {
                let want = jacobian[(j, k)] * info.sizes()[k] / NOISE.torque;
                assert_within!((rows[(j, k)] - want).abs(), 1e-11 * (1.0 + want.abs()), "torque {j}, parameter {k}");
            }
            let rate_at = |d: f64| {
                let mut v = params.values().to_vec();
                v[k] += d * info.sizes()[k];
                let robot = RigidBase::new(model, &Params::from_values(model, v)).unwrap();
                robot.base_twist(&at[0], &at[1])
            };
            let num = (rate_at(1e-5) - rate_at(-1e-5)) / 2e-5 / 1.5e-4;
            for r in 0..3 {
                assert_within!(
                    (rows[(n + r, k)] - num[3 + r]).abs(),
                    1e-7 * (1.0 + num.norm()),
                    "gyro {r}, parameter {k}"
                );
            }
        }
    }
}

#[test]
fn contracted_gradient_matches_differences() {
    // The flexible mission: its panels are frozen into the base.
    let plain = paper("flex.toml").model;
    let mut coupled = plain.clone();
    couple(&mut coupled);
    let params = Params::nominal(&plain);
    let cases = [
        (&plain, (0..10).collect::<Vec<_>>(), Some(1.5e-4)),
        (&plain, vec![0, 2, 5, 9], None),
        (&coupled, (0..10).collect(), Some(1.5e-4)),
    ];
    for (model, estimated, gyro) in cases {
        let noise = SensorNoise { gyro, ..NOISE };
        let info = RigidInformation::new(model, &params, &estimated, noise).unwrap();
        let joints = model.nj();
        for seed in 0..5 {
            let at = state(joints, seed);
            let (rows, n) = (info.rows(), info.parameters());
            let weights = DMatrix::from_vec(rows, n, numbers(rows * n, 1.0, seed + 300));
            let gradient = |s: &dyn SampleInformation| {
                let mut g = [vec![0.0; joints], vec![0.0; joints], vec![0.0; joints]];
                let [a, b, c] = &mut g;
                s.contract([&at[0], &at[1], &at[2]], &weights, [a, b, c]);
                g
            };
            let (exact, num) = (gradient(&info), gradient(&Numeric(&info)));
            for k in 0..3 {
                let norm = num[k].iter().map(|x| x * x).sum::<f64>().sqrt();
                for j in 0..joints {
                    let (e, x) = (exact[k][j], num[k][j]);
                    assert_within!((e - x).abs(), 1e-7 * norm, "{k} {j}: {e} against {x}");
                }
            }
        }
    }
}

#[test]
fn freezing_adds_the_panels_to_the_given_base() {
    let loaded = paper("flex.toml");
    let mut v = Params::<f64>::nominal(&loaded.model).values().to_vec();
    v[0] = 700.0;
    let robot = RigidBase::new(&loaded.model, &Params::from_values(&loaded.model, v.clone())).unwrap();
    let mut heavier = loaded.model.frozen(&Params::nominal(&loaded.model));
    let mut extra = ff_model::Inertia::zero();
    extra.mass = 100.0;
    heavier.add_rigid(0, &extra);
    let want = RigidBase::new(&heavier, &Params::nominal(&heavier)).unwrap();
    let [q, qd, _] = state(7, 3);
    assert_within!((robot.base_twist(&q, &qd) - want.base_twist(&q, &qd)).norm(), 1e-14);
}

#[test]
fn bad_requests_are_refused_by_name() {
    let loaded = paper("flex.toml");
    let (model, params) = (&loaded.model, Params::nominal(&loaded.model));
    let new = |e: &[usize], n| RigidInformation::new(model, &params, e, n).map(|_| ());
    assert!(matches!(new(&[0, 12], NOISE), Err(RigidError::NotBase { name }) if name == "link1.h_y"));
    assert!(matches!(new(&[0, 9999], NOISE), Err(RigidError::NotBase { name }) if name == "9999"));
    assert_eq!(new(&[], NOISE), Err(RigidError::Selection));
    assert_eq!(new(&[3, 3], NOISE), Err(RigidError::Selection));
    let silent = SensorNoise { torque: f64::NAN, ..NOISE };
    assert!(matches!(new(&[0], silent), Err(RigidError::Noise { .. })));
    let fixed = model.clone().with_base_kind(ff_model::BaseKind::Fixed);
    assert_eq!(RigidBase::new(&fixed, &params).map(|_| ()).unwrap_err(), RigidError::NotFreeFloating);
}
