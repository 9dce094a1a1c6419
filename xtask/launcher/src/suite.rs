//! `cargo xtask test`: every test of the workspace, doc tests included.

use crate::failure::Failure;
use crate::{process, workspace};

/// Runs the tests and passes on the exit code of the runner.
///
/// `--no-nextest` uses `cargo test` even where cargo-nextest is installed; all other arguments are passed on to the runner, such as the
/// name of a test. cargo-nextest leaves doc tests out, so they run on their own before it, and its summary closes the output. Both
/// run even if the first fails. Examples are not compiled: clippy has read them, and `.ci/full examples` runs them.
///
/// # Errors
/// The failure of the runner, or of the doc tests when the rest passes.
pub fn run(args: &[String]) -> Result<(), Failure> {
    let root = workspace::root()?;
    let cargo = process::cargo();
    let (own, rest): (Vec<&String>, Vec<&String>) = args.iter().partition(|a| *a == "--no-nextest");
    let with = |base: &[&str]| -> Vec<String> {
        base.iter().map(|&s| s.to_owned()).chain(rest.iter().map(|&s| s.clone())).collect()
    };
    let nextest = own.is_empty() && process::has_cargo_subcommand("nextest");
    if !nextest && !rest.is_empty() {
        return process::run(&root, &cargo, &with(&["test", "--workspace", "--no-fail-fast"]));
    }
    let docs = if rest.is_empty() {
        process::run(&root, &cargo, &["test", "--workspace", "--doc", "--no-fail-fast"])
    } else {
        Ok(()) // a filter of nextest means nothing to rustdoc
    };
    let runner: &[&str] = if nextest { &["nextest", "run"] } else { &["test"] };
    process::run(&root, &cargo, &with(&[runner, &["--workspace", "--tests", "--no-fail-fast"]].concat()))?;
    if docs.is_err() {
        eprintln!("doc tests failed (the other tests passed)");
    }
    docs
}
