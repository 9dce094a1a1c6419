//! Joints that shake as a controller's do, below what encoders read and above what torque sensors do.

use crate::common::fixture;
use crate::evidence::{distances, flown, identify, moved, noisy, truth, world};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use std::f64::consts::TAU;
use std::fs;
use std::path::Path;

/// Bursts of every joint, their frequencies (Hz), how long they last (s), and their amplitude (rad): below the noise of the encoders.
const BURSTS: usize = 25;
const BAND: (f64, f64) = (9.0, 13.0);
const LASTS: f64 = 0.12;
const SHAKEN: f64 = 6e-6;

/// Mission, robot and a record of `fixtures/verdict` with joints that shake; `spoil` changes the readings.
fn shaken(dir: &Path, seed: u64, spoil: impl Fn(&[String], &mut [f64])) {
    world(dir, seed, |_, _| {}, |m| m);
    moved(dir, |rows| shake(rows, seed));
    fs::copy(fixture("verdict").join("truth.toml"), dir.join("truth.toml")).unwrap();
    flown(dir);
    noisy(dir, seed, spoil, |m| m);
}

/// Adds waves under bells to all joints.
fn shake(rows: &mut [Vec<f64>], seed: u64) {
    let (joints, end) = (rows[0].len() / 3, rows[rows.len() - 1][0]);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut bursts = || {
        let one = |_| {
            let [at, f, phase] = [rng.random::<f64>(), rng.random::<f64>(), rng.random::<f64>()];
            [3.0 + (end - 6.0) * at, TAU * (BAND.0 + (BAND.1 - BAND.0) * f), TAU * phase]
        };
        (0..BURSTS).map(one).collect::<Vec<[f64; 3]>>()
    };
    let all: Vec<Vec<[f64; 3]>> = (0..joints).map(|_| bursts()).collect();
    for row in rows {
        let t = row[0];
        for (j, bursts) in all.iter().enumerate() {
            for &[at, w, phase] in bursts.iter().filter(|b| (b[0] - t).abs() < 8.0 * LASTS) {
                let x = (t - at) / LASTS;
                let (bell, (sin, cos)) = ((-0.5 * x * x).exp(), (w * t + phase).sin_cos());
                let (slope, bend) = (-x / LASTS * bell, (x * x - 1.0) / LASTS.powi(2) * bell);
                row[1 + j] += SHAKEN * bell * sin;
                row[1 + joints + j] += SHAKEN * (slope * sin + bell * w * cos);
                row[1 + 2 * joints + j] += SHAKEN * (bend * sin + 2.0 * slope * w * cos - bell * w * w * sin);
            }
        }
    }
}

/// Torques show accelerations that positions do not, and contradicted a right model.
#[test]
#[ignore = "full tier: 30 s"]
fn what_encoders_do_not_tell_contradicts_nothing() {
    let dir = tempfile::tempdir().unwrap();
    shaken(dir.path(), 51, |_, _| {});
    let (code, r) = identify(dir.path(), &[]);
    let e = &r["evidence"];
    assert_eq!((code, e["state"].as_str()), (0, Some("explained")), "{e}");
    let below = e["below_hz"].as_f64().unwrap_or_else(|| panic!("{e}"));
    assert!(below > 0.3 && below < BAND.0, "{below}");
    let said = format!("compared below {below:.4} Hz alone");
    assert!(r["verdict"].to_string().contains(&said), "{said}: {}", r["verdict"]);
    let codes: Vec<&Value> = r["warnings"].as_array().unwrap().iter().map(|w| &w["code"]).collect();
    assert!(codes.iter().any(|c| *c == "Fit::Band"), "{codes:?}");
    let worst = distances(&r, &truth(dir.path())).into_iter().fold(0.0, f64::max);
    assert!(worst < 4.0, "{worst}");
}

/// An error of the world is found in what is left.
#[test]
#[ignore = "full tier: 60 s"]
fn an_error_is_named_below_what_encoders_do_not_tell() {
    let dir = tempfile::tempdir().unwrap();
    let gain = |names: &[String], x: &mut [f64]| {
        let j = names.iter().position(|n| n.starts_with("tau.elbow")).unwrap();
        x[j] *= 1.03;
    };
    shaken(dir.path(), 52, gain);
    let (code, r) = identify(dir.path(), &[]);
    let e = &r["evidence"];
    assert_eq!((code, e["named"][0]["name"].as_str()), (16, Some("torque-gain.elbow")), "{e}");
    assert!(e["with_first"] == "explained" && e["below_hz"].is_number(), "{e}");
    let (code, r) = identify(dir.path(), &["--adopt", "torque-gain.elbow"]);
    assert_eq!((code, r["evidence"]["state"].as_str()), (0, Some("explained")), "{}", r["evidence"]);
}
