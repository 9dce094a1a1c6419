//! `ffid identify`: from a mission and a record to parameters, a report, and files of the identified robot.

mod args;
mod columns;
pub(crate) mod faults;
pub(crate) mod fit;
pub(crate) mod prepare;
pub(crate) mod write;

pub(crate) use args::{Args, EXAMPLES};

use crate::output::Outcome;
use crate::results;
use faults::{INTERRUPTED, faults};
use ff_model::Problems;
use ffid::exit::Exit;
use ffid::workflow::identify::{IdentificationResult, Warning};
use fit::fit;
use prepare::{Destination, Ready, prepare};
use serde::Serialize;
use std::fmt;
use std::fmt::Display;
use std::io::Write;
use std::path::PathBuf;
use write::write;

/// Results in JSON; absent when there are none.
#[derive(Default, Serialize)]
struct Results<'a> {
    result: Option<&'a IdentificationResult>,
    /// The folder that was written.
    out: Option<&'a PathBuf>,
}

/// Where the results are.
struct Written<'a>(&'a PathBuf);

impl Display for Written<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "written to {}: report.html, replay.html, result.json, identified.toml", self.0.display())
    }
}

/// Adds what the result itself finds fault with to the problems of reading and fitting, and all of them to the result; the code to end with.
pub(crate) fn conclude(args: &Args, result: &mut IdentificationResult, problems: &mut Problems) -> Exit {
    let leniency = args.input.leniency();
    leniency.settle(problems);
    let mut faults = faults(result, args, problems);
    let mut exit = results::exit_of(problems, &mut faults, &leniency);
    if result.exit() != Exit::Done {
        exit = result.exit();
    }
    // Of a fit that has ended, too: what comes behind it is missing.
    if problems.0.iter().any(|p| p.code == INTERRUPTED) {
        exit = Exit::Interrupted;
    }
    problems.extend(faults);
    result.warnings = Warning::all(problems);
    exit
}

/// Identifies, writes and prints.
pub(crate) fn run(args: &Args, out: &mut impl Write, err: &mut impl Write) -> Outcome {
    let input = &args.input;
    let (mut ready, destination) = match prepare(args, err) {
        Ok(r) => r,
        Err((exit, p)) => return input.print(exit, &p, Results::default(), &[], out, err),
    };
    let found = fit(args, &mut ready);
    let (mut found, held, warnings) = match found {
        Ok(f) => f,
        Err((exit, p)) => return input.print(exit, &p.in_file(&input.file), Results::default(), &[], out, err),
    };
    let Ready { opened, records, problems, inputs, .. } = ready;
    let Destination { files, folder, target } = destination;
    let mut problems = problems;
    problems.extend(warnings);
    let mut exit = conclude(args, &mut found.result, &mut problems);
    if let Some(p) = results::changed(&inputs, &files) {
        exit = Exit::Data;
        problems.push(p);
    }
    let leniency = input.leniency();
    let wrote = write(&folder, args, (&opened, &records), &mut found, held.as_ref(), &leniency).and_then(|warnings| {
        problems.extend(warnings);
        let r = &found.result;
        let settings: Vec<(&str, String)> =
            r.provenance.settings.iter().map(|(k, v)| (k.as_str(), v.clone())).collect();
        folder.finish(&results::about("identify", args.seed, &settings, inputs))
    });
    let written = wrote.is_ok();
    if let Err(e) = wrote {
        // What was found is printed all the same.
        let (code, p) = results::failed(&e);
        exit = code;
        problems.push(p);
    }
    let where_to = written.then_some(&target);
    let line = where_to.map(Written);
    let text: [Option<&dyn Display>; 2] = [Some(&found.result), line.as_ref().map(|w| w as _)];
    let text = if args.output.quiet { &[][..] } else { &text[..] };
    input.print(exit, &problems, Results { result: Some(&found.result), out: where_to }, text, out, err)
}
