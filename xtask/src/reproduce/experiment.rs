//! Trajectories and simulations of one case.

use super::system::{Source, System, refused};
use excitation::plan::{Extent, Shape};
use excitation::planning::Planned;
use excitation::{JointCommand, Manoeuvre, ManoeuvreSpec};
use ff_dynamics::motion::JointMotion;
use ff_dynamics::motion::bspline::BSplineMotion;
use ff_dynamics::{Boundary, Mode, SimOptions, Trace};
use indicatif::ProgressBar;
use std::path::Path;

/// Rest before a manoeuvre (s).
pub(super) const LEAD_S: f64 = 1.0;

/// Everything simulated for one case, before any identification.
pub(super) struct Experiment {
    pub(super) source: Source,
    pub(super) system: System,
    pub(super) manoeuvre: Manoeuvre,
    /// Ringing after the manoeuvre: the whole trace, and when the joints stand still.
    pub(super) ringing: Trace,
    pub(super) ring_from: f64,
    pub(super) modes: Vec<Mode>,
    pub(super) cantilever: Vec<Mode>,
    /// The trajectories: for the rigid identification, for the identification, for comparison.
    pub(super) quiet: Planned,
    pub(super) loud: Planned,
    pub(super) reference: BSplineMotion,
    pub(super) reference_options: SimOptions,
    /// The rigid satellite on the quiet trajectory, and the flexible one on the identification trajectory.
    pub(super) rigid_trace: Trace,
    pub(super) trace: Trace,
}

impl Experiment {
    pub(super) fn run(mission: &Path, quick: bool, bar: &ProgressBar) -> anyhow::Result<Self> {
        let source = Source::read(mission)?;
        let say = |what: &str| bar.set_message(format!("{}: {what}", source.name));
        say("mission file");
        let system = source.with(quick, |_| ())?;
        let r = &system.reproduce;
        let (modes, cantilever) = (system.modes(Boundary::JointsHeld)?, system.modes(Boundary::BaseHeld)?);
        say("manoeuvre and ringing");
        let hold = if quick { 0.6 * r.record_s } else { r.record_s };
        let manoeuvre = manoeuvre(&system, turning_hz(&modes), hold)?;
        let ringing = system.fly(&manoeuvre)?;
        say("planning");
        let starts = if quick { 1 } else { 2 };
        let loud = system.plan(r.seed, starts)?;
        let quiet = system.plan_quiet(r.seed, starts)?;
        say("simulation");
        let rigid_trace = system.fly_rigid(&quiet.motion)?;
        let trace = system.fly(&loud.motion)?;
        let stream = r.trajectory_seeds.first().copied().unwrap_or(1);
        let (reference, reference_options) = system.reference(stream)?;
        let ring_from = manoeuvre.ringing().0 + r.settle_s;
        Ok(Self {
            ring_from,
            manoeuvre,
            ringing,
            modes,
            cantilever,
            quiet,
            loud,
            reference,
            reference_options,
            rigid_trace,
            trace,
            system,
            source,
        })
    }
    /// Every joint motion of the study by name.
    pub(super) fn motions(&self) -> [(&'static str, &dyn JointMotion); 4] {
        [
            ("manoeuvre", &self.manoeuvre),
            ("identification", &self.loud.motion),
            ("rigid identification", &self.quiet.motion),
            ("reference", &self.reference),
        ]
    }
}

/// Frequency of the mode that turns the base most (Hz).
pub(super) fn turning_hz(modes: &[Mode]) -> f64 {
    let turn = |m: &Mode| m.base.fixed_rows::<3>(3).norm();
    modes.iter().max_by(|a, b| turn(a).total_cmp(&turn(b))).map_or(0.1, |m| m.frequency_hz)
}

/// The paper's simplified manoeuvre: the named joints at full speed and acceleration, there and back, timed at half a period of
/// `frequency` (Hz); then hold (s).
pub(super) fn manoeuvre(s: &System, frequency: f64, hold: f64) -> anyhow::Result<Manoeuvre> {
    let names = s.model().joint_names();
    let commands = s
        .reproduce
        .manoeuvre_joints
        .iter()
        .map(|n| {
            let joint = names.iter().position(|x| x == n).ok_or_else(|| {
                let what = format!("manoeuvre_joints: no joint '{n}'");
                refused("Config::UnknownJoint", what, Path::new(&s.loaded.mission.robot.urdf))
            })?;
            Ok(JointCommand {
                joint,
                shape: Shape::Doublet,
                extent: Extent::HalfPeriod { frequency, negative: false },
                velocity: s.limits[joint].velocity,
                acceleration: s.limits[joint].acceleration,
            })
        })
        .collect::<anyhow::Result<Vec<_>>>()?;
    let start = s.reproduce.hold_rad.clone();
    let spec = ManoeuvreSpec { start, commands, ramp: 0.1, lead: LEAD_S, hold, grid: Some(s.sample_s()) };
    Ok(Manoeuvre::new(&spec)?)
}
