//! `ffid simulate`: the record that the sensors of a mission would write.

use crate::commands::plan as plan_command;
use crate::output::{Input, Outcome};
use crate::results;
use crate::results::{Refusal, io, refused};
use ff_mission::Leniency;
use ff_model::diagnostics::Limit;
use ff_model::{Area, Params, Problem, Problems};
use ff_records::file::ReadOptions;
use ffid::exit::{Exit, Failure};
use ffid::files::atomic;
use ffid::files::folder::Entry;
use ffid::inputs::{Acted, Declared};
use ffid::open::{Opened, open};
use ffid::sense::{MotorSide, csv, current_channel, fly, suite};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;
use std::fmt::Display;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Examples for `--help`.
pub(crate) const EXAMPLES: &str = "Examples:
  ffid simulate m.toml --trajectory m-information/trajectory.json --out rec.csv --seed 3
  ffid simulate m.toml --trajectory mine.csv --out exact.csv --noise-free

The record has time[s], q.<joint>[rad], tau.<joint>[N m] and, unless the base is fixed, gyro.x[rad/s] ..., with noise, bias and quantisation of
[sensors]; without noise also dq., ddq. and att. Joints with a [[drive]] have its friction and reflected inertia in their torque, and
current.<joint>[A] in place of it where it has a gain. `ffid identify` reads it. Base and appendages are at rest at the start. Every
[[input]] of the mission acts on the robot.";

/// Arguments of `ffid simulate`.
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    flags: Flags,
    /// Seed of the noise.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Write exact readings, with joint rates and accelerations.
    #[arg(long, conflicts_with = "seed")]
    noise_free: bool,
}

/// What `simulate` and `predict` ask for alike.
#[derive(clap::Args)]
pub(crate) struct Flags {
    #[command(flatten)]
    pub(crate) input: Input,
    /// The joint motion: .json of `ffid excite`, or .csv.
    #[arg(long, value_name = "FILE")]
    trajectory: PathBuf,
    /// The file to write (.csv).
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

impl Flags {
    /// The simulation asked for; without a seed, without noise.
    pub(crate) fn task(&self, seed: Option<u64>) -> Task<'_> {
        Task { trajectory: &self.trajectory, out: &self.out, seed, hold: self.hold, force: self.force }
    }
}

/// What was written.
#[derive(Serialize)]
pub(crate) struct Summary {
    file: PathBuf,
    sha256: String,
    samples: usize,
    rate_hz: f64,
    seconds: f64,
    /// Absent without noise.
    #[serde(skip_serializing_if = "Option::is_none")]
    seed: Option<u64>,
    /// Absent without inputs.
    #[serde(skip_serializing_if = "Option::is_none")]
    acted: Option<Acted>,
}

impl Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} samples at {} Hz, {:.3} s, ", self.file.display(), self.samples, self.rate_hz, self.seconds)?;
        match self.seed {
            Some(s) => writeln!(f, "sensors of the mission, seed {s}"),
            None => writeln!(f, "without noise"),
        }?;
        self.acted.iter().try_for_each(|a| a.fmt(f))
    }
}

/// Simulates, writes and prints.
pub(crate) fn run(args: &Args, out: &mut impl Write, err: &mut impl Write) -> Outcome {
    print(&args.flags, "record", work(args), out, err)
}

/// Prints what was written, in JSON under `key`, which is null when nothing was.
pub(crate) fn print(
    flags: &Flags,
    key: &'static str,
    done: Result<(Summary, Problems), Refusal>,
    out: &mut impl Write,
    err: &mut impl Write,
) -> Outcome {
    let results = |s| BTreeMap::<&str, Option<&Summary>>::from([(key, s)]);
    match done {
        Ok((summary, problems)) => {
            let text: [Option<&dyn Display>; 1] = [Some(&summary)];
            let text = if flags.quiet { &[][..] } else { &text[..] };
            flags.input.print(Exit::of(&problems), &problems, results(Some(&summary)), text, out, err)
        }
        Err((exit, problems)) => flags.input.print(exit, &problems, results(None), &[], out, err),
    }
}

fn work(args: &Args) -> Result<(Summary, Problems), Refusal> {
    let input = &args.flags.input;
    let opened = open(&input.file, input.leniency()).map_err(refused)?;
    args.flags.task((!args.noise_free).then_some(args.seed)).run(&opened, &input.file, &input.leniency())
}

/// A record to be simulated: that of `simulate`, and without noise that of `predict`.
pub(crate) struct Task<'a> {
    pub(crate) trajectory: &'a Path,
    pub(crate) out: &'a Path,
    /// Seed of the noise; none for exact readings.
    pub(crate) seed: Option<u64>,
    pub(crate) hold: f64,
    pub(crate) force: bool,
}

impl Task<'_> {
    /// Simulates at the nominal values of what was opened from `file`, and writes.
    pub(crate) fn run(
        &self,
        opened: &Opened,
        file: &Path,
        leniency: &Leniency,
    ) -> Result<(Summary, Problems), Refusal> {
        if !(self.hold >= 0.0 && self.hold.is_finite()) {
            let p = Problem::error(Area::Config, "Config::OutOfRange", format!("value {} s, limit >= 0 s", self.hold));
            return Err(refused(Problems(vec![p.on("--hold").hint("give seconds of 0 or more")])));
        }
        let mission = results::mission(opened, file).map_err(refused)?;
        if self.out.exists() && !self.force {
            return Err(io(Failure::Exists { path: self.out.to_owned() }));
        }
        let given = plan_command::load(self.trajectory, opened).map_err(refused)?;
        let mut problems = opened.warnings.clone();
        problems.extend(given.warnings);
        leniency.settle(&mut problems);
        if problems.has_errors() {
            return Err(refused(problems));
        }
        let (model, rate) = (&opened.model, mission.sensors.rate_hz);
        // No longer than what is read again.
        let samples = (given.motion.duration() + self.hold) * rate;
        let most = Limit::AtMost(ReadOptions::default().max_rows as f64);
        if !most.admits(samples) {
            let p = Problem::out_of_range(Area::Config, "Config::OutOfRange", samples, most, "samples");
            return Err(refused(Problems(vec![p.on("--hold").hint("hold for less, or sample at a lower rate")])));
        }
        let numerical = |code, what: String, hint: &str| {
            (Exit::Numerical, Problems(vec![Problem::error(Area::Config, code, what).in_file(file).hint(hint)]))
        };
        let inputs: Vec<_> = opened.inputs.iter().map(Declared::as_input).collect();
        let hint = if inputs.is_empty() {
            "excite less, or check the parameters"
        } else {
            "excite less, or check the parameters and the size of every [[input]]"
        };
        let trace = fly(model, &Params::nominal(model), given.motion.as_ref(), &inputs, rate, self.hold)
            .map_err(|e| numerical("Sim::Failed", e.to_string(), hint))?;
        let sensors = suite(&mission.sensors);
        let noise = self.seed.map(|s| (&sensors, current_channel(&mission.sensors), s));
        let motors = MotorSide::of(model, &trace, &mission.drives);
        let bytes = csv(model, &trace, &motors, rate, noise)
            .map_err(|e| numerical("Sim::NotFinite", e.to_string(), "please report this"))?;
        atomic::write(self.out, &bytes).map_err(io)?;
        let sha256 = Entry::of(self.out, "").map_err(io)?.sha256;
        let summary = Summary {
            file: self.out.to_owned(),
            sha256,
            samples: trace.len(),
            rate_hz: rate,
            seconds: (trace.len() - 1) as f64 / rate,
            seed: self.seed,
            acted: Acted::of(inputs.len(), &trace),
        };
        Ok((summary, problems))
    }
}
