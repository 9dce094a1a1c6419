//! `ffid plan`: what will this trajectory tell, and what does it do to the robot?

use crate::output::{Input, Outcome};
use crate::results;
use crate::results::Output;
use excitation::TrajectoryFile;
use excitation::plan::LimitReport;
use excitation::trajectory::Samples;
use ff_dynamics::motion::JointMotion;
use ff_model::{Area, Problem, Problems};
use ffid::exit::Exit;
use ffid::open::{Opened, open};
use ffid::workflow::preflight::{Preflight, joint_limits, motion_of, prove};
use serde::Serialize;
use std::fmt::Display;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Speed at an end, relative to the largest, below which a joint counts as resting: a spline through samples of a motion from rest is
/// loose there.
const AT_REST: f64 = 1e-3;
/// The same in rad/s or m/s, for motions that hardly are: rounding leaves a spline through one pose a rate.
const STILL: f64 = 1e-9;

/// Examples for `--help`.
pub(crate) const EXAMPLES: &str = "Examples:
  ffid plan m.toml --trajectory m-information/trajectory.json
  ffid plan m.toml --trajectory mine.csv --out verdict

A trajectory is a trajectory.json of `ffid excite`, or a CSV file with a column time[s], a column q.<joint>[rad] (or
[deg], [m]) for every joint, and optionally qd.<joint>[rad/s] and qdd.<joint>[rad/s^2] for all of them. Positions alone
are fitted by a spline. `ffid excite` plans a trajectory; `ffid plan` judges one. Broken limits end with exit code 13.";

/// Arguments of `ffid plan`.
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    input: Input,
    /// The trajectory to judge: .json of `ffid excite`, or .csv.
    #[arg(long, value_name = "FILE")]
    trajectory: PathBuf,
    /// Folder for verdict, report and figures; printed only unless given.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) output: Output,
}

/// Results in JSON; absent when there are none.
#[derive(Default, Serialize)]
struct Results<'a> {
    verdict: Option<&'a Preflight>,
    /// The folder that was written.
    out: Option<&'a PathBuf>,
}

/// A trajectory of a file, with the proof of its joint limits if there can be one.
pub(crate) struct Given {
    pub(crate) motion: Box<dyn JointMotion>,
    pub(crate) proven: Option<LimitReport>,
    pub(crate) warnings: Problems,
}

pub(crate) fn load(path: &Path, opened: &Opened) -> Result<Given, Problems> {
    let model = &opened.model;
    let csv = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv"));
    if csv {
        let (samples, warnings) = Samples::load(path, model)?;
        of_samples(&samples, warnings, opened, path)
    } else {
        of_trajectory(TrajectoryFile::load(path, model)?, opened, path)
    }
}

/// A problem of the trajectory in the file `path`.
fn unusable(path: &Path, what: String, hint: &str) -> Problems {
    Problems(vec![Problem::error(Area::Data, "Data::Unusable", what).in_file(path).hint(hint)])
}

/// The motion through samples; `path` is what problems name.
pub(crate) fn of_samples(
    samples: &Samples,
    mut warnings: Problems,
    opened: &Opened,
    path: &Path,
) -> Result<Given, Problems> {
    let motion = motion_of(samples).map_err(|e| unusable(path, e, "sample the trajectory more finely and evenly"))?;
    warnings.extend(ends(motion.as_ref(), &opened.model.joint_names(), path));
    Ok(Given { motion, proven: None, warnings })
}

/// The motion of a trajectory of this robot, whose limits are proven for all time; `path` is what problems name.
pub(crate) fn of_trajectory(file: TrajectoryFile, opened: &Opened, path: &Path) -> Result<Given, Problems> {
    let model = &opened.model;
    let limits = opened.mission.as_ref().map(|m| &m.limits).cloned().unwrap_or_default();
    let proven = prove(&file.trajectory, &joint_limits(model, &limits))
        .map_err(|e| unusable(path, e.to_string(), "limit fewer derivatives, or use a smoother trajectory"))?;
    let motion: Box<dyn JointMotion> = match file.trajectory {
        excitation::Trajectory::Spline(m) => Box::new(m),
        excitation::Trajectory::Manoeuvre(_, m) => Box::new(m),
    };
    let warnings = ends(motion.as_ref(), &model.joint_names(), path);
    Ok(Given { motion, proven: Some(proven), warnings })
}

/// The verdict starts from rest; a motion that does not is judged all the same, with a warning.
fn ends(motion: &dyn JointMotion, names: &[String], path: &Path) -> Problems {
    let n = motion.dof();
    let at = |t: f64| {
        let (mut q, mut qd, mut qdd) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        motion.eval(t, &mut q, &mut qd, &mut qdd);
        qd
    };
    let duration = motion.duration();
    let most = (0..=200).flat_map(|k| at(duration * f64::from(k) / 200.0)).fold(0.0f64, |m, x| m.max(x.abs()));
    let mut out = Problems::default();
    for (word, t) in [("starts", 0.0), ("ends", duration)] {
        let qd = at(t);
        let moving: Vec<&str> =
            (0..n).filter(|&j| qd[j].abs() > (AT_REST * most).max(STILL)).map(|j| names[j].as_str()).collect();
        if !moving.is_empty() {
            let what = format!(
                "the trajectory {word} with {} moving; the verdict takes base and appendages at rest before",
                moving.join(", ")
            );
            let p = Problem::warning(Area::Data, "Data::NotAtRest", what).in_file(path);
            out.push(p.hint("begin and end with all joints at rest"));
        }
    }
    out
}

/// Judges, writes when asked to, and prints.
pub(crate) fn run(args: &Args, out: &mut impl Write, err: &mut impl Write) -> Outcome {
    let input = &args.input;
    let refuse = |exit: Exit, problems: &Problems, out: &mut dyn Write, err: &mut dyn Write| {
        input.print(exit, problems, Results::default(), &[], &mut &mut *out, &mut &mut *err)
    };
    let opened = match open(&input.file, input.leniency()) {
        Ok(o) => o,
        Err(p) => return refuse(Exit::of(&p), &p, out, err),
    };
    let loaded = results::undisturbed(&opened, &input.file).and_then(|m| Ok((m, load(&args.trajectory, &opened)?)));
    let (mission, given) = match loaded {
        Ok(l) => l,
        Err(p) => return refuse(Exit::of(&p), &p, out, err),
    };
    let mut files = results::mission_files(&input.file, mission);
    files.push(args.trajectory.clone());
    let begun = results::inputs(&files)
        .and_then(|i| Ok((i, args.out.as_ref().map(|o| results::begin(o, &args.output, err)).transpose()?)));
    let (inputs, folder) = match begun {
        Ok(b) => b,
        Err(e) => {
            let (exit, p) = results::failed(&e);
            return refuse(exit, &Problems(vec![p]), out, err);
        }
    };
    let start = ffid::workflow::preflight::start_pose(given.motion.as_ref());
    let judged = ffid::workflow::excite::demands(&opened, &mission.limits, &start, &input.file)
        .map_err(|p| (Exit::of(&p), p))
        .and_then(|d| results::verdict(&opened, mission, given.motion.as_ref(), given.proven.as_ref(), &d));
    let verdict = match judged {
        Ok(v) => v,
        Err((exit, problems)) => return refuse(exit, &problems.in_file(&args.trajectory), out, err),
    };
    let mut problems = opened.warnings.clone();
    problems.extend(given.warnings);
    input.leniency().settle(&mut problems);
    let mut faults = results::faults(&verdict);
    let mut exit = results::exit_of(&problems, &mut faults, &input.leniency());
    problems.extend(faults);
    if let Some(p) = results::changed(&inputs, &files) {
        exit = Exit::Data;
        problems.push(p);
    }
    let mut written = None;
    if let Some(folder) = folder {
        let about = results::about("plan", 0, &[("trajectory", args.trajectory.display().to_string())], inputs);
        let wrote = results::write(&folder, None, &verdict, None, args.output.png);
        match wrote.and_then(|()| folder.finish(&about)) {
            Ok(()) => written = args.out.as_ref(),
            Err(e) => {
                let (code, p) = results::failed(&e);
                exit = code;
                problems.push(p);
            }
        }
    }
    let text: [Option<&dyn Display>; 1] = [Some(&verdict)];
    let text = if args.output.quiet { &[][..] } else { &text[..] };
    input.print(exit, &problems, Results { verdict: Some(&verdict), out: written }, text, out, err)
}
