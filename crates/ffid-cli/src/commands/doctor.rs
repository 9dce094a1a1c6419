//! `ffid doctor`: can this record be true, and is it one of this robot, before anything is fitted?

use crate::flags::fit::{FitFlags, failed};
use crate::flags::record::RecordFlags;
use crate::output::{Input, Outcome};
use crate::results;
use crate::results::{Refusal, refused};
use ff_mission::Mission;
use ff_model::Problems;
use ff_records::Record;
use ffid::exit::Exit;
use ffid::open::{Opened, open};
use ffid::workflow::doctor::{Diagnosis, diagnose};
use ffid::workflow::identify::LabelledRecord;
use serde::Serialize;
use std::fmt::Display;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Examples for `--help`.
pub(crate) const EXAMPLES: &str = "Examples:
  ffid doctor m.toml --record rec.csv              units, axes, signs, rest, noise, clocks, modes
  ffid doctor m.toml --record a.csv b.csv --json
  ffid doctor m.toml --record rec.csv --quiet      problems only

Torques and gyro are compared with one simulation of the mission's values along the recorded joint motion. A finding is good,
suspicious (a warning: a fit can be made) or wrong (an error: exit code 12, or 13 where nothing moves). Nothing is changed or
written (docs/doctor.md). `ffid identify` refuses what is wrong before it fits.";

/// Arguments of `ffid doctor`.
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    pub(crate) input: Input,
    /// The records: CSV, Parquet, or a bag of ROS 1 or ROS 2 (MCAP).
    #[arg(long, value_name = "FILE", num_args = 1.., required = true, alias = "records")]
    record: Vec<PathBuf>,
    /// Print problems only.
    #[arg(long)]
    quiet: bool,
    #[command(flatten)]
    fit: FitFlags,
    #[command(flatten)]
    pub(crate) reading: RecordFlags,
}

/// Results in JSON; absent when there are none.
#[derive(Default, Serialize)]
struct Results<'a> {
    diagnosis: Option<&'a Diagnosis>,
}

/// Reads, judges and prints.
pub(crate) fn run(args: &Args, out: &mut impl Write, err: &mut impl Write) -> Outcome {
    let input = &args.input;
    let (diagnosis, problems) = match judge(args) {
        Ok(found) => found,
        Err((exit, p)) => return input.print(exit, &p, Results::default(), &[], out, err),
    };
    let text: [Option<&dyn Display>; 1] = [Some(&diagnosis)];
    let text = if args.quiet { &[][..] } else { &text[..] };
    input.print(Diagnosis::exit(&problems), &problems, Results { diagnosis: Some(&diagnosis) }, text, out, err)
}

fn judge(args: &Args) -> Result<(Diagnosis, Problems), Refusal> {
    let input = &args.input;
    let opened = open(&input.file, input.leniency()).map_err(refused)?;
    let mission = results::undisturbed(&opened, &input.file).map_err(refused)?;
    let mut records = Vec::new();
    // What looks like degrees is judged here, with its factor, and not refused unread.
    let mut leniency = input.leniency();
    leniency.allow.push("LooksLikeDegrees".to_owned());
    for path in &args.record {
        let loaded = args.reading.read_leniently(path, &opened.model, 8, None, &leniency).map_err(refused)?;
        records.push((path.as_path(), loaded.record, loaded.warnings));
    }
    judge_records(args, &opened, mission, records)
}

/// The diagnosis of records that have been read, each with where it is from and the warnings of reading; and all problems.
pub(crate) fn judge_records(
    args: &Args,
    opened: &Opened,
    mission: &Mission,
    given: Vec<(&Path, Record, Problems)>,
) -> Result<(Diagnosis, Problems), Refusal> {
    let settings = args.fit.settings(mission);
    let (mut records, mut warnings, mut paths) = (Vec::new(), Vec::new(), Vec::new());
    for (path, record, warned) in given {
        let label = path.display().to_string();
        records.push(LabelledRecord { label, record, resampled: (false, false), continues: false, ago: 0 });
        warnings.push(warned);
        paths.push(path);
    }
    let diagnosis = diagnose(opened, &records, &warnings, &settings).map_err(failed)?;
    let mut problems = opened.warnings.clone();
    warnings.into_iter().for_each(|w| problems.extend(w));
    // One after the other, each with its file.
    for path in paths {
        let label = path.display().to_string();
        let own = diagnosis.findings.iter().filter(|f| f.record == label).filter_map(|f| f.problem.clone());
        let mut own = Problems(own.collect()).in_file(path);
        own.0.iter_mut().filter(|p| p.object.as_deref() == Some(label.as_str())).for_each(|p| p.object = None);
        problems.extend(own);
    }
    args.input.leniency().settle(&mut problems);
    if matches!(Exit::of(&problems), Exit::Model | Exit::Config) {
        return Err((Exit::of(&problems), problems));
    }
    Ok((diagnosis, problems))
}
