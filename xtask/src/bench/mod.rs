//! `cargo xtask bench`: nanoseconds per call of every algorithm, beside the engines people would pick instead.
//!
//! `ff-bench` is built for the portable CPU target and for this machine's, and runs by turns with the programs of
//! `peers/run_peers.sh` on one core. [`limits`] holds what must be reached; what is measured and how is in
//! `docs/benchmarks.md`. Two other questions have flags of their own: [`instructions`] and [`sizes`].
pub mod aggregate;
pub mod build;
pub mod cell;
pub mod instructions;
pub mod limits;
pub mod micro;
pub mod models;
pub mod peers;
pub mod programs;
pub mod report;
pub mod run;
pub mod sizes;
pub mod tasks;

use crate::workspace;
use ffid::files::atomic;
use std::path::PathBuf;

/// Arguments of `bench`.
#[derive(Debug, Default, clap::Args)]
pub struct Args {
    /// Write the results and the limits as JSON
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Compare with the peers: the folder of run_peers.sh, or the work folder that it fills
    #[arg(long, value_name = "DIR")]
    pub peers: Option<PathBuf>,
    /// Few repetitions: shows that everything runs, the figures are rough
    #[arg(long)]
    pub quick: bool,
    /// Only what contains this in `model.fn.config`, such as `flex.rnea` or `simulate`
    #[arg(long, value_name = "SUBSTR", default_value = "")]
    pub only: String,
    /// Interleaved rounds over all programs
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub rounds: Option<u32>,
    /// The core everything is pinned to
    #[arg(long, value_name = "CPU", default_value_t = 1)]
    pub core: usize,
    /// Count instructions with callgrind instead of measuring time, and compare with crates/ff-bench/instructions.json
    #[arg(long, conflicts_with_all = ["peers", "json", "sizes"])]
    pub instructions: bool,
    /// With --instructions: keep the counts in crates/ff-bench/instructions.json
    #[arg(long, requires = "instructions")]
    pub keep: bool,
    /// Time against the number of bodies instead: docs/figures/bench-linear.svg
    #[arg(long, conflicts_with_all = ["peers", "json"])]
    pub sizes: bool,
}

/// How often everything is run.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Interleaved rounds over all programs.
    pub rounds: u32,
    /// Repetitions of the loop over all states, per round.
    pub reps: u32,
    /// Repetitions of a whole task, per round.
    pub task_reps: u32,
}

impl Effort {
    fn of(args: &Args) -> Self {
        let (rounds, reps, task_reps) = if args.quick { (2, 5, 1) } else { (5, 25, 3) };
        Self { rounds: args.rounds.unwrap_or(rounds), reps, task_reps }
    }
}

/// Runs what is asked for.
///
/// # Errors
/// Failures of the programs, [`ffid::exit::Failure::Tolerance`] when an instruction count rose.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let root = workspace::root()?;
    let effort = Effort::of(args);
    if args.instructions {
        return instructions::run(&root, args);
    }
    if args.sizes {
        return sizes::run(&root, args, effort);
    }
    // A wrong folder should be known before anything is built.
    let peers = args.peers.as_deref().map(peers::Peers::find).transpose()?;
    let portable = build::ff_bench(&root, build::Target::Portable)?;
    let native = build::ff_bench(&root, build::Target::Native)?;
    let pin = run::Pin::to(args.core);
    let states = match &peers {
        Some(p) => p.states.clone(),
        None => build::own_states(&root, &portable)?,
    };
    let programs = programs::Programs { root: &root, portable: &portable, native: &native, peers: peers.as_ref(), pin };
    let cells = micro::measure(&programs, &states, effort, &args.only)?;
    let tasks = tasks::measure(&programs, effort, &args.only)?;
    let limits = limits::evaluate(&cells, &tasks, peers.is_some());
    print!("{}", report::text(&cells, &tasks, &limits, peers.is_some(), &programs.pin));
    if let Some(path) = &args.json {
        atomic::write(path, &report::json(&cells, &tasks, &limits)?)?;
    }
    Ok(())
}
