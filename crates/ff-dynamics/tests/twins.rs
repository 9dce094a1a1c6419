//! Appendages through their ports against the same bodies as ordinary tree links, on 1,000 random systems.

use crate::common::*;
use ff_dynamics::analysis::budget;
use ff_dynamics::tree::aba;
use ff_dynamics::*;
use ff_model::scalar::D1;
use ff_model::*;
use nalgebra::DMatrix;

#[test]
fn ports_equal_tree_twins_on_a_thousand_random_systems() {
    let mut r = rng(2013);
    let mut worst = [0.0f64; 7];
    for _ in 0..1000 {
        let t = random_twins(&mut r);
        let nv = t.ports.nv();
        assert_eq!(nv, t.tree.nv());
        let s = random_state(&t.ports, &mut r, 0.6);
        let st = tree_state(&t, &s);
        let (pp, pt) = (Params::nominal(&t.ports), Params::nominal(&t.tree));
        let (mut wp, mut wt) = (Work::new(&t.ports), Work::new(&t.tree));
        let (mut hp, mut ht) = (DMatrix::zeros(nv, nv), DMatrix::zeros(nv, nv));
        mass_matrix(&t.ports, &pp, &s, &mut wp, &mut hp);
        mass_matrix(&t.tree, &pt, &st, &mut wt, &mut ht);
        worst[0] = worst[0].max(relative_error(hp.as_slice(), ht.as_slice()));
        // Bias: the ports contain their springs, the tree gets them added.
        let spring: Vec<f64> =
            t.springs.iter().enumerate().map(|(i, &(k, d, rest))| k * (s.eta[i] - rest) + d * s.nu()[i]).collect();
        let first = nv - spring.len();
        let (mut cp, mut ct) = (vec![0.0; nv], vec![0.0; nv]);
        bias(&t.ports, &pp, &s, &mut wp, &mut cp);
        bias(&t.tree, &pt, &st, &mut wt, &mut ct);
        spring.iter().enumerate().for_each(|(i, f)| ct[first + i] += f);
        worst[1] = worst[1].max(relative_error(&cp, &ct));
        // Forward dynamics with general forces everywhere.
        let mut tau: Vec<f64> = (0..nv).map(|_| uniform(&mut r, -9.0, 9.0)).collect();
        let (mut ap, mut at) = (vec![0.0; nv], vec![0.0; nv]);
        forward_dynamics(&t.ports, &pp, &s, &tau, &mut wp, &mut ap).unwrap();
        // ... and back through RNEA.
        let mut back = vec![0.0; nv];
        rnea(&t.ports, &pp, &s, &ap, &mut wp, &mut back);
        worst[2] = worst[2].max(relative_error(&back, &tau));
        spring.iter().enumerate().for_each(|(i, f)| tau[first + i] -= f);
        forward_dynamics(&t.tree, &pt, &st, &tau, &mut wt, &mut at).unwrap();
        worst[3] = worst[3].max(relative_error(&ap, &at));
        // Hybrid: its accelerations and torques solve the full equations with zero base wrench and ports.
        let nj = t.ports.nj();
        let qdd: Vec<f64> = (0..nj).map(|_| uniform(&mut r, -1.0, 1.0)).collect();
        let (mut ah, mut th) = (vec![0.0; nv], vec![0.0; nj]);
        hybrid_dynamics(&t.ports, &pp, &s, &qdd, &mut wp, &mut ah, &mut th).unwrap();
        rnea(&t.ports, &pp, &s, &ah, &mut wp, &mut back);
        let want: Vec<f64> = [vec![0.0; 6], th, vec![0.0; nv - 6 - nj]].concat();
        let scale = cp.iter().fold(1.0f64, |m, x| m.max(x.abs()));
        worst[4] = worst[4].max(back.iter().zip(&want).fold(0.0f64, |m, (x, y)| m.max((x - y).abs())) / scale);
        let (bp, bt) = (budget(&t.ports, &pp, &s, &mut wp), budget(&t.tree, &pt, &st, &mut wt));
        worst[5] = worst[5].max(relative_error(bp.momentum.to_vector().as_slice(), bt.momentum.to_vector().as_slice()));
        worst[6] = worst[6].max(relative_error(&[bp.kinetic], &[bt.kinetic]));
        let diss: f64 = t.springs.iter().enumerate().map(|(i, p)| p.1 * s.nu()[i].powi(2)).sum();
        assert_within!(relative_error(&[bp.dissipation], &[diss]), 1e-13);
        let pot: f64 = t.springs.iter().enumerate().map(|(i, p)| 0.5 * p.0 * (s.eta[i] - p.2).powi(2)).sum();
        assert_within!(relative_error(&[bp.potential], &[pot]), 1e-13);
    }
    println!(
        "worst relative: H {:.1e}, bias {:.1e}, rnea(fd) {:.1e}, fd {:.1e}, hybrid {:.1e}, momentum {:.1e}, energy {:.1e}",
        worst[0], worst[1], worst[2], worst[3], worst[4], worst[5], worst[6]
    );
    assert_within!(worst[0], 1e-13, "H {:e}", worst[0]);
    assert_within!(worst[1], 1e-12, "bias {:e}", worst[1]);
    for (k, e) in worst[2..].iter().enumerate() {
        assert_within!(*e, 1e-10, "check {k}: {e:e}");
    }
}

#[test]
fn regressor_columns_are_the_derivatives_of_rnea() {
    let mut r = rng(7);
    for _ in 0..20 {
        let m = random_twins(&mut r).ports;
        let s = random_state(&m, &mut r, 0.6);
        let p = Params::nominal(&m);
        let nv = m.nv();
        let a: Vec<f64> = (0..nv).map(|_| uniform(&mut r, -1.0, 1.0)).collect();
        let mut y = Regressor::new(&m);
        regressor(&m, &p, &s, &a, &mut Work::new(&m), &mut y);
        // Independent: whole algorithm over duals, one parameter at a time.
        let (sd, ad): (State<D1>, Vec<D1>) = (s.lift(), a.iter().map(|&x| D1::constant(x)).collect());
        let mut w = Work::<D1>::new(&m);
        for k in 0..m.n_params() {
            let v = p.values().iter().enumerate().map(|(i, &x)| D1::new(x, if i == k { 1.0 } else { 0.0 })).collect();
            let mut tau = vec![D1::constant(0.0); nv];
            rnea(&m, &Params::from_values(&m, v), &sd, &ad, &mut w, &mut tau);
            let d: Vec<f64> = tau.iter().map(|t| t.eps[0]).collect();
            let got: Vec<f64> = y.column(k).iter().copied().collect();
            let scale = 1.0 + d.iter().fold(0.0f64, |m, x| m.max(x.abs()));
            assert!(got.iter().zip(&d).all(|(x, y)| (x - y).abs() < 1e-12 * scale), "column {k}");
        }
    }
}

/// Both ways of free forward dynamics on deep trees, wrenches from outside included.
#[test]
fn mass_matrix_and_articulated_bodies_agree_on_deep_trees() {
    let mut r = rng(77);
    for joints in [5, 14, 23] {
        let mut m = random_tree(&mut r, 1, BaseKind::Floating);
        for i in 1..joints {
            let parent = if i == 9 { 3 } else { m.n_bodies() - 1 };
            let (axis, at) = (unit_vector(&mut r), vector(&mut r, 0.6));
            let joint = revolute(&format!("deep{i}"), axis, at, vector(&mut r, 1.0));
            let body = body(&mut r, 3.0);
            m.add_body(parent, format!("deep{i}"), joint, body);
        }
        let t = with_twins(&m, &[(joints, Xform::new(rotation(&mut r), vector(&mut r, 0.5)), random_part(&mut r))]);
        let m = &t.ports.with_gravity(v3(0.3, -0.5, 0.2));
        let (p, s, nv) = (Params::nominal(m), random_state(m, &mut r, 0.3), m.nv());
        let tau: Vec<f64> = (0..nv).map(|_| uniform(&mut r, -9.0, 9.0)).collect();
        let (mut a, mut b, mut c) = (vec![0.0; nv], vec![0.0; nv], vec![0.0; nv]);
        let mut w = Work::new(m);
        w.set_external(joints / 2, Force::new(vector(&mut r, 4.0), vector(&mut r, 3.0)));
        ff_dynamics::tree::by_mass_matrix(m, &p, &s, &tau, &mut w, &mut a).unwrap();
        aba(m, &p, &s, &tau, &mut w, &mut b).unwrap();
        forward_dynamics(m, &p, &s, &tau, &mut w, &mut c).unwrap();
        assert_within!(relative_error(&a, &b), 1e-9, "{joints} joints: {:e}", relative_error(&a, &b));
        // Mean depths 3.0, 5.4 and 8.3: the last alone is deep.
        assert_eq!(if joints == 23 { &b } else { &a }, &c, "{joints} joints take the other way");
    }
}

/// Same numbers of everything, and the rigid body hangs on another link: other elements are zero.
#[test]
#[should_panic(expected = "regressor of another model")]
fn a_regressor_belongs_to_its_tree() {
    let hung = |host: usize| {
        let mut m = system().without_appendages();
        let payload = ff_model::payload::Payload::new(m.inertia(1)).unwrap();
        m.mount("client", host, Xform::identity(), payload).unwrap();
        m
    };
    let (one, other) = (hung(1), hung(2));
    let (p, s, a) = (Params::<f64>::nominal(&one), State::zero(&one), vec![0.3; one.nv()]);
    let mut y = Regressor::new(&other);
    regressor(&one, &p, &s, &a, &mut Work::new(&one), &mut y);
}
