//! What the tests of several commands share.

use assert_cmd::Command;
use ff_model::diagnostics::Violation;
pub(crate) use ff_testkit::fixtures::fixture;
use serde_json::Value;
use std::path::Path;

/// True when a problem, given as JSON, says all of this: `value 0 kg, limit > 0 kg` is compared with the number, the limit
/// and the unit that it names for programs; names and paths are looked for in `line`, the same problem in words.
pub(crate) fn says(problem: &Value, line: &str, words: &[&str]) -> bool {
    let violation = serde_json::from_value::<Violation>(problem["violation"].clone()).map(|v| v.to_string());
    words
        .iter()
        .all(|w| if w.starts_with("value ") { violation.as_ref().is_ok_and(|v| v == w) } else { line.contains(w) })
}

/// Runs the command to its end: exit code, standard output, standard error.
pub(crate) fn finish(command: &mut Command) -> (i32, String, String) {
    let out = command.output().unwrap();
    let text = |b: Vec<u8>| String::from_utf8(b).unwrap();
    (out.status.code().unwrap(), text(out.stdout), text(out.stderr))
}

/// Runs `ffid` in a folder.
pub(crate) fn ffid(dir: &Path, args: &[&str]) -> (i32, String, String) {
    finish(Command::cargo_bin("ffid").unwrap().args(args).current_dir(dir))
}
