//! Two mirrored wings: an answer that is one of several is said to be that.

use crate::common::ffid;
use crate::paper_robot::{mission, sines};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// Hinge stiffness of the left wing, then of the right one (N m/rad).
const TRUE: [f64; 4] = [166.3, 218.2, 183.7, 185.9];

/// `m.toml` and `rec.csv`: slow motion of two wings that are nearly alike.
fn world(dir: &Path) {
    let slow = |m: String| m.replace("rate_hz = 100.0", "rate_hz = 25.0");
    mission(dir, "truth.toml", TRUE, slow);
    mission(dir, "m.toml", [200.0; 4], slow);
    sines(dir, "slow.csv", 24.0, [0.11, 0.13, 0.09, 0.16, 0.1, 0.12, 0.14], [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    let simulate =
        ["simulate", "truth.toml", "--trajectory", "slow.csv", "--out", "rec.csv", "--hold", "10", "--seed", "4"];
    assert_eq!(ffid(dir, &simulate).0, 0);
}

/// What `ffid identify` of that prints and finds: exit code, both outputs, the result.
fn identified(args: &[&str]) -> (i32, String, String, Value) {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    world(dir);
    let (code, out, err) = ffid(dir, &[&["identify", "m.toml", "--record", "rec.csv"], args].concat());
    let r = serde_json::from_slice(&fs::read(dir.join("m-identified/result.json")).unwrap()).unwrap();
    (code, out, err, r)
}

#[test]
#[ignore = "full tier: 4 s"]
fn mirrored_wings_that_a_slow_motion_does_not_tell_apart_are_named() {
    let (code, out, err, r) = identified(&[]);
    assert_eq!(r["evidence"]["state"], "explained", "{out}");
    assert_eq!(code, 0, "{out}");
    assert!(err.contains("Fit::MultipleMinima") && err.contains("panel_left.k[1]"), "{err}");
    let verdict = r["verdict"].as_array().unwrap();
    assert!(verdict.iter().any(|v| v.as_str().unwrap().contains("NOT unique")), "{verdict:?}");
    let all = r["parameters"].as_array().unwrap();
    let truth = ["panel_left.k[0]", "panel_left.k[1]", "panel_right.k[0]", "panel_right.k[1]"].iter().zip(TRUE);
    for (name, k) in truth {
        let p = all.iter().find(|p| p["name"] == **name).unwrap();
        let number = |v: &Value| v.as_f64().unwrap();
        let (low, high) = (number(&p["interval95"][0]), number(&p["interval95"][1]));
        assert!((number(&p["value"]) - k).abs() < 3.0 * number(&p["std"]) && low < k && k < high, "{k}: {p}");
    }
}

/// D33: starts that end in different minima are a warning with their costs, and the lowest is taken.
#[test]
#[ignore = "full tier: 10 s"]
fn d33_starts_that_disagree_are_a_warning() {
    let (code, out, err, r) = identified(&["--starts", "4"]);
    assert_eq!(code, 0, "{out}\n{err}");
    assert!(err.contains("warning[Fit::MultipleMinima]"), "{err}");
    let objectives: Vec<f64> = r["minima"]["objectives"].as_array().unwrap().iter().filter_map(Value::as_f64).collect();
    assert!(objectives.len() > 1 && objectives.windows(2).all(|w| w[0] < w[1]), "{objectives:?}");
    assert!(r["minima"]["starts"].as_u64().unwrap() >= 4, "{}", r["minima"]);
    let last = r["descent"].as_array().unwrap().last().unwrap();
    let taken = last["cost"].as_f64().unwrap() * last["residuals"].as_f64().unwrap();
    assert!((taken / objectives[0] - 1.0).abs() < 1e-3, "{taken} of {objectives:?}");
}
