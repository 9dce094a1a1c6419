//! What the mission-file factory accepts, and what it says when it refuses.
use ff_model::diagnostics::Limit;
use ff_model::{Problem, Problems};
use ff_testkit::problem::{assert_violation, refused_table};
use flex_panel::{KIND, PanelChain, Segment, from_toml, register};
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::PI;

const GOOD: &str = r#"
[[segments]]
mass_kg = 33
com_m = [0.1, 1.075, -0.02]
inertia_com_kgm2 = [15.0, 0.1, -0.2, 11.0, 0.3, 15.0]
hinge_m = [0.9, 0.3, 0.6]
hinge_axis = [2.0, 0.0, 0.0]
stiffness_nm_per_rad = 200.0
damping_nms_per_rad = 2.0

[[segments]]
mass_kg = 30.0
com_m = [0.0, 1.0, 0.0]
inertia_com_kgm2 = [12.0, 0.0, 0.0, 9.0, 0.0, 13.0]
hinge_m = [0.0, 2.15, 0.0]
hinge_axis = [1.0, 0.1, 0.0]
stiffness_nm_per_rad = 180.0
damping_nms_per_rad = 1.5
rest_rad = 0.05
"#;

fn refusal(text: &str) -> Problems {
    match from_toml(&text.parse().unwrap()) {
        Ok(_) => panic!("accepted"),
        Err(e) => e,
    }
}

/// The good file with one piece replaced must be refused with this code alone, naming this object and a next step.
#[track_caller]
fn refused(from: &str, to: &str, code: &str, object: &str) -> Problem {
    refused_table(from_toml, GOOD, (from, to), code, object)
}

#[test]
fn declares_parameters_in_the_promised_order() {
    let a = from_toml(&GOOD.parse().unwrap()).unwrap();
    let d = a.declaration();
    assert_eq!(d.kind, KIND);
    let names: Vec<_> = d.params.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(names.len(), 24);
    assert_eq!((names[0], names[10], names[19]), ("seg[0].mass", "seg[1].mass", "seg[1].i_zz"));
    assert_eq!(&names[20..], &["k[0]", "k[1]", "d[0]", "d[1]"]);
    let values: Vec<_> = d.params[20..].iter().map(|p| p.nominal).collect();
    assert_eq!(values, [200.0, 180.0, 2.0, 1.5]);
    assert_eq!(d.params[0].nominal, 33.0, "an integer is a number");
    assert_eq!(d.coords[1].name, "hinge[1]");
    let mut registry = ff_model::Registry::new();
    register(&mut registry);
    assert!(registry.get(KIND).is_some());
}

#[test]
fn twin_and_accessors_give_back_what_was_built() {
    let s = |x: f64| {
        Segment::new(
            3.0 + x,
            Vector3::new(0.1, 0.7, x),
            &Matrix3::identity(),
            Vector3::new(x, 0.2, 0.3),
            Vector3::new(0.0, 3.0, 4.0),
        )
        .with_spring(20.0 + x, 0.3 + x)
        .with_rest(0.1 * x)
    };
    let c = PanelChain::builder().segment(s(0.5)).segment(s(0.9)).build().unwrap();
    let t = c.twin_bodies();
    assert_eq!((t[0].parent, t[1].parent), (None, Some(0)));
    assert_eq!(t[1].inertia.to_params(), s(0.9).inertia.to_params());
    assert_eq!(t[1].axis, Vector3::new(0.0, 0.6, 0.8));
    assert_eq!(t[1].placement.pos, s(0.9).hinge);
    assert_eq!((t[1].stiffness, t[1].damping, t[1].rest), (20.9, 1.2, 0.09000000000000001));
    assert_eq!(c.segment(1).unwrap().inertia, t[1].inertia);
    assert!(c.segment(2).is_none());
}

#[test]
fn refuses_what_is_not_passive() {
    let at = "segments[0].stiffness_nm_per_rad";
    let p = refused("= 200.0", "= -200.0", "Config::NotPassive", at);
    assert_violation(&p, -200.0, Limit::AtLeast(0.0), "N m/rad");
    let p = refused("= 2.0\n", "= -2.0\n", "Config::NotPassive", "segments[0].damping_nms_per_rad");
    assert_violation(&p, -2.0, Limit::AtLeast(0.0), "N m s/rad");
}

#[test]
fn refuses_bodies_that_cannot_exist() {
    for (mass, text) in [(-33.0, "mass_kg = -33"), (0.0, "mass_kg = 0")] {
        let p = refused("mass_kg = 33", text, "Config::Inertia", "segments[0].mass_kg");
        assert_violation(&p, mass, Limit::Above(0.0), "kg");
    }
    let at = "segments[1].inertia_com_kgm2";
    // The largest moment exceeds the sum of the others; a moment is negative. The moments are 120, 9 and 13 kg m^2.
    let v = refused("[12.0, 0.0, 0.0, 9.0", "[120.0, 0.0, 0.0, 9.0", "Config::Inertia", at).violation.unwrap();
    assert!((v.value - 98.0).abs() < 1e-9 && v.limit == Limit::AtMost(0.0) && v.unit == "kg m^2", "{v:?}");
    let v = refused("[12.0, 0.0, 0.0, 9.0", "[-12.0, 0.0, 0.0, 9.0", "Config::Inertia", at).violation.unwrap();
    assert!((v.value + 12.0).abs() < 1e-9 && v.limit == Limit::AtLeast(0.0) && v.unit == "kg m^2", "{v:?}");
}

#[test]
fn refuses_axes_without_direction_and_numbers_that_are_none() {
    refused("[2.0, 0.0, 0.0]", "[0.0, 0.0, 0.0]", "Config::Axis", "segments[0].hinge_axis");
    refused("[2.0, 0.0, 0.0]", "[1e-300, 0.0, 0.0]", "Config::Axis", "segments[0].hinge_axis");
    refused("[2.0, 0.0, 0.0]", "[nan, 0.0, 0.0]", "Config::NotFinite", "segments[0].hinge_axis[0]");
    refused("hinge_m = [0.9", "hinge_m = [-inf", "Config::NotFinite", "segments[0].hinge_m[0]");
    refused("com_m = [0.1", "com_m = [nan", "Config::NotFinite", "segments[0].com_m[0]");
    refused("mass_kg = 33", "mass_kg = inf", "Config::NotFinite", "segments[0].mass_kg");
    refused("= 200.0", "= inf", "Config::NotFinite", "segments[0].stiffness_nm_per_rad");
    refused("= 2.0\n", "= nan\n", "Config::NotFinite", "segments[0].damping_nms_per_rad");
    let p = refused("= 0.05", "= 5.0", "Config::Param", "segments[1].rest_rad");
    assert_violation(&p, 5.0, Limit::Within(-PI, PI), "rad");
    refused("= 0.05", "= nan", "Config::NotFinite", "segments[1].rest_rad");
}

#[test]
fn refuses_keys_and_types_by_name() {
    refused("rest_rad", "rest_deg", "Config::UnknownKey", "segments[1].rest_deg");
    refused("hinge_axis = [2.0, 0.0, 0.0]\n", "", "Config::MissingKey", "segments[0].hinge_axis");
    refused("= 200.0", "= \"200\"", "Config::Type", "segments[0].stiffness_nm_per_rad");
    refused("[0.9, 0.3, 0.6]", "[0.9, 0.3]", "Config::Type", "segments[0].hinge_m");
    refused("[0.9, 0.3, 0.6]", "[0.9, 0.3, 0.6, 0.1]", "Config::Type", "segments[0].hinge_m");
    assert!(refusal("segments = 3").has("Config::Type"));
    assert!(refusal("segments = [3]").has("Config::Type"));
    assert!(refusal("").has("Config::MissingKey"));
    assert!(refusal("segments = []").has("Config::Param"));
    assert!(refusal("segmnts = []").has("Config::UnknownKey"));
}

#[test]
fn counts_are_limited_and_all_problems_come_at_once() {
    let seventeen = GOOD.split("\n\n").next().unwrap().repeat(17);
    assert!(refusal(&seventeen).has("Config::Param"));
    let e = refusal(
        &GOOD
            .replace("200.0", "-1.0")
            .replace("1.5", "-2.0")
            .replace("rest_rad", "rest")
            .replace("com_m = [0.0", "comm = [0.0"),
    );
    for code in ["Config::NotPassive", "Config::UnknownKey", "Config::MissingKey"] {
        assert!(e.has(code), "{code} missing in {e}");
    }
}
