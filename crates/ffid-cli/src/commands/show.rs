//! `ffid show`: the robot of a mission in 3-D, before any data exist.

use crate::commands::plan;
use crate::output::{Input, Outcome};
use crate::replay::{appearance, flown};
use crate::results::{Refusal, io_hint, refused};
use ff_model::{Area, Params, Problem, Problems};
use ff_report::replay::{Replay, Scene, Subject};
use ffid::exit::{Exit, Failure};
use ffid::files::atomic;
use ffid::inputs::Declared;
use ffid::open::{Opened, open};
use serde::Serialize;
use std::fmt;
use std::fmt::Display;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Rate at which a URDF alone, which names no sensors, is simulated (Hz).
const RATE_HZ: f64 = 100.0;

/// Examples for `--help`.
pub(crate) const EXAMPLES: &str = "Examples:
  ffid show m.toml                                            m-replay.html: is the wing where I think it is?
  ffid show m.toml --trajectory m-information/trajectory.json   and what the plan does to it
  ffid show m-identified/identified.toml --beside truth.toml --out both.html
  ffid show robot.urdf

The page is one file that needs no network: bodies from their meshes or their inertia, panels that bend, fuel that swings, natural modes
with frequency and damping (docs/replay.md). `ffid identify` writes the like as replay.html, with the record's motion.";

/// Arguments of `ffid show`.
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    input: Input,
    /// The joint motion: .json of `ffid excite`, or .csv. Without it the robot stands in its pose, and its modes can be played.
    #[arg(long, value_name = "FILE")]
    trajectory: Option<PathBuf>,
    /// Seconds to go on after the end of the motion, joints held.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0, requires = "trajectory")]
    hold: f64,
    /// Another mission of the same robot, drawn beside it: the truth, an earlier identification.
    #[arg(long, value_name = "FILE")]
    beside: Option<PathBuf>,
    /// The page to write; <file>-replay.html in the working directory unless given.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Replace an existing file.
    #[arg(long)]
    force: bool,
    /// Print problems only.
    #[arg(long)]
    quiet: bool,
}

/// What was written.
#[derive(Serialize)]
pub(crate) struct Summary {
    file: PathBuf,
    bytes: usize,
    robots: Vec<String>,
    modes: usize,
    /// Absent without a motion.
    #[serde(skip_serializing_if = "Option::is_none")]
    seconds: Option<f64>,
}

impl Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let motion = self.seconds.map_or_else(|| "no motion".to_owned(), |s| format!("{s:.2} s of motion"));
        let robots = self.robots.join(" and ");
        writeln!(f, "{}: {robots}, {} modes, {motion}, {} bytes", self.file.display(), self.modes, self.bytes)
    }
}

/// Draws, writes and prints.
pub(crate) fn run(args: &Args, out: &mut impl Write, err: &mut impl Write) -> Outcome {
    args.input.print_done("replay", work(args), args.quiet, out, err)
}

fn stem(file: &Path) -> String {
    file.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

fn work(args: &Args) -> Result<(Summary, Problems), Refusal> {
    let input = &args.input;
    if !(args.hold >= 0.0 && args.hold.is_finite()) {
        let p = Problem::error(Area::Config, "Config::OutOfRange", format!("value {} s, limit >= 0 s", args.hold));
        return Err(refused(Problems(vec![p.on("--hold").hint("give seconds of 0 or more")])));
    }
    let target = args.out.clone().unwrap_or_else(|| PathBuf::from(format!("{}-replay.html", stem(&input.file))));
    if target.exists() && !args.force {
        return Err(io_hint(Failure::Exists { path: target }, "--out"));
    }
    let files: Vec<&Path> = [input.file.as_path()].into_iter().chain(args.beside.as_deref()).collect();
    let mut problems = Problems::default();
    let mut robots = Vec::new();
    for file in &files {
        let opened = open(file, input.leniency()).map_err(refused)?;
        problems.extend(opened.warnings.clone());
        robots.push(opened);
    }
    let surfaces = appearance(&robots[0], files[0], &mut problems);
    let mut scenes = Vec::new();
    let mut seconds = None;
    for (opened, file) in robots.iter().zip(&files) {
        let params = Params::nominal(&opened.model);
        let trace = match &args.trajectory {
            Some(path) => {
                let given = plan::load(path, opened).map_err(refused)?;
                problems.extend(given.warnings);
                let inputs: Vec<_> = opened.inputs.iter().map(Declared::as_input).collect();
                let trace = flown(opened, &params, given.motion.as_ref(), &inputs, rate(opened), args.hold);
                Some(trace.map_err(|p| (Exit::Numerical, p.in_file(*file)))?)
            }
            None => None,
        };
        seconds = trace.as_ref().map(|t| t.dt * (t.len() - 1) as f64);
        let label = match (scenes.is_empty(), stem(file)) {
            (false, name) if name == stem(files[0]) => format!("{name} (other)"),
            (_, name) => name,
        };
        scenes.push(Scene::new(&Subject {
            label: &label,
            model: &opened.model,
            params: &params,
            pose: &opened.pose(),
            trace: trace.as_ref(),
            known: None,
            // Meshes belong to the robot of the first file.
            appearance: &surfaces,
        }));
    }
    input.leniency().settle(&mut problems);
    if problems.has_errors() {
        return Err(refused(problems));
    }
    let names: Vec<String> = scenes.iter().map(|s| s.label.clone()).collect();
    let modes = scenes[0].modes.len();
    let mut replay = Replay::new(robots[0].model.name(), scenes, surfaces);
    if args.trajectory.is_some() {
        replay.notes.push("The motion is simulated from rest, without noise.".to_owned());
    }
    let html = replay.render().map_err(|e| io_hint(e, "--out"))?;
    atomic::write(&target, html.as_bytes()).map_err(|e| io_hint(e, "--out"))?;
    Ok((Summary { file: target, bytes: html.len(), robots: names, modes, seconds }, problems))
}

fn rate(opened: &Opened) -> f64 {
    opened.mission.as_ref().map_or(RATE_HZ, |m| m.sensors.rate_hz)
}
