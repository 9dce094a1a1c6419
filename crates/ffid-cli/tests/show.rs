//! `ffid show`: the page of a robot, its motion, another beside it, and what is refused.

use crate::common::{ffid, fixture};
use serde_json::Value;
use std::fs;
use std::path::Path;

fn data(page: &Path) -> Value {
    let html = fs::read_to_string(page).unwrap();
    let json = html.split("<script type=\"application/json\">").nth(1).unwrap().split("</script>").next().unwrap();
    serde_json::from_str(json).unwrap()
}

#[test]
fn a_mission_is_drawn_with_its_modes_and_a_motion() {
    let dir = tempfile::tempdir().unwrap();
    let mission = fixture("paper/combined.toml").display().to_string();
    let (code, out, err) = ffid(dir.path(), &["show", &mission, "--json"]);
    assert_eq!((code, err.as_str()), (0, ""));
    let said: Value = serde_json::from_str(&out).unwrap();
    assert_eq!((&said["replay"]["modes"], &said["replay"]["robots"][0]), (&6.into(), &"combined".into()));
    let v = data(&dir.path().join("combined-replay.html"));
    let scene = &v["scenes"][0];
    assert_eq!((&v["format"], &scene["motion"]), (&"ffid-replay".into(), &Value::Null));
    assert!((scene["mass_kg"].as_f64().unwrap() - 892.0).abs() < 1e-9);
    let names: Vec<&str> = scene["nodes"].as_array().unwrap().iter().map(|n| n["name"].as_str().unwrap()).collect();
    for name in ["base", "link7", "panel_left", "panel_right[1]", "tank[1]"] {
        assert!(names.contains(&name), "{name} in {names:?}");
    }

    // All joints turn by 0.2 rad in 4 s, and are held for one more.
    let joints = 1..=7;
    let head: String = joints.clone().map(|j| format!(",q.joint{j}[rad]")).collect();
    let row = |i: u32| {
        let t = f64::from(i) * 0.02;
        let s = 0.5 - 0.5 * (std::f64::consts::PI * t / 4.0).cos();
        format!(
            "{t},{}\n",
            joints.clone().map(|j| format!("{}", 0.2 * s + 0.1 * f64::from(j))).collect::<Vec<_>>().join(",")
        )
    };
    let csv = format!("time[s]{head}\n{}", (0..=200).map(row).collect::<String>());
    fs::write(dir.path().join("t.csv"), csv).unwrap();
    let args = ["show", &mission, "--trajectory", "t.csv", "--hold", "1", "--beside", &mission, "--out", "two.html"];
    let (code, out, _) = ffid(dir.path(), &args);
    assert_eq!(code, 0, "{out}");
    assert!(out.starts_with("two.html: combined and combined (other), 6 modes, 5.00 s of motion"), "{out}");
    let v = data(&dir.path().join("two.html"));
    assert_eq!(v["scenes"].as_array().unwrap().len(), 2);
    assert_eq!(v["scenes"][0]["motion"], v["scenes"][1]["motion"]);
}

#[test]
fn what_exists_is_kept_and_bad_values_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let mission = fixture("kinds/all.toml").display().to_string();
    fs::write(dir.path().join("p.html"), "mine").unwrap();
    let refused = |args: &[&str], want: i32, code: &str| {
        let (exit, out, _) = ffid(dir.path(), &[&["show", &mission, "--json"], args].concat());
        let v: Value = serde_json::from_str(&out).unwrap();
        assert_eq!((exit, v["problems"][0]["code"].as_str().unwrap()), (want, code));
        assert!(v["replay"].is_null());
    };
    refused(&["--out", "p.html"], 20, "Io::Exists");
    assert_eq!(fs::read_to_string(dir.path().join("p.html")).unwrap(), "mine");
    refused(&["--trajectory", "none.csv", "--hold=-1"], 11, "Config::OutOfRange");
    let (code, out, _) = ffid(dir.path(), &["show", &mission, "--out", "p.html", "--force"]);
    assert_eq!(code, 0, "{out}");
    // Every kind of appendage has something to draw.
    let v = data(&dir.path().join("p.html"));
    let nodes = v["scenes"][0]["nodes"].as_array().unwrap();
    let mounts = nodes.iter().filter(|n| n["shapes"].as_array().unwrap().iter().any(|s| s["role"] == "mount"));
    for mount in mounts {
        let index = nodes.iter().position(|n| n == mount).unwrap();
        let heavy = nodes.iter().any(|n| n["parent"] == index && (n["mass_kg"].is_number() || n["moves"].is_object()));
        assert!(heavy, "nothing hangs on {}", mount["name"]);
    }
}
