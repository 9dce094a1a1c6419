//! Two mirrored wings: an answer that is one of several is said to be that.

use crate::common::ffid;
use crate::paper_robot::{mission, sines};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// Hinge stiffness of the left wing, then of the right one (N m/rad).
const TRUE: [f64; 4] = [166.3, 218.2, 183.7, 185.9];

/// Stiffnesses, frequencies (Hz) and phases of the joints, seed of the noise.
type World = ([f64; 4], [f64; 7], [f64; 7], &'static str);

const SLOW: World = (TRUE, [0.11, 0.13, 0.09, 0.16, 0.1, 0.12, 0.14], [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0], "4");

/// One in which the valley of the right wing's outer hinge bends.
const BENT: World = (
    [186.296_041_642_647_82, 238.657_113_326_102_23, 212.142_164_292_058_28, 230.676_114_948_848_98],
    [0.151_091_5, 0.158_756, 0.080_036_25, 0.136_429_01, 0.102_287_84, 0.145_74, 0.118_915_05],
    [3.517_353_7, 3.408_627_4, 3.618_297_3, 5.195_701_5, 6.164_114_5, 2.170_04, 5.062_315_6],
    "36",
);

/// `m.toml` and `rec.csv`: slow motion of two wings that are nearly alike.
fn world(dir: &Path, (stiffness, hz, phase, seed): World) {
    let slow = |m: String| m.replace("rate_hz = 100.0", "rate_hz = 25.0");
    mission(dir, "truth.toml", stiffness, slow);
    mission(dir, "m.toml", [200.0; 4], slow);
    sines(dir, "slow.csv", 24.0, hz, phase);
    let simulate =
        ["simulate", "truth.toml", "--trajectory", "slow.csv", "--out", "rec.csv", "--hold", "10", "--seed", seed];
    assert_eq!(ffid(dir, &simulate).0, 0);
}

/// What `ffid identify` of that prints and finds: exit code, both outputs, the result.
fn identified(of: World, args: &[&str]) -> (i32, String, String, Value) {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    world(dir, of);
    let (code, out, err) = ffid(dir, &[&["identify", "m.toml", "--record", "rec.csv"], args].concat());
    let r = serde_json::from_slice(&fs::read(dir.join("m-identified/result.json")).unwrap()).unwrap();
    (code, out, err, r)
}

#[test]
#[ignore = "full tier: 4 s"]
fn mirrored_wings_that_a_slow_motion_does_not_tell_apart_are_named() {
    let (code, out, err, r) = identified(SLOW, &[]);
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

/// The right wing's outer hinge was 3.8 stated deviations off, with white residuals: its cost rises by 1.8 where the parabola says 4.
#[test]
#[ignore = "full tier: 5 s"]
fn a_valley_that_bends_is_covered_and_named() {
    let (code, out, err, r) = identified(BENT, &["--profile", "panel_left.d[0]"]);
    assert_eq!(code, 0, "{out}\n{err}");
    let verdict = r["verdict"].as_array().unwrap();
    let said =
        verdict.iter().any(|v| v.as_str().unwrap().starts_with("The cost is no parabola along panel_right.k[1]"));
    assert!(said, "{verdict:?}");
    let of = |list: &str, name: &str| {
        let found = r[list].as_array().unwrap().iter().find(|p| p["name"] == name);
        found.unwrap_or_else(|| panic!("{name} in {list}")).clone()
    };
    let number = |v: &Value| v.as_f64().unwrap();
    let (line, profile) = (of("parameters", "panel_right.k[1]"), of("profiles", "panel_right.k[1]"));
    let (value, std, upper) = (number(&line["value"]), number(&line["std"]), number(&profile["upper95"]));
    assert!((value - BENT.0[3]).abs() < 2.5 * std, "{line}");
    assert!(profile["bent"] == true && upper - value > 1.5 * (number(&profile["gaussian95"][1]) - value), "{profile}");
    assert!((1.96 * std / (upper - value) - 1.0).abs() < 0.05, "{line} {profile}");
    assert!(of("profiles", "panel_left.d[0]")["bent"].is_null(), "what was asked for is no bend");
}

/// D33: starts that end in different minima are a warning with their costs, and the lowest is taken.
#[test]
#[ignore = "full tier: 10 s"]
fn d33_starts_that_disagree_are_a_warning() {
    let (code, out, err, r) = identified(SLOW, &["--starts", "4"]);
    assert_eq!(code, 0, "{out}\n{err}");
    assert!(err.contains("warning[Fit::MultipleMinima]"), "{err}");
    let objectives: Vec<f64> = r["minima"]["objectives"].as_array().unwrap().iter().filter_map(Value::as_f64).collect();
    assert!(objectives.len() > 1 && objectives.windows(2).all(|w| w[0] < w[1]), "{objectives:?}");
    assert!(r["minima"]["starts"].as_u64().unwrap() >= 4, "{}", r["minima"]);
    let last = r["descent"].as_array().unwrap().last().unwrap();
    let taken = last["cost"].as_f64().unwrap() * last["residuals"].as_f64().unwrap();
    assert!((taken / objectives[0] - 1.0).abs() < 1e-3, "{taken} of {objectives:?}");
}
