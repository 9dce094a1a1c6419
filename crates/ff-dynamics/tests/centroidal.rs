//! The centroidal momentum matrix against Pinocchio, against the budget, and against the law of momentum.
#![allow(clippy::unwrap_used)] // helpers of a test may unwrap like the test

use crate::common::*;
use ff_dynamics::analysis::budget;
use ff_dynamics::analysis::{Centroidal, CentroidalRate};
use ff_dynamics::*;
use ff_model::spatial::so3::{exp_so3, quat_mul, quat_normalize, quat_to_rot};
use ff_model::*;
use nalgebra::{DVector, Vector3, Vector4};

#[track_caller]
fn close(got: &[f64], want: &[f64], limit: f64, what: &str) {
    assert_within!(relative_error(got, want), limit, "{what}");
}

#[test]
fn agrees_with_pinocchio() {
    let m = peers_tree("flex");
    let path = format!("{}/../../fixtures/oracle/flex.json", env!("CARGO_MANIFEST_DIR"));
    let file: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let numbers =
        |v: &serde_json::Value| -> Vec<f64> { v.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect() };
    let mut g = Centroidal::<f64>::new(&m);
    let p = Params::nominal(&m);
    for s in file["states"].as_array().unwrap() {
        let (q, v) = (numbers(&s["q"]), numbers(&s["v"]));
        let mut st = State::zero(&m);
        st.pos.copy_from_slice(&q[..3]);
        st.att = Vector4::new(q[6], q[3], q[4], q[5]);
        st.q.copy_from_slice(&q[7..]);
        g.evaluate(&p, &st);
        close(&g.momentum(&v), &numbers(&s["hg"]), 1e-12, "momentum");
        close(g.com().as_slice(), &numbers(&s["com"]), 1e-13, "centre of mass");
    }
}

/// Random trees with random appendages anywhere, on free and on fixed bases.
#[test]
fn momentum_is_that_of_the_budget() {
    let mut r = rng(31);
    for k in 0..40 {
        let kind = if k % 2 == 0 { BaseKind::Floating } else { BaseKind::Fixed };
        let m = random_twins(&mut r).ports.with_base_kind(kind);
        let s = random_state(&m, &mut r, 0.6);
        let p = Params::nominal(&m);
        let mut g = Centroidal::<f64>::new(&m);
        g.evaluate(&p, &s);
        let b = budget(&m, &p, &s, &mut Work::new(&m));
        let want = [b.momentum.lin.as_slice(), b.angular_com.as_slice()].concat();
        if m.nv() > 0 {
            close(&g.momentum(&s.v), &want, 1e-12, "momentum");
        }
        close(g.com().as_slice(), b.com.as_slice(), 1e-12, "centre of mass");
        assert_within!((g.mass() - b.mass).abs(), 1e-12 * b.mass);
    }
}

/// `h' = A a + A' v` equals what acts from outside, which inverse dynamics finds on its own.
#[test]
fn the_rate_is_the_law_of_momentum() {
    let mut r = rng(32);
    for _ in 0..20 {
        let m = random_twins(&mut r).ports;
        let s = random_state(&m, &mut r, 0.6);
        let p = Params::nominal(&m);
        let a: Vec<f64> = (0..m.nv()).map(|_| uniform(&mut r, -2.0, 2.0)).collect();
        let mut g = CentroidalRate::new(&m);
        g.evaluate(&p, &s);
        let bias = g.bias(&s.v);
        let gain = g.matrix() * DVector::from_column_slice(&a);
        let got: Vec<f64> = (0..6).map(|i| gain[i] + bias[i]).collect();
        // The base wrench is everything that acts from outside, about the base origin, in base axes.
        let mut tau = vec![0.0; m.nv()];
        rnea(&m, &p, &s, &a, &mut Work::new(&m), &mut tau);
        let rot = quat_to_rot(&s.att);
        let (f, n) = (rot * Vector3::from_column_slice(&tau[..3]), rot * Vector3::from_column_slice(&tau[3..6]));
        let com = budget(&m, &p, &s, &mut Work::new(&m)).com;
        let n = n - (com - s.pos).cross(&f);
        close(&got, &[f.as_slice(), n.as_slice()].concat(), 1e-11, "rate of momentum");
    }
}

/// The rate of every column against central differences along the motion.
#[test]
fn the_rate_is_the_derivative_of_every_column() {
    let mut r = rng(33);
    let m = system();
    let s = random_state(&m, &mut r, 0.4);
    let p = Params::nominal(&m);
    let mut g = CentroidalRate::new(&m);
    g.evaluate(&p, &s);
    let at = |dt: f64| {
        let mut x = s.clone();
        let twist = s.base_twist();
        x.pos += quat_to_rot(&s.att) * twist.lin * dt;
        x.att = quat_normalize(&quat_mul(&s.att, &exp_so3(&(twist.ang * dt))));
        x.q.iter_mut().zip(s.qd()).for_each(|(q, w)| *q += w * dt);
        x.eta.iter_mut().zip(s.nu()).for_each(|(q, w)| *q += w * dt);
        let mut c = Centroidal::<f64>::new(&m);
        c.evaluate(&p, &x);
        c.matrix().clone()
    };
    let h = 1e-5;
    let want = (at(h) - at(-h)) / (2.0 * h);
    for j in 0..m.nv() {
        // Columns of the base's linear velocity keep their angular part at zero: compared with the whole.
        let d = (g.rate().column(j) - want.column(j)).amax();
        assert_within!(d, 1e-7 * want.amax(), "column {j}: {d:e} of {:e}", want.amax());
    }
}
