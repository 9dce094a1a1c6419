//! A load at the flange of an arm on the ground, from two logs with currents of unknown gains that Pinocchio has computed.

use crate::common::{ffid, fixture};
use serde_json::Value;
use std::fs;

/// Stated deviations within which every number has to be.
const WITHIN: f64 = 4.0;

#[test]
#[ignore = "full tier: 3 s"]
fn two_logs_with_currents_tell_the_load() {
    let dir = tempfile::tempdir().unwrap();
    let ground = fixture("ground/pair.toml");
    for file in ["pair.toml", "arm6.urdf", "empty.parquet", "loaded.parquet"] {
        fs::copy(ground.with_file_name(file), dir.path().join(file)).unwrap();
    }
    let truth: Value = serde_json::from_slice(&fs::read(ground.with_file_name("pair.json")).unwrap()).unwrap();
    let records = ["--records", "empty.parquet", "loaded.parquet", "--without", "tool=empty.parquet"];
    let (code, out, err) = ffid(dir.path(), &[&["identify", "pair.toml"][..], &records, &["--out", "result"]].concat());
    assert_eq!(code, 0, "{out}\n{err}");
    let result: Value = serde_json::from_slice(&fs::read(dir.path().join("result/result.json")).unwrap()).unwrap();
    let list = |key: &str| result[key].as_array().unwrap().clone();
    let body: Vec<f64> = truth["tool"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
    let parameters = list("parameters");
    let found: Vec<f64> = parameters.iter().map(|p| p["value"].as_f64().unwrap()).collect();
    let off = |p: &Value, truth: f64| (p["value"].as_f64().unwrap() - truth) / p["std"].as_f64().unwrap();
    let z: Vec<f64> = parameters.iter().zip(&body).map(|(p, t)| off(p, *t)).collect();
    assert!(z.iter().all(|z| z.abs() < WITHIN), "{z:.2?}");
    // Nor are deviations so wide that they say nothing.
    let rms = (z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64).sqrt();
    assert!(rms > 0.3, "{z:.2?}");
    assert!((found[0] / body[0] - 1.0).abs() < 0.03, "mass {}", found[0]);
    let com = |b: &[f64]| [b[1] / b[0], b[2] / b[0], b[3] / b[0]];
    let miss: f64 = com(&found).iter().zip(com(&body)).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    assert!(miss < 0.01, "centre of mass off by {miss} m");
    // The load alone tells the gain of the last joint, about whose axis the mission takes it for balanced.
    let drives = list("nuisance");
    for (joint, gain) in truth["gains"].as_object().unwrap() {
        let name = format!("drive.{joint}.gain");
        let p = drives.iter().find(|p| p["name"] == name.as_str()).unwrap();
        let z = off(p, gain.as_f64().unwrap());
        assert!(z.abs() < WITHIN, "{name}: {p}, {z:.2} deviations off");
        assert!(p["std"].as_f64().unwrap() < 0.1 * gain.as_f64().unwrap().abs(), "{name}: {p}");
    }
}
