//! External inputs: momentum changes by their impulse and nothing else, energy by their work.
#![allow(clippy::unwrap_used)] // helpers of a test may unwrap like the test

use crate::common::*;
use ff_dynamics::sim::inputs::ExternalInput;
use ff_dynamics::sim::inputs::{AppliedWrench, Axes, GravityGradient, PassiveForce, Pulse, Signal, Thruster};
use ff_dynamics::sim::simulate_with;
use ff_dynamics::*;
use ff_model::spatial::so3::{exp_so3, quat_to_rot};
use ff_model::*;
use nalgebra::{Matrix3, Vector6};

fn start(m: &Model) -> State<f64> {
    let mut r = rng(99);
    let mut s = State::zero(m);
    s.pos = v3(0.3, -0.4, 0.2);
    s.att = exp_so3(&v3(0.4, -0.2, 0.9));
    s.q = vec![0.3, 0.8, -0.4, 0.7, 0.2, 0.5, -0.3];
    s.eta.iter_mut().for_each(|x| *x = uniform(&mut r, -0.1, 0.1));
    s.v.iter_mut().for_each(|x| *x = uniform(&mut r, -0.06, 0.06));
    s
}

/// Joint dampers and a slow push.
fn law(t: f64, s: &State<f64>, tau: &mut [f64]) {
    tau.iter_mut().zip(s.qd()).enumerate().for_each(|(i, (x, w))| *x = (0.7 * t + i as f64).sin() - 3.0 * w);
}

/// Pulses whose edges fall between steps.
fn burns() -> Signal<1> {
    let p = |start_s, end_s, value| Pulse { start_s, end_s, value: [value] };
    Signal::pulses(vec![p(0.3137, 1.0213, 22.0), p(1.7, 1.70042, 9.0), p(2.01, 2.7771, 13.0)]).unwrap()
}

/// A strong gradient, so that it shows: an orbit of nine seconds.
fn gradient() -> GravityGradient {
    GravityGradient::new(0.5, 1.0, v3(0.6, -0.3, 0.9), v3(0.3, 0.6, 0.0)).unwrap()
}

fn samples() -> AppliedWrench {
    let times = vec![0.2, 0.9, 1.3, 2.45];
    let w = [[3.0, -1.0, 2.0, 0.7, 1.1, -0.4], [-2.0, 4.0, 1.0, 0.3, -0.9, 0.8]];
    let wrench = Signal::sampled(times, vec![w[0], w[1], w[0].map(|x| 0.3 * x), w[1]]).unwrap();
    AppliedWrench { body: 2, axes: Axes::World, wrench }
}

/// Largest violation of the two balances, relative: momentum (linear, angular) and energy.
fn balances(m: &Model, p: &Params<f64>, tr: &Trace) -> [f64; 3] {
    let b0 = tr.budget(m, p, 0);
    let (mut worst, mut size) = ([0.0f64; 3], [b0.momentum.lin.norm(), b0.momentum.ang.norm(), b0.energy().abs()]);
    for i in 0..tr.len() {
        let b = tr.budget(m, p, i);
        let j = Force::from_slice(&Vector6::from_iterator(tr.impulse.row(i).iter().copied()).data.0[0]);
        let gain = tr.work[i] + tr.input_work[i] - tr.dissipated[i];
        let off = [
            (b.momentum.lin - b0.momentum.lin - j.lin).norm(),
            (b.momentum.ang - b0.momentum.ang - j.ang).norm(),
            (b.energy() - b0.energy() - gain).abs(),
        ];
        for k in 0..3 {
            worst[k] = worst[k].max(off[k]);
        }
        size[2] = size[2].max(b.energy().abs());
    }
    [0, 1, 2].map(|k| worst[k] / size[k])
}

#[test]
fn momentum_and_energy_change_by_what_the_inputs_give() {
    let m = system();
    let (p, s, motion) = (Params::nominal(&m), start(&m), Wave(m.nj()));
    let thruster = Thruster::new(0, v3(-0.4, 0.7, 0.2), v3(0.3, -0.5, 1.0), burns()).unwrap();
    let (gradient, samples) = (gradient(), samples());
    let motor = PassiveForce { coordinate: 3, force: burns() };
    let boom = PassiveForce { coordinate: 6, force: Signal::constant([0.3]).unwrap() };
    let inputs: [&dyn ExternalInput; 5] = [&thruster, &gradient, &samples, &motor, &boom];
    let o = SimOptions { duration_s: 3.0, step_s: 1e-3, sample_s: 0.05 };
    for drive in [Drive::Torque(&law), Drive::Prescribed(&motion)] {
        let tr = simulate_with(&m, &p, &s, &drive, &inputs, &o).unwrap();
        let b = balances(&m, &p, &tr);
        let (last, j) = (tr.len() - 1, tr.impulse.row(tr.len() - 1).norm());
        println!("off by {b:?}; impulse {j:.1}, input work {:.2} J", tr.input_work[last]);
        assert!(b.iter().all(|x| *x < 1e-9), "{b:?}");
        assert!(j > 10.0 && tr.input_work[last].abs() > 0.5, "the inputs must matter");
    }
}

/// Non-zero momentum at the start, prescribed joints, dampers on, nothing from outside.
#[test]
fn momentum_of_the_start_is_kept() {
    let m = system();
    let (p, s, motion) = (Params::nominal(&m), start(&m), Wave(m.nj()));
    let o = SimOptions { duration_s: 20.0, step_s: 2e-3, sample_s: 0.5 };
    let tr = simulate(&m, &p, &s, &Drive::Prescribed(&motion), &o).unwrap();
    let b = balances(&m, &p, &tr);
    println!("off by {b:?}");
    assert!(b[0] < 1e-9 && b[1] < 1e-9 && b[2] < 1e-8, "{b:?}");
    assert!(tr.impulse.amax() == 0.0 && tr.input_work.iter().all(|x| *x == 0.0));
    assert!(tr.dissipated[tr.len() - 1] > 0.01, "dampers must matter");
    assert!(tr.budget(&m, &p, 0).momentum.lin.norm() > 1.0);
}

fn one_body() -> (Model, Inertia<f64>) {
    let i = Inertia::from_com(7.3, &v3(0.2, -0.1, 0.3), &Matrix3::from_diagonal(&v3(2.0, 3.1, 2.6)));
    (Model::new("one", "base", i, BaseKind::Floating), i)
}

/// A push through the centre of mass, switched between steps, against the integral by hand.
#[test]
fn a_burn_gives_its_impulse_whatever_the_steps() {
    let (m, i) = one_body();
    let (p, mut s) = (Params::nominal(&m), State::zero(&m));
    s.att = exp_so3(&v3(0.4, -0.2, 0.9));
    let (from, to, end, thrust) = (0.3137, 1.0213, 2.0, 11.0);
    let d = v3(0.3, -0.5, 1.0).normalize();
    let pulse = Signal::pulses(vec![Pulse { start_s: from, end_s: to, value: [thrust] }]).unwrap();
    let thruster = Thruster::new(0, i.h / i.mass, d * 4.0, pulse).unwrap();
    let a = thrust / i.mass;
    let velocity = quat_to_rot(&s.att) * d * (a * (to - from));
    let position = quat_to_rot(&s.att) * d * (0.5 * a * (to - from).powi(2) + a * (to - from) * (end - to));
    for step_s in [0.25, 0.1, 7e-3] {
        let o = SimOptions { duration_s: end, step_s, sample_s: 0.5 };
        let tr = simulate_with(&m, &p, &s, &Drive::Torque(&|_, _, _| {}), &[&thruster], &o).unwrap();
        let off = (tr.last.pos - position).norm();
        let j = tr.impulse.fixed_view::<1, 3>(tr.len() - 1, 0).transpose();
        assert!(off < 1e-9 && (j - velocity * i.mass).norm() < 1e-9, "{step_s}: {off:e}");
        assert_within!((quat_to_rot(&tr.last.att) * tr.last.base_twist().lin - velocity).norm(), 1e-9);
    }
}

/// A wrench in world axes keeps its direction on a tumbling body; one in body axes does not.
#[test]
fn axes_of_a_wrench() {
    let (m, i) = one_body();
    let (p, mut s) = (Params::nominal(&m), State::zero(&m));
    s.v.copy_from_slice(&[0.1, 0.2, -0.1, 0.5, -0.7, 0.9]);
    let w = [1.0, -2.0, 0.7, 0.2, 0.1, -0.3];
    let run = |axes| {
        let wrench = AppliedWrench { body: 0, axes, wrench: Signal::constant(w).unwrap() };
        let o = SimOptions { duration_s: 1.5, step_s: 2e-3, sample_s: 0.5 };
        simulate_with(&m, &p, &s, &Drive::Torque(&|_, _, _| {}), &[&wrench], &o).unwrap()
    };
    let (world, body) = (run(Axes::World), run(Axes::Body));
    let force = v3(w[0], w[1], w[2]) * 1.5;
    let j = |tr: &Trace| tr.impulse.fixed_view::<1, 3>(tr.len() - 1, 0).transpose();
    assert_within!((j(&world) - force).norm(), 1e-9);
    assert!((j(&body) - force).norm() > 0.3);
    let gain = world.budget(&m, &p, 3).momentum.lin - world.budget(&m, &p, 0).momentum.lin;
    assert!((gain - force).norm() < 1e-9 && i.mass > 1.0);
    for tr in [&world, &body] {
        assert!(balances(&m, &p, tr).iter().all(|x| *x < 1e-9));
    }
}

/// The gradient on ports, own rows included, against the same bodies as links of the tree.
#[test]
fn the_gradient_acts_on_appendages_as_on_their_bodies() {
    let mut moved = 0.0f64;
    for seed in 0..12 {
        let mut r = rng(700 + seed);
        let t = random_twins(&mut r);
        let mut s = random_state(&t.ports, &mut r, 0.3);
        s.v.iter_mut().for_each(|x| *x *= 0.3);
        let gradient = GravityGradient::new(0.9, 1.0, v3(0.6, -0.3, 0.9), v3(0.3, 0.6, 0.0)).unwrap();
        let nj = t.ports.nj();
        let springs = |_: f64, s: &State<f64>, tau: &mut [f64]| {
            tau.fill(0.0);
            for (k, (stiff, damp, rest)) in t.springs.iter().enumerate() {
                tau[nj + k] = -stiff * (s.q[nj + k] - rest) - damp * s.qd()[nj + k];
            }
        };
        let o = SimOptions { duration_s: 0.2, step_s: 1e-3, sample_s: 0.1 };
        let run = |m: &Model, s: &State<f64>, drive: &Drive<'_>, inputs: &[&dyn ExternalInput]| {
            simulate_with(m, &Params::nominal(m), s, drive, inputs, &o).unwrap()
        };
        let none = |_: f64, _: &State<f64>, tau: &mut [f64]| tau.fill(0.0);
        let ports = run(&t.ports, &s, &Drive::Torque(&none), &[&gradient]);
        let tree = run(&t.tree, &tree_state(&t, &s), &Drive::Torque(&springs), &[&gradient]);
        let free = run(&t.ports, &s, &Drive::Torque(&none), &[]);
        let off = |a: &[f64], b: &[f64]| {
            let size = b.iter().fold(1.0f64, |m, x| m.max(x.abs()));
            a.iter().zip(b).fold(0.0f64, |m, (a, b)| m.max((a - b).abs())) / size
        };
        let e = off(&ports.last.v, &tree.last.v).max(off(ports.impulse.as_slice(), tree.impulse.as_slice()));
        assert_within!(e, 1e-9, "seed {seed}: {e:e}");
        assert_within!((ports.input_work[2] - tree.input_work[2]).abs(), 1e-9 * tree.input_work[2].abs().max(1.0));
        moved = moved.max(off(ports.last.nu(), free.last.nu()));
    }
    assert!(moved > 1e-3, "the gradient must show on the passive coordinates: {moved:e}");
}

/// A body on its orbit swings about the vertical with the frequency of the textbooks:
/// `w^2 = 3 n^2 (I_t - I_r) / I_n` in the plane of the orbit (Hughes 1986, sec. 9.1).
#[test]
fn libration_has_its_period() {
    let (radial, along, normal) = (v3(1.0, 0.0, 0.0), v3(0.0, 1.0, 0.0), v3(0.0, 0.0, 1.0));
    let (ir, it, inn) = (400.0, 1100.0, 1300.0);
    let body = Inertia::from_com(500.0, &v3(0.0, 0.0, 0.0), &Matrix3::from_diagonal(&v3(ir, it, inn)));
    let m = Model::new("orbit", "base", body, BaseKind::Floating);
    let g = GravityGradient::new(GravityGradient::EARTH, 6.878e6, radial, normal).unwrap();
    let (n, pitch) = (g.rate(), 1e-4);
    assert!((std::f64::consts::TAU / n / 60.0 - 94.6).abs() < 0.1, "500 km: {} s", std::f64::consts::TAU / n);
    let mut s = State::zero(&m);
    s.att = exp_so3(&v3(0.0, 0.0, pitch));
    s.v[5] = n;
    let half = std::f64::consts::PI / (n * (3.0 * (it - ir) / inn).sqrt());
    let o = SimOptions { duration_s: half, step_s: half / 4096.0, sample_s: 0.5 * half };
    let tr = simulate_with(&m, &Params::nominal(&m), &s, &Drive::Torque(&|_, _, _| {}), &[&g], &o).unwrap();
    let angle = |i: usize| {
        let x = quat_to_rot(&tr.state(&m, i).att) * radial;
        let o = g.radial(i as f64 * tr.dt);
        // Signed angle from the vertical to the axis of the body.
        normal.dot(&o.cross(&x)).atan2(o.dot(&x))
    };
    assert_within!((angle(0) / pitch - 1.0).abs(), 1e-9);
    assert_within!(angle(1).abs(), 1e-5 * pitch, "{:e}", angle(1));
    assert_within!((angle(2) / pitch + 1.0).abs(), 1e-5, "{:e}", angle(2));
    assert!(along.dot(&g.radial(0.25 * std::f64::consts::TAU / n)) > 0.999_999);
}

#[test]
fn inputs_that_do_not_fit_are_named() {
    let m = system();
    let (p, s) = (Params::nominal(&m), start(&m));
    let o = SimOptions { duration_s: 0.1, step_s: 0.01, sample_s: 0.01 };
    let go = |inputs: &[&dyn ExternalInput]| {
        simulate_with(&m, &p, &s, &Drive::Torque(&law), inputs, &o).unwrap_err().to_string()
    };
    let on = |body| Thruster::new(body, v3(0.1, 0.2, 0.3), v3(0.0, 1.0, 0.5), burns()).unwrap();
    assert_eq!(
        go(&[&on(3), &on(8)]),
        "external input 1 (from 0): body 8 does not exist; bodies are numbered from 0, the base, to 7"
    );
    let motor = PassiveForce { coordinate: 7, force: burns() };
    assert_eq!(
        go(&[&motor]),
        "external input 0 (from 0): passive coordinate 7 does not exist; the model has 7, numbered from 0"
    );
    let e = GravityGradient::new(4e14, 7e6, v3(1.0, 0.2, 0.0), v3(0.0, 0.3, 1.0)).unwrap_err();
    assert!(e.to_string().contains("must be zero to 1e-6"), "{e}");
    assert!(GravityGradient::new(4e14, -7e6, v3(1.0, 0.2, 0.0), v3(0.0, 0.0, 1.0)).is_err());
    assert!(GravityGradient::new(4e14, 7e6, v3(0.0, 0.0, 0.0), v3(0.0, 0.0, 1.0)).is_err());
}
