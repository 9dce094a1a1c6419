//! What the tests of several commands share.

use assert_cmd::Command;
use std::path::{Path, PathBuf};

/// A file of `fixtures/`.
pub(crate) fn fixture(path: impl AsRef<Path>) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures").join(path)
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
