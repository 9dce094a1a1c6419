//! A life: ten records of 20 s in each world. Fuel changes by N(-1, 1.5^2) kg between them, and the biases of the gyro walk by
//! 1e-5 rad/s in a root second within them, as the mission says. All ten are identified together; parameters, the fuel at every record and the
//! biases over time are held against what was drawn.

use crate::study::figures::Study;
use crate::study::options::Options;
use crate::study::trials::{Number, Trial, Trials};
use crate::study::verdict::world::{Encoder, Readings, World};
use crate::workspace;
use anyhow::Context;
use excitation::TrajectoryFile;
use ff_dynamics::SimOptions;
use ff_dynamics::motion::JointMotion;
use ff_mission::mission::Changes;
use ff_model::Params;
use ffid::exit::Exit;
use ffid::open::Opened;
use ffid::sense::from_rest;
use ffid::workflow::identify::{Course, CoursePoint, LabelledRecord, State};
use nalgebra::DMatrix;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

/// Worlds, and records of each.
const WORLDS: u64 = 300;
const RECORDS: usize = 10;
/// Length (s), sampling and step of the simulation.
const SECONDS: f64 = 20.0;
const SAMPLE_S: f64 = 0.02;
const STEP_S: f64 = 0.005;
/// What changes, and by how much from record to record: mean and standard deviation (kg).
const FUEL: &str = "tank.mass";
const STEP: (f64, f64) = (-1.0, 1.5);
/// Walk of the biases of the gyro (rad/s/sqrt(s)).
const WALK: f64 = 1e-5;

/// What is held against the truth.
const GROUPS: [&str; 5] = ["base", "stiffness", "damping", "fuel", "bias"];

/// What came of a world.
#[derive(Serialize, Deserialize)]
struct Outcome {
    exit: u8,
    contradicted: bool,
    chi2_per_dof: Number,
    /// Place in [`GROUPS`], and distance from the truth in stated deviations.
    off: Vec<(usize, Number)>,
    said: String,
}

/// What was drawn: fuel at each record (kg), biases at each sample (rad/s).
struct Drawn {
    fuel: Vec<f64>,
    biases: Vec<DMatrix<f64>>,
}

/// Runs the part.
pub(super) fn run(world: &World, trials: &Trials, options: &Options, study: &mut Study) -> anyhow::Result<()> {
    let listed = options.cases();
    let numbers = if listed.is_empty() { (0..if options.quick { 1 } else { WORLDS }).collect() } else { listed };
    let path = workspace::root()?.join("fixtures/verdict/m1.json");
    let motion = TrajectoryFile::load(&path, &world.truth.model)?.trajectory;
    let opened = mission(world)?;
    let all = trials.run("life", numbers.iter().copied(), |t| one(world, &opened, motion.motion(), t))?;
    study.figure("life.worlds", "", all.len() as f64);
    study.contradicted(options.quick, "life.", all.iter().map(|o| (o.contradicted, o.exit)));
    for (g, group) in GROUPS.iter().enumerate() {
        let of: Vec<f64> = all.iter().flat_map(|o| &o.off).filter(|x| x.0 == g).map(|x| x.1.0).collect();
        study.covered(options.quick, &format!("life.{group}"), &of);
    }
    for (k, o) in numbers.iter().zip(&all).filter(|(_, o)| o.exit != Exit::Done.code()) {
        study.note(format!("life {k}: exit {}, {}", o.exit, o.said));
    }
    Ok(())
}

/// The mission that says what changes.
fn mission(world: &World) -> anyhow::Result<Opened> {
    let mut opened = world.start.clone();
    let mission = opened.mission.as_mut().context("no mission")?;
    mission.sensors.gyro.bias_walk_rad_per_s_per_sqrt_s = Some(WALK);
    mission.changes.push(Changes {
        parameters: vec![FUEL.to_owned()],
        step_std: Some(STEP.1),
        step_relative_std: None,
        step_mean: STEP.0,
    });
    Ok(opened)
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// Adds biases that walk to the readings of a gyro, and returns them.
fn walk(gyro: &mut DMatrix<f64>, rng: &mut ChaCha8Rng) -> DMatrix<f64> {
    let mut biases = DMatrix::zeros(gyro.nrows(), gyro.ncols());
    for i in 1..gyro.nrows() {
        for a in 0..gyro.ncols() {
            biases[(i, a)] = biases[(i - 1, a)] + WALK * SAMPLE_S.sqrt() * normal(rng);
        }
    }
    *gyro += &biases;
    biases
}

/// Draws a life.
fn records(
    world: &World,
    motion: &dyn JointMotion,
    rng: &mut ChaCha8Rng,
) -> anyhow::Result<(Vec<LabelledRecord>, Drawn)> {
    let mut model = world.truth.model.clone();
    let decls = model.param_decls();
    let tank = decls.iter().position(|d| d.name == FUEL).context("no tank")?;
    let mut fuel = decls[tank].nominal;
    let (mut out, mut drawn) = (Vec::new(), Drawn { fuel: Vec::new(), biases: Vec::new() });
    let options = SimOptions { duration_s: SECONDS, step_s: STEP_S, sample_s: SAMPLE_S };
    for k in 0..RECORDS {
        if k > 0 {
            fuel += STEP.0 + STEP.1 * normal(rng);
        }
        model.set_nominal(&[(tank, fuel)])?;
        let trace = from_rest(&model, &Params::nominal(&model), motion, &options)?;
        let gyro = trace.gyro();
        let mut r = Readings { rate_hz: 1.0 / SAMPLE_S, q: trace.q, qd: trace.qd, tau: trace.tau, gyro };
        world.noise(&mut r, Encoder::Noisy, rng);
        drawn.biases.push(walk(&mut r.gyro, rng));
        drawn.fuel.push(fuel);
        out.push(world.labelled(&format!("r{k}"), &r)?);
    }
    Ok((out, drawn))
}

/// One world, identified.
fn one(world: &World, opened: &Opened, motion: &dyn JointMotion, t: Trial) -> anyhow::Result<Outcome> {
    let (mut records, drawn) = records(world, motion, &mut t.rng())?;
    let found = match world.identify_all(opened, &mut records) {
        Ok(found) => found.result,
        Err(e) => return Ok(Outcome::refused(e.to_string())),
    };
    let truth = world.truth.model.param_decls();
    let mut off = Vec::new();
    for p in found.parameters.iter().filter(|p| p.name != FUEL) {
        let Some(group) = group(&p.name) else { continue };
        let of = truth.iter().find(|d| d.name == p.name).map_or(f64::NAN, |d| d.nominal);
        off.push((group, Number((p.value - of) / p.std.unwrap_or(f64::NAN))));
    }
    for course in &found.over_time {
        let group = if course.name == FUEL { 3 } else { 4 };
        for (i, p) in course.points.iter().enumerate() {
            let of = drawn.of(course, i, p)?;
            off.push((group, Number((p.value - of) / p.std.unwrap_or(f64::NAN))));
        }
    }
    let evidence = found.evidence.clone().unwrap_or_default();
    Ok(Outcome {
        exit: found.exit().code(),
        contradicted: evidence.state == State::Contradicted,
        chi2_per_dof: Number(found.chi2_per_dof),
        off,
        said: evidence.named.first().map_or(evidence.reason, |n| n.name.clone()),
    })
}

impl Outcome {
    fn refused(why: String) -> Self {
        let exit = Exit::Numerical.code();
        Self { exit, contradicted: false, chi2_per_dof: Number(f64::NAN), off: Vec::new(), said: why }
    }
}

/// Stiffnesses of the tank count as such.
fn group(name: &str) -> Option<usize> {
    if name.starts_with("base.") {
        Some(0)
    } else if name.contains(".k[") {
        Some(1)
    } else {
        name.contains(".d[").then_some(2)
    }
}

impl Drawn {
    /// What a point of a course was drawn as.
    fn of(&self, course: &Course, number: usize, point: &CoursePoint) -> anyhow::Result<f64> {
        let unknown = || format!("{} of {:?} was not drawn", course.name, course.record);
        let Some(record) = &course.record else { return self.fuel.get(number).copied().with_context(unknown) };
        let record: usize = record.trim_start_matches('r').parse().with_context(unknown)?;
        let axis =
            ["x", "y", "z"].iter().position(|a| course.name == format!("gyro.bias.{a}")).with_context(unknown)?;
        let biases = self.biases.get(record).with_context(unknown)?;
        let sample = ((point.at / SAMPLE_S).round() as usize).min(biases.nrows() - 1);
        Ok(biases[(sample, axis)])
    }
}
