//! `ffid init`: a first mission file from a URDF.

use crate::output::{Input, Outcome};
use crate::results;
use crate::results::{Refusal, refused};
use ff_mission::urdf;
use ff_mission::urdf::UrdfOptions;
use ff_mission::{LoadOptions, Mission};
use ff_model::diagnostics::{list, text_file};
use ff_model::{Area, BaseKind, Problem, Problems};
use ffid::exit::Failure;
use ffid::files::atomic;
use ffid::init::{Guess, Known, Tank, mission};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;
use std::fmt::Display;
use std::io::Write;
use std::path::{Component, Path, PathBuf};

/// Examples for `--help`.
pub(crate) const EXAMPLES: &str = "Examples:
  ffid init robot.urdf                                      into mission.toml
  ffid init robot.urdf -o m.toml --stiffness 200 --damping 2 --torque-noise 0.1 --gyro-noise 1.5e-4
  ffid init robot.urdf --stiffness wing_1=120 --stiffness wing_2=90 --damping 0.8
  ffid init robot.urdf --tank 64,0.5,12,2 --tank-at -0.2,0.1,0.3     fuel in the base as a pendulum
  ffid init arm.urdf --fixed -o ground.toml                 an arm on the ground, under gravity

Guessed are the base (root of the tree), the arm (longest chain of driven joints), its end, and panels (other chains of hinges
on the base: effort limit 0, or called panel, wing, boom, ...). Fingers and wheels are held (lock). What a URDF cannot tell is commented out with its unit, so the
file passes `ffid check` at once. A panel without stiffness and damping is commented out: its hinges then count as driven.";

/// A number, for all hinges or for one: `200` or `wing_1=200`.
#[derive(Clone, Debug)]
pub(crate) struct OfHinge {
    joint: Option<String>,
    value: f64,
}

fn of_hinge(text: &str) -> Result<OfHinge, String> {
    let (joint, number) = match text.rsplit_once('=') {
        Some((j, x)) => (Some(j.to_owned()), x),
        None => (None, text),
    };
    match number.parse::<f64>() {
        Ok(value) if value.is_finite() && value >= 0.0 => Ok(OfHinge { joint, value }),
        _ => Err(format!("'{number}' is not a number of 0 or more; write VALUE or JOINT=VALUE")),
    }
}

/// Exactly `N` numbers, separated by commas.
fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let all: Vec<f64> = text.split(',').filter_map(|x| x.trim().parse().ok()).filter(|x: &f64| x.is_finite()).collect();
    let wrong = || format!("give {N} numbers, separated by commas and without blanks");
    if text.split(',').count() != N {
        return Err(wrong());
    }
    all.try_into().map_err(|_| wrong())
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x.is_finite() && x > 0.0 => Ok(x),
        _ => Err("give a number above 0".to_owned()),
    }
}

/// Arguments of `ffid init`.
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    input: Input,
    /// The mission file to write.
    #[arg(short, long, value_name = "FILE", default_value = "mission.toml")]
    out: PathBuf,
    /// The base is bolted to the ground, under gravity.
    #[arg(long)]
    fixed: bool,
    /// Stiffness of the hinges of panels (N m/rad), of all or of one joint.
    #[arg(long, value_name = "[JOINT=]K", value_parser = of_hinge)]
    stiffness: Vec<OfHinge>,
    /// Damping of the hinges of panels (N m s/rad), of all or of one joint.
    #[arg(long, value_name = "[JOINT=]D", value_parser = of_hinge)]
    damping: Vec<OfHinge>,
    /// Sample rate of all sensors (Hz).
    #[arg(long, value_name = "HZ", value_parser = positive)]
    rate_hz: Option<f64>,
    /// Standard deviation of the torque sensors (N m).
    #[arg(long, value_name = "NM", value_parser = positive)]
    torque_noise: Option<f64>,
    /// Standard deviation of the gyro (rad/s).
    #[arg(long, value_name = "RAD_PER_S", value_parser = positive, conflicts_with = "fixed")]
    gyro_noise: Option<f64>,
    /// Fuel in the base as a pendulum: mass (kg), length (m), stiffness (N m/rad), damping (N m s/rad).
    #[arg(long, value_name = "MASS,LENGTH,K,D", value_parser = numbers::<4>, conflicts_with = "fixed")]
    tank: Option<[f64; 4]>,
    /// Where the pendulum hangs, in the frame of the base link (m).
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers::<3>, requires = "tank", allow_hyphen_values = true)]
    tank_at: Option<[f64; 3]>,
    /// Replace an existing file.
    #[arg(long)]
    force: bool,
    /// Print problems only.
    #[arg(long)]
    quiet: bool,
}

/// What was guessed, and where it stands.
#[derive(Serialize)]
struct Started {
    mission: PathBuf,
    #[serde(flatten)]
    guess: Guess,
    /// Panels that are lifted out of the tree, by name; the others are commented out.
    lifted: Vec<String>,
}

impl Display for Started {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let g = &self.guess;
        writeln!(f, "{}: a mission for base {}", self.mission.display(), g.base)?;
        match &g.end_effector {
            Some(e) => writeln!(f, "  arm of {} joints, {} to {e}", g.arm.len(), g.arm[0])?,
            None => writeln!(f, "  no arm: no joint is driven")?,
        }
        for p in &g.panels {
            let state = if self.lifted.contains(&p.name) {
                "lifted out of the tree"
            } else {
                "commented out: give --stiffness and --damping, or edit the file; until then its joints count as driven"
            };
            writeln!(f, "  panel {} of {} ({}): {state}", p.name, p.joints.join(", "), p.why)?;
        }
        if !g.lock.is_empty() {
            writeln!(f, "  held where they are, not in the record: {}", list(g.lock.iter().map(String::as_str), 12))?;
        }
        if !g.others.is_empty() {
            writeln!(f, "  other joints, left as they are: {}", g.others.join(", "))?;
        }
        writeln!(f, "check the guesses, fill in what is commented out, then: ffid check {}", self.mission.display())
    }
}

/// Guesses, writes and prints.
pub(crate) fn run(args: &Args, out: &mut impl Write, err: &mut impl Write) -> Outcome {
    args.input.print_done("started", work(args), args.quiet, out, err)
}

fn work(args: &Args) -> Result<(Started, Problems), Refusal> {
    let io = |e: Failure| results::io_hint(e, "-o");
    // Before anything else, as for every output: a mission is work that must not be lost.
    if args.out.exists() && !args.force {
        return Err(io(Failure::Exists { path: args.out.clone() }));
    }
    let file = &args.input.file;
    let options = UrdfOptions {
        base_kind: if args.fixed { BaseKind::Fixed } else { BaseKind::Floating },
        leniency: args.input.leniency(),
        ..UrdfOptions::default()
    };
    let (model, _) = urdf::from_file(file, &options).map_err(refused)?;
    let urdf_text = text_file(file, urdf::MAX_BYTES).map_err(refused)?;
    let held =
        urdf::moving_joints(&urdf_text).into_iter().filter(|j| model.bodies().iter().all(|b| b.joint.name != *j));
    let guess = Guess::of(&model).holding(held);
    let known = known(args, &guess).map_err(refused)?;
    let text = mission(&guess, &seen_from(&args.out, file), &known);
    // The promise that the file loads is kept before it is written.
    let load = LoadOptions { leniency: args.input.leniency() };
    let loaded = Mission::from_str(&text, &urdf_text, &ffid::default_registry(), &load);
    let warnings = loaded.map_err(refused)?.warnings;
    // Those of the mission, not of the robot alone: what it lifts or locks is no assumption any more.
    let of_robot = |w: Problem| if w.area == Area::Model && w.file.is_none() { w.in_file(file) } else { w };
    let problems = Problems(warnings.0.into_iter().map(of_robot).collect());
    atomic::write(&args.out, text.as_bytes()).map_err(io)?;
    let lifted = guess.panels.iter().filter(|p| known.springs(p).is_some()).map(|p| p.name.clone()).collect();
    Ok((Started { mission: args.out.clone(), guess, lifted }, problems))
}

/// The flags as numbers of hinges; a joint that is no hinge of a panel is refused.
fn known(args: &Args, guess: &Guess) -> Result<Known, Problems> {
    let mut wrong = Problems::default();
    let hinges = || guess.panels.iter().flat_map(|p| p.joints.iter().map(String::as_str));
    let mut split = |flag: &str, all: &[OfHinge]| {
        let mut of = BTreeMap::new();
        for h in all {
            let Some(j) = &h.joint else { continue };
            if !hinges().any(|k| k == j) {
                let what = format!("no panel has a joint '{}'", ff_model::diagnostics::clip(j));
                let hint = match ff_model::diagnostics::nearest(j, hinges()) {
                    Some(n) => format!("did you mean {n}?"),
                    None => format!("hinges: {}", ff_model::diagnostics::list(hinges(), 12)),
                };
                wrong.push(Problem::error(Area::Config, "Config::UnknownJoint", what).on(flag).hint(hint));
            }
            of.insert(j.clone(), h.value);
        }
        (all.iter().rfind(|h| h.joint.is_none()).map(|h| h.value), of)
    };
    let (stiffness, stiffness_of) = split("--stiffness", &args.stiffness);
    let (damping, damping_of) = split("--damping", &args.damping);
    let known = Known {
        fixed: args.fixed,
        rate_hz: args.rate_hz,
        torque_noise: args.torque_noise,
        gyro_noise: args.gyro_noise,
        stiffness,
        damping,
        stiffness_of,
        damping_of,
        tank: args.tank.map(|[mass, length, stiffness, damping]| Tank {
            at: args.tank_at.unwrap_or_default(),
            mass,
            length,
            stiffness,
            damping,
        }),
    };
    if wrong.has_errors() { Err(wrong) } else { Ok(known) }
}

/// The path of a file as seen from the folder of another; absolute when there is no way between them.
fn seen_from(mission: &Path, urdf: &Path) -> String {
    let folder = mission.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    // Folders that are still to be made are taken as written.
    let folder = folder.canonicalize().or_else(|_| std::path::absolute(folder));
    let (Ok(from), Ok(to)) = (folder, urdf.canonicalize()) else { return urdf.to_string_lossy().into_owned() };
    let (a, b): (Vec<Component<'_>>, Vec<Component<'_>>) = (from.components().collect(), to.components().collect());
    let same = a.iter().zip(&b).take_while(|(x, y)| x == y).count();
    if same == 0 {
        return to.to_string_lossy().into_owned();
    }
    let mut out = PathBuf::new();
    a[same..].iter().for_each(|_| out.push(".."));
    b[same..].iter().for_each(|c| out.push(c));
    // A forward slash is a separator everywhere.
    out.to_string_lossy().replace(std::path::MAIN_SEPARATOR, "/")
}
