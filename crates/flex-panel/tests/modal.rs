//! The modal appendage: laws, residual mass, and the chain whose modes it carries.
use crate::common::ports::shared;
use crate::common::{relative_error, rng, segment, symmetric, vector};
use ff_dynamics::{State, Work, forward_dynamics};
use ff_model::port::TwinBody;
use ff_model::port::{PortModel, derived_bias};
use ff_model::{BaseKind, Inertia, Model, Motion, Params, PortState, Xform};
use ff_testkit::assert_within;
use flex_panel::modal::{DIRECTIONS, ModalAppendage, Mode, linearise};
use flex_panel::{PanelChain, Segment};
use nalgebra::{Complex, DMatrix, Matrix3, Matrix6, Rotation3, Vector3, Vector6};
use rand::RngExt;
use std::sync::Arc;
use validate::check_appendage;

/// Undeformed inertia with room to spare, and `n` modes that take a quarter of it or so.
fn modal(r: &mut ff_testkit::random::Random, n: usize) -> ModalAppendage {
    let turn = Rotation3::new(vector(r, 2.0)).into_inner();
    let moments = Matrix3::from_diagonal(&Vector3::new(160.0, 210.0, 190.0));
    let rigid = Inertia::from_com(r.random_range(200.0..300.0), &vector(r, 0.4), &(turn * moments * turn.transpose()));
    let modes: Vec<Mode> = (0..n)
        .map(|_| Mode {
            frequency_hz: r.random_range(0.05..1.5),
            damping_ratio: r.random_range(0.001..0.05),
            participation: Vector6::from_fn(|_, _| symmetric(r, 3.0 / (n as f64).sqrt())),
        })
        .collect();
    ModalAppendage::new(rigid, &modes).unwrap()
}

/// A chain whose damping is proportional to its stiffness, so that its modes are uncoupled.
fn proportional(r: &mut ff_testkit::random::Random, n: usize, c: f64) -> PanelChain {
    let mut segments: Vec<Segment> = (0..n).map(|_| segment(r)).collect();
    segments.iter_mut().for_each(|s| s.damping = c * s.stiffness);
    PanelChain::new(segments).unwrap()
}

#[test]
fn random_modal_appendages_keep_every_law() {
    let mut r = rng(31);
    for n in [1, 2, 5, 16] {
        let report = check_appendage(&*shared(&modal(&mut r, n)));
        println!("{report}");
        // The first moment does not follow the deflection: advice that a linearised model cannot take.
        assert!(report.passed(), "{n} modes: {report}");
    }
}

#[test]
fn override_equals_the_derived_bias() {
    let mut r = rng(32);
    let mut worst = 0.0_f64;
    for n in [1, 3, 16] {
        let a = modal(&mut r, n);
        let p = a.nominal();
        for _ in 0..1000 {
            let s = crate::common::PortSample::new(&mut r, &vec![3.0; n]);
            let (mut h, mut d) = (vec![0.0; 6 + n], vec![0.0; 6 + n]);
            PortModel::bias(&a, &p, &s.port(), &mut h);
            derived_bias(&a, &p, &s.port(), &mut d);
            worst = worst.max(relative_error(&h, &d));
        }
    }
    println!("largest relative difference {worst:.2e}");
    assert_within!(worst, 1e-12, "{worst:e}");
}

#[test]
fn parameters_are_declared_in_the_promised_order() {
    let a = modal(&mut rng(33), 2);
    let names: Vec<_> = ff_model::Appendage::decl(&a).params.iter().map(|p| p.name.clone()).collect();
    assert_eq!((&*names[0], &*names[9]), ("rigid.mass", "rigid.i_zz"));
    assert_eq!(&names[10..16], ["m[0]", "m[1]", "k[0]", "k[1]", "d[0]", "d[1]"]);
    assert_eq!(names[a.participation_index(1)], format!("part[1].{}", DIRECTIONS[0]));
    assert_eq!(names[a.participation_index(1) + 5], "part[1].rz");
    assert_eq!((a.stiffness_index(1), a.damping_index(1), a.count(), names.len()), (13, 15, 2, 28));
}

#[test]
fn residual_is_the_schur_complement_of_the_modes() {
    let mut r = rng(34);
    for n in [1, 4, 9] {
        let a = modal(&mut r, n);
        let p = a.nominal();
        let m = a.dense_inertia(&p, &vec![0.0; n]);
        let part = m.view((0, 6), (6, n));
        let residual: Matrix6<f64> =
            (m.view((0, 0), (6, 6)) - part * part.transpose()).fixed_view::<6, 6>(0, 0).into_owned();
        let found = a.residual(&p);
        for i in 0..6 {
            assert_within!((found.parts[i] - residual[(i, i)] / m[(i, i)]).abs(), 1e-13);
        }
        let s = Matrix6::from_diagonal(&m.view((0, 0), (6, 6)).diagonal().fixed_rows::<6>(0).map(|x| 1.0 / x.sqrt()));
        let least = (s * residual * s).symmetric_eigenvalues().min();
        assert!((found.margin - least).abs() < 1e-12 && least > 0.3, "{found:?} {least}");
        // Definite residual, definite kinetic energy; and the same at the edge from both sides.
        let li = m.view((0, 0), (6, 6)).into_owned().cholesky().unwrap().l().try_inverse().unwrap();
        let edge = 1.0 / (li * part).singular_values().max();
        for (k, sign) in [(0.999 * edge, 1.0), (1.001 * edge, -1.0)] {
            let mut q = p.clone();
            q[a.participation_index(0)..].iter_mut().for_each(|x| *x *= k);
            assert!(a.residual(&q).margin * sign > 0.0);
            assert!(a.dense_inertia(&q, &vec![0.0; n]).symmetric_eigenvalues().min() * sign > 0.0);
        }
    }
}

#[test]
fn more_mass_in_the_modes_than_there_is_is_refused_by_name() {
    let rigid = Inertia::from_com(
        50.0,
        &Vector3::new(0.2, 1.1, -0.1),
        &Matrix3::from_diagonal(&Vector3::new(40.0, 12.0, 41.0)),
    );
    let mode = |f: f64, p: [f64; 6]| Mode { frequency_hz: f, damping_ratio: 0.004, participation: Vector6::from(p) };
    let good = mode(0.2, [0.3, 0.2, 4.1, 6.0, 0.1, 0.2]);
    ModalAppendage::new(rigid, std::slice::from_ref(&good)).unwrap();
    // sqrt(50) = 7.07: 7.5^2 kg of effective mass along z is 12.5 % more than there is.
    let e = ModalAppendage::new(rigid, &[good, mode(0.9, [0.1, 0.3, 7.5, 0.4, 0.2, 0.3])]).unwrap_err();
    assert_eq!(
        (e.0.len(), e.0[0].code, e.0[0].object.as_deref()),
        (1, "Config::ResidualMass", Some("modes[1].participation"))
    );
    for says in ["translation along z", "limit 0 %", "mode 1 most", "modal mass of 1 kg"] {
        assert!(e.to_string().contains(says), "{says}: {e}");
    }
}

/// What the host must exert per acceleration: `M_bb + M_be (K + i w D - w^2 M_ee)^-1 w^2 M_eb`, at rest.
fn impedance(m: &DMatrix<f64>, k: &DMatrix<f64>, d: &DMatrix<f64>, w: f64) -> DMatrix<Complex<f64>> {
    let n = k.nrows();
    let c = |x: DMatrix<f64>| x.map(|x| Complex::new(x, 0.0));
    let (mee, meb) = (m.view((6, 6), (n, n)).into_owned(), m.view((6, 0), (n, 6)).into_owned());
    let dynamic = c(k - &mee * (w * w)) + d.map(|x| Complex::new(0.0, w * x));
    let inner = dynamic.lu().solve(&c(meb.clone() * (w * w))).unwrap();
    c(m.view((0, 0), (6, 6)).into_owned()) + c(meb.transpose()) * inner
}

/// `|x_i^T D x_j| / sqrt(x_i^T D x_i x_j^T D x_j)` at its largest, written out for the diagonal `D` of a chain.
#[test]
fn damping_that_couples_modes_is_reported() {
    let mut r = rng(38);
    for n in [2, 4] {
        let segments: Vec<_> =
            (0..n).map(|i| segment(&mut r).with_spring(90.0 + 40.0 * i as f64, 0.3 + 1.9 * (i * i) as f64)).collect();
        let chain = PanelChain::new(segments).unwrap();
        let rest: Vec<f64> = (0..n).map(|i| chain.segment(i).unwrap().rest).collect();
        let lin = linearise(&*shared(&chain), &chain.nominal(), &rest).unwrap();
        let d = DMatrix::from_diagonal(&nalgebra::DVector::from_fn(n, |i, _| chain.segment(i).unwrap().damping));
        let modal = lin.shapes.transpose() * d * &lin.shapes;
        let mut want = 0.0_f64;
        for i in 0..n {
            for j in 0..i {
                want = want.max(modal[(i, j)].abs() / (modal[(i, i)] * modal[(j, j)]).sqrt());
            }
        }
        assert!(want > 0.05, "nothing to see: {want}");
        assert_within!((lin.damping_coupling - want).abs(), 1e-8, "{} {want}", lin.damping_coupling);
    }
}

#[test]
fn a_chains_own_modes_have_its_transfer_functions() {
    let mut r = rng(35);
    let mut worst = 0.0_f64;
    for n in [1, 2, 3, 6] {
        let chain = proportional(&mut r, n, 0.013);
        let rest: Vec<f64> = (0..n).map(|i| chain.segment(i).unwrap().rest).collect();
        let lin = linearise(&*shared(&chain), &chain.nominal(), &rest).unwrap();
        assert_within!(lin.damping_coupling, 1e-10, "{}", lin.damping_coupling);
        let diagonal = |f: &dyn Fn(usize) -> f64| DMatrix::from_diagonal(&nalgebra::DVector::from_fn(n, |i, _| f(i)));
        let s = |i: usize| chain.segment(i).unwrap();
        let p = lin.appendage.nominal();
        let (mc, mm) = (chain.dense_inertia(&chain.nominal(), &rest), lin.appendage.dense_inertia(&p, &vec![0.0; n]));
        for w in [0.03, 0.4, 1.7, 6.0, 40.0] {
            let a = impedance(&mc, &diagonal(&|i| s(i).stiffness), &diagonal(&|i| s(i).damping), w);
            let (k, d) = (lin.appendage.stiffness_index(0), lin.appendage.damping_index(0));
            let b = impedance(&mm, &diagonal(&|i| p[k + i]), &diagonal(&|i| p[d + i]), w);
            worst = worst.max(
                (&a - &b).iter().fold(0.0, |m: f64, z| m.max(z.norm()))
                    / a.iter().fold(0.0, |m: f64, z| m.max(z.norm())),
            );
        }
    }
    println!("impedances, largest relative difference {worst:.2e}");
    assert_within!(worst, 1e-9, "{worst:e}");
}

/// Base with one appendage; its motion after `t` s of free swing from the given deflection, and the mean size of the
/// base's twist on the way. Fourth-order Runge-Kutta on twist and own coordinates: attitude does not matter.
fn swing(model: &Model, eta0: &[f64], t: f64) -> Vec<f64> {
    let p = Params::nominal(model);
    let n = eta0.len();
    let mut work = Work::new(model);
    let mut rate = |x: &[f64]| -> Vec<f64> {
        let mut s = State::<f64>::zero(model);
        s.eta.copy_from_slice(&x[..n]);
        s.v.copy_from_slice(&x[n..]);
        let mut a = vec![0.0; 6 + n];
        forward_dynamics(model, &p, &s, &vec![0.0; 6 + n], &mut work, &mut a).unwrap();
        x[n + 6..].iter().copied().chain(a).collect()
    };
    let mut x: Vec<f64> = eta0.iter().copied().chain(vec![0.0; 6 + n]).collect();
    let steps = 2000;
    let h = t / f64::from(steps);
    let along = |x: &[f64], k: &[f64], a: f64| -> Vec<f64> { x.iter().zip(k).map(|(x, k)| x + a * k).collect() };
    let mut out = Vec::new();
    for _ in 0..steps {
        let k1 = rate(&x);
        let k2 = rate(&along(&x, &k1, h / 2.0));
        let k3 = rate(&along(&x, &k2, h / 2.0));
        let k4 = rate(&along(&x, &k3, h));
        for i in 0..x.len() {
            x[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
        }
        out.extend_from_slice(&x[n..n + 6]);
    }
    out
}

#[test]
fn a_chains_own_modes_move_the_base_as_it_does_at_small_angles() {
    let mut r = rng(36);
    let chain = proportional(&mut r, 3, 0.02);
    let rest: Vec<f64> = (0..3).map(|i| chain.segment(i).unwrap().rest).collect();
    let lin = linearise(&*shared(&chain), &chain.nominal(), &rest).unwrap();
    let base = Inertia::from_com(
        90.0,
        &Vector3::new(0.2, -0.3, 0.4),
        &Matrix3::from_diagonal(&Vector3::new(40.0, 52.0, 61.0)),
    );
    let mount = Xform::new(Rotation3::new(Vector3::new(0.4, -0.8, 1.1)).into_inner(), Vector3::new(0.7, 0.2, -0.5));
    let model = |a: Arc<dyn ff_model::DynAppendage>| {
        let mut m = Model::new("small", "base", base, BaseKind::Floating);
        m.mount("wing", 0, mount, a).unwrap();
        m
    };
    let (full, modal) = (model(chain.into()), model(lin.appendage.clone().into()));
    let inverse = lin.shapes.clone().try_inverse().unwrap();
    let difference = |angle: f64| {
        let delta = nalgebra::DVector::from_vec(vec![angle, -0.6 * angle, 0.8 * angle]);
        let eta: Vec<f64> = rest.iter().zip(delta.iter()).map(|(a, b)| a + b).collect();
        let a = swing(&full, &eta, 6.0);
        let b = swing(&modal, (&inverse * &delta).as_slice(), 6.0);
        relative_error(&a, &b)
    };
    let (small, large) = (difference(1e-7), difference(1e-3));
    println!("base twist, largest relative difference {small:.2e} at 1e-7 rad, {large:.2e} at 1e-3 rad");
    assert_within!(small, 1e-6, "{small:e}");
    // What is left out is of second order in the angle: the relative difference is proportional to it.
    assert!(large > 1e-5 && large < 1e-1, "{large:e}");
}

#[test]
fn one_panel_has_the_frequency_and_effective_mass_of_the_book() {
    // One panel of inertia J about its hinge: w = sqrt(k / J), shape 1 / sqrt(J), participation (m e x rho; J e) / sqrt(J)
    // (docs/theory/panels.md, section 4).
    let (m, rho, e) = (31.0, Vector3::new(0.1, 1.1, -0.2), Vector3::new(0.8, 0.0, 0.6));
    let s = Segment::new(m, rho, &Matrix3::from_diagonal(&Vector3::new(14.0, 9.0, 16.0)), Vector3::zeros(), e)
        .with_spring(180.0, 2.3);
    let b: TwinBody = PanelChain::new(vec![s.clone()]).unwrap().twin_bodies().remove(0);
    let j = e.dot(&(b.inertia.rot * e));
    let chain = PanelChain::new(vec![s]).unwrap();
    let lin = linearise(&*shared(&chain), &chain.nominal(), &[0.0]).unwrap();
    let p = lin.appendage.nominal();
    assert!((p[11] - 180.0 / j).abs() < 1e-12 && (p[12] - 2.3 / j).abs() < 1e-14);
    let sign = lin.shapes[(0, 0)].signum();
    let lin_part = e.cross(&(rho * m)) / j.sqrt() * sign;
    let ang_part = b.inertia.rot * e / j.sqrt() * sign;
    for i in 0..3 {
        assert_within!((p[13 + i] - lin_part[i]).abs(), 1e-12);
        assert_within!((p[16 + i] - ang_part[i]).abs(), 1e-12);
    }
    // A lone hinge leaves nothing about its own axis: the margin is zero.
    assert_within!(lin.appendage.residual(&p).margin.abs(), 1e-12);
    let still = PortState { host: Motion::zero(), eta: &[0.3], nu: &[0.0] };
    let mut h = [0.0; 7];
    PortModel::bias(&lin.appendage, &p, &still, &mut h);
    assert_within!((h[6] - 0.3 * 180.0 / j).abs(), 1e-12);
}
