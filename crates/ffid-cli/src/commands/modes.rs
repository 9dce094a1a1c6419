//! `ffid modes`: at which frequencies does this system ring, and what moves?

use crate::output::{Input, Outcome};
use ff_dynamics::Boundary;
use ff_model::{Area, Problem};
use ffid::exit::Exit;
use ffid::modes::ModeTable;
use ffid::open::{MAX_DENSE, open};
use serde::Serialize;
use std::io::Write;

/// Arguments of `ffid modes`.
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    input: Input,
    /// Hold the base as well: the modes on a test bench.
    #[arg(long, conflicts_with = "free_joints")]
    held: bool,
    /// Let the joints move freely: a limp arm.
    #[arg(long)]
    free_joints: bool,
}

/// Results in JSON.
#[derive(Serialize)]
struct Results<'a> {
    /// Absent when the file was refused or the modes could not be computed.
    modes: Option<&'a ModeTable>,
}

/// Prints the modes at the hold pose of the mission, or at the nominal pose.
pub(crate) fn run(args: &Args, out: &mut impl Write, err: &mut impl Write) -> Outcome {
    let input = &args.input;
    let boundary = match (args.held, args.free_joints) {
        (true, _) => Boundary::BaseHeld,
        (_, true) => Boundary::JointsFree,
        _ => Boundary::JointsHeld,
    };
    let none = Results { modes: None };
    let opened = match open(&input.file, input.leniency()) {
        Ok(o) => o,
        Err(problems) => return input.print(Exit::of(&problems), &problems, none, &[], out, err),
    };
    let mut problems = opened.warnings.clone();
    let table = if opened.model.nv() > MAX_DENSE {
        Err(format!("{} degrees of freedom, limit {MAX_DENSE}", opened.model.nv()))
    } else {
        ModeTable::new(&opened.model, &opened.pose(), boundary).map_err(|e| e.to_string())
    };
    match table {
        Ok(table) => {
            let results = Results { modes: Some(&table) };
            input.print(Exit::of(&problems), &problems, results, &[Some(&table)], out, err)
        }
        Err(why) => {
            let p = Problem::error(Area::Model, "Model::NoModes", why).in_file(&input.file);
            problems.push(p.hint("check stiffness and inertia of the appendages"));
            input.print(Exit::Numerical, &problems, none, &[], out, err)
        }
    }
}
