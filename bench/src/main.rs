//! `ff-bench`: times the dynamics on the models and states that the peers (Pinocchio, MuJoCo) are timed on.
//!
//! The method is that of `peers/src/bench.hpp`: one repetition runs the function once on each of the 1,000 states, one
//! call after the other; three repetitions warm up, the others give the median. Every function is checked before it
//! is timed ([`check`]). One JSON line per model, configuration and function goes to standard output, everything else
//! to standard error. `cargo xtask bench` builds, runs and compares.

mod check;
mod functions;
mod lanes;
mod micro;
mod models;
mod states;
mod timing;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

#[derive(Debug, Parser)]
#[command(name = "ff-bench", version, about)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Nanoseconds per call of every function, on every model
    Micro(micro::Args),
}

fn main() -> ExitCode {
    let outcome = match &Cli::parse().command {
        Command::Micro(args) => micro::run(args),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("error: {e:#}");
            ExitCode::from(14)
        }
    }
}
