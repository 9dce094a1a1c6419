use std::fs;
use std::path::Path;
use std::process::Command;

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

/// Runs the program in `dir`; returns exit code, standard output and standard error.
fn launcher(dir: &Path, args: &[&str]) -> (Option<i32>, String, String) {
    let out = Command::new(env!("CARGO_BIN_EXE_xtask-launcher"))
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
    assert_eq!(launcher(dir.path(), &["fixtures"]).0, Some(0));
    // From a folder below, too.
    let (code, stdout, _) = launcher(&dir.path().join("fixtures"), &["fixtures", "--check"]);
    assert_eq!((code, stdout.as_str()), (Some(0), "fixtures: 1 files as recorded\n"));
    fs::write(dir.path().join("fixtures/a.txt"), "abd").unwrap();
    let (code, _, stderr) = launcher(dir.path(), &["fixtures", "--check"]);
    assert_eq!(code, Some(15), "{stderr}");
    assert!(stderr.contains("a.txt: changed"), "{stderr}");
}

#[test]
fn missing_manifest_is_an_io_error() {
    let dir = workspace();
    let (code, _, stderr) = launcher(dir.path(), &["fixtures", "--check"]);
    assert_eq!(code, Some(20), "{stderr}");
    assert!(stderr.contains("SHA256SUMS"), "{stderr}");
    let elsewhere = tempfile::tempdir().unwrap();
    let (code, _, stderr) = launcher(elsewhere.path(), &["fixtures"]);
    assert_eq!(code, Some(20), "{stderr}");
    assert!(stderr.contains("no workspace here or above"), "{stderr}");
}

#[test]
fn nonsense_on_the_command_line_is_usage() {
    let dir = workspace();
    for args in [&["frobnicate"][..], &["fixtures", "--chekc"], &["ci", "--fast"], &[]] {
        let (code, _, stderr) = launcher(dir.path(), args);
        assert_eq!(code, Some(2), "{args:?}: {stderr}");
        assert!(stderr.contains("--help"), "{stderr}");
    }
}

#[test]
fn help_needs_no_workspace() {
    let elsewhere = tempfile::tempdir().unwrap();
    for args in [&["--help"][..], &["test", "--help"], &["ci", "-h"]] {
        let (code, stdout, _) = launcher(elsewhere.path(), args);
        assert_eq!(code, Some(0));
        assert!(stdout.contains("reproduce") && stdout.contains("pass on the code"), "{stdout}");
    }
}

/// The steps are run by bash in the root of the workspace, and a failing one decides the code. `--full` adds the second file.
#[test]
fn ci_runs_the_files_of_steps() {
    let dir = workspace();
    fs::create_dir_all(dir.path().join(".ci")).unwrap();
    let step = |name: &str, text: &str| fs::write(dir.path().join(".ci").join(name), text).unwrap();
    step("run", "echo quick > said\n");
    step("full", "echo full >> said\nexit 7\n");
    assert_eq!(launcher(&dir.path().join("fixtures"), &["ci"]).0, Some(0));
    assert_eq!(fs::read_to_string(dir.path().join("said")).unwrap(), "quick\n");
    let (code, _, stderr) = launcher(dir.path(), &["ci", "--full"]);
    assert_eq!(code, Some(7), "{stderr}");
    assert!(stderr.contains("`bash .ci/full` ended with"), "{stderr}");
    assert_eq!(fs::read_to_string(dir.path().join("said")).unwrap(), "quick\nfull\n");
}
