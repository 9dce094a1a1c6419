//! From a mission file to a manoeuvre: what `ffid excite` plans.
//!
//! [`plan`] turns section `[excite]` into a cost ([`goal`]), the limits of `[limits]` into constraints, and
//! lets the optimiser of `excitation` search from several starts until it converges or is stopped. The result
//! is a [`Trajectory`] that a file can hold exactly; what it will tell is [`crate::workflow::preflight`]'s to say.
pub mod demands;
mod error;
pub mod goal;
pub(crate) mod search;
pub(crate) mod world;

pub use demands::{Demands, demands};
pub use error::ExciteError;
pub use search::{Observer, Progress, Search};
pub use world::InWorld;

use crate::exit::Exit;
use crate::open::Opened;
use crate::workflow::identify::UncertainItems;
use crate::workflow::preflight::{Sensing, joint_limits};
use excitation::plan::PlanError;
use excitation::plan::{Extent, Shape};
use excitation::trajectory::{Origin, named_joints};
use excitation::{
    Duration, End, JointCommand, Manoeuvre, ManoeuvreSpec, PlanSpec, SplinePlan, Trajectory, TrajectoryFile,
};
use ff_dynamics::{Boundary, modes};
use ff_mission::mission::{Excite, ExciteDuration, ExciteEnd, Goal, Limits};
use ff_model::{Model, Params};
use serde::Serialize;
use world::World;

/// Ramp time of the acceleration in the paper's manoeuvre (s), and rest before it (s).
const RAMP: f64 = 0.1;
const LEAD: f64 = 1.0;

/// A planned trajectory and how it was found.
#[derive(Clone, Debug, Serialize)]
pub struct Planned {
    /// What it was planned for.
    pub goal: &'static str,
    /// Seed of the search.
    pub seed: u64,
    /// Duration (s).
    pub duration_s: f64,
    /// Final cost; absent for the paper's manoeuvre, which is not optimised.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cost: Option<f64>,
    /// What the cost is.
    pub cost_means: &'static str,
    /// The choice between plans with what the mission is not sure of; absent where it is sure of everything, or the goal is no criterion of
    /// the covariance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub in_world: Option<InWorld>,
    /// Every search, in order of the starts.
    pub searches: Vec<Search>,
    /// True when the search was stopped before its end; the plan is the best until then.
    pub interrupted: bool,
    /// What was taken otherwise than asked, in words.
    pub notes: Vec<String>,
    /// The trajectory.
    #[serde(skip)]
    pub file: TrajectoryFile,
}

/// Plans what `settings` ask for. Allocates; starts threads.
///
/// # Errors
/// [`ExciteError`].
pub fn plan(
    opened: &Opened,
    settings: &Excite,
    limits: &Limits,
    demands: &Demands,
    sensing: &Sensing,
    watch: &Observer<'_>,
) -> Result<Planned, ExciteError> {
    let start = start(opened, settings);
    let (trajectory, found) = if settings.goal == Goal::Paper {
        (manoeuvre(opened, settings, limits, sensing, &start)?, None)
    } else {
        let (t, f) = spline(opened, settings, limits, demands, sensing, &start, watch)?;
        (t, Some(f))
    };
    let origin = Origin {
        robot: opened.model.name().to_owned(),
        goal: settings.goal.name().to_owned(),
        seed: settings.seed,
        program: concat!("ffid ", env!("CARGO_PKG_VERSION")).to_owned(),
    };
    let duration_s = trajectory.motion().duration();
    let file = TrajectoryFile { joints: named_joints(&opened.model), origin, trajectory };
    let (cost, cost_means, in_world, searches, interrupted, notes) = match found {
        Some(f) => (Some(f.cost), f.means, f.in_world, f.searches, f.interrupted, f.notes),
        None => (None, "none: the paper's manoeuvre is not optimised", None, Vec::new(), false, Vec::new()),
    };
    Ok(Planned {
        goal: settings.goal.name(),
        seed: settings.seed,
        duration_s,
        cost,
        cost_means,
        in_world,
        searches,
        interrupted,
        notes,
        file,
    })
}

/// Where the arm starts: as the section says, or else the pose the mission holds.
pub fn start(opened: &Opened, settings: &Excite) -> Vec<f64> {
    if settings.start_rad.is_empty() { opened.pose() } else { settings.start_rad.clone() }
}

struct Found {
    cost: f64,
    means: &'static str,
    in_world: Option<InWorld>,
    searches: Vec<Search>,
    interrupted: bool,
    notes: Vec<String>,
}

fn spline(
    opened: &Opened,
    settings: &Excite,
    limits: &Limits,
    demands: &Demands,
    sensing: &Sensing,
    start: &[f64],
    watch: &Observer<'_>,
) -> Result<(Trajectory, Found), ExciteError> {
    let model = &opened.model;
    let of_joints = joint_limits(model, limits);
    for (b, l) in model.own_bodies().zip(&of_joints) {
        if !l.acceleration.is_finite() {
            let hint = "add acceleration_rad_per_s2 = ... to [limits]";
            let e = ExciteError::new(
                Exit::Config,
                "Config::MissingKey",
                "no limit of the joint accelerations is given",
                hint,
            );
            return Err(e.on(format!("limits, joint {}", b.joint.name)));
        }
    }
    let plan = SplinePlan::new(PlanSpec {
        start: start.to_vec(),
        end: match &settings.end {
            ExciteEnd::Free => End::Free,
            ExciteEnd::Start => End::Fixed(start.to_vec()),
            ExciteEnd::At(q) => End::Fixed(q.clone()),
        },
        duration: match settings.duration {
            ExciteDuration::Fixed(t) => Duration::Fixed(t),
            ExciteDuration::Free([min, max]) => Duration::Free { min, max },
        },
        degree: settings.degree as usize,
        free: settings.control_points as usize,
        limits: of_joints,
        refine: 1,
    })
    .map_err(|e| refused(&e, model))?;
    let params = Params::nominal(model);
    let asked = goal::Asked { model, params: &params, selected: &opened.excited, settings, sensing, start };
    let mut goal = goal::cost(&asked, &plan)?;
    let constraints = demands.list();
    let under = search::Under { model, system: demands.system.as_deref(), constraints: &constraints };
    let world = World::of(opened, limits, *sensing, settings.weak_relative_std, &goal);
    let found = search::run(&goal, &plan, under, settings, world.as_ref(), watch).map_err(|e| refused(&e, model))?;
    if world.is_none() && goal.criterion.is_none() && !UncertainItems::beside(opened, &opened.excited).is_empty() {
        goal.notes.push("this goal takes as exact what the mission is not sure of; the verdict allows for it".into());
    }
    if found.rounds > 0 {
        let n = found.rounds;
        goal.notes.push(format!("limits of the whole system were corrected by the full simulation {n} times"));
    }
    let motion = plan.motion(&found.x).map_err(|e| refused(&e, model))?;
    let found = Found {
        cost: found.cost,
        means: goal.means,
        in_world: found.in_world,
        searches: found.searches,
        interrupted: found.interrupted,
        notes: goal.notes,
    };
    Ok((Trajectory::Spline(motion), found))
}

/// A refusal of the planner in the words of the mission file.
fn refused(e: &PlanError, model: &Model) -> ExciteError {
    let name = |j: usize| model.own_bodies().nth(j).map_or_else(|| j.to_string(), |b| b.joint.name.clone());
    match e {
        PlanError::Infeasible { which } => {
            let what = match which.joint {
                Some(j) => format!("{} {} of joint {} cannot be kept", which.quantity, which.limit, name(j)),
                None => format!("bound {} s of the duration cannot be kept", which.limit),
            };
            let by = if which.excess > 0.0 { format!(" (by {:.3e})", which.excess) } else { String::new() };
            let hint = "loosen this limit, take longer, or choose another start or end";
            ExciteError::new(Exit::IllPosed, "Plan::Infeasible", what + &by, hint)
        }
        PlanError::Conflict(c) => {
            let demands: Vec<String> = c.demands.iter().map(ToString::to_string).collect();
            let what = format!("no plan keeps all of this: {}", demands.join("; "));
            ExciteError::new(Exit::IllPosed, "Plan::Conflict", what, c.next.trim_end_matches('.'))
        }
        PlanError::Broken { .. } | PlanError::Unverified { .. } => {
            ExciteError::new(Exit::IllPosed, "Plan::Infeasible", e.to_string(), "loosen this limit, or take longer")
        }
        PlanError::Interrupted => {
            ExciteError::new(Exit::Interrupted, "Plan::Interrupted", e.to_string(), "let it run longer")
        }
        PlanError::Cost(_) | PlanError::Undefined | PlanError::Simulation(_) => {
            ExciteError::new(Exit::Numerical, "Plan::Cost", e.to_string(), "try another seed, or more control points")
        }
        PlanError::Limits(_) | PlanError::Spline(_) | PlanError::Argument { .. } => {
            ExciteError::new(Exit::Config, "Config::Excite", e.to_string(), "correct [excite] or [limits]")
        }
    }
}

/// The paper's simplified manoeuvre (section II-A.2): the named joints at full speed and acceleration, there and back,
/// timed at half a period of the mode that turns the base most; then hold.
fn manoeuvre(
    opened: &Opened,
    settings: &Excite,
    limits: &Limits,
    sensing: &Sensing,
    start: &[f64],
) -> Result<Trajectory, ExciteError> {
    let model = &opened.model;
    let params = Params::nominal(model);
    let named = opened.mission.as_ref().and_then(|m| m.reproduce.as_ref()).map(|r| r.manoeuvre_joints.as_slice());
    let joints = if settings.joints.is_empty() { named.unwrap_or_default() } else { &settings.joints };
    if joints.is_empty() {
        let hint = "name the joints parallel to the hinges: joints = [\"...\"] in [excite]";
        let e = ExciteError::new(Exit::Config, "Config::MissingKey", "the paper's manoeuvre moves no joints", hint);
        return Err(e.on("excite.joints"));
    }
    let rest = model.rest_position(&params);
    let found = modes(model, &params, start, &rest, Boundary::JointsHeld).map_err(|e| {
        ExciteError::new(
            Exit::Numerical,
            "Model::NoModes",
            e.to_string(),
            "check stiffness and inertia of the appendages",
        )
    })?;
    let turn = |m: &ff_dynamics::Mode| m.base.fixed_rows::<3>(3).norm();
    let Some(mode) = found.iter().max_by(|a, b| turn(a).total_cmp(&turn(b))) else {
        let hint = "choose goal = \"information\"";
        let e = ExciteError::new(
            Exit::Config,
            "Config::Excite",
            "the paper's manoeuvre is timed by a mode; there are none",
            hint,
        );
        return Err(e.on("excite.goal"));
    };
    let of_joints = joint_limits(model, limits);
    let names = model.joint_names();
    let mut commands = Vec::with_capacity(joints.len());
    for name in joints {
        let Some(joint) = names.iter().position(|n| n == name) else {
            // Names of the file have been checked; this one comes from a program.
            let e = ExciteError::new(
                Exit::Config,
                "Config::UnknownJoint",
                format!("no joint '{name}'"),
                "name a joint of the robot",
            );
            return Err(e.on("excite.joints"));
        };
        let (velocity, acceleration) = (of_joints[joint].velocity, of_joints[joint].acceleration);
        if !(velocity.is_finite() && acceleration.is_finite()) {
            let hint = "give velocity_rad_per_s and acceleration_rad_per_s2 in [limits]";
            let e = ExciteError::new(
                Exit::Config,
                "Config::MissingKey",
                "moves at full speed need a speed and an acceleration limit",
                hint,
            );
            return Err(e.on(format!("limits, joint {name}")));
        }
        let extent = Extent::HalfPeriod { frequency: mode.frequency_hz, negative: false };
        commands.push(JointCommand { joint, shape: Shape::Doublet, extent, velocity, acceleration });
    }
    let spec = ManoeuvreSpec {
        start: start.to_vec(),
        commands,
        // A jerk limit asks for a longer ramp: the jerk is the acceleration over the ramp.
        ramp: of_joints.iter().fold(RAMP, |r, l| r.max(l.acceleration / l.jerk.unwrap_or(f64::INFINITY))),
        lead: LEAD,
        hold: settings.hold_s,
        grid: Some(1.0 / sensing.rate_hz),
    };
    let m = Manoeuvre::new(&spec).map_err(|e| {
        ExciteError::new(Exit::IllPosed, "Plan::Infeasible", e.to_string(), "loosen the acceleration or jerk limit")
    })?;
    let report = excitation::check_manoeuvre(&m, &of_joints).map_err(|e| refused(&PlanError::Limits(e), model))?;
    if let Some(w) = report.worst().filter(|_| !report.holds) {
        let what = format!(
            "{} {} of joint {} cannot be kept: the move reaches {:.4}",
            w.quantity, w.limit, names[w.joint], w.bound
        );
        let hint = "start from another pose, or move other joints";
        return Err(ExciteError::new(Exit::IllPosed, "Plan::Infeasible", what, hint));
    }
    Ok(Trajectory::Manoeuvre(spec, m))
}
