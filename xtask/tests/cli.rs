//! The binary as a user meets it: exit codes and messages.

// Helpers of an integration test are test code, which clippy does not see.

use assert_cmd::Command;
use ffid::exit::Exit;
use std::fs;
use std::path::Path;

/// A folder that looks like the workspace.
fn workspace() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    fs::create_dir_all(dir.path().join("xtask")).unwrap();
    fs::write(dir.path().join("xtask/Cargo.toml"), "").unwrap();
    fs::write(dir.path().join("Cargo.lock"), "").unwrap();
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

#[test]
fn nonsense_on_the_command_line_is_usage() {
    let dir = workspace();
    for args in [&["frobnicate"][..], &["reproduce", "--quikc"], &[]] {
        let (code, _, stderr) = xtask(dir.path(), args);
        assert_eq!(code, Some(2), "{args:?}: {stderr}");
    }
}

#[test]
fn help_shows_the_table_of_exit_codes() {
    let (code, stdout, _) = xtask(workspace().path(), &["--help"]);
    assert_eq!(code, Some(0));
    assert!(stdout.contains(" 15  reproduction"), "{stdout}");
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

/// `cargo xtask` is another program, compiled in seconds, that knows which commands to hand on and which codes they end with.
#[test]
fn the_launcher_knows_every_command_and_code() {
    let launcher = xtask::workspace::root().unwrap().join("xtask/launcher/src");
    let tasks = fs::read_to_string(launcher.join("tasks.rs")).unwrap();
    let listed: Vec<&str> = tasks.split("\n    (\"").skip(1).filter_map(|l| l.split('"').next()).collect();
    let (_, help, _) = xtask(workspace().path(), &["--help"]);
    let commands = help.split("Commands:").nth(1).unwrap().split("Options:").next().unwrap();
    let mut own: Vec<&str> = commands
        .lines()
        .filter(|l| l.starts_with("  ") && !l.starts_with("   "))
        .filter_map(|l| l.split_whitespace().next())
        .collect();
    own.retain(|c| *c != "help");
    own.dedup();
    let sorted = |mut v: Vec<&str>| {
        v.sort_unstable();
        v.join(" ")
    };
    assert_eq!(sorted(listed), sorted(own));
    let exit = [Exit::Usage, Exit::Tolerance, Exit::Io].map(|e| e.code().to_string()).join(", ");
    let codes = fs::read_to_string(launcher.join("failure.rs")).unwrap();
    assert!(codes.contains(&format!("pub const CODES: [u8; 3] = [{exit}];")), "{exit}");
}
