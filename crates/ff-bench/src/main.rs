//! `ff-bench`: times the dynamics on the models and states that the peers (Pinocchio, MuJoCo) are timed on.
//!
//! The method is that of `peers/src/bench.hpp`: one repetition runs the function once on each of the 1,000 states, one
//! call after the other; three repetitions warm up, the others give the median. Every function is checked before it
//! is timed ([`check`]). One JSON line per model, configuration and function goes to standard output, everything else
//! to standard error. `cargo xtask bench` builds, runs and compares.

mod check;
mod count;
mod functions;
mod generate;
mod identify;
mod isa;
mod lanes;
mod linear;
mod micro;
mod models;
mod motion;
mod sensitivities;
mod sim;
mod sizes;
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
    /// A minute of the manoeuvre, as the peers simulate it
    Sim(sim::Args),
    /// Sensitivities of the record against the plain simulation
    Sensitivities(sensitivities::Args),
    /// Identification of the flexible system, as the peers run it
    Identify(identify::Args),
    /// Least squares over the regressor of many instants, as the peers run it
    Linear(linear::Args),
    /// Time against the number of bodies
    Sizes(sizes::Args),
    /// A number of calls for an instruction counter
    Count(count::Args),
    /// Write 1,000 states per model in the peers' format, from a fixed seed
    States(generate::Args),
}

fn main() -> ExitCode {
    let outcome = match &Cli::parse().command {
        Command::Micro(args) => micro::run(args),
        Command::Sim(args) => sim::run(args),
        Command::Sensitivities(args) => sensitivities::run(args),
        Command::Identify(args) => identify::run(args),
        Command::Linear(args) => linear::run(args),
        Command::Sizes(args) => sizes::run(args),
        Command::Count(args) => count::run(args),
        Command::States(args) => generate::run(args),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("error: {e:#}");
            ExitCode::from(14)
        }
    }
}
