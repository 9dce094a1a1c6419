//! The systems that are identified, and their records.

use super::shaken::Shaken;
use crate::workspace;
use anyhow::Context;
use excitation::End;
use excitation::plan_information;
use excitation::planning::InformationRequest;
use excitation::{SensorNoise, SqpOptions};
use ff_dynamics::motion::JointMotion;
use ff_dynamics::sim::Channel;
use ff_dynamics::{Boundary, SensorSuite, SimOptions, Trace, modes};
use ff_mission::{LoadOptions, Mission};
use ff_model::{Model, ParamDecl, Params};
use ff_records::{Record, RecordBuilder};
use ffid::sense::{from_rest, suite};
use ident::Noise;
use ident::parameters::select;

/// Integration step of the simulated truth (s).
const STEP_S: f64 = 1e-3;

/// Free control points per joint of a motion that is to be shaken as well.
const SHAKEN_POINTS: usize = 40;

/// A system with a planned motion.
pub(super) struct Case {
    pub(super) name: &'static str,
    pub(super) model: Model,
    pub(super) decls: Vec<ParamDecl>,
    pub(super) truth: Params<f64>,
    /// Parameters to estimate.
    pub(super) selected: Vec<usize>,
    pub(super) motion: Box<dyn JointMotion>,
    pub(super) noise: Noise,
    pub(super) sensors: SensorSuite,
}

/// Which system.
#[derive(Clone, Copy)]
pub(super) struct Kind {
    pub(super) name: &'static str,
    mission: &'static str,
    patterns: &'static [&'static str],
    /// Appendages frozen to their hosts.
    rigid: bool,
}

pub(super) const RIGID: Kind = Kind { name: "rigid", mission: "flex", patterns: &["base.*"], rigid: true };
pub(super) const FLEXIBLE: Kind =
    Kind { name: "flexible", mission: "flex", patterns: &["base.*", "panel_*.k[*]", "panel_*.d[*]"], rigid: false };
pub(super) const SLOSH: Kind = Kind { name: "slosh", mission: "slosh", patterns: &["base.*", "tank.*"], rigid: false };
pub(super) const COMBINED: Kind = Kind {
    name: "combined",
    mission: "combined",
    patterns: &["base.*", "panel_*.k[*]", "panel_*.d[*]", "tank.*"],
    rigid: false,
};
pub(super) const PAYLOAD: Kind =
    Kind { name: "payload", mission: "payload", patterns: &["base.*", "tank.*", "client.*"], rigid: false };

impl Case {
    /// Loads the mission and plans the motion that tells most of the base, at the mission's limits.
    ///
    /// With `shaken`, with more control points and tones at the natural frequencies that those do not reach ([`Shaken`]).
    pub(super) fn new(kind: Kind, seconds: f64, shaken: bool, seed: u64) -> anyhow::Result<Self> {
        let file = workspace::root()?.join(format!("fixtures/paper/{}.toml", kind.mission));
        let loaded = Mission::load(&file, &ffid::default_registry(), &LoadOptions::default())?;
        let m = &loaded.mission;
        let s = &m.sensors;
        let SensorSuite { torque, gyro, encoder } = suite(s);
        let unbiased = |c| Channel { bias: 0.0, ..c };
        let sensors = SensorSuite { torque: unbiased(torque), gyro: unbiased(gyro), encoder };
        let noise = Noise { torque: sensors.torque.sigma(), gyro: sensors.gyro.sigma() };
        let full = Params::nominal(&loaded.model);
        let model = if kind.rigid { loaded.model.frozen(&full) } else { loaded.model };
        let truth = Params::nominal(&model);
        let decls = model.param_decls();
        let request = InformationRequest {
            start: m.reproduce.as_ref().context("section [reproduce]")?.hold_rad.clone(),
            end: End::Free,
            limits: ffid::workflow::preflight::joint_limits(&model, &m.limits),
            duration: seconds,
            control_points: if shaken { SHAKEN_POINTS } else { 10 },
            seed,
            starts: 1,
            noise: SensorNoise { torque: noise.torque, gyro: Some(noise.gyro), rate: s.rate_hz },
            options: SqpOptions::default(),
        };
        let base: Vec<usize> = (0..10).collect();
        let plan = plan_information(&model, &truth, &base, &request).context(kind.name)?.motion;
        let motion: Box<dyn JointMotion> = if shaken {
            let rest = model.rest_position(&truth);
            let modes = modes(&model, &truth, &request.start, &rest, Boundary::JointsHeld)?;
            let most: Vec<f64> = request.limits.iter().map(|l| l.acceleration).collect();
            // A spline with a point every h seconds reaches 1 / (2 h).
            let reach = SHAKEN_POINTS as f64 / (2.0 * seconds);
            let tones = modes.iter().map(|m| m.damped_hz).filter(|f| *f > reach).collect();
            Box::new(Shaken::new(plan, tones, &most))
        } else {
            Box::new(plan)
        };
        let selected = select(&decls, kind.patterns)?;
        Ok(Self { name: kind.name, model, decls, truth, selected, motion, noise, sensors })
    }
    /// The true system along the motion, from rest, sampled every `sample_s`.
    pub(super) fn simulate(&self, sample_s: f64) -> anyhow::Result<Trace> {
        self.simulate_of(&self.truth, sample_s)
    }
    /// The same system with other parameters.
    pub(super) fn simulate_of(&self, params: &Params<f64>, sample_s: f64) -> anyhow::Result<Trace> {
        let o = SimOptions { duration_s: self.motion.duration(), step_s: STEP_S, sample_s };
        Ok(from_rest(&self.model, params, &*self.motion, &o)?)
    }
    /// A door for records of this robot at `dt`.
    pub(super) fn record(&self, dt: f64) -> RecordBuilder {
        RecordBuilder::new(self.model.joint_names()).uniform(0.0, 1.0 / dt).allow("Data::Stuck")
    }
    /// The exact record: positions, rates, accelerations, torques, gyro.
    pub(super) fn exact(&self, t: &Trace) -> anyhow::Result<Record> {
        let b = self.record(t.dt).q(t.q.clone()).qd(t.qd.clone()).qdd(t.qdd.clone());
        Ok(b.tau(t.tau.clone()).gyro(t.gyro()).build()?.0)
    }
    /// Value of a parameter by name.
    pub(super) fn true_value(&self, name: &str) -> f64 {
        self.decls.iter().position(|d| d.name == name).map_or(f64::NAN, |i| self.truth.values()[i])
    }
}
