//! The command line: parse, dispatch, map the outcome to an exit code.

use crate::exit;
use crate::exit::Exit;
use crate::{bench, ci, conformance, fixtures, reproduce, study, suite};
use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Project tasks.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask", version, about, after_help = exit::help())]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

/// One variant per command; each has its own file.
#[derive(Debug, Subcommand)]
enum Command {
    /// Run every test of the workspace, doc tests included
    Test(suite::Args),
    /// Hold every kind of appendage to the laws of mechanics, and check that wrong ones are caught
    Conformance(conformance::Args),
    /// Write fixtures/SHA256SUMS, or verify it with --check
    Fixtures(fixtures::Args),
    /// Run the steps of .ci/run
    Ci,
    /// Run the paper's study end to end: tables, figures, series, summary.json
    Reproduce(reproduce::Args),
    /// Run a seeded study and hold its figures to their limits
    Study(study::Args),
    /// Time the dynamics, beside Pinocchio and MuJoCo with --peers
    Bench(bench::Args),
}

/// Runs the command line of this process.
pub fn main() -> ExitCode {
    // clap exits by itself on bad usage, with code 2: the code of the project's table.
    let cli = Cli::parse();
    let outcome = match &cli.command {
        Command::Test(args) => suite::run(args),
        Command::Conformance(args) => conformance::run(args),
        Command::Fixtures(args) => fixtures::run(args),
        Command::Ci => ci::run(),
        Command::Reproduce(args) => reproduce::run(args),
        Command::Study(args) => study::run(args),
        Command::Bench(args) => bench::run(args),
    };
    match outcome {
        Ok(()) => Exit::Done.into(),
        Err(e) => {
            eprintln!("error: {e:#}");
            ExitCode::from(exit::code_of(&e))
        }
    }
}
