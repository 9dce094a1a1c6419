//! One satellite of the study: model, truth, sensors, limits, from the text of a mission.

use anyhow::Context;
use excitation::planning::{InformationRequest, Planned, Quietness};
use excitation::random_plan;
use excitation::{Duration, End, JointLimits, PlanSpec, SensorNoise, SplinePlan};
use excitation::{plan_information, plan_quiet};
use ff_dynamics::motion::JointMotion;
use ff_dynamics::motion::bspline::BSplineMotion;
use ff_dynamics::{Boundary, Mode, SensorSuite, SimOptions, Trace, modes};
use ff_mission::mission::Reproduce;
use ff_mission::{LoadOptions, Loaded, Mission};
use ff_model::{Area, Model, ParamDecl, Params, Problem, Problems};
use ffid::sense::{from_rest, suite};
use ident::Noise;
use ident::parameters::select;
use std::path::{Path, PathBuf};

/// Integration step of the simulated truth (s).
const STEP: f64 = 1e-3;
/// The same along the reference trajectory, and its sampling (s).
const REFERENCE: (f64, f64) = (2e-3, 0.05);
/// Part of the length of every spline of a quick run.
const QUICK: f64 = 0.4;
/// Weight of quietness against information.
const EMPHASIS: f64 = 3.0;

/// A mission of `fixtures/paper` as text, with the text of its robot: what a sweep changes before it is loaded.
#[derive(Clone, Debug)]
pub(super) struct Source {
    pub(super) name: String,
    file: PathBuf,
    mission: String,
    urdf: String,
}

impl Source {
    pub(super) fn read(file: &Path) -> anyhow::Result<Self> {
        let name = file.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let text = |p: &Path| std::fs::read_to_string(p).with_context(|| p.display().to_string());
        let mission = text(file)?;
        let table: toml::Table = mission.parse().with_context(|| file.display().to_string())?;
        let urdf = table.get("robot").and_then(|r| r.get("urdf")).and_then(toml::Value::as_str);
        let urdf = urdf.ok_or_else(|| missing("robot.urdf", file))?;
        let urdf = text(&file.parent().unwrap_or(Path::new("")).join(urdf))?;
        Ok(Self { name, file: file.to_owned(), mission, urdf })
    }
    /// The satellite with its mission changed.
    pub(super) fn with(&self, quick: bool, change: impl FnOnce(&mut toml::Table)) -> anyhow::Result<System> {
        let mut table: toml::Table = self.mission.parse().with_context(|| self.file.display().to_string())?;
        change(&mut table);
        let registry = ffid::default_registry();
        let loaded = Mission::from_str(&table.to_string(), &self.urdf, &registry, &LoadOptions::default())
            .map_err(|p| p.in_file(&self.file))?;
        System::new(self, loaded, quick)
    }
}

/// A satellite.
pub(super) struct System {
    pub(super) name: String,
    pub(super) loaded: Loaded,
    pub(super) reproduce: Reproduce,
    pub(super) quick: bool,
    /// The true system and its rigid counterpart (appendages frozen at rest).
    pub(super) params: Params<f64>,
    pub(super) rigid: Model,
    pub(super) rigid_params: Params<f64>,
    pub(super) sensors: SensorSuite,
    pub(super) noise: Noise,
    pub(super) limits: Vec<JointLimits>,
    pub(super) end_effector: String,
}

impl System {
    fn new(source: &Source, loaded: Loaded, quick: bool) -> anyhow::Result<Self> {
        let reproduce = loaded.mission.reproduce.clone().ok_or_else(|| missing("[reproduce]", &source.file))?;
        let end_effector = loaded.mission.robot.end_effector.clone();
        let end_effector = end_effector.ok_or_else(|| missing("robot.end_effector", &source.file))?;
        let sensors = suite(&loaded.mission.sensors);
        let params = Params::nominal(&loaded.model);
        let rigid = loaded.model.frozen(&params);
        Ok(Self {
            name: source.name.clone(),
            reproduce,
            quick,
            rigid_params: Params::nominal(&rigid),
            params,
            rigid,
            noise: Noise { torque: sensors.torque.sigma(), gyro: sensors.gyro.sigma() },
            sensors,
            limits: ffid::workflow::preflight::joint_limits(&loaded.model, &loaded.mission.limits),
            end_effector,
            loaded,
        })
    }
    pub(super) fn model(&self) -> &Model {
        &self.loaded.model
    }
    pub(super) fn seed(&self) -> u64 {
        self.reproduce.seed
    }
    /// Part of the full length that every spline has.
    fn scale(&self) -> f64 {
        if self.quick { QUICK } else { 1.0 }
    }
    /// Length of what is identified from (s).
    pub(super) fn identification_s(&self) -> f64 {
        (self.reproduce.identification_s * self.scale()).round()
    }
    pub(super) fn sample_s(&self) -> f64 {
        1.0 / self.loaded.mission.sensors.rate_hz
    }
    /// Parameters that are estimated, by index into `decls`. A quick run leaves out mass and length of the pendulum.
    pub(super) fn estimated(&self, decls: &[ParamDecl]) -> anyhow::Result<Vec<usize>> {
        if self.quick { Ok(select(decls, &["base.*", "*.k[*]", "*.d[*]"])?) } else { Ok(self.loaded.estimated.clone()) }
    }
    /// Natural modes at the pose in which the joints hold.
    pub(super) fn modes(&self, boundary: Boundary) -> anyhow::Result<Vec<Mode>> {
        let rest = self.model().rest_position(&self.params);
        Ok(modes(self.model(), &self.params, &self.reproduce.hold_rad, &rest, boundary)?)
    }
    /// Motion of the true system from rest.
    pub(super) fn fly(&self, motion: &dyn JointMotion) -> anyhow::Result<Trace> {
        self.fly_for(&self.params, motion, motion.duration())
    }
    /// Motion of this system with other parameters, for a time (s).
    pub(super) fn fly_for(
        &self,
        params: &Params<f64>,
        motion: &dyn JointMotion,
        duration_s: f64,
    ) -> anyhow::Result<Trace> {
        let options = SimOptions { duration_s, step_s: STEP, sample_s: self.sample_s() };
        Ok(from_rest(self.model(), params, motion, &options)?)
    }
    /// Motion of the true system from rest, sampled every `sample_s`.
    pub(super) fn fly_sampled(&self, motion: &dyn JointMotion, sample_s: f64) -> anyhow::Result<Trace> {
        let options = SimOptions { duration_s: motion.duration(), step_s: STEP, sample_s };
        Ok(from_rest(self.model(), &self.params, motion, &options)?)
    }
    /// Motion of the rigid satellite from rest.
    pub(super) fn fly_rigid(&self, motion: &dyn JointMotion) -> anyhow::Result<Trace> {
        let options = SimOptions { duration_s: motion.duration(), step_s: STEP, sample_s: self.sample_s() };
        Ok(from_rest(&self.rigid, &self.rigid_params, motion, &options)?)
    }
    fn request(&self, seed: u64, starts: usize) -> InformationRequest {
        let (r, noise) = (&self.reproduce, self.noise);
        InformationRequest {
            start: r.hold_rad.clone(),
            end: End::Free,
            limits: self.limits.clone(),
            duration: self.identification_s(),
            control_points: if self.quick { 8 } else { r.control_points as usize },
            seed,
            starts,
            noise: SensorNoise {
                torque: noise.torque,
                gyro: Some(noise.gyro),
                rate: self.loaded.mission.sensors.rate_hz,
            },
            options: Default::default(),
        }
    }
    /// The trajectory that tells most of the base.
    pub(super) fn plan(&self, seed: u64, starts: usize) -> anyhow::Result<Planned> {
        let base: Vec<usize> = (0..10).collect();
        let request = self.request(seed, starts);
        plan_information(self.model(), &self.params, &base, &request).context("identification trajectory")
    }
    /// The like that leaves the appendages alone.
    pub(super) fn plan_quiet(&self, seed: u64, starts: usize) -> anyhow::Result<Planned> {
        let base: Vec<usize> = (0..10).collect();
        let request = self.request(seed, starts);
        let request = InformationRequest { control_points: 10.min(request.control_points), ..request };
        plan_quiet(self.model(), &self.params, &base, &request, &Quietness::Modes { emphasis: EMPHASIS })
            .context("quiet trajectory for the rigid identification")
    }
    /// A random motion at the limits with so many free control points, from the pose that is held.
    pub(super) fn random(&self, seconds: f64, points: usize, stream: u64) -> anyhow::Result<BSplineMotion> {
        let spec = PlanSpec {
            start: self.reproduce.hold_rad.clone(),
            end: End::Free,
            duration: Duration::Fixed(seconds),
            degree: 5,
            free: points,
            limits: self.limits.clone(),
            refine: 2,
        };
        let plan = SplinePlan::new(spec)?;
        Ok(plan.motion(&random_plan(&plan, self.seed(), 1000 + stream, 1.0)?)?)
    }
    /// A trajectory that no identification has seen, along which models are compared, and how they follow it.
    pub(super) fn reference(&self, stream: u64) -> anyhow::Result<(BSplineMotion, SimOptions)> {
        let motion = self.random(self.reproduce.reference_s * self.scale(), 8, stream)?;
        let options = SimOptions { duration_s: motion.duration(), step_s: REFERENCE.0, sample_s: REFERENCE.1 };
        Ok((motion, options))
    }
}

/// A mission file that lacks something this study needs.
fn missing(what: &str, file: &Path) -> Problems {
    refused("Config::MissingKey", format!("{what} is missing"), file)
}

/// A mission file that this study cannot use.
pub(super) fn refused(code: &'static str, what: String, file: &Path) -> Problems {
    Problems(vec![Problem::error(Area::Config, code, what).in_file(file).hint("add it to the mission file")])
}
