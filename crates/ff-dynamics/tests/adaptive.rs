//! Adaptive steps against the fixed step, and the error they report against the error they make.
#![allow(clippy::unwrap_used)] // helpers of a test may unwrap like the test

use crate::common::*;
use ff_dynamics::*;
use ff_model::*;

fn start(m: &Model) -> State<f64> {
    let mut s = State::zero(m);
    s.pos = v3(0.3, -0.4, 0.2);
    s.att = ff_model::spatial::so3::exp_so3(&v3(0.4, -0.2, 0.9));
    s.q = vec![0.3, 0.8, -0.4, 0.7, 0.2, 0.5, -0.3];
    s.eta.iter_mut().enumerate().for_each(|(i, x)| *x = 0.02 + 0.007 * i as f64);
    s.v.iter_mut().enumerate().for_each(|(i, x)| *x = 0.05 - 0.011 * i as f64);
    s
}

fn options(tolerance: f64) -> AdaptiveOptions {
    AdaptiveOptions {
        duration_s: 6.0,
        sample_s: 0.05,
        relative: tolerance,
        absolute: tolerance,
        max_step_s: f64::INFINITY,
    }
}

/// Largest difference of any recorded channel, each relative to its own size.
fn difference(a: &Trace, b: &Trace) -> f64 {
    assert_eq!(a.len(), b.len());
    let channels = |t: &Trace| {
        [&t.q, &t.qd, &t.qdd, &t.tau, &t.twist, &t.accel, &t.pos, &t.att, &t.eta, &t.nu].map(nalgebra::DMatrix::clone)
    };
    let matrices = channels(a).into_iter().zip(channels(b)).map(|(a, b)| (a - &b).amax() / b.amax());
    let energies = [(&a.dissipated, &b.dissipated), (&a.work, &b.work)].map(|(a, b)| {
        let size = b.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        a.iter().zip(b).fold(0.0f64, |m, (a, b)| m.max((a - b).abs())) / size
    });
    matrices.chain(energies).fold(0.0, f64::max)
}

#[test]
fn samples_agree_with_the_fixed_step_under_both_drives() {
    let m = system();
    let (p, s, motion) = (Params::nominal(&m), start(&m), Wave(m.nj()));
    let law = |t: f64, s: &State<f64>, tau: &mut [f64]| {
        tau.iter_mut().zip(s.qd()).enumerate().for_each(|(i, (x, w))| *x = (0.7 * t + i as f64).sin() - 3.0 * w);
    };
    for drive in [Drive::Prescribed(&motion), Drive::Torque(&law)] {
        let o = SimOptions { duration_s: 6.0, step_s: 5e-4, sample_s: 0.05 };
        let want = simulate(&m, &p, &s, &drive, &o).unwrap();
        let mut last = f64::INFINITY;
        for tolerance in [1e-5, 1e-7, 1e-9] {
            let (got, report) = simulate_adaptive(&m, &p, &s, &drive, &[], &options(tolerance)).unwrap();
            let e = difference(&got, &want);
            println!("tolerance {tolerance:.0e}: off by {e:.1e}, {report:?}");
            assert!(e < 2e3 * tolerance && e < 0.3 * last, "{e:e} at {tolerance:e}");
            last = e;
            assert!(report.shortest_s > 0.0 && report.shortest_s <= report.longest_s);
            assert_eq!(report.evaluations, 6 * (report.steps + report.rejected) + 3 + 120 + report.restarts);
        }
    }
}

/// Steps are longer than samples where they may be: the continuous extension serves the samples in between.
#[test]
fn dense_output_does_not_cost_steps() {
    let m = system();
    let (p, s, motion) = (Params::nominal(&m), start(&m), Wave(m.nj()));
    let run = |sample_s: f64| {
        let o = AdaptiveOptions { sample_s, ..options(1e-6) };
        simulate_adaptive(&m, &p, &s, &Drive::Prescribed(&motion), &[], &o).unwrap()
    };
    let (coarse, fine) = (run(0.5), run(0.002));
    assert_eq!(coarse.1.steps, fine.1.steps);
    assert_eq!((coarse.0.len(), fine.0.len()), (13, 3001));
    // Equal times, equal samples.
    for i in 0..13 {
        assert!((coarse.0.tau.row(i) - fine.0.tau.row(250 * i)).amax() < 1e-9 * fine.0.tau.amax());
    }
    assert!(fine.1.longest_s > 0.01, "{:?}", fine.1);
}

/// The reported error is of the size of the true one.
#[test]
fn the_reported_error_is_the_error_made() {
    let m = system();
    let (p, s, motion) = (Params::nominal(&m), start(&m), Wave(m.nj()));
    let drive = Drive::Prescribed(&motion);
    let truth = simulate(&m, &p, &s, &drive, &SimOptions { duration_s: 6.0, step_s: 5e-4, sample_s: 0.05 }).unwrap();
    for tolerance in [1e-5, 1e-7] {
        let (got, report) = simulate_adaptive(&m, &p, &s, &drive, &[], &options(tolerance)).unwrap();
        let (a, b) = (&got.last, &truth.last);
        let d = |x: &[f64], y: &[f64]| x.iter().zip(y).fold(0.0f64, |m, (x, y)| m.max((x - y).abs()));
        let made = d(&a.v, &b.v).max(d(&a.eta, &b.eta)).max((a.pos - b.pos).amax());
        println!("{tolerance:.0e}: made {made:.1e}, reported {:.1e}", report.error);
        assert!(report.error > 0.2 * made && report.error < 300.0 * made, "{made:e}, reported {:e}", report.error);
    }
}

#[test]
fn options_that_make_no_sense_are_refused() {
    let m = system();
    let (p, s, motion) = (Params::nominal(&m), start(&m), Wave(m.nj()));
    let run = |o: AdaptiveOptions| simulate_adaptive(&m, &p, &s, &Drive::Prescribed(&motion), &[], &o).unwrap_err();
    let what = |e: SimError| if let SimError::Options { what, .. } = e { what } else { "another error" };
    assert_eq!(what(run(AdaptiveOptions { relative: 0.0, ..options(1e-6) })), "relative tolerance");
    assert_eq!(what(run(AdaptiveOptions { max_step_s: f64::NAN, ..options(1e-6) })), "longest step");
    assert_eq!(what(run(AdaptiveOptions { duration_s: -2.0, ..options(1e-6) })), "duration");
    let three = Wave(3);
    let e = simulate_adaptive(&m, &p, &s, &Drive::Prescribed(&three), &[], &options(1e-6)).unwrap_err();
    assert!(matches!(e, SimError::Joints { got: 3, want: 7 }));
}

/// Piecewise constant acceleration: switched at times that no grid has.
struct Bang {
    joints: usize,
    switches: [f64; 4],
    /// Whether it says when it switches.
    tells: bool,
}

impl ff_dynamics::motion::JointMotion for Bang {
    fn dof(&self) -> usize {
        self.joints
    }
    fn duration(&self) -> f64 {
        self.switches[3]
    }
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        let s = &self.switches;
        let signs = [1.0, 0.0, -1.0];
        for j in 0..self.joints {
            let a = 0.6 - 0.13 * j as f64;
            (q[j], qd[j], qdd[j]) = (0.2 * j as f64, 0.0, 0.0);
            for k in 0..3 {
                let dt = (t - s[k]).clamp(0.0, s[k + 1] - s[k]);
                q[j] += qd[j] * dt + 0.5 * signs[k] * a * dt * dt;
                qd[j] += signs[k] * a * dt;
                if t >= s[k] && t < s[k + 1] {
                    qdd[j] = signs[k] * a;
                }
            }
        }
    }
    fn breaks(&self) -> Vec<f64> {
        if self.tells { self.switches.to_vec() } else { Vec::new() }
    }
}

/// Momentum is what jumps in the acceleration of prescribed joints spoil first.
#[test]
fn steps_end_where_the_motion_breaks() {
    let m = system();
    let (p, s) = (Params::nominal(&m), start(&m));
    let run = |tells: bool| {
        let bang = Bang { joints: m.nj(), switches: [0.413, 1.277, 2.1913, 3.0553], tells };
        let (tr, report) = simulate_adaptive(&m, &p, &s, &Drive::Prescribed(&bang), &[], &options(1e-8)).unwrap();
        let (a, b) = (tr.budget(&m, &p, 0).momentum, tr.budget(&m, &p, tr.len() - 1).momentum);
        let off = (a.lin - b.lin).norm() / a.lin.norm() + (a.ang - b.ang).norm() / a.ang.norm();
        println!("breaks told: {tells}, momentum off by {off:.1e}, {report:?}");
        (off, report)
    };
    let ((told, with), (_, without)) = (run(true), run(false));
    assert!(told < 1e-6, "{told:e}");
    assert_eq!((with.restarts, without.restarts), (4, 1));
    assert!(with.rejected + 10 < without.rejected, "{} {}", with.rejected, without.rejected);
}

/// Steps end in an error, not in a loop or a NaN, where the equations end.
#[test]
fn what_cannot_be_followed_is_an_error() {
    let m = system();
    let (p, s) = (Params::nominal(&m), start(&m));
    let nan = |t: f64, _: &State<f64>, tau: &mut [f64]| tau.fill(if t < 0.7 { 0.1 } else { f64::NAN });
    let run = |p: &Params<f64>, s: &State<f64>, law: &ff_dynamics::sim::TorqueLaw<'_>| {
        simulate_adaptive(&m, p, s, &Drive::Torque(law), &[], &options(1e-6)).unwrap_err()
    };
    let e = run(&p, &s, &nan);
    assert!(matches!(e, SimError::StepUnderflow { t, .. } if (t - 0.7).abs() < 1e-6), "{e}");
    let quiet = |_: f64, _: &State<f64>, tau: &mut [f64]| tau.fill(0.0);
    let mut v = p.values().to_vec();
    v[..10].iter_mut().for_each(|x| *x *= -5.0);
    let e = run(&Params::from_values(&m, v), &s, &quiet);
    assert!(matches!(e, SimError::Singular { t: 0.0, .. }), "{e}");
    let mut far = s.clone();
    far.eta[1] = 7.0;
    assert!(matches!(run(&p, &far, &quiet), SimError::Range { .. }));
}

/// The advised fixed step makes the error it promises, on the modes it was made for.
#[test]
fn the_advised_step_holds_in_a_simulation() {
    let m = system();
    let p = Params::nominal(&m);
    let mut s = State::zero(&m);
    s.q = vec![0.3, 0.8, -0.4, 0.7, 0.2, 0.5, -0.3];
    // Small: the modes are those of the linearised system.
    let size = 1e-4;
    s.eta.iter_mut().enumerate().for_each(|(i, x)| *x = size * (1.0 - 0.3 * i as f64));
    let all = modes(&m, &p, &s.q, &vec![0.0; m.np()], Boundary::JointsHeld).unwrap();
    let hold = ff_dynamics::motion::Hold::new(s.q.clone(), 20.0).unwrap();
    let run = |step_s: f64| {
        let o = SimOptions { duration_s: 12.0, step_s, sample_s: 0.5 };
        simulate(&m, &p, &s, &Drive::Prescribed(&hold), &o).unwrap().eta
    };
    for wanted in [1e-3, 1e-5] {
        let advice = advise_step(&all, 12.0, wanted).unwrap();
        // Samples shorten the step; the error of the step taken is known as well.
        let taken = 0.5 / (0.5 / advice.step_s).ceil();
        let promised = all.iter().map(|x| rk4_error(x.frequency_hz, x.damping_ratio, taken, 12.0)).fold(0.0, f64::max);
        let made = (run(advice.step_s) - run(0.05 * advice.step_s)).amax() / size;
        println!("{wanted:.0e}: step {:.4} s, promised {promised:.1e}, made {made:.1e}", advice.step_s);
        assert!(made < 3.0 * promised && made > 0.02 * promised, "made {made:e}, promised {promised:e}");
        assert!(promised <= wanted);
    }
}
