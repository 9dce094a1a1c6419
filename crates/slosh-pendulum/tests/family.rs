//! Spring-mass and tank: laws, equivalence with the pendulum, geometry, and what is said when a table is wrong.
use crate::common::ports::{check_ports, shared};
use crate::common::{Random, pendulum, rel, rng, sym, vec3};
use ff_model::port::{PortModel, derived_bias};
use ff_model::{Appendage, DynAppendage, Motion, PortState, Problems};
use nalgebra::{Complex, DMatrix, DVector, Matrix3, Vector3};
use rand::RngExt;
use slosh_pendulum::geometry::Tank;
use slosh_pendulum::{
    FixedFuel, SPRING_MASS_KIND, SloshPart, SloshPendulum, SloshSpringMass, SloshTank, TANK_KIND,
    from_toml as spring_mass_from_toml, from_toml as tank_from_toml, register,
};
use validate::check_appendage;

fn spring_mass(r: &mut Random, n: usize) -> SloshSpringMass {
    let k: Vec<f64> = (0..n).map(|_| r.random_range(1.0..60.0)).collect();
    let d: Vec<f64> = (0..n).map(|_| r.random_range(0.1..6.0)).collect();
    SloshSpringMass::new(r.random_range(1.0..150.0), vec3(r, 0.8), &k, &d, 0.7).unwrap()
}

/// A pendulum, masses on two and on three springs, and fixed fuel.
fn tank(r: &mut Random) -> SloshTank {
    let mut u = |a: f64, b: f64| r.random_range(a..b);
    let pendulum = SloshPart::Pendulum {
        mass: u(1.0, 90.0),
        length: u(0.2, 1.2),
        fulcrum: Vector3::new(u(-0.5, 0.5), u(-0.5, 0.5), u(0.1, 0.9)),
        k: [u(1.0, 50.0), u(1.0, 50.0)],
        d: [u(0.1, 5.0), u(0.1, 5.0)],
    };
    let mut springs = |n: usize| SloshPart::SpringMass {
        mass: u(1.0, 40.0),
        rest: Vector3::new(u(-0.5, 0.5), u(-0.5, 0.5), u(0.1, 0.9)),
        k: (0..n).map(|_| u(1.0, 50.0)).collect(),
        d: (0..n).map(|_| u(0.1, 5.0)).collect(),
        travel: 0.6,
    };
    let parts = [pendulum, springs(2), springs(3)];
    let inertia_com = Matrix3::new(3.0, 0.2, -0.3, 0.2, 4.0, 0.1, -0.3, 0.1, 3.5);
    SloshTank::new(Some(FixedFuel { mass: 31.0, com: vec3(r, 0.4), inertia_com }), &parts).unwrap()
}

#[test]
fn random_spring_masses_and_tanks_keep_every_law() {
    let mut r = rng(51);
    for i in 0..6 {
        let reports = [shared(&spring_mass(&mut r, 2 + i % 2)), shared(&tank(&mut r))].map(|a| check_appendage(&*a));
        for report in reports {
            println!("{report}");
            assert!(report.checks.iter().all(|c| c.pass), "{report}");
        }
    }
}

fn bias_difference<A: Appendage>(a: &A, p: &[f64], r: &mut Random) -> f64 {
    let n = a.decl().coords.len();
    (0..300).fold(0.0_f64, |worst, _| {
        let eta: Vec<f64> = (0..n).map(|_| sym(r, 0.6)).collect();
        let nu: Vec<f64> = (0..n).map(|_| sym(r, 2.0)).collect();
        let s = PortState { host: Motion::new(vec3(r, 2.0), vec3(r, 2.0)), eta: &eta, nu: &nu };
        // The override must not lean on what the buffer held.
        let (mut h, mut d) = (vec![f64::NAN; 6 + n], vec![0.0; 6 + n]);
        Appendage::bias(a, p, &s, &mut h);
        derived_bias(a, p, &s, &mut d);
        let worse = rel(&h, &d);
        if worse.is_nan() { f64::NAN } else { worst.max(worse) }
    })
}

#[test]
fn overrides_equal_the_derived_bias() {
    let mut r = rng(52);
    for _ in 0..5 {
        let (a, b, c) = (spring_mass(&mut r, 2), spring_mass(&mut r, 3), tank(&mut r));
        assert!(bias_difference(&a, &a.nominal(), &mut r) < 1e-12);
        assert!(bias_difference(&b, &b.nominal(), &mut r) < 1e-12);
        assert!(bias_difference(&c, &c.nominal(), &mut r) < 1e-12);
        let bare = SloshTank::new(
            None,
            &[SloshPart::SpringMass {
                mass: 3.0,
                rest: vec3(&mut r, 0.5),
                k: vec![2.0, 3.0],
                d: vec![0.1, 0.2],
                travel: 0.4,
            }],
        )
        .unwrap();
        assert!(bias_difference(&bare, &bare.nominal(), &mut r) < 1e-12);
    }
}

#[test]
fn port_equations_equal_the_defaults_over_lanes_and_differences() {
    let mut r = rng(54);
    for _ in 0..10 {
        let (a, b, c, d) = (pendulum(&mut r), spring_mass(&mut r, 2), spring_mass(&mut r, 3), tank(&mut r));
        check_ports(&a, &a.nominal(), &mut r, 5);
        check_ports(&b, &b.nominal(), &mut r, 5);
        check_ports(&c, &c.nominal(), &mut r, 5);
        check_ports(&d, &d.nominal(), &mut r, 5);
    }
}

#[test]
fn a_tank_is_the_sum_of_its_parts() {
    let mut r = rng(53);
    let (m, l, k, d) = (70.0, 0.6, [20.0, 26.0], [4.0, 3.0]);
    let pendulum = SloshPendulum::new(m, l, k, d).unwrap();
    let part = SloshPart::Pendulum { mass: m, length: l, fulcrum: Vector3::zeros(), k, d };
    let springs = spring_mass(&mut r, 3);
    let p = springs.nominal();
    let other = SloshPart::SpringMass {
        mass: p[0],
        rest: Vector3::new(p[1], p[2], p[3]),
        k: p[4..7].to_vec(),
        d: p[7..10].to_vec(),
        travel: 0.7,
    };
    let tank = SloshTank::new(None, &[part, other]).unwrap();
    let eta = [0.4, -0.3, 0.2, 0.1, -0.25];
    let nu = [0.7, -0.5, 0.3, 0.6, -0.2];
    let whole = tank.dense_inertia(&tank.nominal(), &eta);
    let (a, b) = (pendulum.dense_inertia(&pendulum.nominal(), &eta[..2]), springs.dense_inertia(&p, &eta[2..]));
    assert!((whole.view((0, 0), (6, 6)) - a.view((0, 0), (6, 6)) - b.view((0, 0), (6, 6))).amax() < 1e-12);
    assert!((whole.view((0, 6), (8, 2)) - a.view((0, 6), (8, 2))).amax() < 1e-12);
    assert!((whole.view((0, 8), (6, 3)) - b.view((0, 6), (6, 3))).amax() < 1e-12);
    assert!((whole.view((8, 8), (3, 3)) - b.view((6, 6), (3, 3))).amax() < 1e-12);
    let host = Motion::new(vec3(&mut r, 1.0), vec3(&mut r, 1.0));
    let bias = |x: &dyn PortModel<f64>, p: &[f64], range: std::ops::Range<usize>| {
        let mut h = vec![0.0; 6 + range.len()];
        x.bias(p, &PortState { host, eta: &eta[range.clone()], nu: &nu[range] }, &mut h);
        h
    };
    let (h, ha, hb) =
        (bias(&tank, &tank.nominal(), 0..5), bias(&pendulum, &pendulum.nominal(), 0..2), bias(&springs, &p, 2..5));
    for i in 0..6 {
        assert!((h[i] - ha[i] - hb[i]).abs() < 1e-11);
    }
    assert!(rel(&h[6..8], &ha[6..]) < 1e-13 && rel(&h[8..], &hb[6..]) < 1e-13);
}

/// Wrench about a fixed point per acceleration of the host, at rest, at frequency `w` (rad/s): `M_bb + w^2 M_be (K +
/// i w D - w^2 M_ee)^-1 M_eb`, for an appendage whose mount is `height` above the point along z.
fn impedance(a: &dyn PortModel<f64>, p: &[f64], k: &[f64], d: &[f64], height: f64, w: f64) -> DMatrix<Complex<f64>> {
    let n = k.len();
    let m = a.dense_inertia(p, &vec![0.0; n]);
    let c = |x: DMatrix<f64>| x.map(|x| Complex::new(x, 0.0));
    // Twist at the mount from the twist at the point: v + w x [0, 0, height].
    let mut x = DMatrix::identity(6, 6);
    (x[(0, 4)], x[(1, 3)]) = (height, -height);
    let (mbb, mbe) = (x.transpose() * m.view((0, 0), (6, 6)) * &x, x.transpose() * m.view((0, 6), (6, n)));
    let diagonal = |v: &[f64]| DMatrix::from_diagonal(&DVector::from_column_slice(v));
    let dynamic = c(diagonal(k) - m.view((6, 6), (n, n)) * (w * w)) + diagonal(d).map(|x| Complex::new(0.0, w * x));
    let inner = dynamic.lu().solve(&c(mbe.transpose() * (w * w))).unwrap();
    c(mbb) + c(mbe) * inner
}

#[test]
fn spring_mass_and_pendulum_have_the_same_transfer_functions() {
    // theory.md 5.15: (l, k, d, fulcrum) -> (s l, s^2 k, s^2 d, fulcrum + (1 - s) l r0); on springs k / l^2, d / l^2.
    let (m, l, k, d) = (100.0, 0.8, [20.0, 26.0], [5.0, 3.0]);
    let fulcrum = 0.45;
    let springs_k = [k[1] / (l * l), k[0] / (l * l)]; // x belongs to the second swing, y to the first
    let springs_d = [d[1] / (l * l), d[0] / (l * l)];
    let springs = SloshSpringMass::new(m, Vector3::zeros(), &springs_k, &springs_d, 0.5).unwrap();
    let mut worst = 0.0_f64;
    for s in [0.37, 1.0, 2.6] {
        let (k2, d2) = (k.map(|x| s * s * x), d.map(|x| s * s * x));
        let pendulum = SloshPendulum::new(m, s * l, k2, d2).unwrap();
        for w in [0.02, 0.3, 0.559, 0.6, 1.7, 12.0] {
            let height = fulcrum - (1.0 - s) * l;
            let a = impedance(&pendulum, &pendulum.nominal(), &k2, &d2, height, w);
            let b = impedance(&springs, &springs.nominal(), &springs_k, &springs_d, fulcrum - l, w);
            let scale = b.iter().fold(0.0_f64, |x, z| x.max(z.norm()));
            let apart = (&a - &b).iter().fold(0.0_f64, |x, z| x.max(z.norm()));
            worst = worst.max(apart / scale);
            // Not because nothing depends on the frequency: at resonance the mass pushes much harder than frozen.
            if w == 0.559 {
                assert!(b[(1, 1)].norm() > 5.0 * m);
            }
        }
    }
    println!("impedances, largest relative difference {worst:.2e}");
    assert!(worst < 1e-9, "{worst:e}");
    // With the fulcrum left where it is the moment differs: the equivalence is about the rest position.
    let long = SloshPendulum::new(m, 2.0 * l, k.map(|x| 4.0 * x), d.map(|x| 4.0 * x)).unwrap();
    let a = impedance(&long, &long.nominal(), &k.map(|x| 4.0 * x), &d.map(|x| 4.0 * x), fulcrum, 0.3);
    let b = impedance(&springs, &springs.nominal(), &springs_k, &springs_d, fulcrum - l, 0.3);
    assert!((a[(3, 1)] - b[(3, 1)]).norm() > 0.1 * b[(3, 1)].norm());
}

#[test]
fn springs_give_hookes_law_and_stokes_law() {
    let a =
        SloshSpringMass::new(40.0, Vector3::new(0.1, -0.2, 0.3), &[12.0, 15.0, 19.0], &[1.5, 1.1, 0.7], 0.5).unwrap();
    let (eta, nu) = ([0.2, -0.1, 0.3], [0.4, 0.5, -0.6]);
    let mut h = [0.0; 9];
    PortModel::bias(&a, &a.nominal(), &PortState { host: Motion::zero(), eta: &eta, nu: &nu }, &mut h);
    assert_eq!(&h[..6], &[0.0; 6], "a mass that moves evenly pushes nobody");
    assert!(rel(&h[6..], &[12.0 * 0.2 + 1.5 * 0.4, -1.5 + 1.1 * 0.5, 19.0 * 0.3 - 0.7 * 0.6]) < 1e-15);
    let m = a.dense_inertia(&a.nominal(), &eta);
    assert_eq!((m[(0, 4)], m[(6, 6)], m[(7, 5)]), (40.0 * 0.6, 40.0, 40.0 * (0.1 + 0.2)));
}

const TANK: &str = r#"
cylinder = { radius_m = 0.45, fill_m = 0.6 }
density_kg_per_m3 = 1010.0
settling_m_per_s2 = 0.02
damping_ratio = 0.01
slosh_modes = 2
"#;
const MASSES: &str = r#"
fixed = { mass_kg = 40.0, com_m = [0.0, 0.1, 0.2] }
modes = [
    { type = "pendulum", at_m = [0.0, 0.0, 0.9], mass_kg = 60.0, length_m = 0.5, stiffness_nm_per_rad = [20.0, 21.0], damping_nms_per_rad = [2.0, 2.1] },
    { type = "spring_mass", at_m = [0.1, 0.0, 0.4], mass_kg = 6.0, stiffness_n_per_m = [7.0, 8.0, 9.0], damping_ns_per_m = [0.7, 0.8, 0.9], travel_m = 0.3 },
]
"#;

fn nominal(a: &dyn DynAppendage, name: &str) -> f64 {
    a.declaration().params.iter().find(|p| p.name == name).unwrap_or_else(|| panic!("no {name}")).nominal
}

#[test]
fn geometry_gives_masses_that_swing_at_the_sloshing_frequency() {
    let model = Tank::Cylinder { radius: 0.45, fill: 0.6 }.model(1010.0, 2).unwrap();
    for (text, pendulum) in [(TANK.to_owned(), true), (format!("{TANK}model = 'spring_mass'"), false)] {
        let a = tank_from_toml(&text.parse().unwrap()).unwrap();
        assert_eq!((a.declaration().kind, a.declaration().coords.len()), (TANK_KIND, 4));
        let p: Vec<f64> = a.declaration().params.iter().map(|p| p.nominal).collect();
        let m = a.dense_inertia(&p, &[0.0; 4]);
        for (i, mode) in model.modes.iter().enumerate() {
            let (k, d) = (nominal(&*a, &format!("mode[{i}].k[1]")), nominal(&*a, &format!("mode[{i}].d[1]")));
            let own = m[(7 + 2 * i, 7 + 2 * i)];
            let w = mode.omega(0.02);
            assert!(((k / own).sqrt() / w - 1.0).abs() < 1e-13);
            assert!((d / (2.0 * own * w) - 0.01).abs() < 1e-14);
            if pendulum {
                assert!((nominal(&*a, &format!("mode[{i}].length")) - 0.02 / (w * w)).abs() < 1e-13);
            } else {
                assert_eq!(nominal(&*a, &format!("mode[{i}].rest_z")), mode.height);
            }
        }
        // All of the liquid is there, with its centre of mass where it is.
        let total = 1010.0 * std::f64::consts::PI * 0.45 * 0.45 * 0.6;
        assert!((m[(0, 0)] / total - 1.0).abs() < 1e-13 && (m[(0, 4)] / total - 0.3).abs() < 1e-13);
    }
    let sphere = "sphere = { radius_m = 0.5, fill_m = 0.5 }\ndensity_kg_per_m3 = 800\ndiaphragm_n_per_m = [30.0]\ndamping_ratio = 0.05";
    let a = tank_from_toml(&sphere.parse().unwrap()).unwrap();
    let (m, l) = (nominal(&*a, "mode[0].mass"), nominal(&*a, "mode[0].length"));
    assert!((nominal(&*a, "mode[0].k[0]") - 30.0 * l * l).abs() < 1e-12);
    assert!((nominal(&*a, "mode[0].d[0]") - 2.0 * 0.05 * (30.0 * m).sqrt() * l * l).abs() < 1e-12);
    assert!((m + nominal(&*a, "fixed.mass") - 800.0 * 2.0 / 3.0 * std::f64::consts::PI * 0.125).abs() < 1e-9);
}

#[test]
fn masses_in_a_table_are_read() {
    let a = tank_from_toml(&MASSES.parse().unwrap()).unwrap();
    let names: Vec<_> = a.declaration().params.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(&names[..4], ["fixed.mass", "mode[0].mass", "mode[0].length", "mode[0].k[0]"]);
    assert_eq!(names[7..11], ["mode[1].mass", "mode[1].rest_x", "mode[1].rest_y", "mode[1].rest_z"]);
    assert_eq!(
        (nominal(&*a, "mode[1].k[2]"), nominal(&*a, "mode[1].d[0]"), nominal(&*a, "mode[1].rest_x")),
        (9.0, 0.7, 0.1)
    );
    assert_eq!(a.declaration().coords[4].name, "mode[1].shift[2]");
    assert_eq!(a.declaration().coords[4].range, (-0.3, 0.3));
    let one = "mass_kg = 100\nstiffness_n_per_m = [31.0, 32.0]\ndamping_ns_per_m = [7, 8]\ntravel_m = 0.4\nrest_m = [0.1, 0.2, 0.3]";
    let a = spring_mass_from_toml(&one.parse().unwrap()).unwrap();
    assert_eq!((a.declaration().kind, nominal(&*a, "rest_z"), nominal(&*a, "k[1]")), (SPRING_MASS_KIND, 0.3, 32.0));
    let mut registry = ff_model::Registry::new();
    register(&mut registry);
    assert_eq!(registry.kinds().collect::<Vec<_>>(), ["slosh_pendulum", "slosh_spring_mass", "slosh_tank"]);
}

#[track_caller]
fn refused(text: &str, from: &str, to: &str, code: &str, object: &str) -> Problems {
    assert!(text.contains(from), "{from}");
    let Err(e) = tank_from_toml(&text.replacen(from, to, 1).parse().unwrap()) else { panic!("accepted") };
    assert_eq!(
        (e.0.len(), e.0[0].code, e.0[0].object.as_deref(), e.0[0].hint.is_some()),
        (1, code, Some(object), true),
        "{e}"
    );
    e
}

#[test]
fn wrong_tanks_are_refused_by_name() {
    refused(TANK, "cylinder =", "sphere = { radius_m = 1, fill_m = 1 }\ncylinder =", "Config::Conflict", "modes");
    refused(TANK, "fill_m = 0.6", "fill_m = 60", "Config::Param", "cylinder.fill_m");
    refused(TANK, "radius_m = 0.45", "radius_m = -0.45", "Config::Param", "cylinder.radius_m");
    refused(TANK, "1010.0", "0.0", "Config::Param", "density_kg_per_m3");
    refused(TANK, "slosh_modes = 2", "slosh_modes = 9", "Config::Param", "slosh_modes");
    refused(TANK, "slosh_modes = 2", "slosh_modes = 1.5", "Config::Type", "slosh_modes");
    refused(TANK, "0.02", "-0.02", "Config::NotPassive", "settling_m_per_s2");
    refused(TANK, "0.01\n", "-0.01\n", "Config::NotPassive", "damping_ratio");
    refused(TANK, "settling_m_per_s2 = 0.02", "", "Config::Conflict", "settling_m_per_s2");
    refused(TANK, "slosh_modes", "diaphragm_n_per_m = [1.0]\nslosh_modes", "Config::Conflict", "settling_m_per_s2");
    refused(TANK, "settling_m_per_s2 = 0.02", "diaphragm_n_per_m = [1.0]", "Config::WrongLength", "diaphragm_n_per_m");
    refused(
        TANK,
        "settling_m_per_s2 = 0.02",
        "diaphragm_n_per_m = [1.0, -1.0]",
        "Config::NotPassive",
        "diaphragm_n_per_m[1]",
    );
    refused(TANK, "slosh_modes = 2", "model = 'penduum'", "Config::BadChoice", "model");
    refused(TANK, "radius_m = 0.45, ", "", "Config::MissingKey", "cylinder.radius_m");
    refused(MASSES, "\"pendulum\"", "\"spring\"", "Config::BadChoice", "modes[0].type");
    refused(MASSES, "mass_kg = 60.0", "mass_kg = -60.0", "Config::Param", "modes[0].mass_kg");
    refused(MASSES, "mass_kg = 40.0", "mass_kg = -40.0", "Config::Inertia", "fixed.mass_kg");
    refused(MASSES, "[7.0, 8.0, 9.0]", "[7.0]", "Config::WrongLength", "modes[1].stiffness_n_per_m");
    refused(MASSES, "[0.7, 0.8, 0.9]", "[0.7, 0.8, -0.9]", "Config::NotPassive", "modes[1].damping_ns_per_m[2]");
    refused(MASSES, "travel_m = 0.3", "travel_m = 0.0", "Config::Param", "modes[1].travel_m");
    refused(MASSES, "travel_m = 0.3", "travel = 0.3, travel_m = 0.3", "Config::UnknownKey", "modes[1].travel");
    assert!(SloshTank::new(None, &[]).unwrap_err().to_string().contains("no sloshing mass"));
    let part = SloshPart::Pendulum { mass: 1.0, length: 0.5, fulcrum: Vector3::zeros(), k: [1.0; 2], d: [0.1; 2] };
    assert!(SloshTank::new(None, &vec![part; 9]).unwrap_err().to_string().contains("18 coordinates, limit 16"));
    let Err(e) = tank_from_toml(&"density_kg_per_m3 = 3".parse().unwrap()) else { panic!("accepted") };
    assert!(e.has("Config::Conflict"), "{e}");
}
