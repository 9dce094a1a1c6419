//! Derivatives of inverse and hybrid dynamics against forward duals and central differences, on random systems
//! with appendages on base and links, gravity, external wrenches and a moving base.
#![allow(clippy::unwrap_used)] // helpers of a test may unwrap like the test

use crate::common::*;
use ff_dynamics::*;
use ff_model::spatial::so3::quat_mul;
use ff_model::*;
use nalgebra::{DMatrix, Vector3, Vector4};

/// Largest difference relative to the largest element.
fn rel(a: &DMatrix<f64>, b: &DMatrix<f64>) -> f64 {
    (a - b).amax() / b.amax().max(1e-300)
}

/// d tau / d(q, v, a) by one forward-dual pass of `rnea` per direction.
fn by_duals(m: &Model, s: &State<f64>, a: &[f64], wrench: &Force<f64>) -> [DMatrix<f64>; 3] {
    let (nb, nj, nv) = (m.nb(), m.nj(), m.nv());
    let p = Params::<D1>::nominal(m);
    let mut w = Work::<D1>::new(m);
    w.set_external(m.n_bodies() - 1, Force::new(wrench.lin.map(D1::constant), wrench.ang.map(D1::constant)));
    let mut out = [0, 1, 2].map(|_| DMatrix::zeros(nv, nv));
    let e = |x: f64| D1::new(x, 1.0);
    for k in 0..nv {
        for (kind, out) in out.iter_mut().enumerate() {
            let mut d: State<D1> = s.lift();
            let mut acc: Vec<D1> = a.iter().map(|&x| D1::constant(x)).collect();
            match kind {
                0 if k < nb && k < 3 => d.pos[k].eps[0] = 1.0,
                0 if k < nb => {
                    let half = D1::new(0.0, 0.5);
                    let mut turn =
                        Vector4::new(D1::constant(1.0), D1::constant(0.0), D1::constant(0.0), D1::constant(0.0));
                    turn[k - 2] = half;
                    d.att = quat_mul(&d.att, &turn);
                }
                0 if k < nb + nj => d.q[k - nb] = e(s.q[k - nb]),
                0 => d.eta[k - nb - nj] = e(s.eta[k - nb - nj]),
                1 => d.v[k] = e(s.v[k]),
                _ => acc[k] = e(a[k]),
            }
            let mut tau = vec![D1::constant(0.0); nv];
            rnea(m, &p, &d, &acc, &mut w, &mut tau);
            for (i, t) in tau.iter().enumerate() {
                out[(i, k)] = t.eps[0];
            }
        }
    }
    out
}

#[test]
fn inverse_dynamics_derivatives_equal_forward_duals() {
    let mut r = rng(77);
    let mut worst = [0.0f64; 3];
    for case in 0..60 {
        let t = rand_twins(&mut r);
        let models = [t.ports.with_gravity(Vector3::new(0.7, -1.9, 3.2)), t.tree];
        let m = &models[case % 2];
        let mut s = rand_state(m, &mut r, 0.6);
        // Reads as a moving base: the equations must not care about its linear velocity but through w x v.
        s.v[0] += 1.3;
        let a: Vec<f64> = (0..m.nv()).map(|_| uni(&mut r, -2.0, 2.0)).collect();
        let p = Params::nominal(m);
        let mut w = Work::new(m);
        let wrench = Force::new(Vector3::new(0.4, -1.1, 2.3), Vector3::new(-0.8, 0.6, 1.7));
        w.set_external(m.n_bodies() - 1, wrench);
        let mut d = Derivatives::new(m);
        rnea_derivatives(m, &p, &s, &a, &mut w, &mut d);
        let want = by_duals(m, &s, &a, &wrench);
        for (k, (got, want)) in [&d.dq, &d.dv, &d.da].into_iter().zip(&want).enumerate() {
            worst[k] = worst[k].max(rel(got, want));
        }
    }
    assert!(worst.iter().all(|&w| w < 1e-12), "{worst:?}");
}

#[test]
fn inverse_dynamics_derivatives_equal_central_differences() {
    let mut r = rng(78);
    let t = rand_twins(&mut r);
    let m = &t.ports;
    let (nb, nj, nv) = (m.nb(), m.nj(), m.nv());
    let s = rand_state(m, &mut r, 0.6);
    let a: Vec<f64> = (0..nv).map(|_| uni(&mut r, -2.0, 2.0)).collect();
    let p = Params::nominal(m);
    let mut w = Work::new(m);
    let mut d = Derivatives::new(m);
    rnea_derivatives(m, &p, &s, &a, &mut w, &mut d);
    let h = 1e-6;
    for k in nb..nv {
        let mut column = |of: &dyn Fn(&mut State<f64>, f64)| {
            let mut tau = [vec![0.0; nv], vec![0.0; nv]];
            for (x, tau) in [h, -h].into_iter().zip(&mut tau) {
                let mut s = s.clone();
                of(&mut s, x);
                rnea(m, &p, &s, &a, &mut w, tau);
            }
            nalgebra::DVector::from_fn(nv, |i, _| (tau[0][i] - tau[1][i]) / (2.0 * h))
        };
        let q = column(&|s, x| {
            if k < nb + nj {
                s.q[k - nb] += x;
            } else {
                s.eta[k - nb - nj] += x;
            }
        });
        let v = column(&|s, x| s.v[k] += x);
        assert!((q - d.dq.column(k)).amax() < 1e-6 * d.dq.amax(), "dq column {k}");
        assert!((v - d.dv.column(k)).amax() < 1e-6 * d.dv.amax(), "dv column {k}");
    }
}

#[test]
fn hybrid_derivatives_follow_from_those_of_inverse_dynamics() {
    let mut r = rng(79);
    for _ in 0..20 {
        let t = rand_twins(&mut r);
        let m = &t.ports;
        let (nb, nj, nv) = (m.nb(), m.nj(), m.nv());
        let s = rand_state(m, &mut r, 0.6);
        let qdd: Vec<f64> = (0..nj).map(|_| uni(&mut r, -1.0, 1.0)).collect();
        let p = Params::nominal(m);
        let mut w = Work::new(m);
        let (mut a, mut tau) = (vec![0.0; nv], vec![0.0; nj]);
        hybrid_dynamics(m, &p, &s, &qdd, &mut w, &mut a, &mut tau).unwrap();
        let mut d = Derivatives::new(m);
        rnea_derivatives(m, &p, &s, &a, &mut w, &mut d);
        let mut y = Regressor::new(m);
        regressor(m, &p, &s, &a, &mut w, &mut y);
        let mut y = y.clone_owned();
        let mut by_rate = d.dv.clone();
        hybrid_columns(m, &d.da, &mut by_rate).unwrap();
        hybrid_columns(m, &d.da, &mut y).unwrap();
        // Against a dual in each rate and each parameter.
        let mut wd = Work::<D1>::new(m);
        let qd: Vec<D1> = qdd.iter().map(|&x| D1::constant(x)).collect();
        let values = p.values().to_vec();
        let mut check = |s: &State<D1>, p: &Params<D1>, column: &[f64], what: &str| {
            let zero = D1::constant(0.0);
            let (mut a, mut tau) = (vec![zero; nv], vec![zero; nj]);
            hybrid_dynamics(m, p, s, &qd, &mut wd, &mut a, &mut tau).unwrap();
            a[nb..nb + nj].copy_from_slice(&tau);
            let scale = a.iter().fold(1e-9f64, |m, x| m.max(x.eps[0].abs()));
            for (got, want) in column.iter().zip(&a) {
                assert!((got - want.eps[0]).abs() < 1e-11 * scale, "{what}: {got} {}", want.eps[0]);
            }
        };
        for k in 0..nv {
            let mut d: State<D1> = s.lift();
            d.v[k].eps[0] = 1.0;
            check(&d, &Params::nominal(m), by_rate.column(k).as_slice(), &format!("rate {k}"));
        }
        for k in 0..m.n_params() {
            let mut v: Vec<D1> = values.iter().map(|&x| D1::constant(x)).collect();
            v[k].eps[0] = 1.0;
            check(&s.lift(), &Params::from_values(m, v), y.column(k).as_slice(), &format!("parameter {k}"));
        }
    }
}
