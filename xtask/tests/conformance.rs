//! `cargo xtask conformance` through its library and its command line.
// Helpers of an integration test are test code, which clippy does not see.

use assert_cmd::Command;
use ff_model::Registry;
use validate::conformance::law;
use xtask::conformance::{Outcome, kinds, systems, wrong_ones};

#[test]
#[ignore = "full tier: 3 s"]
fn every_kind_passes_and_every_wrong_one_is_caught() {
    let dir = tempfile::tempdir().unwrap();
    let json = dir.path().join("conformance.json");
    let out = Command::cargo_bin("xtask")
        .unwrap()
        .args(["conformance", "--systems", "20", "--seed", "500", "--json"])
        .arg(&json)
        .output()
        .unwrap();
    let text = String::from_utf8(out.stdout).unwrap();
    println!("{text}");
    assert_eq!(out.status.code(), Some(0), "{}", String::from_utf8_lossy(&out.stderr));
    assert!(out.stderr.is_empty(), "{}", String::from_utf8_lossy(&out.stderr));
    for kind in ffid::default_registry().kinds() {
        for l in [law::MOMENTUM, law::ENERGY, law::NO_ALLOCATION, law::TABLES] {
            assert!(text.lines().any(|r| r.starts_with(kind) && r.contains(l) && r.ends_with("yes")), "{kind}: {l}");
        }
    }
    assert!(text.contains("wrong: damper-without-work") && !text.contains("NOT CAUGHT"));
    let read: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(json).unwrap()).unwrap();
    assert_eq!(read["kinds"].as_array().unwrap().len(), ffid::default_registry().kinds().count());
    assert!(read["known_wrong"].as_array().unwrap().iter().all(|w| w["caught"] == true));
    assert_eq!(read["systems"]["checks"].as_array().unwrap().len(), 3);
    assert_eq!(read["systems"]["count"], 20);
}

/// A kind that fails, a wrong one that passes, and a system outside its limits are faults, each by name.
#[test]
#[ignore = "full tier: 3 s"]
fn faults_are_named() {
    let mut r = Registry::new();
    r.register("slosh_pendulum", takes_any_table).example("slosh_pendulum", "k = 2.0");
    let mut outcome = Outcome { kinds: kinds(&r), known_wrong: wrong_ones(), systems: systems(&r, 2, 7).ok() };
    assert!(!outcome.faults().is_empty(), "the factory takes any key");
    assert!(outcome.faults().iter().all(|f| f.starts_with("slosh_pendulum")), "{:?}", outcome.faults());
    assert!(outcome.table().to_string().contains("NO"));
    outcome.kinds.clear();
    assert_eq!(outcome.faults(), Vec::<String>::new());
    outcome.known_wrong[3].caught = false;
    outcome.systems.as_mut().unwrap().checks[0].pass = false;
    let faults = outcome.faults();
    assert_eq!(faults.len(), 2, "{faults:?}");
    assert!(faults[0].contains(outcome.known_wrong[3].name) && faults[1].contains("momentum drift"), "{faults:?}");
    assert!(outcome.table().to_string().contains("NOT CAUGHT"));
}

/// A factory that reads nothing.
fn takes_any_table(
    _: &ff_model::toml::Table,
) -> Result<std::sync::Arc<dyn ff_model::DynAppendage>, ff_model::Problems> {
    Ok(slosh_pendulum::SloshPendulum::new(3.0, 0.7, [2.0, 3.0], [0.0, 0.0])?.into())
}

#[test]
fn nothing_to_build_systems_from_is_an_error() {
    let e = systems(&Registry::new(), 3, 1).unwrap_err();
    assert!(e.to_string().contains("example"), "{e}");
}
