//! `ffid init` through the real binary: what is guessed on robots of several shapes, and that the file loads at once.

use crate::common::{ffid, fixture};
use serde_json::Value;
use std::fmt::Write as _;
use std::fs;
use tempfile::TempDir;

/// Runs `ffid init --json` on a URDF in the folder; then `ffid check --json` on what it wrote. Both results.
fn init(dir: &TempDir, urdf: &str, more: &[&str]) -> (Value, Value) {
    let (code, out, err) = ffid(dir.path(), &[&["init", urdf, "--json", "--force"], more].concat());
    assert_eq!(code, 0, "{out}\n{err}");
    let guess: Value = serde_json::from_str(&out).unwrap();
    let file = guess["started"]["mission"].as_str().unwrap().to_owned();
    let (code, out, err) = ffid(dir.path(), &["check", &file, "--json"]);
    let text = fs::read_to_string(dir.path().join(&file)).unwrap();
    assert_eq!(code, 0, "{out}\n{err}\n{text}");
    (guess["started"].clone(), serde_json::from_str(&out).unwrap())
}

fn names(v: &Value) -> Vec<&str> {
    v.as_array().unwrap().iter().map(|x| x.as_str().unwrap()).collect()
}

/// A joint of a made-up robot: name, type, parent, child, limits or none.
type Row<'a> = (&'a str, &'a str, &'a str, &'a str, Option<f64>);

/// A URDF of skewed axes and lopsided bodies, with a link for each name.
fn urdf(rows: &[Row<'_>]) -> String {
    let mut out = String::from("<robot name=\"made up\">\n");
    let link = |name: &str, k: usize, out: &mut String| {
        let (m, s) = (20.0 + 3.0 * k as f64, 1.0 + 0.1 * k as f64);
        let _ = writeln!(
            out,
            "<link name=\"{name}\"><inertial><origin xyz=\"0.1 {} -0.2\" rpy=\"0.1 0.2 0.3\"/><mass value=\"{m}\"/>\
             <inertia ixx=\"{}\" ixy=\"0.1\" ixz=\"-0.05\" iyy=\"{}\" iyz=\"0.2\" izz=\"{}\"/></inertial></link>",
            0.3 * s,
            3.0 * s,
            4.0 * s,
            3.5 * s
        );
    };
    link(rows[0].2, 10, &mut out);
    for (k, (name, kind, parent, child, effort)) in rows.iter().enumerate() {
        link(child, k, &mut out);
        let limit = effort.map_or_else(String::new, |e| {
            format!("<limit lower=\"-1.9\" upper=\"2.2\" effort=\"{e}\" velocity=\"0.7\"/>")
        });
        let axis = if *kind == "fixed" {
            String::new()
        } else {
            format!("<axis xyz=\"{} 0.6 {}\"/>", if k % 2 == 0 { 0.0 } else { 0.8 }, if k % 2 == 0 { 0.8 } else { 0.0 })
        };
        let _ = writeln!(
            out,
            "<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/>\
             <origin xyz=\"0.4 0.{k} 0.3\" rpy=\"0.2 -0.1 0.4\"/>{axis}{limit}</joint>"
        );
    }
    out + "</robot>\n"
}

fn folder(text: &str) -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("r.urdf"), text).unwrap();
    dir
}

/// Six joints and a hand of two fingers, a wing of three segments behind a flange, a camera boom that is driven.
fn satellite() -> TempDir {
    let e = Some(80.0);
    folder(&urdf(&[
        ("s1", "revolute", "bus", "l1", e),
        ("wing_a", "revolute", "bus", "blade1", Some(0.0)),
        ("s2", "revolute", "l1", "l2", e),
        ("s3", "revolute", "l2", "l3", e),
        ("wing_b", "revolute", "blade1", "blade2", Some(0.0)),
        ("s4", "continuous", "l3", "l4", None),
        ("s5", "revolute", "l4", "l5", e),
        ("s6", "revolute", "l5", "l6", e),
        ("flange", "fixed", "l6", "hand", None),
        ("finger1", "prismatic", "hand", "f1", Some(5.0)),
        ("finger2", "prismatic", "hand", "f2", Some(5.0)),
        ("wing_c", "revolute", "blade2", "blade3", Some(0.0)),
        ("mast", "revolute", "bus", "mast1", e),
    ]))
}

#[test]
fn the_papers_robot_needs_nothing_but_the_urdf() {
    let dir = tempfile::tempdir().unwrap();
    let urdf = fixture("paper/robot.urdf");
    let (g, c) = init(&dir, urdf.to_str().unwrap(), &[]);
    assert_eq!(names(&g["arm"]), ["joint1", "joint2", "joint3", "joint4", "joint5", "joint6", "joint7"]);
    assert_eq!((g["base"].as_str(), g["end_effector"].as_str()), (Some("base"), Some("tool")));
    assert!(g["panels"].as_array().unwrap().is_empty() && g["others"].as_array().unwrap().is_empty());
    assert_eq!(c["mission"]["estimate"]["parameters"], serde_json::json!(["base.*"]));
    assert_eq!(c["mission"]["robot"]["end_effector"], "tool");
    assert_eq!(c["problems"].as_array().unwrap().len(), 0, "{}", c["problems"]);
}

#[test]
fn panels_are_found_by_name_and_lifted_when_their_springs_are_given() {
    let dir = tempfile::tempdir().unwrap();
    fs::copy(fixture("peers-model/flex.urdf"), dir.path().join("flex.urdf")).unwrap();
    // Without springs the hinges stay joints, and the file says how to change that.
    let (g, c) = init(&dir, "flex.urdf", &[]);
    assert_eq!(g["panels"].as_array().unwrap().len(), 2);
    assert!(names(&g["lifted"]).is_empty() && c["model"]["appendages"].as_array().unwrap().is_empty());
    let text = fs::read_to_string(dir.path().join("mission.toml")).unwrap();
    assert!(text.contains("# lift = [\"panel_a1\", \"panel_a2\"]"), "{text}");
    assert!(text.contains("# stiffness_nm_per_rad = [200.0, 200.0]") && text.contains("noise_std_nm"), "{text}");
    // With them the two wings are those of the peers' model.
    let more = ["--stiffness", "210", "--damping", "1.7", "--stiffness", "panel_b2=190.5", "--gyro-noise", "1e-4"];
    let (g, c) = init(&dir, "flex.urdf", &more);
    let lifted = names(&g["lifted"]).iter().map(|n| (*n).to_owned()).collect::<Vec<_>>();
    assert_eq!(lifted.len(), 2);
    let specs = c["mission"]["appendages"].as_array().unwrap();
    assert_eq!(specs[0]["settings"]["stiffness_nm_per_rad"], serde_json::json!([210.0, 210.0]));
    assert_eq!(specs[1]["settings"]["stiffness_nm_per_rad"], serde_json::json!([210.0, 190.5]));
    assert_eq!(c["mission"]["sensors"]["gyro"]["noise_std_rad_per_s"], 1e-4);
    let modes = c["modes"]["modes"].as_array().unwrap();
    assert_eq!(modes.len(), 4, "{}", c["modes"]);
    // What swings is estimated beside the base.
    let patterns = names(&c["mission"]["estimate"]["parameters"]);
    assert_eq!(patterns.len(), 5, "{patterns:?}");
    assert!(patterns.contains(&format!("{}.k[*]", lifted[1]).as_str()), "{patterns:?}");
}

#[test]
fn hands_wings_and_masts_are_told_from_the_arm() {
    let dir = satellite();
    let (g, c) = init(&dir, "r.urdf", &["-o", "a folder/m.toml"]);
    assert_eq!(names(&g["arm"]), ["s1", "s2", "s3", "s4", "s5", "s6"]);
    // The last frame of the last link, not the finger.
    assert_eq!((g["base"].as_str(), g["end_effector"].as_str()), (Some("bus"), Some("hand")));
    let panels = g["panels"].as_array().unwrap();
    assert_eq!(names(&panels[0]["joints"]), ["wing_a", "wing_b", "wing_c"]);
    assert!(panels[0]["why"].as_str().unwrap().contains("effort limit"), "{panels:?}");
    // A single driven joint may be a panel or not: said, but never lifted by numbers for all.
    assert_eq!((names(&panels[1]["joints"]), &panels[1]["evident"]), (vec!["mast"], &Value::Bool(false)));
    assert!(names(&g["others"]).is_empty());
    assert_eq!((names(&g["lock"]), &c["mission"]["robot"]["lock"]), (vec!["finger1", "finger2"], &g["lock"]));
    assert_eq!(c["mission"]["robot"]["urdf"], "../r.urdf");
    let (g, c) = init(&dir, "r.urdf", &["--stiffness", "90", "--damping", "0.4"]);
    assert_eq!(names(&g["lifted"]), [panels[0]["name"].as_str().unwrap()]);
    let dof: Vec<u64> = c["model"]["dof"].as_array().unwrap().iter().map(|d| d.as_u64().unwrap()).collect();
    assert_eq!(dof, [6, 7, 3]);
    // Fuel, where it hangs, and what of it is estimated.
    let (_, c) = init(&dir, "r.urdf", &["--tank", "64,0.5,12,2.5", "--tank-at", "-0.2,0.1,0.3"]);
    let tank = &c["mission"]["appendages"][0];
    assert_eq!((tank["kind"].as_str(), tank["host"].as_str()), (Some("slosh_pendulum"), Some("bus")));
    assert_eq!(tank["mount"]["xyz_m"], serde_json::json!([-0.2, 0.1, 0.3]));
    assert_eq!(tank["settings"]["length_m"], 0.5);
    assert!(names(&c["mission"]["estimate"]["parameters"]).contains(&"tank.*"));
}

/// A model of MuJoCo tells springs and dampers: its wings are lifted at once.
#[test]
fn springs_of_a_mujoco_model_need_no_flag() {
    let dir = tempfile::tempdir().unwrap();
    let model = fixture("../docs/examples/three-segment/robot.xml");
    let (g, c) = init(&dir, model.to_str().unwrap(), &[]);
    assert_eq!(names(&g["arm"]), ["arm_1", "arm_2", "arm_3", "arm_4", "arm_5", "arm_6"]);
    assert_eq!(g["panels"][0]["joints"], serde_json::json!(["wing_1", "wing_2", "wing_3"]));
    assert_eq!(names(&g["lifted"]), [g["panels"][0]["name"].as_str().unwrap()]);
    let settings = &c["mission"]["appendages"][0]["settings"];
    assert_eq!(settings["stiffness_nm_per_rad"], serde_json::json!([310.0, 190.0, 120.0]));
    assert_eq!(settings["damping_nms_per_rad"], serde_json::json!([2.6, 1.7, 1.1]));
    // The two hinges of the tank are no panel, and its fuel is a point: both are said.
    let codes: Vec<&str> = c["problems"].as_array().unwrap().iter().map(|p| p["code"].as_str().unwrap()).collect();
    assert_eq!(codes, ["Urdf::Spring", "Urdf::ImplausibleScale"]);
}

#[test]
fn an_arm_on_the_ground_feels_gravity() {
    let dir = tempfile::tempdir().unwrap();
    fs::copy(fixture("peers-model/arm_fixed.urdf"), dir.path().join("arm.urdf")).unwrap();
    let (g, c) = init(&dir, "arm.urdf", &["--fixed", "--rate-hz", "250", "--torque-noise", "0.3"]);
    let robot = &c["mission"]["robot"];
    assert_eq!((robot["base"].as_str(), g["arm"].as_array().unwrap().len()), (Some("fixed"), 7));
    assert_eq!(robot["gravity_m_per_s2"], serde_json::json!([0.0, 0.0, -9.80665]));
    assert_eq!(c["mission"]["sensors"]["rate_hz"], 250.0);
    assert_eq!(c["mission"]["estimate"]["parameters"].as_array().unwrap().len(), 7);
    let dof: Vec<u64> = c["model"]["dof"].as_array().unwrap().iter().map(|d| d.as_u64().unwrap()).collect();
    assert_eq!(dof, [0, 7, 0]);
    // A base that cannot turn has no gyro.
    let (code, _, err) = ffid(dir.path(), &["init", "arm.urdf", "--fixed", "--gyro-noise", "1e-4", "-o", "x.toml"]);
    assert_eq!(code, 2, "{err}");
}

#[test]
fn names_of_any_kind_and_robots_without_joints() {
    let e = Some(9.0);
    let odd = folder(&urdf(&[
        ("j &quot;one&quot;", "revolute", "b*us.x[1]", "l \\ 1", e),
        ("a&#10;b", "revolute", "l \\ 1", "l2", e),
        ("solar.left&#10;[1]", "revolute", "b*us.x[1]", "panel . *", Some(0.0)),
        ("solar right", "revolute", "b*us.x[1]", "panel", Some(0.0)),
    ]));
    let (g, c) = init(&odd, "r.urdf", &["--stiffness", "30", "--damping", "0.2"]);
    assert_eq!((g["arm"].as_array().unwrap().len(), names(&g["lifted"]).len()), (2, 2));
    assert_eq!(c["model"]["appendages"].as_array().unwrap().len(), 2);
    let still = folder(
        "<robot name=\"r\"><link name=\"bus\"><inertial><mass value=\"71\"/>\
        <inertia ixx=\"3\" ixy=\"0.2\" ixz=\"0\" iyy=\"4\" iyz=\"0.1\" izz=\"5\"/></inertial></link></robot>",
    );
    let (g, _) = init(&still, "r.urdf", &[]);
    assert!(names(&g["arm"]).is_empty() && g["end_effector"].is_null());
}

#[test]
fn nothing_is_overwritten_and_bad_robots_are_refused() {
    let dir = satellite();
    let mission = dir.path().join("mission.toml");
    fs::write(&mission, "mine").unwrap();
    let (code, _, err) = ffid(dir.path(), &["init", "r.urdf"]);
    assert_eq!(code, 20, "{err}");
    assert!(err.contains("Io::Exists") && err.contains("--force"), "{err}");
    assert_eq!(fs::read_to_string(&mission).unwrap(), "mine");
    let (code, out, _) = ffid(dir.path(), &["init", "r.urdf", "--force"]);
    assert!(code == 0 && out.contains("arm of 6 joints, s1 to hand") && out.contains("ffid check"), "{out}");
    assert!(fs::read_to_string(&mission).unwrap().starts_with("# Written by `ffid init`"));
    // A hinge that is none, with the nearest name.
    let (code, _, err) = ffid(dir.path(), &["init", "r.urdf", "-o", "x.toml", "--stiffness", "wing_d=3"]);
    assert_eq!(code, 11, "{err}");
    assert!(err.contains("no panel has a joint 'wing_d'; did you mean wing_"), "{err}");
    let (code, _, err) = ffid(dir.path(), &["init", "r.urdf", "-o", "x.toml", "--damping", "wing_a=-3"]);
    assert_eq!(code, 2, "{err}");
    let bad = fixture("bad/M11_negative_mass.urdf");
    let (code, _, err) = ffid(dir.path(), &["init", bad.to_str().unwrap(), "-o", "x.toml"]);
    assert!(code == 10 && err.contains("NonPositiveMass"), "{code} {err}");
    assert!(!dir.path().join("x.toml").exists());
}
