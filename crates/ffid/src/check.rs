//! `ffid check`: is this mission, or this URDF, what its author thinks it is?

use ffid::exit::Exit;
use ffid::model::leniency::Leniency;
use ffid::model::mission::{LoadOptions, Mission};
use ffid::model::urdf::{self, UrdfOptions};
use ffid::model::{Problems, Severity};
use ffid::summary::Summary;
use serde::Serialize;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Arguments of `ffid check`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Mission file (.toml), or a URDF (.urdf).
    file: PathBuf,
    /// Print model and problems as JSON.
    #[arg(long)]
    json: bool,
    /// Report a named error as a warning, for instance `--allow triangle`.
    #[arg(long, value_name = "CODE")]
    allow: Vec<String>,
    /// Refuse on warnings too.
    #[arg(long)]
    strict: bool,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report<'a> {
    file: &'a Path,
    exit_code: u8,
    problems: &'a Problems,
    /// Absent when the file was refused.
    model: Option<&'a Summary>,
    /// Absent for a URDF alone, or when the file was refused.
    mission: Option<&'a Mission>,
}

/// Checks the file and prints the outcome; the error carries the exit code that would have been returned.
pub(crate) fn run(args: &Args, out: &mut impl Write, err: &mut impl Write) -> Result<Exit, (Exit, io::Error)> {
    let leniency = Leniency { allow: args.allow.clone(), strict: args.strict };
    let loaded = load(&args.file, leniency);
    let (summary, mission, problems) = match loaded {
        Ok((summary, mission, warnings)) => (Some(summary), mission, warnings),
        Err(problems) => (None, None, problems),
    };
    let exit = Exit::of(&problems);
    let print = |out: &mut dyn Write, err: &mut dyn Write| -> io::Result<()> {
        if args.json {
            let report = Report {
                file: &args.file,
                exit_code: exit.code(),
                problems: &problems,
                model: summary.as_ref(),
                mission: mission.as_ref(),
            };
            serde_json::to_writer_pretty(&mut *out, &report)?;
            writeln!(out)?;
        } else {
            for p in &problems.0 {
                writeln!(err, "{p}")?;
            }
            if let Some(s) = &summary {
                write!(out, "{s}")?;
            }
            let count = |s: Severity| problems.0.iter().filter(|p| p.severity == s).count();
            let (e, w) = (count(Severity::Error), count(Severity::Warning));
            if e + w > 0 {
                writeln!(err, "{}: {e} errors, {w} warnings", args.file.display())?;
            }
        }
        out.flush()
    };
    print(out, err).map(|()| exit).map_err(|e| (exit, e))
}

/// A mission with its model, or the model of a URDF alone.
fn load(file: &Path, leniency: Leniency) -> Result<(Summary, Option<Mission>, Problems), Problems> {
    let name = file.to_string_lossy().to_lowercase();
    if name.ends_with(".urdf") || name.ends_with(".xacro") {
        let unknown = leniency.check();
        if unknown.has_errors() {
            return Err(unknown);
        }
        let (model, warnings) = urdf::from_file(file, &UrdfOptions { leniency, ..UrdfOptions::default() })?;
        return Ok((Summary::new(&model, &[]), None, warnings));
    }
    let l = Mission::load(file, &ffid::default_registry(), &LoadOptions { leniency })?;
    Ok((Summary::new(&l.model, &l.estimated), Some(l.mission), l.warnings))
}
