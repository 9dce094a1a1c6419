//! Joints that follow others: against Pinocchio's mimic joints, against the whole tree under constraint forces, and by balances.
#![allow(clippy::unwrap_used)] // helpers of a test may unwrap like the test

use crate::common::*;
use ff_dynamics::analysis::{Centroidal, budget};
use ff_dynamics::motion::JointMotion;
use ff_dynamics::reduced::{ArmTable, Disturbance, Disturbances, simulate_reduced_batch, simulate_reduced_over};
use ff_dynamics::sim::{Keep, Run, simulate_ensemble};
use ff_dynamics::tree::{Derivatives, aba, bias, mass_matrix_lower, rnea_derivatives};
use ff_dynamics::*;
use ff_model::scalar::D1;
use ff_model::tree::Coordinates;
use ff_model::*;
use ff_testkit::scaled;
use nalgebra::{DMatrix, DVector};
use serde::Deserialize;
use std::sync::Arc;

/// A branched arm with two appendages on links and one on the base, of which three joints follow others: one in another branch and before
/// what it follows, one at the head of a chain of followers.
fn coupled() -> Model {
    let mut r = rng(71);
    let mut m = branched_arm(72, 8, BaseKind::Floating);
    m.couple(3, 7, -0.7, 0.21).unwrap();
    m.couple(7, 2, 1.6, -0.13).unwrap();
    m.couple(4, 6, 0.35, 0.09).unwrap();
    for (k, host) in [0, 3, 8].into_iter().enumerate() {
        let mount = Xform::new(rotation(&mut r), vector(&mut r, 0.6));
        match random_part(&mut r) {
            Part::Panel(p) => m.mount(format!("a{k}"), host, mount, p).unwrap(),
            Part::Slosh(s) => m.mount(format!("a{k}"), host, mount, s).unwrap(),
        }
    }
    m
}

/// `G` of velocities `[base | joints | passive]` of the tree, written down entry by entry.
fn g_of(m: &Model) -> DMatrix<f64> {
    let tree = m.spanning();
    let (nb, nj, n) = (m.nb(), m.nj(), m.n_joints());
    let mut g = DMatrix::zeros(tree.nv(), m.nv());
    (0..nb).for_each(|i| g[(i, i)] = 1.0);
    (0..m.np()).for_each(|i| g[(nb + n + i, nb + nj + i)] = 1.0);
    for i in 0..n {
        let c = m.coordinate(i);
        g[(nb + i, nb + c.index)] = c.multiplier;
    }
    g
}

/// The state of the whole tree.
fn of_tree(m: &Model, s: &State<f64>) -> State<f64> {
    let mut t = State::zero(&m.spanning());
    (t.pos, t.att, t.eta) = (s.pos, s.att, s.eta.clone());
    for i in 0..m.n_joints() {
        let c = m.coordinate(i);
        t.q[i] = c.multiplier * s.q[c.index] + c.offset;
    }
    t.v = (g_of(m) * DVector::from_column_slice(&s.v)).as_slice().to_vec();
    t
}

fn random(r: &mut ff_testkit::random::Random, n: usize) -> Vec<f64> {
    (0..n).map(|_| uniform(r, -1.0, 1.0)).collect()
}

#[test]
fn ratios_of_chains_are_referred_to_the_joint_that_moves_by_itself() {
    let m = coupled();
    assert_eq!(
        (m.nj(), m.n_joints(), m.joint_names()),
        (5, 8, ["j0", "j1", "j4", "j5", "j7"].map(String::from).to_vec())
    );
    // Joint 2 follows 6, which was made to follow 1 later: -0.7 (1.6 q1 - 0.13) + 0.21.
    let (c, d) = (m.coordinate(2), m.coordinate(6));
    assert_eq!((c.index, d.index, m.coordinate(3).index), (1, 1, 3));
    assert_within!((c.multiplier + 1.12).abs() + (c.offset - 0.301).abs(), 1e-15, "chain");
    assert_eq!((d.multiplier, d.offset), (1.6, -0.13));
    let followers: Vec<_> = m.followers().map(|(b, _)| b.joint.name.as_str()).collect();
    assert_eq!(followers, ["j2", "j3", "j6"]);
    assert_eq!((m.joint("j2"), m.joint("j4")), (None, Some(2)));
}

#[test]
fn a_joint_that_follows_twice_itself_or_at_no_number_is_refused() {
    let mut m = branched_arm(72, 4, BaseKind::Floating);
    m.couple(2, 1, 0.7, 0.1).unwrap();
    let before = m.clone();
    for (follower, driver, multiplier) in [(2, 3, 0.4), (1, 2, 0.4), (3, 3, 0.4), (3, 1, f64::NAN)] {
        let p = m.couple(follower, driver, multiplier, 0.2).unwrap_err();
        let p = &p.0[0];
        assert_eq!((p.code, p.object.is_some(), p.hint.is_some()), ("Model::Coupling", true, true), "{p}");
        assert_eq!(m.coordinates(), before.coordinates());
    }
}

#[test]
fn damping_and_friction_of_followers_are_reflected() {
    use ff_model::tree::JointImpedance;
    let mut m = branched_arm(72, 4, BaseKind::Floating);
    m.couple(3, 1, -1.7, 0.3).unwrap();
    m.set_impedance(1, JointImpedance { stiffness: 2.3, rest: 0.4, viscous: 0.9, coulomb: 0.6 });
    m.set_impedance(3, JointImpedance { stiffness: 1.1, rest: -0.2, viscous: 0.7, coulomb: 0.5 });
    let sum = m.reflected_impedance(0);
    assert_within!((sum.viscous - (0.9 + 1.7 * 1.7 * 0.7)).abs(), 1e-15, "damping");
    assert_within!((sum.coulomb - (0.6 + 1.7 * 0.5)).abs(), 1e-15, "friction");
    // Torque of both springs along the coordinate, at two positions.
    for q in [-0.7, 1.3] {
        let own = 2.3 * (q - 0.4) - 1.7 * 1.1 * (-1.7 * q + 0.3 + 0.2);
        assert_within!((sum.stiffness * (q - sum.rest) - own).abs(), 1e-14, "springs");
    }
    assert_eq!(m.reflected_impedance(1), JointImpedance::default());
}

/// The whole tree with constraint forces `lambda` on the followers: `H a + c = tau + A^T lambda`, `A v = 0`. Another formulation of the same
/// robot: nothing of `G` enters.
#[test]
fn forward_dynamics_are_those_of_the_tree_under_constraint_forces() {
    let m = coupled();
    let tree = m.spanning();
    let (p, mut r) = (Params::nominal(&m), rng(5));
    let (mut work, mut full) = (Work::new(&m), Work::new(&tree));
    let (nb, n) = (m.nb(), tree.nv());
    for _ in 0..5 {
        let s = random_state(&m, &mut r, 0.2);
        let (t, tau) = (of_tree(&m, &s), random(&mut r, m.nv()));
        let mut h = DMatrix::zeros(n, n);
        mass_matrix(&tree, &p, &t, &mut full, &mut h);
        let mut c = vec![0.0; n];
        bias(&tree, &p, &t, &mut full, &mut c);
        let mut force = DVector::zeros(n);
        let mut constraints = DMatrix::zeros(m.n_joints() - m.nj(), n);
        let mut row = 0;
        for i in 0..m.n_joints() {
            let k = m.coordinate(i);
            let own = m.coordinates().unwrap().own()[k.index];
            if own == i {
                force[nb + i] = tau[nb + k.index];
            } else {
                constraints[(row, nb + i)] = 1.0;
                constraints[(row, nb + own)] = -k.multiplier;
                row += 1;
            }
        }
        (0..nb).for_each(|i| force[i] = tau[i]);
        (0..m.np()).for_each(|i| force[nb + m.n_joints() + i] = tau[nb + m.nj() + i]);
        let k = constraints.nrows();
        let mut kkt = DMatrix::zeros(n + k, n + k);
        kkt.view_mut((0, 0), (n, n)).copy_from(&h);
        kkt.view_mut((0, n), (n, k)).copy_from(&constraints.transpose());
        kkt.view_mut((n, 0), (k, n)).copy_from(&constraints);
        let mut rhs = DVector::zeros(n + k);
        rhs.rows_mut(0, n).copy_from(&(force - DVector::from_vec(c)));
        let solved = kkt.lu().solve(&rhs).unwrap();
        let mut a = vec![0.0; m.nv()];
        forward_dynamics(&m, &p, &s, &tau, &mut work, &mut a).unwrap();
        let whole = g_of(&m) * DVector::from_column_slice(&a);
        assert_within!((&whole - solved.rows(0, n)).amax() / whole.amax(), 1e-10, "accelerations");
        let mut again = vec![0.0; m.nv()];
        aba(&m, &p, &s, &tau, &mut work, &mut again).unwrap();
        assert_eq!(a, again);
        // Inverse dynamics of these accelerations give the forces back, and so does the hybrid form.
        let mut back = vec![0.0; m.nv()];
        rnea(&m, &p, &s, &a, &mut work, &mut back);
        assert_within!(relative_error(&back, &tau), 1e-9, "forces");
        work.set_passive_forces(&tau[nb + m.nj()..]);
        let (mut all, mut joint) = (vec![0.0; m.nv()], vec![0.0; m.nj()]);
        let mut held = work.clone();
        let mut free = tau.clone();
        free[..6].fill(0.0);
        let mut a = vec![0.0; m.nv()];
        forward_dynamics(&m, &p, &s, &free, &mut work, &mut a).unwrap();
        hybrid_dynamics(&m, &p, &s, &a[nb..nb + m.nj()], &mut held, &mut all, &mut joint).unwrap();
        assert_within!(relative_error(&all, &a), 1e-9, "hybrid accelerations");
        assert_within!(relative_error(&joint, &free[nb..nb + m.nj()]), 1e-9, "hybrid torques");
    }
}

#[test]
fn derivatives_and_regressor_are_those_of_inverse_dynamics() {
    let m = coupled().with_gravity(nalgebra::Vector3::new(0.3, -0.4, -3.7));
    let (mut r, p) = (rng(8), Params::nominal(&m));
    let (s, a) = (random_state(&m, &mut r, 0.2), random(&mut r, m.nv()));
    let mut work = Work::new(&m);
    let mut d = Derivatives::new(&m);
    rnea_derivatives(&m, &p, &s, &a, &mut work, &mut d);
    let force = |s: &State<f64>, a: &[f64], p: &Params<f64>| {
        let mut tau = vec![0.0; m.nv()];
        rnea(&m, p, s, a, &mut Work::new(&m), &mut tau);
        DVector::from_vec(tau)
    };
    const H: f64 = 1e-6;
    let (nb, nj) = (m.nb(), m.nj());
    for j in 0..m.nv() {
        let central = |f: &dyn Fn(f64) -> DVector<f64>| (f(H) - f(-H)) / (2.0 * H);
        let by_v = central(&|h| {
            let mut t = s.clone();
            t.v[j] += h;
            force(&t, &a, &p)
        });
        let scale = |x: &DVector<f64>| 1.0 + x.amax();
        assert_within!((d.dv.column(j) - &by_v).amax() / scale(&by_v), 1e-7, "rate {j}");
        let by_a = central(&|h| {
            let mut b = a.clone();
            b[j] += h;
            force(&s, &b, &p)
        });
        assert_within!((d.da.column(j) - &by_a).amax() / scale(&by_a), 1e-7, "acceleration {j}");
        if j >= nb {
            let by_q = central(&|h| {
                let mut t = s.clone();
                if j < nb + nj {
                    t.q[j - nb] += h
                } else {
                    t.eta[j - nb - nj] += h
                }
                force(&t, &a, &p)
            });
            assert_within!((d.dq.column(j) - &by_q).amax() / scale(&by_q), 1e-7, "position {j}");
        }
    }
    let mut y = Regressor::new(&m);
    regressor(&m, &p, &s, &a, &mut work, &mut y);
    for k in 0..m.n_params() {
        let central = |h: f64| {
            let at = |h: f64| {
                let mut v = p.values().to_vec();
                v[k] += h;
                force(&s, &a, &Params::from_values(&m, v))
            };
            (at(h) - at(-h)) / (2.0 * h)
        };
        let by = central(1e-4 * (1.0 + p.values()[k].abs()));
        assert_within!((y.column(k) - &by).amax() / (1.0 + by.amax()), 1e-6, "parameter {k}");
    }
    // The lower triangle, the full matrix and the derivative are one matrix.
    let mut h = DMatrix::zeros(m.nv(), m.nv());
    mass_matrix(&m, &p, &s, &mut work, &mut h);
    assert_within!((&h - &d.da).amax() / h.amax(), 1e-13, "mass matrix");
    let lower = mass_matrix_lower(&m, &p, &s, &mut work);
    for i in 0..m.nv() {
        for j in 0..=i {
            assert_within!((lower[(i, j)] - h[(i, j)]).abs() / h.amax(), 1e-15, "lower triangle");
        }
    }
}

#[test]
fn frames_and_momentum_are_those_of_the_tree() {
    let m = coupled();
    let tree = m.spanning();
    let (p, mut r) = (Params::nominal(&m), rng(9));
    let s = random_state(&m, &mut r, 0.2);
    let t = of_tree(&m, &s);
    let (mut work, mut full) = (Work::new(&m), Work::new(&tree));
    assert_eq!(budget(&m, &p, &s, &mut work), budget(&tree, &p, &t, &mut full));
    let (mut j, mut k) = (DMatrix::zeros(6, m.nv()), DMatrix::zeros(6, tree.nv()));
    for f in m.frames() {
        assert_eq!(frame_pose(&m, &s, f, &mut work), frame_pose(&tree, &t, f, &mut full));
        frame_jacobian(&m, &s, f, &mut work, &mut j);
        frame_jacobian(&tree, &t, f, &mut full, &mut k);
        assert_within!((&j - &k * g_of(&m)).amax(), 1e-14, "Jacobian of {}", f.name);
    }
    let mut c = Centroidal::new(&m);
    c.evaluate(&p, &s);
    let b = budget(&m, &p, &s, &mut work);
    let h = c.momentum(&s.v);
    let want: Vec<f64> = b.momentum.lin.iter().chain(b.angular_com.iter()).copied().collect();
    assert_within!(relative_error(&h, &want), 1e-11, "momentum");
}

/// Momentum is kept and the work of the joints is energy gained and dissipated, with dampers at work: an ideal coupling does none.
#[test]
fn energy_and_momentum_balance_with_dampers_at_work() {
    let m = coupled();
    let p = Params::nominal(&m);
    let mut s = random_state(&m, &mut rng(12), 0.1);
    s.v.iter_mut().for_each(|x| *x *= 0.3);
    let law = |t: f64, s: &State<f64>, tau: &mut [f64]| {
        for (j, (tau, w)) in tau.iter_mut().zip(s.qd()).enumerate() {
            *tau = 0.4 * (1.1 * t + j as f64).sin() - 0.7 * w;
        }
    };
    let options = SimOptions { duration_s: 2.0, step_s: 5e-4, sample_s: 0.5 };
    let trace = simulate(&m, &p, &s, &Drive::Torque(&law), &options).unwrap();
    let [first, last] = [0, trace.len() - 1].map(|i| trace.budget(&m, &p, i));
    let n = trace.len() - 1;
    assert!(trace.dissipated[n] > 1e-3 && trace.work[n].abs() > 1e-3, "{} {}", trace.dissipated[n], trace.work[n]);
    let balance = trace.work[n] - (last.energy() - first.energy()) - trace.dissipated[n];
    assert_within!(balance.abs() / last.energy(), 1e-9, "energy");
    let p0 = first.momentum.lin.norm().max(1.0);
    assert_within!((last.momentum.lin - first.momentum.lin).norm() / p0, 1e-9, "momentum");
    assert_within!(
        (last.momentum.ang - first.momentum.ang).norm() / first.momentum.ang.norm(),
        1e-9,
        "angular momentum"
    );
    // Under the motion that came out, the prescribed form gives the torques of the law.
    let mut tau = vec![0.0; m.nj()];
    law(0.0, &s, &mut tau);
    assert_within!(relative_error(trace.tau.row(0).transpose().as_slice(), &tau), 1e-14, "torques");
}

fn start(m: &Model) -> Vec<f64> {
    (0..6 + 2 * m.np()).map(|i| 0.03 * (1.3 * i as f64 + 0.4).sin()).collect()
}

#[test]
fn the_reduced_system_gives_the_record_of_the_full_one() {
    let m = coupled();
    let (p, z0) = (Params::nominal(&m), start(&m));
    let mut s = State::zero(&m);
    s.v[..6].copy_from_slice(&z0[..6]);
    s.eta.copy_from_slice(&z0[6..6 + m.np()]);
    s.nu_mut().copy_from_slice(&z0[6 + m.np()..]);
    let wave = Wave(m.nj());
    let o = SimOptions { duration_s: 2.0, step_s: 1e-3, sample_s: 0.05 };
    let full = simulate(&m, &p, &s, &Drive::Prescribed(&wave), &o).unwrap();
    let sampling = Sampling { samples: full.len(), sample_s: 0.05, substeps: 50 };
    let table = Prescribed::new(&m, &p, &wave, &sampling, &[]);
    let red = simulate_reduced(&m, &p, &table, &z0).unwrap();
    assert_eq!(red.tau.ncols(), m.nj());
    for (a, b) in [(&red.tau, &full.tau), (&red.twist, &full.twist), (&red.eta, &full.eta), (&red.nu, &full.nu)] {
        assert_within!((a - b).amax() / b.amax(), 1e-10, "record");
    }
    // Lanes, and the run of an ensemble, give the same.
    let both = simulate_reduced_batch(&m, &table, &[(&p, &z0), (&p, &z0)]).unwrap();
    for r in both {
        assert_within!((r.unwrap().tau - &red.tau).amax() / red.tau.amax(), 1e-10, "lanes");
    }
    let runs = [Run { params: &p, start: &s }];
    let runs = simulate_ensemble(&m, &runs, &wave, &o, Keep::default()).unwrap();
    assert_within!((&runs[0].tau - &full.tau).amax() / full.tau.amax(), 1e-10, "ensemble");
}

/// Exact derivatives of the record by dual numbers through table and integration.
#[test]
fn sensitivities_are_the_derivatives_of_the_record() {
    let m = coupled();
    let (p, z0, wave) = (Params::nominal(&m), start(&m), Wave(m.nj()));
    let sampling = Sampling { samples: 21, sample_s: 0.05, substeps: 5 };
    // A follower and the tip, an appendage on a follower, and placements of a driver and of a follower.
    let kinematics: Vec<usize> = ["j1.offset", "j2.offset", "j6.placement.x", "a1.mount.ry"]
        .iter()
        .map(|n| m.kinematic_index(n).unwrap())
        .collect();
    let change = Wave(m.nj());
    let wanted = Wanted {
        params: (0..10).chain(30..40).chain(80..m.n_params()).collect(),
        kinematics: kinematics.clone(),
        disturbances: vec![0],
        initial: (0..z0.len()).collect(),
        ..Wanted::default()
    };
    let by = Disturbances::new(vec![Disturbance::Motion(Arc::new(change))], vec![0.01]);
    let fixed = Kinematics::fixed(&m);
    let table = Prescribed::disturbed(&m, &p, (&fixed, &by), &wave, &sampling, 0..21, &wanted);
    let (r, s) = sensitivities(&m, &p, &table, &z0, &wanted).unwrap();
    assert_eq!(s.tau.shape(), (21 * m.nj(), wanted.len()));
    assert_eq!(r, simulate_reduced(&m, &p, &table, &z0).unwrap());
    // The disturbed motion is the wave and a hundredth of it.
    let larger = Scaled(Wave(m.nj()), 1.01);
    let one = |i: usize, k: usize| D1::new(0.0, f64::from(u8::from(i == k)));
    let np = wanted.params.len();
    for col in (0..np + kinematics.len()).step_by(3).chain(np..np + kinematics.len()) {
        let values = p
            .values()
            .iter()
            .enumerate()
            .map(|(i, &x)| D1::constant(x) + if col < np { one(i, wanted.params[col]) } else { D1::constant(0.0) });
        let params = Params::from_values(&m, values.collect());
        let shift = (0..m.n_kinematic_params())
            .map(|i| if col >= np { one(i, kinematics[col - np]) } else { D1::constant(0.0) })
            .collect();
        let arm = ArmTable::new(&m, &params, &Kinematics::from_values(&m, shift), &larger, &sampling);
        let z: Vec<D1> = z0.iter().map(|&x| D1::constant(x)).collect();
        let dual = simulate_reduced_over(&m, &params, &arm, &z).unwrap();
        let d = DMatrix::from_fn(21 * m.nj(), 1, |i, _| dual.tau[(i / m.nj(), i % m.nj())].eps[0]);
        assert_within!((s.tau.column(col) - d.column(0)).amax() / (1e-9 + d.amax()), 1e-8, "column {col}");
    }
    // The size of the disturbance, and a state at the beginning, by differences.
    const H: f64 = 1e-5;
    let run = |size: f64, z: &[f64]| {
        let larger = Scaled(Wave(m.nj()), 1.0 + size);
        let table = Prescribed::new(&m, &p, &larger, &sampling, &[]);
        simulate_reduced(&m, &p, &table, z).unwrap().tau
    };
    let flat = |d: DMatrix<f64>| DVector::from_column_slice(d.transpose().as_slice());
    let d = flat((run(0.01 + H, &z0) - run(0.01 - H, &z0)) / (2.0 * H));
    assert_within!((s.tau.column(np + kinematics.len()) - &d).amax() / d.amax(), 1e-7, "size of the disturbance");
    let moved = |h: f64| {
        let mut z = z0.clone();
        z[7] += h;
        z
    };
    let d = flat((run(0.01, &moved(H)) - run(0.01, &moved(-H))) / (2.0 * H));
    assert_within!((s.tau.column(np + kinematics.len() + 1 + 7) - &d).amax() / d.amax(), 1e-6, "initial state");
}

/// A motion made larger.
struct Scaled(Wave, f64);

impl JointMotion for Scaled {
    fn dof(&self) -> usize {
        self.0.dof()
    }
    fn duration(&self) -> f64 {
        self.0.duration()
    }
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        self.0.eval(t, q, qd, qdd);
        for x in [q, qd, qdd] {
            x.iter_mut().for_each(|x| *x *= self.1);
        }
    }
}

#[test]
fn torques_of_a_rigid_robot_and_their_derivatives() {
    let m = coupled().without_appendages();
    let (p, wave) = (Params::nominal(&m), Wave(m.nj()));
    let sampling = Sampling { samples: 13, sample_s: 0.1, substeps: 1 };
    let wanted = Wanted { params: (0..m.n_params()).collect(), ..Wanted::default() };
    let table = Prescribed::new(&m, &p, &wave, &sampling, &wanted.links(&m));
    let rates = DMatrix::from_fn(13, 3, |i, k| 0.1 * (0.7 * i as f64 + k as f64).sin());
    let (tau, d) = reduced_torques(&m, &p, &table, &rates, &wanted).unwrap();
    assert_eq!((tau.ncols(), d.nrows()), (m.nj(), 13 * m.nj()));
    // Hybrid dynamics at the same instants.
    let mut work = Work::new(&m);
    let mut s = State::zero(&m);
    let (mut qd, mut qdd) = (vec![0.0; m.nj()], vec![0.0; m.nj()]);
    let (mut a, mut joint) = (vec![0.0; m.nv()], vec![0.0; m.nj()]);
    for i in 0..13 {
        wave.eval(0.1 * i as f64, &mut s.q, &mut qd, &mut qdd);
        s.qd_mut().copy_from_slice(&qd);
        (0..3).for_each(|k| s.v[3 + k] = rates[(i, k)]);
        hybrid_dynamics(&m, &p, &s, &qdd, &mut work, &mut a, &mut joint).unwrap();
        assert_within!(relative_error(tau.row(i).transpose().as_slice(), &joint), 1e-11, "torques");
    }
    // Linear of degree one in all parameters.
    let by = &d * DVector::from_column_slice(p.values());
    let flat = DVector::from_column_slice(tau.transpose().as_slice());
    assert_within!((by - &flat).amax() / flat.amax(), 1e-11, "Euler's theorem");
}

#[derive(Deserialize)]
#[allow(non_snake_case)]
struct Sample {
    q: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
    tau: Vec<f64>,
    M: Vec<Vec<f64>>,
    nle: Vec<f64>,
    rnea: Vec<f64>,
    rnea_g: Vec<f64>,
    forward: Vec<f64>,
    Y: Vec<Vec<f64>>,
    J_l5_local: Vec<Vec<f64>>,
    T_l5: Vec<Vec<f64>>,
    kinetic: f64,
}

#[derive(Deserialize)]
struct Oracle {
    own: Vec<String>,
    gravity_of_rnea_g: [f64; 3],
    pi: Vec<f64>,
    states: Vec<Sample>,
}

/// Pinocchio 4.1 with mimic joints (`fixtures/oracle/mimic.py`).
#[test]
fn mimic_joints_of_pinocchio() {
    let folder = format!("{}/../../fixtures/oracle", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(format!("{folder}/mimic.json")).unwrap();
    let o: Oracle = serde_json::from_str(&text).unwrap();
    let m = ff_testkit::fixtures::robot("oracle/mimic.urdf");
    assert_eq!(m.joint_names(), o.own);
    let p = Params::nominal(&m);
    assert_within!(relative_error(p.values(), &o.pi), 1e-12, "parameters");
    let heavy = m.clone().with_gravity(o.gravity_of_rnea_g.into());
    let (mut work, mut loaded) = (Work::new(&m), Work::new(&heavy));
    let close = |got: &[f64], want: &[f64], what: &str| {
        assert_within!(relative_error(got, want), 1e-11, "{what}");
    };
    let rows = |m: &[Vec<f64>]| m.concat();
    let by_rows = |m: &DMatrix<f64>| m.transpose().as_slice().to_vec();
    for s in &o.states {
        let mut st = State::zero(&m);
        st.pos.copy_from_slice(&s.q[..3]);
        st.att = nalgebra::Vector4::new(s.q[6], s.q[3], s.q[4], s.q[5]);
        st.q.copy_from_slice(&s.q[7..]);
        st.v.copy_from_slice(&s.v);
        let mut tau = vec![0.0; m.nv()];
        rnea(&m, &p, &st, &s.a, &mut work, &mut tau);
        close(&tau, &s.rnea, "inverse dynamics");
        rnea(&heavy, &p, &st, &s.a, &mut loaded, &mut tau);
        close(&tau, &s.rnea_g, "inverse dynamics under gravity");
        bias(&m, &p, &st, &mut work, &mut tau);
        close(&tau, &s.nle, "bias");
        let mut h = DMatrix::zeros(m.nv(), m.nv());
        mass_matrix(&m, &p, &st, &mut work, &mut h);
        close(&by_rows(&h), &rows(&s.M), "mass matrix");
        let mut a = vec![0.0; m.nv()];
        forward_dynamics(&m, &p, &st, &s.tau, &mut work, &mut a).unwrap();
        assert_within!(relative_error(&a, &s.forward), scaled(1e-9), "forward dynamics");
        let mut y = Regressor::new(&m);
        regressor(&m, &p, &st, &s.a, &mut work, &mut y);
        close(&by_rows(&y), &rows(&s.Y), "regressor");
        let frame = m.frame("l5").unwrap();
        let mut j = DMatrix::zeros(6, m.nv());
        frame_jacobian(&m, &st, frame, &mut work, &mut j);
        close(&by_rows(&j), &rows(&s.J_l5_local), "Jacobian");
        let x = frame_pose(&m, &st, frame, &mut work);
        close(
            &by_rows(&DMatrix::from_fn(3, 3, |i, k| x.rot[(i, k)])),
            &rows(&s.T_l5.iter().take(3).map(|r| r[..3].to_vec()).collect::<Vec<_>>()),
            "rotation",
        );
        let b = budget(&m, &p, &st, &mut work);
        assert_within!((b.kinetic - s.kinetic).abs() / s.kinetic, 1e-12, "energy");
    }
}

#[test]
fn the_map_of_coordinates_and_its_transpose_do_the_same_work() {
    let m = coupled();
    let map: &Coordinates = m.coordinates().unwrap();
    let mut r = rng(31);
    let (v, tau) = (random(&mut r, m.nj()), random(&mut r, m.n_joints()));
    let (mut theta, mut own) = (vec![0.0; m.n_joints()], vec![0.0; m.nj()]);
    map.rates(&v, &mut theta);
    map.torques(&tau, &mut own);
    let power = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    assert_within!((power(&tau, &theta) - power(&own, &v)).abs(), 1e-14, "power");
    let mut places = vec![0.0; m.n_joints()];
    map.positions(&v, &mut places);
    let shift: Vec<f64> = places.iter().zip(&theta).map(|(a, b)| a - b).collect();
    let offsets: Vec<f64> = map.joints().iter().map(|c| c.offset).collect();
    assert_within!(relative_error(&shift, &offsets), 1e-14, "offsets");
}
