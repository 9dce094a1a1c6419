//! The command line: parse, dispatch, map the outcome to an exit code.

use crate::exit;
use crate::{bench, conformance, corpus, pages, reproduce, study};
use clap::{Parser, Subcommand};
use ffid::exit::Exit;
use std::process::ExitCode;

/// Project tasks that need its libraries; `cargo xtask --help` lists the others.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask", version, about, after_help = exit::help())]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

/// One variant per command; each has its own file, and a line in `launcher/src/tasks.rs`, which starts it.
#[derive(Debug, Subcommand)]
enum Command {
    /// Hold every kind of appendage to the laws of mechanics, and check that wrong ones are caught
    Conformance(conformance::Args),
    /// Try URDFs of others, from PyPI: how many ffid check accepts, what it refuses and why
    Corpus(corpus::Args),
    /// Write every kind of page, and with --check open each in headless Chromium and try what it does
    Pages(pages::Args),
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
        Command::Conformance(args) => conformance::run(args),
        Command::Corpus(args) => corpus::run(args),
        Command::Pages(args) => pages::run(args),
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
