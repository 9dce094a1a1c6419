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

/// Studies that hold times to limits.
const TIMED: [&str; 2] = ["convergence", "starts"];

/// Whether a command is to be built as a program that is published: times are those of what users run. `--quick` judges no machine.
fn is_timed(args: &[String]) -> bool {
    let study = args.first().is_some_and(|a| a == "study") && args.get(1).is_some_and(|a| TIMED.contains(&a.as_str()));
    study && !args.iter().any(|a| a == "--quick")
}

/// Compiles package `xtask` and runs a command of it in the current folder.
///
/// # Errors
/// [`Failure::Child`] with the code of Cargo or of the command.
pub fn run(args: &[String]) -> Result<(), Failure> {
    let root = workspace::root()?;
    let timed = is_timed(args);
    let built = target(&root).join(if timed { "release" } else { "debug" });
    if !built.join(format!("xtask{}", std::env::consts::EXE_SUFFIX)).is_file() {
        let takes =
            if timed { "a quarter of an hour on two cores: times are those of a release" } else { "some minutes" };
        eprintln!("compiling the tasks and the libraries that they run; the first time this takes {takes}");
    }
    let manifest = root.join("Cargo.toml");
    let mut command = Command::new(process::cargo());
    command.arg("run").args(timed.then_some("--release")).args(["--package", "xtask", "--manifest-path"]);
    command.arg(manifest).arg("--").args(args);
    if !timed {
        environment::set(&mut command);
    }
    process::pass(&mut command, format!("cargo xtask {}", args.join(" ")))
}

/// Where Cargo builds.
pub(crate) fn target(root: &Path) -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), PathBuf::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_those_of_a_release() {
        let timed = |words: &str| is_timed(&words.split(' ').map(str::to_owned).collect::<Vec<_>>());
        assert!(timed("study convergence --only beam") && timed("study starts"));
        assert!(!timed("study convergence --quick") && !timed("study verdict") && !timed("reproduce starts"));
    }
}
