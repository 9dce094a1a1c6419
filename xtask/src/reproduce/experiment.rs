//! Trajectories and simulations of one case.

use anyhow::Context;
use excitation::JointLimits;
use excitation::SensorNoise;
use excitation::plan::{Extent, Shape};
use excitation::planning::{InformationRequest, Quietness};
use excitation::random_plan;
use excitation::{Duration, End, PlanSpec, SplinePlan};
use excitation::{JointCommand, Manoeuvre, ManoeuvreSpec};
use excitation::{plan_information, plan_quiet};
use ff_dynamics::motion::JointMotion;
use ff_dynamics::motion::bspline::BSplineMotion;
use ff_dynamics::{Boundary, Mode, SensorSuite, SimOptions, Trace, modes};
use ff_mission::mission::Reproduce;
use ff_mission::{LoadOptions, Loaded, Mission};
use ff_model::{Area, Model, Params, Problem, Problems};
use ffid::sense::{from_rest, suite};
use ident::Noise;
use indicatif::ProgressBar;
use std::path::Path;

/// Integration step of the simulated truth (s).
const STEP: f64 = 1e-3;

/// Everything simulated for one case, before any identification.
pub(super) struct Experiment {
    pub(super) name: String,
    pub(super) loaded: Loaded,
    pub(super) seed: u64,
    pub(super) quick: bool,
    /// The true system and its rigid counterpart (appendages frozen at rest).
    pub(super) params: Params<f64>,
    pub(super) rigid: Model,
    pub(super) rigid_params: Params<f64>,
    pub(super) sensors: SensorSuite,
    pub(super) noise: Noise,
    /// Ringing after the manoeuvre: the whole trace, and when the joints stand still.
    pub(super) ringing: Trace,
    pub(super) ring_from: f64,
    pub(super) modes: Vec<Mode>,
    pub(super) cantilever: Vec<Mode>,
    /// The rigid satellite on the quiet trajectory, and the flexible one on the identification trajectory.
    pub(super) rigid_trace: Trace,
    pub(super) trace: Trace,
    /// Trajectory along which models are compared.
    pub(super) reference: BSplineMotion,
    pub(super) reference_options: SimOptions,
    pub(super) end_effector: String,
}

impl Experiment {
    pub(super) fn run(mission: &Path, quick: bool, bar: &ProgressBar) -> anyhow::Result<Self> {
        let name = mission.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let say = |what: &str| bar.set_message(format!("{name}: {what}"));
        say("mission file");
        let loaded = Mission::load(mission, &ffid::default_registry(), &LoadOptions::default())?;
        let section = |what: &str| refused("Config::MissingKey", what.to_owned(), mission);
        let r = loaded.mission.reproduce.clone().ok_or_else(|| section("section [reproduce] is missing"))?;
        let end_effector = loaded.mission.robot.end_effector.clone();
        let end_effector = end_effector.ok_or_else(|| section("robot.end_effector is missing"))?;
        let m = &loaded.model;
        let s = &loaded.mission.sensors;
        let sensors = suite(s);
        let noise = Noise { torque: sensors.torque.sigma(), gyro: sensors.gyro.sigma() };
        let params = Params::nominal(m);
        let rigid = m.frozen(&params);
        let rigid_params = Params::nominal(&rigid);
        let limits = limits(&loaded);
        let rest = m.rest_position(&params);
        let modes_at = |b| modes(m, &params, &r.hold_rad, &rest, b);
        let (free, cantilever) = (modes_at(Boundary::JointsHeld)?, modes_at(Boundary::BaseHeld)?);

        say("manoeuvre and ringing");
        let sample_s = 1.0 / s.rate_hz;
        let manoeuvre = manoeuvre(&loaded, &r, &free, sample_s, quick)?;
        let ringing = truth(m, &params, &manoeuvre, sample_s)?;
        say("planning");
        let scale = if quick { 0.4 } else { 1.0 };
        let request = InformationRequest {
            start: r.hold_rad.clone(),
            end: End::Free,
            limits: limits.clone(),
            duration: (r.identification_s * scale).round(),
            control_points: if quick { 8 } else { r.control_points as usize },
            seed: r.seed,
            starts: if quick { 1 } else { 2 },
            noise: SensorNoise { torque: noise.torque, gyro: Some(noise.gyro), rate: s.rate_hz },
            options: Default::default(),
        };
        let base: Vec<usize> = (0..10).collect();
        let loud = plan_information(m, &params, &base, &request).context("identification trajectory")?;
        let quiet_request = InformationRequest { control_points: 10.min(request.control_points), ..request.clone() };
        let quiet = plan_quiet(m, &params, &base, &quiet_request, &Quietness::Modes { emphasis: 3.0 });
        let quiet = quiet.context("quiet trajectory for the rigid identification")?;
        say("simulation");
        let rigid_trace = truth(&rigid, &rigid_params, &quiet.motion, sample_s)?;
        let trace = truth(m, &params, &loud.motion, sample_s)?;
        let reference = reference(&r, &limits, scale)?;
        let reference_options = SimOptions { duration_s: reference.duration(), step_s: 2e-3, sample_s: 0.05 };
        Ok(Self {
            ring_from: manoeuvre.ringing().0 + r.settle_s,
            seed: r.seed,
            quick,
            params,
            rigid,
            rigid_params,
            sensors,
            noise,
            ringing,
            modes: free,
            cantilever,
            rigid_trace,
            trace,
            reference,
            reference_options,
            end_effector,
            name,
            loaded,
        })
    }
}

/// A mission file that lacks something this study needs.
fn refused(code: &'static str, what: String, file: &Path) -> Problems {
    Problems(vec![Problem::error(Area::Config, code, what).in_file(file).hint("add it to the mission file")])
}

/// Motion of the true system from rest.
fn truth(m: &Model, p: &Params<f64>, motion: &dyn JointMotion, sample_s: f64) -> anyhow::Result<Trace> {
    Ok(from_rest(m, p, motion, &SimOptions { duration_s: motion.duration(), step_s: STEP, sample_s })?)
}

fn limits(l: &Loaded) -> Vec<JointLimits> {
    ffid::workflow::preflight::joint_limits(&l.model, &l.mission.limits)
}

/// The paper's simplified manoeuvre: the named joints at full speed and acceleration, there and back, timed at
/// half a period of the mode that turns the base most; then hold.
fn manoeuvre(l: &Loaded, r: &Reproduce, modes: &[Mode], grid: f64, quick: bool) -> anyhow::Result<Manoeuvre> {
    let names = l.model.joint_names();
    let limits = limits(l);
    let turning = modes.iter().max_by(|a, b| {
        let turn = |m: &Mode| m.base.fixed_rows::<3>(3).norm();
        turn(a).total_cmp(&turn(b))
    });
    let frequency = turning.map_or(0.1, |m| m.frequency_hz);
    let commands = r
        .manoeuvre_joints
        .iter()
        .map(|n| {
            let joint = names.iter().position(|x| x == n);
            let joint = joint.ok_or_else(|| {
                refused(
                    "Config::UnknownJoint",
                    format!("manoeuvre_joints: no joint '{n}'"),
                    Path::new(&l.mission.robot.urdf),
                )
            })?;
            Ok(JointCommand {
                joint,
                shape: Shape::Doublet,
                extent: Extent::HalfPeriod { frequency, negative: false },
                velocity: limits[joint].velocity,
                acceleration: limits[joint].acceleration,
            })
        })
        .collect::<anyhow::Result<Vec<_>>>()?;
    let spec = ManoeuvreSpec {
        start: r.hold_rad.clone(),
        commands,
        ramp: 0.1,
        lead: 1.0,
        hold: if quick { 0.6 * r.record_s } else { r.record_s },
        grid: Some(grid),
    };
    Ok(Manoeuvre::new(&spec)?)
}

/// A random plan at the limits: a trajectory that no identification has seen.
fn reference(r: &Reproduce, limits: &[JointLimits], scale: f64) -> anyhow::Result<BSplineMotion> {
    let spec = PlanSpec {
        start: r.hold_rad.clone(),
        end: End::Free,
        duration: Duration::Fixed(r.reference_s * scale),
        degree: 5,
        free: 8,
        limits: limits.to_vec(),
        refine: 2,
    };
    let plan = SplinePlan::new(spec)?;
    let stream = r.trajectory_seeds.first().copied().unwrap_or(1);
    Ok(plan.motion(&random_plan(&plan, r.seed, 1000 + stream, 1.0)?)?)
}
