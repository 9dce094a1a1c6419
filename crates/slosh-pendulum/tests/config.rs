//! What the mission-file factory accepts, and what it says when it refuses.
use ff_model::Problem;
use ff_model::diagnostics::Limit;
use ff_testkit::problem::{assert_violation, refused_table};
use nalgebra::Vector3;
use slosh_pendulum::from_toml;
use slosh_pendulum::{KIND, register};
use slosh_pendulum::{SWING_LIMITS, SloshPendulum};

const GOOD: &str =
    "mass_kg = 100\nlength_m = 0.8\nstiffness_nm_per_rad = [20.0, 21.0]\ndamping_nms_per_rad = [5.0, 6]\n";

#[track_caller]
fn refused(from: &str, to: &str, code: &str, object: &str) -> Problem {
    refused_table(from_toml, GOOD, (from, to), code, object)
}

#[test]
fn declares_parameters_in_the_promised_order() {
    let a = from_toml(&GOOD.parse().unwrap()).unwrap();
    let d = a.declaration();
    let have: Vec<_> = d.params.iter().map(|p| (p.name.as_str(), p.unit, p.nominal)).collect();
    let (k, c) = ("N m/rad", "N m s/rad");
    assert_eq!(
        have,
        [
            ("mass", "kg", 100.0),
            ("length", "m", 0.8),
            ("k[0]", k, 20.0),
            ("k[1]", k, 21.0),
            ("d[0]", c, 5.0),
            ("d[1]", c, 6.0)
        ]
    );
    assert_eq!(d.coords[1].range, (-SWING_LIMITS[1], SWING_LIMITS[1]));
    const { assert!(SWING_LIMITS[1] < std::f64::consts::FRAC_PI_2, "the second angle must not reach its singularity") };
    let mut registry = ff_model::Registry::new();
    register(&mut registry);
    assert!(registry.get(KIND).is_some());
}

#[test]
fn twin_is_a_massless_link_and_a_point() {
    let t = SloshPendulum::new(7.0, 0.4, [2.0, 3.0], [0.2, 0.3]).unwrap().twin_bodies();
    assert_eq!((t[0].parent, t[1].parent), (None, Some(0)));
    assert!(t[0].inertia.is_zero());
    assert_eq!(t[1].inertia.com(), Some(Vector3::new(0.0, 0.0, -0.4)));
    assert_eq!((t[0].stiffness, t[1].stiffness, t[0].damping, t[1].damping), (2.0, 3.0, 0.2, 0.3));
}

#[test]
fn refuses_bad_values_by_name() {
    let p = refused("= 100", "= 0", "Config::Param", "mass_kg");
    assert_violation(&p, 0.0, Limit::Above(0.0), "kg");
    let p = refused("= 0.8", "= -0.8", "Config::Param", "length_m");
    assert_violation(&p, -0.8, Limit::Above(0.0), "m");
    refused("= 0.8", "= inf", "Config::NotFinite", "length_m");
    let p = refused("21.0", "-21.0", "Config::NotPassive", "stiffness_nm_per_rad[1]");
    assert_violation(&p, -21.0, Limit::AtLeast(0.0), "N m/rad");
    let p = refused("[5.0", "[-5.0", "Config::NotPassive", "damping_nms_per_rad[0]");
    assert_violation(&p, -5.0, Limit::AtLeast(0.0), "N m s/rad");
    refused("[5.0", "[nan", "Config::NotFinite", "damping_nms_per_rad[0]");
    refused("= [20.0, 21.0]", "= [20.0]", "Config::Type", "stiffness_nm_per_rad");
    refused("= [20.0, 21.0]", "= [20.0, 1.0, 2.0]", "Config::Type", "stiffness_nm_per_rad");
    refused("= 100", "= \"100 kg\"", "Config::Type", "mass_kg");
    refused("length_m = 0.8\n", "", "Config::MissingKey", "length_m");
    refused("= 100\n", "= 100\nlenght_m = 1.0\n", "Config::UnknownKey", "lenght_m");
}

#[test]
fn all_problems_come_at_once() {
    let text = GOOD.replace("100", "-1.0").replace("length_m", "len_m").replace("21.0", "nan").replace("5.0", "-5.0");
    let Err(e) = from_toml(&text.parse().unwrap()) else { panic!("accepted") };
    for code in ["Config::Param", "Config::UnknownKey", "Config::MissingKey", "Config::NotFinite", "Config::NotPassive"]
    {
        assert!(e.has(code), "{code} missing in {e}");
    }
    assert_eq!(e.0.len(), 5);
}
