//! Every cost against central differences, over control points, free end and free duration.

use crate::common::{Toy, ToyRegressor, spec};
use excitation::objective::Optimality;
use excitation::objective::{
    BaseMotion, Disturbance, DrivenMode, Form, Information, Modal, ModalResponse, Quiet, ResponseTarget, Robust, Target,
};
use excitation::plan::PlanError;
use excitation::plan::feasible_start;
use excitation::solve::minimise;
use excitation::*;
use ff_dynamics::motion::JointMotion;
use ff_testkit::assert_within;
use nalgebra::Vector6;

fn plans() -> Vec<(SplinePlan, Vec<f64>)> {
    let mut free = spec(3, 7);
    free.duration = Duration::Free { min: 15.0, max: 40.0 };
    free.end = End::Free;
    [spec(3, 7), free]
        .into_iter()
        .enumerate()
        .map(|(i, s)| {
            let p = SplinePlan::new(s).unwrap();
            let x = random_plan(&p, 11 + i as u64, 3, 0.9).unwrap();
            (p, x)
        })
        .collect()
}

fn check(cost: &dyn Cost) {
    for (plan, x) in plans() {
        let n = plan.variables();
        let (mut g, mut scrap) = (vec![7.0; n], vec![0.0; n]);
        cost.value_gradient(&plan, &x, &mut g);
        let norm = g.iter().map(|v| v * v).sum::<f64>().sqrt();
        for i in 0..n {
            let mut y = x.clone();
            let mut at = |d: f64| {
                y[i] = x[i] + d;
                cost.value_gradient(&plan, &y, &mut scrap)
            };
            // Fourth-order central difference.
            let h = 1e-3 * x[i].abs().clamp(0.3, 1.0);
            let num = (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
            assert_within!(
                (g[i] - num).abs(),
                1e-6 * norm.max(g[i].abs()),
                "variable {i}: {} against {num}, norm {norm}",
                g[i]
            );
        }
    }
}

#[test]
fn base_motion_gradient() {
    for form in [Form::Inverse, Form::Log] {
        let directions =
            vec![Vector6::new(0.0, 0.0, 0.0, 0.36, 0.48, 0.8), Vector6::new(0.3, -0.2, 0.5, 0.0, 0.1, -0.4)];
        check(&BaseMotion { response: Toy(3), directions, samples: 61, form });
    }
}

#[test]
fn information_gradient_analytic_and_numeric() {
    for analytic in [true, false] {
        check(&Information { source: ToyRegressor { n: 3, analytic }, samples: 41, rate: 100.0, delta: 1e-3 });
    }
}

#[test]
fn quiet_and_modal_gradients() {
    check(&Quiet { low: 0.05, high: 0.4, points: 23, weights: vec![1.0, 0.4, 2.3] });
    let targets = vec![
        Target { frequency: 0.113, weights: vec![0.3, -1.2, 0.8], importance: 0.7 },
        Target { frequency: 0.23, weights: vec![1.1, 0.6, -0.5], importance: 1.9 },
    ];
    for form in [Form::Inverse, Form::Log] {
        check(&Modal { targets: targets.clone(), form });
    }
    let sum: Vec<(f64, Box<dyn Cost>)> = vec![
        (3.0, Box::new(Quiet { low: 0.1, high: 0.2, points: 5, weights: vec![1.0; 3] })),
        (0.2, Box::new(Modal { targets, form: Form::Log })),
    ];
    check(&CostSum(sum));
}

#[test]
fn disturbance_gradient() {
    let mode = |frequency, damping, drive| DrivenMode { frequency, damping, drive, torque: 30.0, gyro: 2.0 };
    let modes = vec![
        mode(0.11, 0.004, Vector6::new(0.3, -0.2, 0.5, 0.0, 0.1, -0.4)),
        mode(0.23, 0.05, Vector6::new(0.0, 0.4, 0.1, 0.7, -0.3, 0.2)),
    ];
    check(&Disturbance { response: Toy(3), modes, rate: 100.0, duration: 19.0, emphasis: 0.7 });
}

#[test]
fn response_gradient() {
    let target = |frequency, damping, drive, importance| ResponseTarget {
        mode: DrivenMode { frequency, damping, drive, torque: 30.0, gyro: 2.0 },
        spread: 0.06,
        importance,
    };
    let targets = vec![
        target(0.11, 0.02, Vector6::new(0.3, -0.2, 0.5, 0.0, 0.1, -0.4), 0.6),
        target(0.23, 0.01, Vector6::new(0.0, 0.4, 0.1, 0.7, -0.3, 0.2), 1.4),
    ];
    for robust in [Robust::Mean, Robust::Worst { power: 4.0 }] {
        check(&ModalResponse { response: Toy(3), targets: targets.clone(), fan: 5, robust });
    }
}

/// The optimality of the rows of a regressor, for every criterion that needs no names.
#[test]
fn optimality_gradients() {
    for criterion in [Criterion::D, Criterion::A, Criterion::E { power: 8.0 }, Criterion::Condition { power: 8.0 }] {
        let source = ToyRegressor { n: 3, analytic: true };
        // Enough prior that rounding in the inverse stays below what the differences resolve.
        let information = Information { source, samples: 41, rate: 100.0, delta: 3.0 };
        check(&Optimality { information, criterion });
    }
}

#[test]
fn wide_band_energy_is_parseval() {
    let (plan, x) = plans().remove(0);
    let m = plan.motion(&x).unwrap();
    let weights = vec![1.0, 0.4, 2.3];
    let (mut q, mut qd, mut qdd) = ([0.0; 3], [0.0; 3], [0.0; 3]);
    let steps = 40_000;
    let mut energy = 0.0;
    for i in 0..steps {
        m.eval(m.duration() * (i as f64 + 0.5) / steps as f64, &mut q, &mut qd, &mut qdd);
        energy += (0..3).map(|j| weights[j] * qdd[j] * qdd[j]).sum::<f64>() * m.duration() / steps as f64;
    }
    let mut g = vec![0.0; x.len()];
    let wide = Quiet { low: 0.0, high: 4.0, points: 800, weights }.value_gradient(&plan, &x, &mut g);
    assert_within!((wide / energy - 1.0).abs(), 1e-4, "{wide} against {energy}");
}

#[test]
fn no_motion_has_no_finite_gain() {
    let mut s = spec(2, 5);
    s.end = End::Fixed(s.start.clone());
    let plan = SplinePlan::new(s).unwrap();
    let x = feasible_start(&plan, 19.0).unwrap();
    let target = Target { frequency: 0.2, weights: vec![1.0, 0.5], importance: 1.0 };
    let cost = Modal { targets: vec![target], form: Form::Log };
    assert!(matches!(minimise(&cost, &plan, &x, &SqpOptions::default()), Err(PlanError::Cost(_))));
}
