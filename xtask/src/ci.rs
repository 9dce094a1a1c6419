//! `cargo xtask ci`: the steps of continuous integration, here.

use crate::{process, workspace};
use std::ffi::OsStr;

/// Runs `.ci/run`, which holds the one list of steps.
///
/// # Errors
/// The exit code of the first step that fails.
pub fn run() -> anyhow::Result<()> {
    let root = workspace::root()?;
    Ok(process::run(&root, OsStr::new("bash"), &[".ci/run"])?)
}
