//! The binary as a user meets it: exit codes and messages.

// Helpers of an integration test are test code, which clippy does not see.

use assert_cmd::Command;
use std::fs;
use std::path::Path;

/// A folder that looks like the workspace, with one fixture.
fn workspace() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    fs::create_dir_all(dir.path().join("xtask")).unwrap();
    fs::create_dir_all(dir.path().join("fixtures")).unwrap();
    fs::write(dir.path().join("xtask/Cargo.toml"), "").unwrap();
    fs::write(dir.path().join("Cargo.lock"), "").unwrap();
    fs::write(dir.path().join("fixtures/a.txt"), "abc").unwrap();
    dir
}

/// Runs `xtask` in `dir`; returns exit code, standard output and standard error.
fn xtask(dir: &Path, args: &[&str]) -> (Option<i32>, String, String) {
    let out = Command::cargo_bin("xtask")
        .unwrap()
        .args(args)
        .current_dir(dir)
        .env_remove("CARGO_MANIFEST_DIR")
        .output()
        .unwrap();
    let text = |b: Vec<u8>| String::from_utf8(b).unwrap();
    (out.status.code(), text(out.stdout), text(out.stderr))
}

/// Row R14 through the command line.
#[test]
fn r14_edited_fixture_exits_15() {
    let dir = workspace();
    assert_eq!(xtask(dir.path(), &["fixtures"]).0, Some(0));
    // From a folder below, too.
    let (code, stdout, _) = xtask(&dir.path().join("fixtures"), &["fixtures", "--check"]);
    assert_eq!((code, stdout.as_str()), (Some(0), "fixtures: 1 files as recorded\n"));
    fs::write(dir.path().join("fixtures/a.txt"), "abd").unwrap();
    let (code, _, stderr) = xtask(dir.path(), &["fixtures", "--check"]);
    assert_eq!(code, Some(15), "{stderr}");
    assert!(stderr.contains("a.txt: changed"), "{stderr}");
}

#[test]
fn missing_manifest_is_an_io_error() {
    let dir = workspace();
    let (code, _, stderr) = xtask(dir.path(), &["fixtures", "--check"]);
    assert_eq!(code, Some(20), "{stderr}");
    assert!(stderr.contains("SHA256SUMS"), "{stderr}");
    let elsewhere = tempfile::tempdir().unwrap();
    let (code, _, stderr) = xtask(elsewhere.path(), &["fixtures"]);
    assert_eq!(code, Some(20), "{stderr}");
    assert!(stderr.contains("no workspace here or above"), "{stderr}");
}

#[test]
fn nonsense_on_the_command_line_is_usage() {
    let dir = workspace();
    for args in [&["frobnicate"][..], &["fixtures", "--chekc"], &[]] {
        let (code, _, stderr) = xtask(dir.path(), args);
        assert_eq!(code, Some(2), "{args:?}: {stderr}");
    }
}

#[test]
fn help_shows_the_table_of_exit_codes() {
    let (code, stdout, _) = xtask(workspace().path(), &["--help"]);
    assert_eq!(code, Some(0));
    assert!(stdout.contains(" 15  reproduction") && stdout.contains("pass on the code"), "{stdout}");
}

#[test]
fn an_unknown_study_is_bad_usage() {
    let dir = workspace();
    for args in [&["study", "nothing"][..], &["study"], &["study", "excitation", "--seed", "x"]] {
        let (code, _, stderr) = xtask(dir.path(), args);
        assert_eq!(code, Some(2), "{stderr}");
    }
    // Without the paper's mission there is nothing to study: a file that cannot be read.
    for study in ["excitation", "starts"] {
        let (code, _, stderr) = xtask(dir.path(), &["study", study, "--quick"]);
        assert_eq!(code, Some(20), "{stderr}");
    }
}
