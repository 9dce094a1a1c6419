//! A gain that all torque sensors share and masses, stiffness and damping that go with it: no record tells it, however many there are.
//!
//! Torques scaled by `1 + g` are those of a robot whose bodies, springs and dampers all are: with every mass free the relative deviation of the
//! base's mass is that of the gain.

use crate::common::ffid;
use crate::paper_robot::{mission, sines};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// What the mission says of the gain.
const GAIN: f64 = 0.013;
/// What it is.
const TRUE: f64 = 0.009;
const STIFFNESS: [f64; 4] = [218.0, 186.0, 193.0, 209.0];
const MOTIONS: [([f64; 7], [f64; 7]); 5] = [
    ([0.308, 0.285, 0.194, 0.150, 0.218, 0.189, 0.292], [1.90, 2.99, 3.66, 5.70, 3.17, 1.77, 4.75]),
    ([0.116, 0.309, 0.286, 0.149, 0.214, 0.201, 0.256], [4.95, 0.59, 0.18, 5.25, 2.72, 4.79, 0.01]),
    ([0.338, 0.336, 0.095, 0.103, 0.306, 0.279, 0.261], [1.94, 3.81, 3.81, 3.65, 0.99, 2.70, 2.47]),
    ([0.144, 0.227, 0.180, 0.243, 0.249, 0.098, 0.084], [5.26, 1.63, 1.47, 6.25, 2.95, 5.25, 2.99]),
    ([0.144, 0.108, 0.187, 0.122, 0.098, 0.188, 0.328], [5.03, 4.81, 1.39, 3.37, 1.74, 1.08, 0.67]),
];

/// `m.toml` and records `r0.csv` .. of a robot with quiet sensors.
fn world(dir: &Path, records: usize) {
    let quiet = |m: String| {
        m.replace("rate_hz = 100.0", "rate_hz = 20.0")
            .replace("noise_std_nm = 0.1", &format!("noise_std_nm = 0.003\ngain_common_relative_std = {GAIN}"))
            .replace("noise_std_rad_per_s = 1.5e-4", "noise_std_rad_per_s = 3e-6")
            .replace("bits = 20 ", "bits = 26 ")
            .replace("prior_relative_std = 0.3", "")
    };
    mission(dir, "truth.toml", STIFFNESS, quiet);
    let free = "\n[[uncertain]]\nbodies = [\"link*\", \"panel_*.seg[*]\"]\nmass_relative_std = 1.0\n";
    mission(dir, "m.toml", [200.0; 4], |m| quiet(m) + free);
    for (k, (hz, phase)) in MOTIONS.iter().take(records).enumerate() {
        let (motion, record) = (format!("t{k}.csv"), format!("r{k}.csv"));
        sines(dir, &motion, 60.0 + 4.0 * k as f64, *hz, *phase);
        let seed = (k + 3).to_string();
        let simulate = ["simulate", "truth.toml", "--trajectory", &motion, "--out", &record, "--seed", &seed];
        assert_eq!(ffid(dir, &simulate).0, 0);
        spoil(&dir.join(record));
    }
}

/// Torques read larger by the gain.
fn spoil(record: &Path) {
    let text = fs::read_to_string(record).unwrap();
    let torques: Vec<bool> = text.lines().next().unwrap().split(',').map(|n| n.starts_with("tau.")).collect();
    let line = |l: &str| {
        let one = |(x, torque): (&str, &bool)| {
            if *torque { (x.parse::<f64>().unwrap() * (1.0 + TRUE)).to_string() } else { x.to_owned() }
        };
        l.split(',').zip(&torques).map(one).collect::<Vec<_>>().join(",")
    };
    let out: Vec<String> = text.lines().enumerate().map(|(i, l)| if i == 0 { l.to_owned() } else { line(l) }).collect();
    fs::write(record, out.join("\n") + "\n").unwrap();
}

fn identify(dir: &Path, out: &str, args: &[&str]) -> Value {
    let (code, text, err) = ffid(dir, &[&["identify", "m.toml", "--quiet", "--out", out], args].concat());
    assert_eq!(code, 0, "{text}\n{err}");
    serde_json::from_slice(&fs::read(dir.join(out).join("result.json")).unwrap()).unwrap()
}

/// The relative deviation of the base's mass is that of the gain, to a hundredth, and that of its prior: no record has told it.
fn holds(r: &Value) {
    let named = |list: &str, name: &str| {
        let of = r[list].as_array().unwrap().iter().find(|p| p["name"] == name);
        let of = of.unwrap_or_else(|| panic!("{name} in {}", r[list]));
        (of["value"].as_f64().unwrap(), of["std"].as_f64().unwrap())
    };
    let ((mass, std), (_, gain)) = (named("parameters", "base.mass"), named("uncertain", "torque.gain"));
    let ratio = std / mass / gain;
    assert!((ratio - 1.0).abs() < 0.01, "{ratio}: {mass} +- {std}, gain +- {gain}");
    assert!((gain / GAIN - 1.0).abs() < 0.01, "{gain}");
    assert!((mass - 600.0).abs() < 3.0 * std, "{mass} +- {std}");
}

#[test]
#[ignore = "full tier: 3 s"]
fn a_common_gain_is_the_deviation_of_every_mass() {
    let dir = tempfile::tempdir().unwrap();
    world(dir.path(), 1);
    holds(&identify(dir.path(), "one", &["--record", "r0.csv"]));
}

/// Together, and one after the other.
#[test]
#[ignore = "full tier: 60 s"]
fn five_records_do_not_average_a_common_gain_away() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    world(dir, 5);
    holds(&identify(dir, "all", &["--records", "r0.csv", "r1.csv", "r2.csv", "r3.csv", "r4.csv"]));
    identify(dir, "life", &["--record", "r0.csv"]);
    for k in 1..5 {
        let record = format!("r{k}.csv");
        holds(&identify(dir, "life", &["--record", &record, "--prior-from", "life", "--force"]));
    }
}
