//! Every row M01 to M40 of the bad-input table gets what it must: code, severity, place, value, limit, unit, next step.
//!
//! The files and what each must get stand in `fixtures/bad/manifest.toml`; the large ones are made here.

use crate::common::registry;
use ff_mission::Leniency;
use ff_mission::urdf;
use ff_mission::urdf::UrdfOptions;
use ff_mission::{LoadOptions, Mission};
use ff_model::diagnostics::Limit;
use ff_model::{Area, CoordDecl, Decl, ParamDecl, PortMatrix, Problem, Problems, Registry, Scalar, Severity};
use ff_testkit::fixtures::{fixture, text};
use ff_testkit::problem::{assert_violation, problem_of, refused};
use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    id: String,
    file: String,
    code: String,
    severity: String,
    line: Option<usize>,
    #[serde(default)]
    says: Vec<String>,
    suggests: Option<String>,
    value: Option<f64>,
    limit: Option<String>,
    unit: Option<String>,
    #[serde(default)]
    allow: Vec<String>,
    #[serde(default)]
    strict: bool,
    checked_by: Option<String>,
}

fn rows() -> Vec<Row> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Manifest {
        row: Vec<Row>,
    }
    toml::from_str::<Manifest>(&text("bad/manifest.toml")).unwrap().row
}

/// All problems of a file, and whether it was refused.
fn problems(file: &str, leniency: Leniency) -> (Problems, bool) {
    let path = fixture(file);
    let result = if file.ends_with(".toml") {
        Mission::load(&path, &registry(), &LoadOptions { leniency }).map(|l| l.warnings)
    } else {
        urdf::from_file(&path, &UrdfOptions { leniency, ..UrdfOptions::default() }).map(|(_, w)| w)
    };
    match result {
        Ok(w) => (w, false),
        Err(p) => (p, true),
    }
}

fn from_text(text: &str) -> Problems {
    urdf::from_str(text, &UrdfOptions::default()).unwrap_err()
}

#[test]
fn every_row_gets_its_code_place_value_limit_unit_and_next_step() {
    let mut failures = Vec::new();
    for r in rows() {
        assert!(r.file.starts_with(&r.id), "{}: name must start with its id", r.file);
        // The stand-ins of these tests check springs only; `ffid` runs every row with all it has.
        if r.checked_by.as_deref().is_some_and(|c| c != "flex-panel") {
            continue;
        }
        let (found, refused) =
            problems(&format!("bad/{}", r.file), Leniency { allow: r.allow.clone(), strict: r.strict });
        let severity = if r.severity == "error" { Severity::Error } else { Severity::Warning };
        let mut fail = |what: &str| failures.push(format!("{}: {what}; found:\n{found}", r.file));
        if refused != (severity == Severity::Error) {
            fail("refused or accepted against its row");
        }
        let Some(p) = found.0.iter().find(|p| p.code == r.code && p.severity == severity) else {
            fail("no problem of this code and severity");
            continue;
        };
        if r.line.is_some() && p.line != r.line {
            fail(&format!("line {:?}, expected {:?}", p.line, r.line));
        }
        let line = p.to_string();
        if let Some(w) = r.says.iter().find(|w| !line.contains(w.as_str())) {
            fail(&format!("does not say {w:?}"));
        }
        let hint = p.hint.as_deref().unwrap_or_default();
        if hint.is_empty() || r.suggests.as_deref().is_some_and(|name| !hint.contains(name)) {
            fail("names no next step, or not the name it must suggest");
        }
        let violation = p.violation.as_ref();
        let differs = r.value.is_some_and(|x| violation.is_none_or(|v| (v.value - x).abs() > 1e-9 * x.abs()))
            || r.limit.as_deref().is_some_and(|x| violation.is_none_or(|v| v.limit.to_string() != x))
            || r.unit.as_deref().is_some_and(|x| violation.is_none_or(|v| v.unit != x));
        if differs {
            fail(&format!("value, limit or unit differ from {:?} {:?} {:?}: {violation:?}", r.value, r.limit, r.unit));
        }
        let file_named = p.file.as_ref().is_some_and(|f| f.to_string_lossy().contains(&r.file));
        if !file_named && r.file != "M30_package.toml" {
            fail("does not name the file");
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n\n"));
}

#[test]
fn every_file_is_in_the_manifest_and_every_row_is_covered() {
    let listed: Vec<String> = rows().into_iter().map(|r| r.file).collect();
    for f in std::fs::read_dir(fixture("bad")).unwrap() {
        let name = f.unwrap().file_name().into_string().unwrap();
        assert!(
            listed.contains(&name) || name == "manifest.toml" || name.starts_with("several."),
            "{name} is not listed"
        );
    }
    // M02 to M04 are made below; M37 is checked where the physics is.
    for n in (1..=40).filter(|n| ![2, 3, 4, 37].contains(n)) {
        assert!(listed.iter().any(|f| f.starts_with(&format!("M{n:02}"))), "no file for M{n:02}");
    }
}

#[test]
fn one_mistake_gives_one_error() {
    // A reader that reports consequences buries the cause.
    let mut failures = String::new();
    for r in rows().iter().filter(|r| r.severity == "error" && r.checked_by.is_none() && r.allow.is_empty()) {
        let (found, _) = problems(&format!("bad/{}", r.file), Leniency { strict: r.strict, ..Leniency::default() });
        let errors = found.0.iter().filter(|p| p.severity == Severity::Error).count();
        if errors != 1 {
            failures += &format!("{}:\n{found}\n", r.file);
        }
    }
    assert!(failures.is_empty(), "{failures}");
}

#[test]
fn m02_deep_nesting_never_reaches_a_parser() {
    // 20,000 levels abort the process inside urdf-rs. On the small stack of a test thread this one would, too.
    for text in
        [format!("<robot name='x'>{}", "<a>".repeat(20_000)), "<a ".repeat(30_000) + ">", "<a>".repeat(2_000_000)]
    {
        let p = from_text(&text);
        assert!(p.has("Urdf::TooDeep") || p.has("Urdf::Syntax"), "{p}");
    }
    let lines = "<a>\n".repeat(100);
    let p = from_text(&lines);
    assert_eq!((p.0[0].code, p.0[0].line), ("Urdf::TooDeep", Some(65)));
    assert_violation(&p.0[0], 65.0, Limit::AtMost(64.0), "levels");
}

/// A tree of links without mass on one body.
fn chain(n: usize) -> String {
    let mut s = String::from(
        "<robot name='chain'><link name='l0'><inertial><mass value='1'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial></link>",
    );
    for i in 1..n {
        s += &format!(
            "<link name='l{i}'><inertial><mass value='0'/><inertia ixx='0' ixy='0' ixz='0' iyy='0' iyz='0' izz='0'/></inertial></link><joint name='j{i}' type='fixed'><parent link='l{}'/><child link='l{i}'/></joint>",
            i - 1
        );
    }
    s + "</robot>"
}

#[test]
fn m03_size_and_number_of_links_are_limited() {
    let p = urdf::from_bytes(&vec![b' '; (16 << 20) + 1], &UrdfOptions::default()).unwrap_err();
    let limit = f64::from(16 << 20);
    assert_violation(problem_of(&p, "Urdf::TooLarge"), limit + 1.0, Limit::AtMost(limit), "bytes");

    let p = from_text(&chain(10_001));
    let v = problem_of(&p, "Urdf::TooLarge").violation.as_ref().unwrap();
    assert_eq!((v.value, v.limit, v.unit.as_ref()), (10_001.0, Limit::AtMost(10_000.0), "links"), "{p}");
    // Another limit holds in both directions; a small one, because ten thousand links take seconds.
    let limit = |n| UrdfOptions { max_links: n, ..UrdfOptions::default() };
    assert!(urdf::from_str(&chain(51), &limit(51)).is_ok());
    assert!(urdf::from_str(&chain(51), &limit(50)).is_err());
}

#[test]
#[ignore = "full tier: 3 s"]
fn m03_as_many_links_as_the_limit_are_read() {
    let (m, _) = urdf::from_str(&chain(10_000), &UrdfOptions::default()).unwrap();
    assert_eq!((m.n_bodies(), m.frames().len()), (1, 10_000));
}

#[test]
fn m04_document_types_and_entities_are_refused() {
    let mut bomb = String::from("<?xml version='1.0'?>\n<!DOCTYPE lolz [<!ENTITY a0 'ha'>");
    for i in 1..10 {
        bomb += &format!("<!ENTITY a{i} '{}'>", format!("&a{};", i - 1).repeat(10));
    }
    bomb += "]>\n<robot name='&a9;'/>";
    let p = from_text(&bomb);
    assert_eq!((p.0.len(), p.0[0].code, p.0[0].line), (1, "Urdf::DtdForbidden", Some(2)));
}

#[test]
fn m22_axes_within_tolerance_are_normalised_in_silence() {
    let good = text("bad/M22_axis_off.urdf").replace("1.0001", "1.0000001");
    let (m, w) = urdf::from_str(&good, &UrdfOptions::default()).unwrap();
    assert!(w.0.is_empty(), "{w}");
    assert_eq!(m.bodies()[0].joint.axis.z, 1.0);
}

#[test]
fn m31_a_byte_order_mark_is_no_problem() {
    let with_mark = format!("\u{feff}{}", text("paper/robot.urdf"));
    let (a, w) = urdf::from_bytes(with_mark.as_bytes(), &UrdfOptions::default()).unwrap();
    assert!(w.0.is_empty() && a.n_bodies() == 8, "{w}");
    let mission = format!("\u{feff}{}", text("paper/slosh.toml"));
    Mission::from_str(&mission, &with_mark, &registry(), &LoadOptions::default()).unwrap();
}

#[test]
fn m39_nominal_values_outside_their_bounds_are_named_at_their_table() {
    struct Odd(Decl);
    impl ff_model::Appendage for Odd {
        fn decl(&self) -> &Decl {
            &self.0
        }
        fn inertia<T: Scalar>(&self, _: &[T], _: &[T], _: &mut PortMatrix<'_, T>) {}
    }
    let mut r = Registry::new();
    r.register("odd", |t| {
        let k = t["k_nm_per_rad"].as_float().unwrap();
        let coords = [CoordDecl::new("x", "rad", (-1.0, 1.0))];
        let p = ParamDecl { bounds: (1.0, 9.0), ..ParamDecl::positive("k_nm_per_rad", "N m/rad", k) };
        Ok(ff_model::port::Derived::new(Odd(Decl::new("odd", coords, [p]))).into())
    });
    let toml = "[robot]\nurdf = 'x'\n\n[[appendage]]\nkind = 'odd'\nname = 'a'\nhost = 'base'\nk_nm_per_rad = 0.5\n";
    let p = Mission::from_str(toml, &text("paper/robot.urdf"), &r, &LoadOptions::default()).unwrap_err();
    assert_eq!((p.0.len(), p.0[0].code, p.0[0].line), (1, "Config::Param", Some(8)), "{p}");
    assert_eq!(p.0[0].object.as_deref(), Some("a.k_nm_per_rad"));
    assert_violation(&p.0[0], 0.5, Limit::Within(1.0, 9.0), "N m/rad");
}

#[test]
fn all_problems_of_a_urdf_are_listed_at_once() {
    let (found, refused) = problems("bad/several.urdf", Leniency::default());
    assert!(refused);
    for code in [
        "Urdf::UnknownElement",
        "Urdf::NonPositiveMass",
        "Urdf::BadNumber",
        "Urdf::ZeroAxis",
        "Urdf::BadLimits",
        "Urdf::UnknownLink",
    ] {
        assert!(found.has(code), "{code} is missing:\n{found}");
    }
    assert!(found.0.iter().all(|p| p.line.is_some()), "{found}");
    assert_eq!(found.exit_code(), 10);
}

#[test]
fn all_problems_of_a_mission_are_listed_at_once() {
    let (found, refused) = problems("bad/several.toml", Leniency::default());
    assert!(refused);
    let want = [
        ("Config::UnknownKey", 3),
        ("Config::NotFinite", 4),
        ("Config::UnknownKind", 7),
        ("Config::UnknownFrame", 17),
        ("Config::NotUnit", 18),
        ("Config::OutOfRange", 25),
        ("Config::UnknownKey", 27),
        ("Config::Type", 30),
    ];
    for (code, line) in want {
        assert!(
            found.0.iter().any(|p| p.code == code && p.line == Some(line)),
            "{code} at {line} is missing:\n{found}"
        );
    }
    assert_eq!(found.0.len(), want.len(), "{found}");
    assert_eq!(found.exit_code(), 11);
}

#[test]
fn problems_of_urdf_and_mission_are_listed_together() {
    let toml = "[robot]\nurdf = 'x'\nbad_key = 1\n";
    let p =
        Mission::from_str(toml, &text("bad/M11_negative_mass.urdf"), &registry(), &LoadOptions::default()).unwrap_err();
    assert!(p.has("Urdf::NonPositiveMass") && p.has("Config::UnknownKey"), "{p}");
    assert_eq!(p.exit_code(), 10);
}

#[test]
fn missing_files_and_folders_are_io_errors() {
    for path in ["paper/none.urdf", "paper"] {
        let p = urdf::from_file(&fixture(path), &UrdfOptions::default()).unwrap_err();
        assert_eq!((p.0[0].code, p.0[0].area, p.exit_code()), ("Io::Read", Area::Io, 20), "{p}");
        let p = Mission::load(&fixture(path), &registry(), &LoadOptions::default()).unwrap_err();
        assert_eq!(p.exit_code(), 20, "{p}");
    }
}

#[test]
fn what_cannot_be_allowed_is_said() {
    let leniency = Leniency { allow: vec!["cycle".into()], strict: false };
    let p = Mission::load(&fixture("paper/flex.toml"), &registry(), &LoadOptions { leniency }).unwrap_err();
    let want = Problem::error(Area::Config, "Config::NotAllowable", "");
    assert_eq!((p.0[0].code, p.0[0].area), (want.code, want.area), "{p}");
}

#[test]
fn allowing_unknown_elements_hides_nothing_else() {
    let leniency = Leniency { allow: vec!["unknown-element".into()], strict: false };
    let options = UrdfOptions { leniency, ..UrdfOptions::default() };
    let good = text("paper/robot.urdf").replace("<link name=\"link3\">", "<link name=\"link3\"><inertail/>");
    let (m, w) = urdf::from_str(&good, &options).unwrap();
    assert_eq!((m.n_bodies(), w.0.len(), w.0[0].code), (8, 1, "Urdf::UnknownElement"));
    // The inertia of the link with the unknown element is still checked.
    let p = urdf::from_str(&good.replace("ixx=\"0.4\"", "ixx=\"-9.4\""), &options).unwrap_err();
    assert_eq!(p.0.iter().filter(|p| p.code == "Urdf::InertiaNotPsd").count(), 7, "{p}");
    // However many are allowed, the one error among them is not lost.
    let many =
        good.replace("<inertail/>", &"<inertail/>".repeat(2_000)).replace("xyz=\"0.9 0 1.2\"", "xyz=\"0.9 x 0 1.2\"");
    assert!(urdf::from_str(&many, &options).unwrap_err().has("Urdf::BadNumber"));
}

/// A mission of a newer format is refused as such, and nothing else in it is judged; one without a format is of the first.
#[test]
fn a_newer_format_is_refused_and_the_first_may_be_left_out() {
    let (mission, urdf) = (text("paper/flex.toml"), text("paper/robot.urdf"));
    let load = |text: &str| Mission::from_str(text, &urdf, &registry(), &LoadOptions::default());
    let plain = load(&mission).unwrap();
    assert_eq!(load(&format!("format = 1\n{mission}")).unwrap().mission, plain.mission);
    let newer = load(&format!("# later\nformat = 7\nkey_of_later = 3\n{mission}")).unwrap_err();
    let p = refused(&newer, "Config::Version", "format");
    assert_violation(p, 7.0, Limit::AtMost(ff_mission::mission::FORMAT as f64), "");
    assert_eq!((p.line, p.column, newer.exit_code()), (Some(2), Some(10), 11));
    let p = load(&format!("format = 0\n{mission}")).unwrap_err();
    assert_violation(refused(&p, "Config::OutOfRange", "format"), 0.0, Limit::Within(1.0, 1.0), "");
    refused(&load(&format!("format = \"1\"\n{mission}")).unwrap_err(), "Config::Type", "format");
}
