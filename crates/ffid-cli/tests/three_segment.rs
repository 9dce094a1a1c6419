//! The example of newcomers: a spacecraft of another shape, measured in MuJoCo, from `ffid init` to a validated model.

use crate::json_schema;
use assert_cmd::Command;
use ffid::workflow::identify::IdentificationResult;
use serde_json::Value;
use std::fs;
use std::path::PathBuf;

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples/three-segment")
}

/// The commands of the README's first block, without `$`.
fn commands() -> Vec<Vec<String>> {
    let text = fs::read_to_string(folder().join("README.md")).unwrap();
    let block = text.split("```sh\n").nth(1).unwrap().split("```").next().unwrap().replace("\\\n", " ");
    let lines = block.lines().filter(|l| l.trim_start().starts_with("ffid "));
    let words = |l: &str| l.split('#').next().unwrap().split_whitespace().skip(1).map(str::to_owned).collect();
    lines.map(words).collect()
}

/// Runs commands of the README beside its files, in a folder that is removed afterwards. Returns the folder and what each printed.
fn run(commands: &[Vec<String>]) -> (tempfile::TempDir, Vec<String>) {
    let dir = tempfile::tempdir().unwrap();
    for name in ["robot.urdf", "record.csv", "other.csv"] {
        fs::copy(folder().join(name), dir.path().join(name)).unwrap();
    }
    let mut printed = Vec::new();
    for args in commands {
        let out = Command::cargo_bin("ffid").unwrap().args(args).current_dir(dir.path()).output().unwrap();
        let text = String::from_utf8_lossy(&out.stdout).into_owned();
        assert_eq!(out.status.code(), Some(0), "{args:?}\n{text}\n{}", String::from_utf8_lossy(&out.stderr));
        printed.push(text);
    }
    (dir, printed)
}

/// What the project's own README quotes of `ffid identify` stands in what it printed, in this order, to a tenth of a deviation.
fn the_first_page_quotes(printed: &str) {
    let page = fs::read_to_string(folder().join("../../../README.md")).unwrap();
    let block = page.split("```text\n").find(|b| b.starts_with("identification of surveyor")).unwrap();
    let words = |l: &str| l.split_whitespace().map(|w| w.trim_matches(['[', ']', ',']).to_owned()).collect::<Vec<_>>();
    let same = |a: &str, b: &str| {
        let (a, b) = (words(a), words(b));
        a.len() == b.len()
            && a.iter().zip(&b).all(|(a, b)| match (a.parse::<f64>(), b.parse::<f64>()) {
                (Ok(x), Ok(y)) => (x - y).abs() <= 0.01 * x.abs().max(y.abs()) || (x - y).abs() <= 0.1,
                _ => a == b,
            })
    };
    let mut lines = printed.lines();
    for quoted in block.split("```").next().unwrap().lines().filter(|l| *l != "...") {
        assert!(lines.any(|l| same(quoted, l)), "README.md quotes\n{quoted}\nbut this is printed:\n{printed}");
    }
}

#[test]
fn three_commands_lead_to_the_modes_of_the_guessed_mission() {
    let commands = commands();
    let named: Vec<&str> = commands.iter().map(|c| c[0].as_str()).collect();
    assert_eq!(named, ["init", "check", "modes", "identify", "validate"]);
    let (_, modes) = run(&commands[..3]);
    // Three hinges and two directions of the fuel.
    let modes = &modes[2];
    let rows = modes.lines().filter(|l| l.contains(" Hz ") && l.contains('%')).count();
    assert_eq!(rows, 5, "{modes}");
}

#[test]
#[ignore = "full tier: 26 s"]
fn five_commands_lead_to_the_truth_of_mujoco() {
    let (dir, printed) = run(&commands());
    the_first_page_quotes(&printed[3]);
    let page = fs::read_to_string(dir.path().join("result/report.html")).unwrap();
    assert!(page.contains("</html>") && !page.contains("http-equiv=\"refresh\""));
    let columns = fs::read(dir.path().join("result/residuals.parquet")).unwrap();
    assert!(columns.starts_with(b"PAR1") && columns.ends_with(b"PAR1"));
    let result = IdentificationResult::from_json(&fs::read(dir.path().join("result/result.json")).unwrap()).unwrap();
    assert!(result.status.is_solution() && result.null_directions.is_empty());
    // It is what its schema says.
    let out = Command::cargo_bin("ffid").unwrap().args(["schema", "result"]).output().unwrap();
    let expected: Value = serde_json::from_slice(&out.stdout).unwrap();
    let written: Value = serde_json::from_slice(&fs::read(dir.path().join("result/result.json")).unwrap()).unwrap();
    json_schema::check(&expected, &written, "").unwrap();
    assert!((0.9..1.15).contains(&result.chi2_per_dof), "{}", result.chi2_per_dof);
    let truth: Value = serde_json::from_slice(&fs::read(folder().join("truth.json")).unwrap()).unwrap();
    let truth = truth["values"].as_object().unwrap();
    assert_eq!(result.parameters.len(), truth.len());
    let (mut within, mut worst) = (0, 0.0_f64);
    for p in &result.parameters {
        let want = truth[&p.name].as_f64().unwrap();
        let off = (p.value - want).abs() / p.std.unwrap();
        worst = worst.max(off);
        within += usize::from(off < 1.96);
        assert!(off < 4.0, "{}: {} +- {} instead of {want}", p.name, p.value, p.std.unwrap());
    }
    // 95 % intervals of 22 parameters: fewer than 18 inside would happen once in a thousand.
    assert!(within >= 18, "{within} of {} within their interval, worst {worst:.2} deviations", truth.len());
}
