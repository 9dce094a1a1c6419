//! Nothing allocates after `Work::new`: every algorithm that takes a `Work`, over numbers and duals, and the integrator.
#![allow(clippy::unwrap_used)] // helpers outside #[test] may panic too

use crate::common::*;
use allocation_counter::measure;
use ff_dynamics::analysis::budget;
use ff_dynamics::motion::JointMotion;
use ff_dynamics::sim::inputs::ExternalInput;
use ff_dynamics::sim::simulate_with;
use ff_dynamics::sim::{QUADRATURES, Rkmk4};
use ff_dynamics::tree::mass_matrix_lower;
use ff_dynamics::*;
use ff_model::scalar::{D1, ModelScalar};
use ff_model::*;
use nalgebra::DMatrix;

/// Allocations of each algorithm in its first call; results are made beforehand.
fn counts<T: ModelScalar>(m: &Model) -> Vec<(&'static str, u64)> {
    let p = Params::<T>::nominal(m);
    let s = random_state(m, &mut rng(41), 0.3).lift::<T>();
    let (nv, nj) = (m.nv(), m.nj());
    let a: Vec<T> = (0..nv).map(|i| T::from_f64(0.3 - 0.07 * i as f64)).collect();
    let (mut out, mut tau) = (a.clone(), vec![T::zero(); nj]);
    let mut h = DMatrix::from_element(nv, nv, T::zero());
    let mut w = Work::new(m);
    let frame = m.frames().last().unwrap();
    vec![
        ("rnea", measure(|| rnea(m, &p, &s, &a, &mut w, &mut out)).count_total),
        ("bias", measure(|| bias(m, &p, &s, &mut w, &mut out)).count_total),
        ("mass_matrix_lower", measure(|| _ = mass_matrix_lower(m, &p, &s, &mut w)).count_total),
        ("mass_matrix", measure(|| mass_matrix(m, &p, &s, &mut w, &mut h)).count_total),
        ("forward_dynamics", measure(|| forward_dynamics(m, &p, &s, &a, &mut w, &mut out).unwrap()).count_total),
        (
            "hybrid_dynamics",
            measure(|| hybrid_dynamics(m, &p, &s, &a[6..6 + nj], &mut w, &mut out, &mut tau).unwrap()).count_total,
        ),
        ("budget", measure(|| _ = budget(m, &p, &s, &mut w)).count_total),
        ("frame_pose", measure(|| _ = frame_pose(m, &s, frame, &mut w)).count_total),
    ]
}

#[test]
fn the_counter_counts() {
    assert_eq!(measure(|| drop(std::hint::black_box(vec![0.5; 7]))).count_total, 1);
}

#[test]
fn algorithms_do_not_allocate() {
    let m = system();
    // Not over `Grad` and `D2`: the algorithms are the same over duals of any width and depth, which take a third of the time that this
    // program compiles. `validate` counts the allocations of appendages over them.
    for (number, all) in [("f64", counts::<f64>(&m)), ("D1", counts::<D1>(&m))] {
        assert!(all.iter().all(|(_, n)| *n == 0), "over {number}: {all:?}");
    }
}

#[test]
fn a_step_of_the_integrator_does_not_allocate() {
    let m = system();
    let p = Params::<f64>::nominal(&m);
    let mut s = random_state(&m, &mut rng(42), 0.1);
    let (mut w, mut stepper) = (Work::new(&m), Rkmk4::<f64>::new(&m));
    let (mut quad, mut tau) = ([0.0; QUADRATURES], vec![0.2; m.nv()]);
    tau[..6].fill(0.0);
    let before = s.clone();
    let n = measure(|| {
        for k in 0..3 {
            let t = 0.001 * f64::from(k);
            stepper
                .step(t, 0.001, &mut s, &mut quad, |_, s, a, _| forward_dynamics(&m, &p, s, &tau, &mut w, a))
                .unwrap();
        }
    });
    assert_ne!(s, before, "it moved");
    assert_eq!(n.count_total, 0);
}

/// What `simulate` allocates (trace, buffers) does not grow with the number of steps.
#[test]
fn simulation_allocates_by_sample_and_not_by_step() {
    let m = system();
    let p = Params::<f64>::nominal(&m);
    let s = State::zero(&m);
    let wave = Wave(m.nj());
    let law = |_: f64, s: &State<f64>, tau: &mut [f64]| tau.iter_mut().zip(s.qd()).for_each(|(t, w)| *t = 0.1 - w);
    for drive in [Drive::Prescribed(&wave as &dyn JointMotion), Drive::Torque(&law)] {
        let count = |step_s: f64| {
            let o = SimOptions { duration_s: 0.1, step_s, sample_s: 0.02 };
            measure(|| drop(simulate(&m, &p, &s, &drive, &o).unwrap())).count_total
        };
        let (few, many) = (count(0.01), count(0.0005));
        assert!(few > 0);
        assert_eq!(few, many, "10 steps against 200");
    }
}

/// External inputs add nothing per step.
#[test]
fn inputs_do_not_allocate() {
    use ff_dynamics::sim::inputs::{GravityGradient, PassiveForce, Signal};
    let m = system();
    let (p, s, wave) = (Params::<f64>::nominal(&m), State::zero(&m), Wave(m.nj()));
    let gradient = GravityGradient::new(0.5, 1.0, v3(0.6, -0.3, 0.9), v3(0.3, 0.6, 0.0)).unwrap();
    let motor = PassiveForce { coordinate: 2, force: Signal::constant([0.4]).unwrap() };
    let inputs: [&dyn ExternalInput; 2] = [&gradient, &motor];
    let drive = Drive::Prescribed(&wave);
    let fixed = |step_s: f64| {
        let o = SimOptions { duration_s: 0.1, step_s, sample_s: 0.02 };
        measure(|| drop(simulate_with(&m, &p, &s, &drive, &inputs, &o).unwrap())).count_total
    };
    assert_eq!(fixed(0.01), fixed(0.0005), "10 steps against 200");
}

/// The reduced system and its sensitivities: buffers and results once, nothing per step or stage.
#[test]
fn records_of_prescribed_motion_allocate_once() {
    let m = system();
    let p = Params::<f64>::nominal(&m);
    let wave = Wave(m.nj());
    let z0 = vec![0.01; 6 + 2 * m.np()];
    let wanted = Wanted { params: (0..m.n_params()).collect(), initial: vec![2, 7], ..Wanted::default() };
    let links = wanted.links(&m);
    let allocations = |substeps: usize| {
        let table = Prescribed::new(&m, &p, &wave, &Sampling { samples: 6, sample_s: 0.02, substeps }, &links);
        [
            measure(|| drop(simulate_reduced(&m, &p, &table, &z0).unwrap())).count_total,
            measure(|| drop(sensitivities(&m, &p, &table, &z0, &wanted).unwrap())).count_total,
        ]
    };
    let (few, many) = (allocations(2), allocations(20));
    assert!(few[0] > 0 && few[1] > few[0], "{few:?}");
    assert_eq!(few, many, "10 steps against 100");
}
