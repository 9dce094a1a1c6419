//! `cargo xtask test`: every test of the workspace, doc tests included.

use crate::exit::Failure;
use crate::{process, workspace};

/// Arguments of `test`.
#[derive(Debug, Default, clap::Args)]
pub struct Args {
    /// Use `cargo test` even where cargo-nextest is installed
    #[arg(long)]
    pub no_nextest: bool,
    /// Passed on to the test runner, such as a name filter
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    pub runner_args: Vec<String>,
}

/// Runs the tests and passes on the exit code of the runner.
///
/// cargo-nextest leaves doc tests out, so they run first on their own; the runner comes last, so that its
/// summary closes the output. Both run even if the first fails.
///
/// # Errors
/// The failure of the runner, or of the doc tests when the rest passes.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let root = workspace::root()?;
    let cargo = process::cargo();
    let with = |base: &[&str]| -> Vec<String> {
        base.iter().map(|&s| s.to_owned()).chain(args.runner_args.iter().cloned()).collect()
    };
    if args.no_nextest || !process::has_cargo_subcommand("nextest") {
        return Ok(process::run(&root, &cargo, &with(&["test", "--workspace", "--no-fail-fast"]))?);
    }
    let docs = if args.runner_args.is_empty() {
        process::run(&root, &cargo, &["test", "--workspace", "--doc", "--no-fail-fast"])
    } else {
        Ok(()) // a filter of nextest means nothing to rustdoc
    };
    process::run(&root, &cargo, &with(&["nextest", "run", "--workspace", "--no-fail-fast"]))?;
    docs.map_err(|e: Failure| anyhow::Error::new(e).context("doc tests failed (the other tests passed)"))
}
