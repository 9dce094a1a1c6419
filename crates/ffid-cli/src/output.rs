//! How every subcommand ends: its options, its printing, its exit code.

use crate::results::Refusal;
use ff_mission::Leniency;
use ff_model::{Problems, Severity};
use ffid::exit::Exit;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Display;
use std::io;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Arguments of every subcommand that reads a file.
#[derive(clap::Args)]
pub(crate) struct Input {
    /// Mission file (.toml), or a URDF (.urdf); for `validate` and `predict` the folder that `ffid identify` wrote.
    pub(crate) file: PathBuf,
    /// Print the result and all problems as JSON.
    #[arg(long)]
    json: bool,
    /// Report a named error as a warning, for instance `--allow triangle`.
    #[arg(long, value_name = "CODE")]
    allow: Vec<String>,
    /// Refuse on warnings too.
    #[arg(long)]
    strict: bool,
}

/// What `--json` prints: the same for every subcommand, with its results by name.
#[derive(Serialize)]
struct Report<'a, R> {
    file: &'a Path,
    exit_code: u8,
    problems: &'a Problems,
    #[serde(flatten)]
    results: R,
}

/// The code a command ends with; an output error carries the one it would have ended with.
pub(crate) type Outcome = Result<Exit, (Exit, io::Error)>;

impl Input {
    pub(crate) fn leniency(&self) -> Leniency {
        Leniency { allow: self.allow.clone(), strict: self.strict }
    }
    /// Prints what a command has done, in JSON as the value of `key`, or why it was refused; `quiet`: problems only.
    pub(crate) fn print_done<T: Serialize + Display>(
        &self,
        key: &'static str,
        done: Result<(T, Problems), Refusal>,
        quiet: bool,
        out: &mut impl Write,
        err: &mut impl Write,
    ) -> Outcome {
        let (exit, problems, done) = match done {
            Ok((done, problems)) => (Exit::of(&problems), problems, Some(done)),
            Err((exit, problems)) => (exit, problems, None),
        };
        let text = done.as_ref().filter(|_| !quiet).map(|d| d as &dyn Display);
        self.print(exit, &problems, BTreeMap::from([(key, &done)]), &[text], out, err)
    }
    /// Prints `results` as JSON; or `text` (in order, absent parts left out) and the problems line by line.
    pub(crate) fn print(
        &self,
        exit: Exit,
        problems: &Problems,
        results: impl Serialize,
        text: &[Option<&dyn Display>],
        out: &mut impl Write,
        err: &mut impl Write,
    ) -> Outcome {
        let print = || -> io::Result<()> {
            if self.json {
                let report = Report { file: &self.file, exit_code: exit.code(), problems, results };
                serde_json::to_writer_pretty(&mut *out, &report)?;
                writeln!(out)?;
            } else {
                for p in &problems.0 {
                    writeln!(err, "{p}")?;
                }
                for (i, part) in text.iter().flatten().enumerate() {
                    write!(out, "{}{part}", if i > 0 { "\n" } else { "" })?;
                }
                let count = |s: Severity| problems.0.iter().filter(|p| p.severity == s).count();
                let (e, w) = (count(Severity::Error), count(Severity::Warning));
                if e + w > 0 {
                    writeln!(err, "{}: {e} errors, {w} warnings", self.file.display())?;
                }
            }
            out.flush()
        };
        print().map(|()| exit).map_err(|e| (exit, e))
    }
}
