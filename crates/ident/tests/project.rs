//! The projection against cases solved in closed form, against the conditions of optimality, and on a linear estimate.

use ff_model::Inertia;
use ff_testkit::assert_within;
use ff_testkit::random::{Random, rng, symmetric, uniform, vector};
use ident::solve::{Body, Cone, Nearest, ProjectError, ProjectOptions, nearest};
use nalgebra::{DMatrix, DVector, Matrix4};

const EPS: f64 = 1e-7;
const OPTIONS: ProjectOptions = ProjectOptions { epsilon: EPS, hold: 1e-5, tolerance: 1e-9 };

fn body(first: usize) -> Body {
    Body {
        name: format!("b{first}"),
        known: [0.0; 10],
        unknown: core::array::from_fn(|k| Some(first + k)),
        size: (1.0, 1.0),
    }
}
/// Rows whose norm is the Frobenius norm of the pseudo-inertia.
fn frobenius() -> DMatrix<f64> {
    let mut out = DMatrix::zeros(16, 10);
    for k in 0..10 {
        let mut unit = [0.0; 10];
        unit[k] = 1.0;
        let p = Inertia::from_params(&unit).pseudo();
        out.set_column(k, &DVector::from_column_slice(p.as_slice()));
    }
    out
}
fn random_symmetric(s: &mut Random) -> Matrix4<f64> {
    let a = Matrix4::from_fn(|_, _| symmetric(s, 1.0));
    a + a.transpose()
}

#[test]
fn in_the_frobenius_norm_it_is_the_clipping_of_eigenvalues() {
    let mut s = rng(4);
    for _ in 0..20 {
        let target = random_symmetric(&mut s);
        let x_hat = Inertia::from_pseudo(&target).to_params();
        let cone = Cone { bodies: vec![body(0)], positive: vec![] };
        let got = nearest(&frobenius(), &x_hat, &[1.0; 10], &[0.0; 10], &cone, &OPTIONS).unwrap();
        let e = target.symmetric_eigen();
        let clipped =
            e.eigenvectors * Matrix4::from_diagonal(&e.eigenvalues.map(|v| v.max(EPS))) * e.eigenvectors.transpose();
        let p = Inertia::from_params(&got.x).pseudo();
        // The cost is flat: its error is the square of this one.
        assert_within!((p - clipped).norm(), 2e-5, "{:e} after {} steps", (p - clipped).norm(), got.steps);
        let exact = 0.5 * (target - clipped).norm_squared();
        assert_within!((got.cost - exact).abs(), 1e-8 * (1.0 + exact), "{} {exact}", got.cost);
        assert!(got.steps < 150);
    }
}

#[test]
fn two_positive_numbers_that_are_correlated_have_a_closed_form() {
    // |R (x - x_hat)| with both negative: the solution has x_0 = eps and x_1 from the normal equation of what is left.
    let r = DMatrix::from_row_slice(3, 2, &[2.0, 0.7, 0.0, 1.3, 0.4, -0.2]);
    let x_hat = [-1.5, 0.3];
    let g = r.transpose() * &r;
    let x1 = x_hat[1] - g[(1, 0)] * (2.0 * EPS - x_hat[0]) / g[(1, 1)];
    let cone = Cone { bodies: vec![], positive: vec![0, 1] };
    let got = nearest(&r, &x_hat, &[2.0, 5.0], &[0.0; 2], &cone, &OPTIONS).unwrap();
    let expected = if x1 > 5.0 * EPS { x1 } else { 5.0 * EPS };
    assert!((got.x[0] - 2.0 * EPS).abs() < 1e-7 && (got.x[1] - expected).abs() < 1e-6, "{:?} {x1}", got.x);
    // The other sign of the correlation moves the second number up instead.
    let mut r = r;
    r[(0, 1)] = -0.7;
    let g = r.transpose() * &r;
    let x1 = x_hat[1] - g[(1, 0)] * (2.0 * EPS - x_hat[0]) / g[(1, 1)];
    let got = nearest(&r, &x_hat, &[2.0, 5.0], &[0.0; 2], &cone, &OPTIONS).unwrap();
    assert!(x1 > 0.5 && (got.x[1] - x1).abs() < 1e-6, "{:?} {x1}", got.x);
}

/// Stationarity, feasibility of both sides, complementarity.
fn check_kkt(r: &DMatrix<f64>, x_hat: &[f64], sizes: &[f64], cone: &Cone, got: &Nearest, limit: f64) {
    let n = x_hat.len();
    let dx = DVector::from_fn(n, |i, _| got.x[i] - x_hat[i]);
    let mut g = r.transpose() * (r * &dx);
    for i in 0..n {
        g[i] += (OPTIONS.hold / sizes[i]).powi(2) * dx[i];
    }
    let size = g.iter().zip(sizes).map(|(g, s)| (g * s).abs()).fold(1.0, f64::max);
    let mut slackness = 0.0;
    for (b, z) in cone.bodies.iter().zip(&got.bodies) {
        assert!(z.symmetric_eigenvalues().min() > 0.0);
        let p = Inertia::from_params(&core::array::from_fn::<f64, 10, _>(|k| got.x[b.unknown[k].unwrap()])).pseudo();
        let least =
            Matrix4::from_diagonal(&nalgebra::Vector4::new(b.size.1.powi(2), b.size.1.powi(2), b.size.1.powi(2), 1.0))
                * (b.size.0 * EPS);
        assert!((p - least).symmetric_eigenvalues().min() > 0.0);
        slackness += (z * (p - least)).trace();
        for k in 0..10 {
            let mut unit = [0.0; 10];
            unit[k] = 1.0;
            g[b.unknown[k].unwrap()] -= (z * Inertia::from_params(&unit).pseudo()).trace();
        }
    }
    for (&k, z) in cone.positive.iter().zip(&got.positive) {
        slackness += z * (got.x[k] - EPS * sizes[k]);
        g[k] -= z;
    }
    let worst = g.iter().zip(sizes).map(|(g, s)| (g * s).abs()).fold(0.0, f64::max);
    assert!(worst < limit * size, "gradient {worst:e} of {size:e}");
    assert!(slackness < 2.0 * got.gap && got.gap <= 1e-9 * got.cost.max(1.0), "{slackness:e} {:e}", got.gap);
}

#[test]
fn the_conditions_of_optimality_hold_for_two_bodies_springs_and_a_metric_that_lacks_rank() {
    let mut s = rng(17);
    for _ in 0..10 {
        let n = 23;
        // 18 rows see 23 unknowns; sizes of a satellite and of a spring.
        let sizes: Vec<f64> =
            (0..n).map(|k| [600.0, 300.0, 300.0, 300.0, 150.0][k % 5] * if k >= 20 { 0.01 } else { 1.0 }).collect();
        let r = DMatrix::from_fn(18, n, |_, k| symmetric(&mut s, 40.0) / sizes[k]);
        let x_hat: Vec<f64> = (0..n).map(|k| symmetric(&mut s, 1.0) * sizes[k]).collect();
        let mut bodies = vec![body(0), body(10)];
        bodies.iter_mut().for_each(|b| b.size = (600.0, 0.5));
        let cone = Cone { bodies, positive: vec![20, 22] };
        let got = nearest(&r, &x_hat, &sizes, &[0.0; 23], &cone, &OPTIONS).unwrap();
        check_kkt(&r, &x_hat, &sizes, &cone, &got, 1e-5);
        assert!(got.cost > 0.0 && got.steps < 250, "{} steps", got.steps);
    }
}

#[test]
fn what_exists_already_stays() {
    let mut s = rng(2);
    let x_hat = (0..5).fold(Inertia::zero(), |mut b, _| {
        b += Inertia::point(uniform(&mut s, 0.1, 0.9), &vector(&mut s, 0.8));
        b
    });
    let x_hat = x_hat.to_params();
    let cone = Cone { bodies: vec![body(0)], positive: vec![] };
    let r = DMatrix::from_fn(14, 10, |i, k| ((i * 7 + k * 3) as f64).sin() * 30.0);
    let got = nearest(&r, &x_hat, &[1.0; 10], &[0.0; 10], &cone, &OPTIONS).unwrap();
    assert!(got.cost == 0.0 && got.x == x_hat && got.steps == 0);
    // Beside one that has to move, and not coupled to it, it stays all the same.
    let moved = [-0.4, 0.1, 0.2, -0.1, 0.5, 0.05, 0.6, 0.02, -0.04, 0.7];
    let both = [x_hat, moved].concat();
    let mut r = DMatrix::zeros(32, 20);
    r.view_mut((0, 0), (16, 10)).copy_from(&frobenius());
    r.view_mut((16, 10), (16, 10)).copy_from(&frobenius());
    let cone = Cone { bodies: vec![body(0), body(10)], positive: vec![] };
    let got = nearest(&r, &both, &[1.0; 20], &[0.0; 20], &cone, &OPTIONS).unwrap();
    assert!(got.cost > 0.05);
    got.x.iter().zip(&x_hat).for_each(|(a, b)| assert!((a - b).abs() < 1e-7, "{a} {b}"));
}

#[test]
fn bodies_known_in_part_start_from_the_known_part() {
    // Only the mass is unknown and the data want it negative: the least mass that the known moments allow.
    let known = Inertia::point(2.0, &nalgebra::Vector3::new(0.3, -0.4, 0.5)).to_params();
    let mut known: [f64; 10] = known;
    (known[4], known[6], known[9]) = (known[4] + 0.3, known[6] + 0.2, known[9] + 0.25);
    let b =
        Body { name: "b".into(), known, unknown: core::array::from_fn(|k| (k == 0).then_some(0)), size: (2.0, 0.7) };
    let cone = Cone { bodies: vec![b.clone()], positive: vec![] };
    let r = DMatrix::from_element(1, 1, 3.0);
    let got = nearest(&r, &[-4.0], &[2.0], &[2.0], &cone, &OPTIONS).unwrap();
    // The Schur complement: m >= h^T S^-1 h.
    let p = Inertia::from_params(&known).pseudo();
    let (s, h) = (p.fixed_view::<3, 3>(0, 0).into_owned(), p.fixed_view::<3, 1>(0, 3).into_owned());
    let least = h.dot(&(s.try_inverse().unwrap() * h));
    assert!((got.x[0] - least).abs() < 1e-4 && least > 0.1, "{} {least}", got.x[0]);
    let e = nearest(&r, &[-4.0], &[2.0], &[-1.0], &cone, &OPTIONS).unwrap_err();
    assert!(matches!(e, ProjectError::Infeasible { ref body } if body == "b"), "{e}");
    for (o, what) in [
        (ProjectOptions { epsilon: 0.0, ..OPTIONS }, "epsilon"),
        (ProjectOptions { hold: f64::NAN, ..OPTIONS }, "hold"),
    ] {
        assert!(nearest(&r, &[1.0], &[2.0], &[2.0], &cone, &o).unwrap_err().to_string().contains(what));
    }
    assert!(nearest(&r, &[f64::INFINITY], &[2.0], &[2.0], &cone, &OPTIONS).is_err());
    assert!(nearest(&r, &[1.0, 2.0], &[2.0], &[2.0], &cone, &OPTIONS).is_err());
}

#[test]
fn a_linear_estimate_from_poor_data_becomes_a_robot_that_can_exist() {
    use ff_dynamics::motion::JointMotion;
    use ff_dynamics::{State, Work, rnea};
    use ff_model::{BaseKind, Params};
    use ff_records::RecordBuilder;
    use ff_testkit::motion::Sines;
    use ff_testkit::tree::branched_arm;
    use ident::solve::project;
    use ident::{Friction, Ground};
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    let m = branched_arm(6, 4, BaseKind::Fixed).with_gravity(nalgebra::Vector3::new(0.8, 1.1, -9.7));
    let decls = m.param_decls();
    let truth = Params::<f64>::nominal(&m);
    let motion = Sines::new(3, 4, 6.0, 0.3);
    let z = DMatrix::zeros(600, 4);
    let (mut q, mut qd, mut qdd, mut tau) = (z.clone(), z.clone(), z.clone(), z);
    let (mut work, mut state) = (Work::new(&m), State::zero(&m));
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(8);
    let (mut acc, mut row) = ([0.0; 4], [0.0; 4]);
    for i in 0..600 {
        let State { q: x, v, .. } = &mut state;
        motion.eval(0.01 * i as f64, x, v, &mut acc);
        rnea(&m, &truth, &state, &acc, &mut work, &mut row);
        for j in 0..4 {
            let e: f64 = StandardNormal.sample(&mut rng);
            (q[(i, j)], qd[(i, j)], qdd[(i, j)], tau[(i, j)]) = (state.q[j], state.v[j], acc[j], row[j] + 1.0 * e);
        }
    }
    let r = RecordBuilder::new(m.joint_names()).uniform(0.0, 100.0).q(q).qd(qd).qdd(qdd).tau(tau).fixed_base();
    let r = r.build().unwrap().0;
    let selected: Vec<usize> = (10..50).collect();
    let e = Ground::new(&m, Friction::ALL).unwrap().estimate(&[&r], &selected, truth.values()).unwrap();
    assert!(!e.fit.unphysical.is_empty());
    let positive = |n: &str| !n.ends_with("offset");
    let p = project(&e.fit, &decls, &selected, truth.values(), positive, &ProjectOptions::default()).unwrap();
    println!("{:?} -> at the boundary {:?}, chi-square + {:.2}", e.fit.unphysical, p.at_boundary, p.chi2_increase);
    for b in 1..5 {
        assert!(Inertia::from_params(&p.values[10 * b..10 * b + 10]).check().is_ok());
    }
    assert!(p.unknowns.iter().all(|u| !u.name.contains("viscous") && !u.name.contains("coulomb") || u.to > 0.0));
    // The truth is among the bodies that exist: the projection is not further than the truth.
    let x_hat: Vec<f64> = p.unknowns.iter().map(|u| u.from).collect();
    let mut to_truth = DVector::zeros(x_hat.len());
    for k in 0..x_hat.len() {
        to_truth[k] = if k < 40 { truth.values()[10 + k] } else { 0.0 } - x_hat[k];
    }
    let far = (&e.fit.equations.r * to_truth).norm_squared();
    assert!(p.chi2_increase > 0.0 && p.chi2_increase < far + 1e-6, "{} {far}", p.chi2_increase);
    assert!(!p.at_boundary.is_empty() && p.gap < 1e-9 * p.chi2_increase.max(1.0));
    // A calibration names what ends there where it costs more than one direction of the data leaves open.
    let mut near = e.clone();
    let pressed = near.make_physical(&decls, &selected, truth.values()).unwrap();
    assert_eq!(pressed, if p.chi2_increase > 3.84 { p.at_boundary } else { Vec::new() });
    assert_eq!(near.fit.values, p.values);
}

/// Data without noise: a metric of rounding's fineness sees what it sees exactly, and the body is found in what it leaves open.
#[test]
fn a_metric_of_any_fineness_is_followed() {
    let mut s = rng(5);
    let truth = (0..5).fold(Inertia::zero(), |mut b, _| {
        b += Inertia::point(uniform(&mut s, 0.1, 0.9), &vector(&mut s, 0.8));
        b
    });
    let truth = DVector::from_column_slice(&truth.to_params());
    let seen = DMatrix::from_fn(6, 10, |_, _| symmetric(&mut s, 3.0));
    // Off in what the rows do not see, by so much that no body has it.
    let across = seen.clone().pseudo_inverse(1e-12).unwrap();
    let stray = DVector::from_fn(10, |_, _| symmetric(&mut s, 4.0));
    let x_hat = &truth + &stray - across * (&seen * &stray);
    let cone = Cone { bodies: vec![body(0)], positive: vec![] };
    for fineness in [1.0, 1e6, 1e15] {
        let r = &seen * fineness;
        let got = nearest(&r, x_hat.as_slice(), &[1.0; 10], &[0.0; 10], &cone, &OPTIONS).unwrap();
        let body = Inertia::from_params(&core::array::from_fn::<f64, 10, _>(|k| got.x[k]));
        assert!(body.pseudo().symmetric_eigenvalues().min() > 0.0, "{fineness:e}");
        let moved = (&seen * (DVector::from_column_slice(&got.x) - &x_hat)).amax();
        assert!(got.steps > 0 && moved < 1e-6, "{fineness:e}: {moved:e}");
    }
}
