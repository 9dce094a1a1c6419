//! Two mirrored wings: an answer that is one of two is said to be that.

use crate::common::{ffid, fixture};
use serde_json::Value;
use std::fmt::Write;
use std::fs;
use std::path::Path;

/// Hinge stiffness of the left wing, then of the right one (N m/rad).
const TRUE: [f64; 4] = [166.3, 218.2, 183.7, 185.9];

/// The paper's flexible robot with `stiffness` in its hinges and `more` at the end, at 10 Hz.
fn mission(dir: &Path, name: &str, stiffness: [f64; 4], more: &str) {
    let text = fs::read_to_string(fixture("paper").join("flex.toml")).unwrap();
    let text = text.split("[reproduce]").next().unwrap();
    let mut parts = text.split("stiffness_nm_per_rad = 200.0");
    let mut out = parts.next().unwrap().to_owned();
    for (part, k) in parts.zip(stiffness) {
        let _ = write!(out, "stiffness_nm_per_rad = {k}{part}");
    }
    let out = out.replace("start_offset = 0.25", "").replace("rate_hz = 100.0", "rate_hz = 10.0");
    fs::write(dir.join(name), out + more).unwrap();
}

/// Slow motions of all joints over 24 s, at rest at both ends.
fn slow(dir: &Path) {
    let hold = [1.570_796_326_794_896_6, 1.4, 0.0, -2.6, 0.0, 2.4, 0.0];
    let hz = [0.11, 0.13, 0.09, 0.16, 0.1, 0.12, 0.14];
    let mut out = "time[s]".to_owned();
    (1..=7).for_each(|j| write!(out, ",q.joint{j}[rad]").unwrap());
    let smooth = |u: f64| u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
    for i in 0..=1200 {
        let t = f64::from(i) * 0.02;
        let part = smooth((t / 4.0).min(1.0)) * smooth(((24.0 - t) / 4.0).min(1.0));
        write!(out, "\n{t:.3}").unwrap();
        for (j, (q, f)) in hold.iter().zip(hz).enumerate() {
            write!(out, ",{:.9}", q + part * 0.15 * (std::f64::consts::TAU * f * t + j as f64).sin()).unwrap();
        }
    }
    fs::write(dir.join("slow.csv"), out + "\n").unwrap();
}

#[test]
fn mirrored_wings_that_a_slow_motion_does_not_tell_apart_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    fs::copy(fixture("paper").join("robot.urdf"), dir.join("robot.urdf")).unwrap();
    mission(dir, "truth.toml", TRUE, "");
    mission(dir, "m.toml", [200.0; 4], "");
    slow(dir);
    let simulate =
        ["simulate", "truth.toml", "--trajectory", "slow.csv", "--out", "rec.csv", "--hold", "10", "--seed", "4"];
    assert_eq!(ffid(dir, &simulate).0, 0);
    let (code, out, err) = ffid(dir, &["identify", "m.toml", "--record", "rec.csv"]);
    let r: Value = serde_json::from_slice(&fs::read(dir.join("m-identified/result.json")).unwrap()).unwrap();
    assert_eq!(r["evidence"]["state"], "explained", "{out}");
    assert_eq!(code, 13, "{out}");
    assert!(err.contains("Fit::NotUnique") && err.contains("panel_left.k[1]"), "{err}");
    assert!(r["verdict"][1].as_str().unwrap().contains("NOT unique"), "{}", r["verdict"]);
    let exchange = &r["exchanges"][0];
    assert_eq!(exchange["separate"], true);
    let all = r["parameters"].as_array().unwrap();
    let truth = ["panel_left.k[0]", "panel_left.k[1]", "panel_right.k[0]", "panel_right.k[1]"].iter().zip(TRUE);
    for (name, k) in truth {
        let p = all.iter().find(|p| p["name"] == **name).unwrap();
        let number = |v: &Value| v.as_f64().unwrap();
        let (low, high) = (number(&p["interval95"][0]), number(&p["interval95"][1]));
        assert!((number(&p["value"]) - k).abs() < 3.0 * number(&p["std"]) && low < k && k < high, "{k}: {p}");
        let unique = p["verdict"] == "estimated";
        assert_eq!(unique, name.ends_with("[0]"), "{p}");
        // About the one minimum alone, the outer hinges are known to a few per cent.
        if let Some(v) = exchange["parameters"].as_array().unwrap().iter().find(|v| v["name"] == **name) {
            assert!(number(&v["std"]) < 12.0, "{v}");
        }
    }
}
