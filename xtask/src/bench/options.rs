//! What is asked of a benchmark.

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
    pub(super) fn of(args: &Args) -> Self {
        let (rounds, reps, task_reps) = if args.quick { (2, 5, 1) } else { (5, 25, 3) };
        Self { rounds: args.rounds.unwrap_or(rounds), reps, task_reps }
    }
}
