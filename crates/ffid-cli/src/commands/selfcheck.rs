//! `ffid selfcheck`: does the simulation of this robot keep the laws of mechanics?

use crate::output::{Input, Outcome};
use ff_model::{Area, Problem};
use ffid::exit::Exit;
use ffid::open::open;
use ffid::selfcheck::{SelfCheck, check};
use serde::Serialize;
use std::fmt::Display;
use std::io::Write;

/// Arguments of `ffid selfcheck`.
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    input: Input,
}

/// Results in JSON.
#[derive(Default, Serialize)]
struct Results<'a> {
    /// Absent when the file was refused or could not be simulated.
    selfcheck: Option<&'a SelfCheck>,
}

/// Moves the robot, asks, and prints.
pub(crate) fn run(args: &Args, out: &mut impl Write, err: &mut impl Write) -> Outcome {
    let input = &args.input;
    let opened = match open(&input.file, input.leniency()) {
        Ok(o) => o,
        Err(p) => return input.print(Exit::of(&p), &p, Results::default(), &[], out, err),
    };
    let mut problems = opened.warnings.clone();
    let fail = |code, what: String| {
        Problem::error(Area::Model, code, what)
            .in_file(&input.file)
            .hint("check masses, stiffness and damping; if they are right, report this")
    };
    match check(&opened.model) {
        Ok(found) => {
            let broken: Vec<&str> = found.laws.iter().filter(|l| !l.holds).map(|l| l.name).collect();
            let mut exit = Exit::of(&problems);
            if !broken.is_empty() {
                problems.push(fail("Sim::LawBroken", format!("not kept: {}", broken.join(", "))));
                exit = Exit::Numerical;
            }
            let text: [Option<&dyn Display>; 1] = [Some(&found)];
            input.print(exit, &problems, Results { selfcheck: Some(&found) }, &text, out, err)
        }
        Err(e) => {
            problems.push(fail("Sim::Failed", e.to_string()));
            input.print(Exit::Numerical, &problems, Results::default(), &[], out, err)
        }
    }
}
