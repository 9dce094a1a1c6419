//! Running other programs, visibly.

use crate::failure::Failure;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The cargo that started this process, else the one on the path.
pub fn cargo() -> OsString {
    std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into())
}

/// Runs a program in `dir` with its output passed through, after printing the command.
///
/// # Errors
/// [`Failure::Io`] if it cannot be started, [`Failure::Child`] with its exit code if it fails.
pub fn run<S: AsRef<OsStr>>(dir: &Path, program: &OsStr, args: &[S]) -> Result<(), Failure> {
    let command = shown(program, args);
    eprintln!("+ {command}");
    pass(Command::new(program).args(args).current_dir(dir), command)
}

/// Runs a prepared command, shown as `command` if it fails.
///
/// # Errors
/// As [`run`].
pub fn pass(prepared: &mut Command, command: String) -> Result<(), Failure> {
    let program = PathBuf::from(prepared.get_program());
    let status = prepared.status().map_err(|e| Failure::io("start", &program, e))?;
    if status.success() {
        return Ok(());
    }
    Err(Failure::Child { command, status: status.to_string(), code: status.code() })
}

/// True when `cargo <subcommand> --version` works.
pub fn has_cargo_subcommand(subcommand: &str) -> bool {
    Command::new(cargo())
        .args([subcommand, "--version"])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|s| s.success())
}

fn shown<S: AsRef<OsStr>>(program: &OsStr, args: &[S]) -> String {
    let name = Path::new(program).file_name().unwrap_or(program).to_string_lossy().into_owned();
    args.iter().fold(name, |s, a| s + " " + &a.as_ref().to_string_lossy())
}
