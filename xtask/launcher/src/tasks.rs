//! Tasks that need the libraries of the project: compiled by package `xtask`, with Cargo's progress in sight.

use crate::failure::Failure;
use crate::{environment, process, workspace};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Commands of package `xtask`, with what they do.
pub const TASKS: [(&str, &str); 6] = [
    ("reproduce", "Run the paper's study end to end: tables, figures, series, summary.json"),
    ("study", "Run a seeded study and hold its figures to their limits"),
    ("conformance", "Hold every kind of appendage to the laws of mechanics, and check that wrong ones are caught"),
    ("corpus", "Try URDFs of others, from PyPI: how many ffid check accepts, what it refuses and why"),
    ("pages", "Write every kind of page, and with --check open each in headless Chromium and try what it does"),
    ("bench", "Time the dynamics, beside Pinocchio and MuJoCo with --peers"),
];

/// Compiles package `xtask` and runs a command of it in the current folder.
///
/// # Errors
/// [`Failure::Child`] with the code of Cargo or of the command.
pub fn run(args: &[String]) -> Result<(), Failure> {
    let root = workspace::root()?;
    if !target(&root).join("debug").join(format!("xtask{}", std::env::consts::EXE_SUFFIX)).is_file() {
        eprintln!("compiling the tasks and the libraries that they run; the first time this takes some minutes");
    }
    let manifest = root.join("Cargo.toml");
    let mut command = Command::new(process::cargo());
    command.args(["run", "--package", "xtask", "--manifest-path"]).arg(manifest).arg("--").args(args);
    environment::set(&mut command);
    process::pass(&mut command, format!("cargo xtask {}", args.join(" ")))
}

/// Where Cargo builds.
pub(crate) fn target(root: &Path) -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), PathBuf::from)
}
