//! Modal weights against the full dynamics: at rest, and as the motion that is left over.

use crate::common::{numbers, paper};
use excitation::objective::{BaseResponse, Form, Modal, Target};
use excitation::plan::feasible_start;
use excitation::system::rigid::RigidBase;
use excitation::system::{driven_modes, flexible_band, modal_targets};
use excitation::*;
use ff_dynamics::motion::JointMotion;
use ff_dynamics::{Boundary, Prescribed, Sampling, State, Work, hybrid_dynamics, modes, simulate_reduced};
use ff_model::{BaseKind, Params};
use ff_testkit::assert_within;
use std::f64::consts::TAU;

#[test]
fn modes_add_up_to_the_passive_acceleration() {
    for file in ["flex.toml", "slosh.toml"] {
        for base in [BaseKind::Floating, BaseKind::Fixed] {
            let model = paper(file).model.with_base_kind(base);
            let params = Params::nominal(&model);
            for seed in 0..5 {
                let (q, qdd) = (numbers(7, 2.0, seed), numbers(7, 1.0, seed + 50));
                let mut s = State::zero(&model);
                s.q.copy_from_slice(&q);
                s.eta.copy_from_slice(&model.rest_position(&params));
                let (mut a, mut tau) = (vec![0.0; model.nv()], vec![0.0; 7]);
                hybrid_dynamics(&model, &params, &s, &qdd, &mut Work::new(&model), &mut a, &mut tau).unwrap();
                let shapes = modes(&model, &params, &q, &s.eta, Boundary::JointsHeld).unwrap();
                let targets = modal_targets(&model, &params, &q).unwrap();
                for i in 0..model.np() {
                    let force = |t: &Target| t.weights.iter().zip(&qdd).map(|(c, a)| c * a).sum::<f64>();
                    let sum: f64 = shapes.iter().zip(&targets).map(|(m, t)| m.passive[i] * force(t)).sum();
                    let want = a[model.nb() + 7 + i];
                    assert_within!((sum - want).abs(), 1e-10, "{file} {base:?} {i}: {sum} against {want}");
                }
            }
        }
    }
}

#[test]
fn base_acceleration_of_the_frozen_robot_drives_the_same_modes() {
    let noise = SensorNoise { torque: 0.1, gyro: None, rate: 100.0 };
    for file in ["flex.toml", "slosh.toml"] {
        let model = paper(file).model;
        let params = Params::nominal(&model);
        let robot = RigidBase::new(&model, &params).unwrap();
        for seed in 0..5 {
            let (q, qdd) = (numbers(7, 2.0, seed), numbers(7, 1.0, seed + 50));
            let mut a = [0.0; 6];
            robot.base_acceleration(&q, &[0.0; 7], &qdd, &mut a);
            let modes = driven_modes(&model, &params, &q, &noise).unwrap();
            for (m, t) in modes.iter().zip(modal_targets(&model, &params, &q).unwrap()) {
                let force: f64 = t.weights.iter().zip(&qdd).map(|(c, a)| c * a).sum();
                assert_within!((m.drive.dot(&nalgebra::Vector6::from(a)) - force).abs(), 1e-10);
                assert!(m.frequency == t.frequency && m.gyro == 0.0 && m.torque > 0.0);
            }
        }
    }
}

#[test]
fn a_small_motion_leaves_the_predicted_swing() {
    // Small, so that the mass matrix stays what it was; undamped, so that the swing lasts.
    let model = paper("flex.toml").model;
    let mut values = Params::<f64>::nominal(&model).values().to_vec();
    for (v, d) in values.iter_mut().zip(model.param_decls()) {
        if d.name.contains(".d[") {
            *v = 0.0;
        }
    }
    let params = Params::from_values(&model, values);
    let q = [1.57, 1.4, 0.3, -2.6, 0.2, 2.4, 0.1];
    let targets = modal_targets(&model, &params, &q).unwrap();
    let limits = JointLimits { lower: -3.1, upper: 3.1, velocity: 0.17, acceleration: 0.15, jerk: None };
    let plan = SplinePlan::new(PlanSpec {
        start: q.to_vec(),
        end: End::Fixed(q.to_vec()),
        duration: Duration::Fixed(12.0),
        degree: 5,
        free: 12,
        limits: vec![limits; 7],
        refine: 1,
    })
    .unwrap();
    let centre = feasible_start(&plan, 12.0).unwrap();
    let x: Vec<f64> =
        random_plan(&plan, 5, 0, 1.0).unwrap().iter().zip(&centre).map(|(a, c)| c + 1e-3 * (a - c)).collect();
    let motion = plan.motion(&x).unwrap();
    let sampling = Sampling { samples: 1201, sample_s: 0.01, substeps: 1 };
    let table = Prescribed::new(&model, &params, &motion, &sampling, &[]);
    let response = simulate_reduced(&model, &params, &table, &[0.0; 14]).unwrap();
    assert_eq!(motion.duration(), 12.0);
    let shapes = modes(&model, &params, &q, &model.rest_position(&params), Boundary::JointsHeld).unwrap();
    // Modal coordinates at the end: the shapes are a basis.
    let basis = nalgebra::DMatrix::from_fn(4, 4, |i, m| shapes[m].passive[i]).lu();
    let at = basis.solve(&response.eta.row(1200).transpose()).unwrap();
    let rate = basis.solve(&response.nu.row(1200).transpose()).unwrap();
    for (m, target) in targets.iter().enumerate() {
        let swing = rate[m].hypot(TAU * target.frequency * at[m]);
        let gain = Modal { targets: vec![target.clone()], form: Form::Inverse };
        let predicted = gain.value_gradient(&plan, &x, &mut vec![0.0; x.len()]).powf(-0.5);
        eprintln!("{:.4} Hz: left {swing:.6e} rad/s, predicted {predicted:.6e}", target.frequency);
        assert!((swing / predicted - 1.0).abs() < 0.02);
    }
}

#[test]
fn the_band_covers_all_modes_and_rigid_robots_have_none() {
    let model = paper("flex.toml").model;
    let params = Params::nominal(&model);
    let q = [0.0, 0.8, 0.0, 0.8, 0.0, 0.5, 0.0];
    let (low, high) = flexible_band(&model, &params, &q, 0.2).unwrap().unwrap();
    let targets = modal_targets(&model, &params, &q).unwrap();
    assert_eq!(targets.len(), 4);
    assert!((low - 0.8 * targets[0].frequency).abs() < 1e-12 && (high - 1.2 * targets[3].frequency).abs() < 1e-12);
    let rigid = model.without_appendages();
    let params = Params::nominal(&rigid);
    assert_eq!(flexible_band(&rigid, &params, &q, 0.2), Ok(None));
    assert_eq!(modal_targets(&rigid, &params, &q), Ok(Vec::new()));
}
