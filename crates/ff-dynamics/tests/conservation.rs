//! Laws that hold whatever the numbers: momentum, and energy with damping on.

use crate::common::*;
use ff_dynamics::*;
use ff_model::*;

#[test]
fn sixty_seconds_of_free_motion_conserve_momentum_and_balance_energy() {
    let m = system();
    let p = Params::nominal(&m);
    let mut s = State::zero(&m);
    let mut r = rng(99);
    s.pos = v3(0.3, -0.4, 0.2);
    s.att = ff_model::spatial::so3::exp_so3(&v3(0.4, -0.2, 0.9));
    s.q = vec![0.3, 0.8, -0.4, 0.7, 0.2, 0.5, -0.3];
    s.eta.iter_mut().for_each(|x| *x = uni(&mut r, -0.12, 0.12));
    s.v.iter_mut().for_each(|x| *x = uni(&mut r, -0.06, 0.06));
    // Joint dampers keep the arm from whirling; their work is accounted for as work of the drive.
    let law = |_: f64, s: &State<f64>, tau: &mut [f64]| {
        tau.iter_mut().zip(s.qd()).for_each(|(t, w)| *t = -3.0 * w);
    };
    let o = SimOptions { duration_s: 60.0, step_s: 1e-3, sample_s: 0.5 };
    let tr = simulate(&m, &p, &s, &Drive::Torque(&law), &o).unwrap();
    let b0 = tr.budget(&m, &p, 0);
    let scale_p = b0.momentum.lin.norm();
    let scale_l = b0.momentum.ang.norm();
    let (mut dp, mut dl, mut de, mut dq) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
    for i in 0..tr.len() {
        let b = tr.budget(&m, &p, i);
        dp = dp.max((b.momentum.lin - b0.momentum.lin).norm() / scale_p);
        dl = dl.max((b.momentum.ang - b0.momentum.ang).norm() / scale_l);
        de = de.max((b.energy() + tr.dissipated[i] - tr.work[i] - b0.energy()).abs() / b0.energy());
        dq = dq.max((tr.state(&m, i).att.norm() - 1.0).abs());
    }
    let lost = tr.dissipated[tr.len() - 1] / b0.energy();
    println!("momentum {dp:.1e} {dl:.1e}, energy balance {de:.1e}, |q|-1 {dq:.1e}, dissipated {lost:.2} of the energy");
    assert!(dp < 1e-11 && dl < 1e-11, "momentum {dp:e} {dl:e}");
    assert!(de < 1e-10, "energy {de:e}");
    assert!(dq < 1e-15, "quaternion norm {dq:e}");
    assert!(lost > 0.05, "damping must matter: {lost}");
}

#[test]
fn the_integrator_is_of_fourth_order() {
    let m = system();
    let p = Params::nominal(&m);
    let mut s = State::zero(&m);
    s.q = vec![0.3, 0.8, -0.4, 0.7, 0.2, 0.5, -0.3];
    s.eta.iter_mut().enumerate().for_each(|(i, x)| *x = 0.05 + 0.013 * i as f64);
    s.v.iter_mut().enumerate().for_each(|(i, x)| *x = 0.1 - 0.021 * i as f64);
    let law = |t: f64, _: &State<f64>, tau: &mut [f64]| {
        tau.iter_mut().enumerate().for_each(|(i, x)| *x = (0.7 * t + i as f64).sin());
    };
    let run = |h: f64| {
        let o = SimOptions { duration_s: 2.0, step_s: h, sample_s: 2.0 };
        simulate(&m, &p, &s, &Drive::Torque(&law), &o).unwrap().last
    };
    let fine = run(1e-3);
    let err = |h: f64| {
        let x = run(h);
        let d: f64 = x.v.iter().zip(&fine.v).map(|(a, b)| (a - b).powi(2)).sum();
        (d + (x.att - fine.att).norm_squared() + (x.pos - fine.pos).norm_squared()).sqrt()
    };
    let order = (err(0.04) / err(0.02)).log2();
    println!("observed order {order:.2}");
    assert!((3.6..4.6).contains(&order), "order {order}");
}
