//! `cargo xtask ci`: the steps of continuous integration, here.

use crate::failure::Failure;
use crate::{process, workspace};
use std::ffi::OsStr;

/// Runs `.ci/run`, what every change has to pass; with `full`, `.ci/full` after it, which takes longer and needs more tools.
///
/// # Errors
/// The exit code of the first step that fails.
pub fn run(full: bool) -> Result<(), Failure> {
    let root = workspace::root()?;
    process::run(&root, OsStr::new("bash"), &[".ci/run"])?;
    if full {
        process::run(&root, OsStr::new("bash"), &[".ci/full"])?;
    }
    Ok(())
}
