//! The wheel: laws, gyroscopic torque, motor, friction, its tree twin, and what is said when a table is wrong.
#![allow(clippy::unwrap_used)] // helpers outside #[test] may panic too

use ff_dynamics::analysis::budget;
use ff_dynamics::{State, Work, bias, forward_dynamics, mass_matrix};
use ff_model::diagnostics::Limit;
use ff_model::port::{PortModel, derived_bias};
use ff_model::tree::JointLimits;
use ff_model::{
    BaseKind, Inertia, Joint, JointKind, Model, Motion, Params, PortDynamics, PortState, Problem, Registry, Xform,
};
use ff_testkit::assert_within;
use ff_testkit::ports;
use ff_testkit::problem::{assert_violation, refused_table};
use ff_testkit::random::{Random, rng, symmetric, uniform, vector};
use nalgebra::{DMatrix, Matrix3, Rotation3, Vector3};
use reaction_wheel::{KIND, ReactionWheel, Wheel, axial_momentum, from_toml, register};
use validate::check_appendage;

fn random(r: &mut Random) -> ReactionWheel {
    let spin = uniform(r, 0.02, 0.5);
    ReactionWheel::new(&Wheel {
        axis: vector(r, 2.0),
        mass: uniform(r, 2.0, 15.0),
        spin,
        transverse: spin * uniform(r, 0.5, 0.9),
        viscous: uniform(r, 1e-4, 0.05),
        dry: uniform(r, 1e-3, 0.02),
        rounding: 0.3,
    })
    .unwrap()
}

#[test]
fn random_wheels_keep_every_law() {
    let mut r = rng(61);
    for _ in 0..10 {
        let report = check_appendage(&*ports::shared(&random(&mut r)));
        println!("{report}");
        assert!(report.checks.iter().all(|c| c.pass), "{report}");
    }
}

#[test]
fn port_equations_equal_the_defaults_over_lanes_and_differences() {
    let mut r = rng(69);
    for _ in 0..20 {
        let w = random(&mut r);
        ports::check_ports(&w, &w.nominal(), &mut r, 5);
    }
}

#[test]
fn override_equals_the_derived_bias() {
    let mut r = rng(62);
    let mut worst = 0.0_f64;
    for _ in 0..1000 {
        let w = random(&mut r);
        let s = PortState {
            host: Motion::new(vector(&mut r, 2.0), vector(&mut r, 2.0)),
            eta: &[symmetric(&mut r, 9.0)],
            nu: &[symmetric(&mut r, 300.0)],
        };
        let (mut h, mut d) = ([f64::NAN; 7], [0.0; 7]);
        PortDynamics::bias(&w, &w.nominal(), &s, &mut h);
        derived_bias(&w, &w.nominal(), &s, &mut d);
        for range in [0..6, 6..7] {
            let scale = d[range.clone()].iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            worst = range.fold(worst, |m, i| m.max((h[i] - d[i]).abs() / scale));
        }
    }
    println!("largest relative difference {worst:.2e}");
    assert_within!(worst, 1e-12, "{worst:e}");
}

#[test]
fn a_turned_spinning_wheel_gives_the_gyroscopic_torque() {
    let mut r = rng(63);
    let w = random(&mut r);
    let [_, j, ..] = w.nominal();
    let (omega, nu) = (vector(&mut r, 0.5), 250.0);
    let wrench = |nu: f64| {
        let mut h = [0.0; 7];
        PortModel::bias(
            &w,
            &w.nominal(),
            &PortState { host: Motion::new(Vector3::zeros(), omega), eta: &[0.4], nu: &[nu] },
            &mut h,
        );
        h
    };
    let (a, b) = (wrench(nu), wrench(0.0));
    let want = omega.cross(&(w.axis() * (j * nu)));
    for i in 0..3 {
        assert_within!((a[3 + i] - b[3 + i] - want[i]).abs(), 1e-12 * want.amax());
    }
    assert_eq!(axial_momentum(&w, &w.nominal(), &omega, nu), j * (w.axis().dot(&omega) + nu));
}

fn base() -> Inertia<f64> {
    let i = Matrix3::new(40.0, 2.0, -3.0, 2.0, 52.0, 1.0, -3.0, 1.0, 61.0);
    Inertia::from_com(140.0, &Vector3::new(0.2, -0.3, 0.4), &i)
}
fn mount() -> Xform<f64> {
    Xform::new(Rotation3::new(Vector3::new(0.4, -0.8, 1.1)).into_inner(), Vector3::new(0.7, 0.2, -0.5))
}

#[test]
fn the_wheel_is_its_tree_twin() {
    let mut r = rng(64);
    for _ in 0..100 {
        let w = random(&mut r);
        let [mass, j, jt, d, c] = w.nominal();
        let mut port = Model::new("sat", "base", base(), BaseKind::Floating);
        port.mount("wheel", 0, mount(), w.clone()).unwrap();
        let a = w.axis();
        let rotor =
            Inertia::from_com(mass, &Vector3::zeros(), &(Matrix3::identity() * jt + a * a.transpose() * (j - jt)));
        let mut tree = Model::new("sat", "base", base(), BaseKind::Floating);
        let joint = Joint {
            name: "spin".into(),
            kind: JointKind::Continuous,
            axis: *a,
            placement: mount(),
            limits: JointLimits::default(),
        };
        tree.add_body(0, "rotor", joint, rotor);
        let (mut s, mut t) = (State::<f64>::zero(&port), State::<f64>::zero(&tree));
        let v: Vec<f64> = (0..7).map(|i| symmetric(&mut r, if i < 6 { 1.0 } else { 80.0 })).collect();
        s.v.copy_from_slice(&v);
        t.v.copy_from_slice(&v);
        (s.eta[0], t.q[0]) = (0.7, 0.7);
        let (ps, pt) = (Params::nominal(&port), Params::nominal(&tree));
        let (mut hs, mut ht) = (DMatrix::zeros(7, 7), DMatrix::zeros(7, 7));
        mass_matrix(&port, &ps, &s, &mut Work::new(&port), &mut hs);
        mass_matrix(&tree, &pt, &t, &mut Work::new(&tree), &mut ht);
        assert_within!((&hs - &ht).amax(), 1e-13 * ht.amax());
        let (mut bs, mut bt) = (vec![0.0; 7], vec![0.0; 7]);
        bias(&port, &ps, &s, &mut Work::new(&port), &mut bs);
        bias(&tree, &pt, &t, &mut Work::new(&tree), &mut bt);
        let friction = d * v[6] + c * v[6] / (v[6] * v[6] + 0.09).sqrt();
        bt[6] += friction;
        let scale = bt.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        assert!(bs.iter().zip(&bt).all(|(x, y)| (x - y).abs() < 1e-12 * scale), "{bs:?} {bt:?}");
        // The motor: a torque on the wheel's row, in the tree on its joint.
        let mut tau: Vec<f64> = (0..7).map(|_| symmetric(&mut r, 2.0)).collect();
        let (mut acc, mut twin) = (vec![0.0; 7], vec![0.0; 7]);
        forward_dynamics(&port, &ps, &s, &tau, &mut Work::new(&port), &mut acc).unwrap();
        tau[6] -= friction;
        forward_dynamics(&tree, &pt, &t, &tau, &mut Work::new(&tree), &mut twin).unwrap();
        let scale = twin.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        assert!(acc.iter().zip(&twin).all(|(x, y)| (x - y).abs() < 1e-10 * scale), "{acc:?} {twin:?}");
    }
}

#[test]
fn the_motor_turns_the_base_the_other_way_and_keeps_the_momentum() {
    let wheel = Wheel {
        axis: Vector3::new(0.3, -0.5, 0.8),
        mass: 6.0,
        spin: 0.2,
        transverse: 0.12,
        viscous: 3e-3,
        dry: 1e-3,
        rounding: 0.1,
    };
    let mut m = Model::new("sat", "base", base(), BaseKind::Floating);
    m.mount("wheel", 0, mount(), ReactionWheel::new(&wheel).unwrap()).unwrap();
    let (p, mut work) = (Params::nominal(&m), Work::new(&m));
    let motor = 0.05;
    let mut s = State::<f64>::zero(&m);
    // Twist, speed and attitude by small steps of the midpoint rule; momentum about the base origin in world axes needs
    // the attitude, but with the system at rest at first it is zero in any axes.
    let (steps, h) = (4000, 0.01);
    let tau = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, motor];
    for _ in 0..steps {
        let mut a = vec![0.0; 7];
        forward_dynamics(&m, &p, &s, &tau, &mut work, &mut a).unwrap();
        let mut mid = s.clone();
        (0..7).for_each(|i| mid.v[i] += 0.5 * h * a[i]);
        forward_dynamics(&m, &p, &mid, &tau, &mut work, &mut a).unwrap();
        (0..7).for_each(|i| s.v[i] += h * a[i]);
    }
    let b = budget(&m, &p, &s, &mut work);
    let carried = wheel.spin * s.v[6];
    println!(
        "speed {:.2} rad/s, momentum of the wheel {carried:.3}, of the system {:.1e} kg m^2/s",
        s.v[6],
        b.momentum.ang.norm()
    );
    assert!(carried > 1.0 && b.momentum.ang.norm() < 1e-6 * carried && b.momentum.lin.norm() < 1e-6 * carried);
    let axis = mount().rot * wheel.axis.normalize();
    let turned = Vector3::new(s.v[3], s.v[4], s.v[5]);
    assert!(turned.dot(&axis) < 0.0);
    // Friction: at the speed where motor and friction balance the wheel would stay; it is below that.
    assert!(s.v[6] < motor / wheel.viscous);
}

const GOOD: &str = "axis = [0.3, -0.5, 0.8]\nmass_kg = 8.5\ninertia_spin_kgm2 = 0.11\ninertia_transverse_kgm2 = 0.06\nviscous_nms_per_rad = 2e-5\ndry_nm = 1e-3\n";

#[track_caller]
fn refused(from: &str, to: &str, code: &str, object: &str) -> Problem {
    refused_table(from_toml, GOOD, (from, to), code, object)
}

#[test]
fn tables_are_read_and_refused_by_name() {
    let a = from_toml(&GOOD.parse().unwrap()).unwrap();
    let d = a.declaration();
    let all: Vec<_> = d.params.iter().map(|p| (p.name.as_str(), p.unit, p.nominal)).collect();
    let want = [
        ("mass", "kg", 8.5),
        ("i_spin", "kg m^2", 0.11),
        ("i_transverse", "kg m^2", 0.06),
        ("d", "N m s/rad", 2e-5),
        ("c", "N m", 1e-3),
    ];
    assert_eq!((d.kind, d.coords.len(), &all[..]), (KIND, 1, &want[..]));
    let mut registry = Registry::new();
    register(&mut registry);
    assert!(registry.get("reaction_wheel").is_some());
    let p = refused("8.5", "-8.5", "Config::Param", "mass_kg");
    assert_violation(&p, -8.5, Limit::Above(0.0), "kg");
    let p = refused("0.06", "0.05", "Config::Inertia", "inertia_transverse_kgm2");
    assert_violation(&p, 0.05, Limit::AtLeast(0.055), "kg m^2");
    refused("0.11", "nan", "Config::NotFinite", "inertia_spin_kgm2");
    refused("[0.3, -0.5, 0.8]", "[0.0, 0.0, 0.0]", "Config::Axis", "axis");
    let p = refused("2e-5", "-2e-5", "Config::NotPassive", "viscous_nms_per_rad");
    assert_violation(&p, -2e-5, Limit::AtLeast(0.0), "N m s/rad");
    let p = refused("1e-3", "-1e-3", "Config::NotPassive", "dry_nm");
    assert_violation(&p, -1e-3, Limit::AtLeast(0.0), "N m");
    refused("dry_nm", "dry_Nm", "Config::UnknownKey", "dry_Nm");
    refused("mass_kg = 8.5\n", "", "Config::MissingKey", "mass_kg");
    let p = refused("dry_nm", "rounding_rad_per_s = 0.0\ndry_nm", "Config::Param", "rounding_rad_per_s");
    assert_violation(&p, 0.0, Limit::Above(0.0), "rad/s");
}
