//! `ffid predict`: what the identified robot will do on a trajectory.

use crate::commands::simulate::{Flags, Summary, print};
use crate::output::Outcome;
use crate::result_folder;
use crate::results::{Refusal, refused};
use ff_model::Problems;
use std::io::Write;

/// Examples for `--help`.
pub(crate) const EXAMPLES: &str = "Examples:
  ffid predict m-identified --trajectory next.json --out pred.csv

The file is a record without noise or bias: joint motion, torques, base rates and attitude, at the rate of [sensors].";

/// Arguments of `ffid predict`.
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    flags: Flags,
}

/// Predicts, writes and prints.
pub(crate) fn run(args: &Args, out: &mut impl Write, err: &mut impl Write) -> Outcome {
    print(&args.flags, "prediction", work(args), out, err)
}

fn work(args: &Args) -> Result<(Summary, Problems), Refusal> {
    let found = result_folder::load(&args.flags.input).map_err(refused)?;
    args.flags.task(None).run(&found.opened, &found.mission_file, &args.flags.input.leniency())
}
