//! The studies that take a moment, whole; the others in short.

use assert_cmd::Command;
use serde_json::Value;

/// Runs a study in the workspace; its JSON and what it printed. The exit code must be zero: every limit holds.
fn study(args: &[&str]) -> (Value, String) {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("study.json");
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
    let out = Command::cargo_bin("xtask")
        .unwrap()
        .arg("study")
        .args(args)
        .arg("--json")
        .arg(&file)
        .current_dir(root)
        .output()
        .unwrap();
    let text = String::from_utf8(out.stdout).unwrap();
    assert_eq!(out.status.code(), Some(0), "{text}\n{}", String::from_utf8_lossy(&out.stderr));
    (serde_json::from_str(&std::fs::read_to_string(file).unwrap()).unwrap(), text)
}

#[test]
fn nist_problems_are_solved_without_a_false_success() {
    let (json, text) = study(&["nist"]);
    assert_eq!(json["figures"]["start_2.reached_6_digits"], 27.0);
    assert_eq!(text.lines().filter(|l| l.contains("digits, ") && l.contains(" start ")).count(), 54);
}

#[test]
fn built_degeneracies_are_named() {
    for seed in ["1", "17"] {
        let (json, text) = study(&["degeneracies", "--seed", seed]);
        assert_eq!(json["figures"]["cases"], 20.0, "{text}");
        assert_eq!(json["pass"], true);
    }
}

#[test]
fn noise_free_data_give_the_truth_back() {
    let (json, _) = study(&["recovery", "--quick", "--only", "rigid", "--only", "slosh"]);
    assert_eq!(json["figures"]["slosh.recovered"], 2.0);
    assert!(json["figures"].get("flexible.recovered").is_none());
}
