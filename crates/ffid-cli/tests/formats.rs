//! Files of an earlier version are read, to the same numbers; files of a newer one are refused, with the version that is
//! read (`fixtures/formats`).

use crate::common::{ffid, fixture};
use excitation::TrajectoryFile;
use ff_model::diagnostics::Limit;
use ff_testkit::problem::{assert_violation, refused};
use ffid::files::format;
use ffid::open::open;
use ffid::workflow::identify::{FORMAT, IdentificationResult, VERSION};
use std::fs;
use std::path::PathBuf;

/// A file written by the program of commit 1f38818.
fn old(name: &str) -> PathBuf {
    fixture("formats/1").join(name)
}

#[test]
fn files_of_the_first_format_are_read_to_the_same_numbers() {
    let mission = open(&old("mission.toml"), Default::default()).unwrap();
    assert_eq!((mission.model.nv(), mission.model.n_params()), (6 + 7 + 2, 80 + 6));

    let trajectory = TrajectoryFile::load(&old("trajectory.json"), &mission.model).unwrap();
    assert_eq!(trajectory.to_json(), fs::read_to_string(old("trajectory.json")).unwrap());

    let text = fs::read(old("result.json")).unwrap();
    format::check(&text, FORMAT, VERSION).unwrap();
    let result = IdentificationResult::from_json(&text).unwrap();
    assert_eq!(result.to_json().unwrap(), text);

    // The identified mission holds the estimates of the result, bit for bit.
    let identified = open(&old("identified.toml"), Default::default()).unwrap();
    let found: Vec<u64> = identified.model.param_decls().iter().map(|d| d.nominal.to_bits()).collect();
    assert_eq!(found, result.model.iter().map(|v| v.value.to_bits()).collect::<Vec<_>>());
}

/// The record of the old program is still explained by the model that the old program identified from it.
#[test]
fn an_old_record_is_predicted_by_an_old_model() {
    let dir = tempfile::tempdir().unwrap();
    let [mission, trajectory, record] =
        ["identified.toml", "trajectory.json", "record.csv"].map(|f| old(f).to_string_lossy().into_owned());
    let args = ["simulate", &mission, "--trajectory", &trajectory, "--noise-free", "--out", "exact.csv", "--quiet"];
    let (code, _, problems) = ffid(dir.path(), &args);
    assert_eq!(code, 0, "{problems}");
    let column = |file: PathBuf, name: &str| -> Vec<f64> {
        let mut rows = csv::Reader::from_path(file).unwrap();
        let at = rows.headers().unwrap().iter().position(|h| h == name).unwrap();
        rows.records().map(|r| r.unwrap()[at].parse().unwrap()).collect()
    };
    for (name, sigma) in [("gyro.x[rad/s]", 1.5e-4), ("gyro.z[rad/s]", 1.5e-4), ("tau.joint2[N m]", 0.1)] {
        let (measured, exact) = (column(PathBuf::from(&record), name), column(dir.path().join("exact.csv"), name));
        assert_eq!(measured.len(), exact.len());
        let squares: f64 = measured.iter().zip(&exact).map(|(m, e)| ((m - e) / sigma).powi(2)).sum();
        let chi2 = squares / measured.len() as f64;
        assert!((0.7..1.4).contains(&chi2), "{name}: {chi2}");
    }
}

#[test]
fn files_of_a_newer_version_are_refused_as_such() {
    let newer = |text: String| text.replacen("\"version\": 1", "\"version\": 3", 1).replacen('{', "{ \"later\": 1,", 1);
    let text = newer(fs::read_to_string(old("trajectory.json")).unwrap());
    let found = TrajectoryFile::from_json(&text).unwrap_err();
    assert_violation(refused(&found, "Data::Version", "version"), 3.0, Limit::AtMost(1.0), "");

    let text = newer(fs::read_to_string(old("result.json")).unwrap());
    let found = format::check(text.as_bytes(), FORMAT, VERSION).unwrap_err();
    assert_violation(refused(&found, "Data::Version", "version"), 3.0, Limit::AtMost(f64::from(VERSION)), "");
    assert_eq!(found.exit_code(), 12);
    // Another format, and a version before the first.
    let found = format::check(br#"{ "format": "ffid-trajectory", "version": 1 }"#, FORMAT, VERSION).unwrap_err();
    refused(&found, "Data::Format", "format");
    let found = format::check(br#"{ "format": "ffid-result", "version": 0 }"#, FORMAT, VERSION).unwrap_err();
    assert_violation(refused(&found, "Data::Version", "version"), 0.0, Limit::AtLeast(1.0), "");
}
