//! `ffid predict`: what the identified robot will do on a trajectory.

use crate::output::{Input, Outcome};
use crate::result_folder;
use crate::simulate_command::{Summary, Task};
use ffid::exit::Exit;
use ffid::model::Problems;
use serde::Serialize;
use std::fmt::Display;
use std::io::Write;
use std::path::PathBuf;

/// Examples for `--help`.
pub(crate) const EXAMPLES: &str = "Examples:
  ffid predict m-identified --trajectory next.json --out pred.csv

The file is a record without noise or bias: joint motion, torques, base rates and attitude, at the rate of [sensors].";

/// Arguments of `ffid predict`.
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    input: Input,
    /// The joint motion: .json of `ffid excite`, or .csv.
    #[arg(long, value_name = "FILE")]
    trajectory: PathBuf,
    /// The prediction to write (.csv).
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Seconds to go on after the end of the motion, joints held.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0)]
    hold: f64,
    /// Replace an existing file.
    #[arg(long)]
    force: bool,
    /// Print problems only.
    #[arg(long)]
    quiet: bool,
}

/// Results in JSON; absent when there are none.
#[derive(Default, Serialize)]
struct Results<'a> {
    prediction: Option<&'a Summary>,
}

/// Predicts, writes and prints.
pub(crate) fn run(args: &Args, out: &mut impl Write, err: &mut impl Write) -> Outcome {
    let input = &args.input;
    match work(args) {
        Ok((summary, problems)) => {
            let text: [Option<&dyn Display>; 1] = [Some(&summary)];
            let text = if args.quiet { &[][..] } else { &text[..] };
            input.print(Exit::of(&problems), &problems, Results { prediction: Some(&summary) }, text, out, err)
        }
        Err((exit, problems)) => input.print(exit, &problems, Results::default(), &[], out, err),
    }
}

fn work(args: &Args) -> Result<(Summary, Problems), (Exit, Problems)> {
    let input = &args.input;
    let found = result_folder::load(input).map_err(|p| (Exit::of(&p), p))?;
    let task = Task { trajectory: &args.trajectory, out: &args.out, seed: None, hold: args.hold, force: args.force };
    task.run(&found.opened, &found.mission_file, &input.leniency())
}
