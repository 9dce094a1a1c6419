//! `ffid check` through the real binary: exit codes, output, and every bad fixture with the real appendages.

use crate::common::{finish, fixture};
use assert_cmd::Command;
use serde_json::Value;
use std::path::PathBuf;

/// Runs `ffid check`; exit code, standard output, standard error.
fn check(file: &str, more: &[&str]) -> (i32, String, String) {
    finish(Command::cargo_bin("ffid").unwrap().arg("check").arg(fixture(file)).args(more))
}

fn json(file: &str, more: &[&str]) -> (i32, Value) {
    let (code, out, err) = check(file, &[&["--json"], more].concat());
    assert!(err.is_empty(), "{err}");
    (code, serde_json::from_str(&out).unwrap())
}

#[test]
fn the_papers_missions_are_valid() {
    for (file, dof, kinds) in
        [("paper/flex.toml", 17, vec!["flex_panel", "flex_panel"]), ("paper/slosh.toml", 15, vec!["slosh_pendulum"])]
    {
        let (code, r) = json(file, &["--strict"]);
        assert_eq!((code, r["problems"].as_array().unwrap().len()), (0, 0), "{r}");
        let m = &r["model"];
        let total: u64 = m["dof"].as_array().unwrap().iter().map(|d| d.as_u64().unwrap()).sum();
        assert_eq!(total, dof);
        let found: Vec<&str> =
            m["appendages"].as_array().unwrap().iter().map(|a| a["kind"].as_str().unwrap()).collect();
        assert_eq!(found, kinds);
        let mass = if dof == 17 { 600.0 + 60.0 + 4.0 * 33.0 } else { 600.0 + 60.0 + 100.0 };
        assert!((m["total_mass_kg"].as_f64().unwrap() - mass).abs() < 1e-9, "{}", m["total_mass_kg"]);
    }
}

#[test]
fn text_names_bodies_joints_appendages_and_parameters() {
    let (code, out, err) = check("paper/flex.toml", &[]);
    assert_eq!((code, err.as_str()), (0, ""));
    for piece in [
        "floating base",
        "792.000 kg",
        "link7",
        "joint7",
        "panel_left (flex_panel) on base",
        "* panel_left.k[0]",
        "N m/rad",
        "modes (4), joints held, joints at [1.5708, 1.4000,",
        "0.2289 Hz",
        "base rotates",
    ] {
        assert!(out.contains(piece), "{piece:?} is missing in\n{out}");
    }
    // Panel inertias are parameters, but not to be estimated.
    assert!(out.lines().any(|l| l.starts_with("  panel_left.") && l.contains("mass")), "{out}");
}

#[test]
fn every_bad_fixture_gets_its_code_and_never_a_panic() {
    let manifest: toml::Table =
        toml::from_str(&std::fs::read_to_string(fixture("bad/manifest.toml")).unwrap()).unwrap();
    let mut failures = String::new();
    for r in manifest["row"].as_array().unwrap() {
        let file = r["file"].as_str().unwrap();
        let mut more = Vec::new();
        for a in r.get("allow").and_then(|a| a.as_array()).into_iter().flatten() {
            more.extend(["--allow", a.as_str().unwrap()]);
        }
        if r.get("strict").is_some() {
            more.push("--strict");
        }
        let (code, report) = json(&format!("bad/{file}"), &more);
        let problems = report["problems"].as_array().unwrap();
        let hit = problems
            .iter()
            .find(|p| p["code"] == r["code"].as_str().unwrap() && p["severity"] == r["severity"].as_str().unwrap());
        let line_ok = hit.is_some_and(|p| r.get("line").is_none_or(|l| p["line"].as_i64() == l.as_integer()));
        let says = r.get("says").and_then(|s| s.as_array()).cloned().unwrap_or_default();
        let (_, out, err) = check(&format!("bad/{file}"), &more);
        let silent: Vec<_> = says.iter().filter(|s| !err.contains(s.as_str().unwrap())).collect();
        let want = match (r["severity"].as_str().unwrap(), r["code"].as_str().unwrap().split("::").next().unwrap()) {
            ("warning", _) => 0,
            (_, "Urdf" | "Model") => 10,
            _ => 11,
        };
        if code != want
            || !line_ok
            || !silent.is_empty()
            || report["exit_code"] != want
            || (want != 0) != out.is_empty()
        {
            failures += &format!("{file}: exit {code}, expected {want}; silent on {silent:?}\n{err}\n");
        }
    }
    assert!(failures.is_empty(), "{failures}");
}

/// M40: a wrist whose first and last axis meet only in the pose the mission holds.
#[test]
fn m40_a_hold_pose_on_a_singularity_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let base = std::fs::read_to_string(fixture("bad/M40_same_axis.urdf")).unwrap();
    let massless = "<link name='mid'><inertial><mass value='0'/>\
        <inertia ixx='0' ixy='0' ixz='0' iyy='0' iyz='0' izz='0'/></inertial></link>";
    let wrist = "<joint name='bend' type='revolute'><parent link='between'/><child link='mid'/>\
        <axis xyz='0 1 0'/><limit lower='-3' upper='3' effort='9' velocity='1'/></joint>";
    let urdf = base
        .replace("  <link name=\"arm\">", &format!("{massless}{wrist}<link name='arm'>"))
        .replace("<parent link=\"between\"/>\n    <child link=\"arm\"/>", "<parent link='mid'/><child link='arm'/>")
        .replace("<origin xyz=\"0 0 0.3\"/>\n    <axis xyz=\"0 0 1\"/>", "<axis xyz='1 0 0'/>");
    std::fs::write(dir.path().join("wrist.urdf"), urdf).unwrap();
    let path = dir.path().join("m.toml");
    let run = |bend: &str| {
        let text = format!(
            "robot = {{ urdf = 'wrist.urdf' }}\n[reproduce]\nrecord_s = 9.0\nidentification_s = 9.0\nreference_s = 9.0\nhold_rad = [0.3, {bend}, -0.2]\n"
        );
        std::fs::write(&path, text).unwrap();
        let out = Command::cargo_bin("ffid").unwrap().arg("check").arg(&path).output().unwrap();
        (out.status.code(), String::from_utf8(out.stderr).unwrap())
    };
    assert_eq!(run("0.4"), (Some(0), String::new()));
    let (code, err) = run("1.5707963267948966");
    assert_eq!(code, Some(10), "{err}");
    for says in ["Model::NearSingular", "shoulder", "elbow", "at hold_rad", "m.toml: 1 errors"] {
        assert!(err.contains(says), "{says}: {err}");
    }
}

#[test]
fn modes_are_those_of_the_theory_page() {
    let run = |args: &[&str]| {
        let file = fixture("paper/slosh.toml");
        let out = Command::cargo_bin("ffid").unwrap().arg("modes").arg(file).arg("--json").args(args).output().unwrap();
        assert_eq!(out.status.code(), Some(0));
        let r: Value = serde_json::from_slice(&out.stdout).unwrap();
        let rows = r["modes"]["modes"].as_array().unwrap().clone();
        (r, rows)
    };
    let hz = |m: &Value| m["frequency_hz"].as_f64().unwrap();
    // docs/theory/modes.md, section 4: free-floating 0.1055 and 0.1090 Hz, clamped 0.0890 Hz with zeta 0.070.
    let (r, free) = run(&[]);
    assert!((hz(&free[0]) - 0.1055).abs() < 5e-5 && (hz(&free[1]) - 0.1090).abs() < 5e-5, "{free:?}");
    assert_eq!((&free[0]["base"], &r["modes"]["boundary"]), (&"rotates".into(), &"joints held".into()));
    let (r, held) = run(&["--held"]);
    assert!((hz(&held[0]) - 0.0890).abs() < 5e-5 && (held[0]["damping_ratio"].as_f64().unwrap() - 0.070).abs() < 5e-4);
    assert_eq!((&held[0]["base"], &r["modes"]["coordinates"][0]), (&"held".into(), &"tank.swing[0]".into()));
    let (_, limp) = run(&["--free-joints"]);
    assert!(hz(&limp[0]) > hz(&free[0]), "freeing the joints can only take inertia away");
    let (_, r) = json("paper/slosh.toml", &[]);
    assert_eq!(r["modes"]["modes"].as_array().unwrap().as_slice(), free, "`ffid check` shows the same");
}

/// Symmetric modes translate the base, which a gyro does not see; antisymmetric ones rotate it.
#[test]
fn modes_say_what_the_base_does() {
    let (_, r) = json("paper/flex.toml", &[]);
    let words: Vec<_> = r["modes"]["modes"].as_array().unwrap().iter().map(|m| m["base"].as_str().unwrap()).collect();
    assert_eq!(words, ["translates", "rotates", "translates", "rotates"]);
    let out = Command::cargo_bin("ffid").unwrap().arg("modes").arg(fixture("paper/robot.urdf")).output().unwrap();
    assert_eq!(out.status.code(), Some(0));
    assert!(String::from_utf8(out.stdout).unwrap().starts_with("modes (0)"));
    let out = Command::cargo_bin("ffid").unwrap().arg("modes").arg(fixture("bad/M05_cycle.urdf")).output().unwrap();
    assert_eq!((out.status.code(), out.stdout.as_slice()), (Some(10), &b""[..]));
}

#[test]
fn several_problems_are_all_printed() {
    let (code, _, err) = check("bad/several.toml", &[]);
    assert_eq!(code, 11);
    assert!(err.contains("8 errors, 0 warnings"), "{err}");
    let (code, _, err) = check("bad/several.urdf", &[]);
    assert_eq!(code, 10);
    assert!(err.lines().count() >= 7, "{err}");
}

#[test]
fn wrong_usage_is_2_and_help_is_0() {
    let run = |args: &[&str]| Command::cargo_bin("ffid").unwrap().args(args).output().unwrap();
    for args in [&[][..], &["chekc"], &["check"], &["check", "a.toml", "--alow"]] {
        assert_eq!(run(args).status.code(), Some(2), "{args:?}");
    }
    let help = run(&["--help"]);
    assert_eq!(help.status.code(), Some(0));
    let text = String::from_utf8(help.stdout).unwrap();
    assert!(text.contains(" 10  model invalid") && text.contains("130  interrupted"), "{text}");
}

#[test]
fn missing_files_and_folders_are_20() {
    for file in ["paper/none.toml", "paper/none.urdf", "paper"] {
        let (code, _, err) = check(file, &[]);
        assert_eq!(code, 20, "{err}");
        assert!(err.contains("Io::Read"), "{err}");
    }
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("m.toml");
    std::fs::write(&path, "[robot]\nurdf = 'nowhere.urdf'\n").unwrap();
    let out = Command::cargo_bin("ffid").unwrap().arg("check").arg(&path).output().unwrap();
    assert_eq!(out.status.code(), Some(20));
}

#[test]
fn names_that_cannot_be_allowed_are_11() {
    for file in ["paper/flex.toml", "bad/M16_triangle.urdf"] {
        let (code, _, err) = check(file, &["--allow", "triangel"]);
        assert_eq!(code, 11, "{err}");
        assert!(err.contains("did you mean Triangle"), "{err}");
    }
}

/// R01: a full disk under the output is an I/O error, not a panic of `println!`.
#[cfg(target_os = "linux")]
#[test]
fn a_full_output_device_is_20() {
    let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
    let status = std::process::Command::new(assert_cmd::cargo::cargo_bin("ffid"))
        .arg("check")
        .arg(fixture("paper/flex.toml"))
        .stdout(full)
        .stderr(std::process::Stdio::null())
        .status()
        .unwrap();
    assert_eq!(status.code(), Some(20));
}

/// R10, R12: line ends, locale and odd paths make no difference.
#[test]
fn crlf_locale_and_odd_paths_make_no_difference() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("a b µ");
    std::fs::create_dir(&folder).unwrap();
    for name in ["robot.urdf", "slosh.toml"] {
        let text = std::fs::read_to_string(fixture(format!("paper/{name}"))).unwrap().replace('\n', "\r\n");
        std::fs::write(folder.join(name), text).unwrap();
    }
    let run = |path: PathBuf| {
        let mut c = Command::cargo_bin("ffid").unwrap();
        c.arg("check").arg(path).env("LC_ALL", "de_DE.UTF-8").output().unwrap()
    };
    let (a, b) = (run(folder.join("slosh.toml")), run(fixture("paper/slosh.toml")));
    assert_eq!((a.status.code(), b.status.code()), (Some(0), Some(0)), "{}", String::from_utf8_lossy(&a.stderr));
    assert_eq!(a.stdout, b.stdout);
}
