//! Before anything flies: what the record of a trajectory will tell, and what the trajectory does to the robot.
//!
//! Any joint motion, planned or given, is judged at the mission's nominal parameters with the mission's sensors:
//!
//! | question | answer |
//! |---|---|
//! | how well will each parameter be known? | [`Preflight::parameters`]: Cramer-Rao standard deviations from the whitened Jacobian `J` of the fit that will be made ([`ident::OutputError`]), `cov = (J^T J)^-1`, gyro bias, torque biases and the initial state estimated beside them |
//! | what can no fit tell? | null directions by parameter names; parameters weaker than a threshold |
//! | which modes do the sensors see? | [`ModeVisibility`]: what each mode adds to torques and gyro, against their noise |
//! | what does the base do? | [`Excursion`]: angle, rate, displacement, peaks of torques and deflections |
//! | what is excited? | [`Spectrum`]: joint and base accelerations at the modes and in their band |
//! | are the limits kept? | [`LimitMargin`] |
//! | what if the model were rigid? | [`RigidBias`]: the first Gauss-Newton step of a rigid identification ([`ident::Rda`]), from the true rigid parameters, on the flexible system's torques |
//!
//! Standard deviations are those of white noise of the stated size, beside what the mission is not sure of ([`Question::uncertain`]),
//! with everything else right: joint positions are taken as exact, other parameters that are not asked for as known. The verdict needs both planning data and the estimator,
//! which are crates of one layer; that is why it lives here.
pub(crate) mod bias;
mod error;
pub(crate) mod excursion;
pub(crate) mod limits;
pub(crate) mod modes;
pub(crate) mod parameters;
mod question;
mod samples;
pub(crate) mod spectrum;
pub(crate) mod text;
pub(crate) mod world;

pub use bias::{BiasedParameter, RigidBias};
pub use error::PreflightError;
pub use excursion::{Excursion, Peak, angle, displacement};
pub use limits::{LimitMargin, Proof, joint_limits, prove};
pub use modes::{ModeVisibility, Reading, SENSED, Seen};
pub use parameters::{Determination, Predicted, PredictedError};
pub use question::{Question, Sensing};
pub use samples::step;
pub use spectrum::{ModePower, Spectrum};

use crate::workflow::identify::{BudgetLine, Harm, UncertainItems};
use ff_dynamics::motion::{HermiteTable, JointMotion};
use ff_dynamics::{Boundary, Drive, Mode, SimOptions, State, Trace, simulate};
use ff_model::BaseKind;
use ident::Uncertainty;
use ident::belief::Direction;
use nalgebra::DMatrix;
use serde::Serialize;

/// Small errors that are listed.
const HARMFUL: usize = 10;

/// The verdict.
#[derive(Clone, Debug, Serialize)]
pub struct Preflight {
    /// Name of the robot.
    pub robot: String,
    /// Duration of the trajectory (s).
    pub duration_s: f64,
    /// Samples of the record.
    pub samples: usize,
    /// Every how many samples one was looked at (it then counts that often); 1 unless the record is huge.
    pub every: usize,
    /// The sensors.
    pub sensing: Sensing,
    /// Predicted standard deviation of every parameter that is to be estimated.
    pub parameters: Vec<Predicted>,
    /// Centre of mass and inertia about it, for bodies whose ten parameters are all estimated.
    pub derived: Vec<Predicted>,
    /// Biases and initial state, estimated beside.
    pub nuisance: Vec<Predicted>,
    /// What the mission is not sure of, estimated beside with its priors.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub uncertain: Vec<PredictedError>,
    /// Where the variance of every parameter will come from, as `ffid identify` will state it; empty where the mission is sure of everything.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub budget: Vec<BudgetLine>,
    /// The most harmful of the small errors in what is taken as exact.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub taken_as_exact: Vec<Harm>,
    /// Unknowns: parameters, nuisance, and what the mission is not sure of.
    pub unknowns: usize,
    /// Directions that the record determines.
    pub rank: usize,
    /// Condition number of the scaled sensitivities over those directions.
    pub condition: f64,
    /// Relative standard deviation above which a parameter is called weak.
    pub weak_above: f64,
    /// Combinations on which the record is silent.
    pub null_directions: Vec<Direction>,
    /// Combinations known worse than to their own size.
    pub weak_directions: Vec<Direction>,
    /// The modes at the start pose, joints held, and who sees them.
    pub modes: Vec<ModeVisibility>,
    /// What base and appendages do.
    pub excursion: Excursion,
    /// What is excited.
    pub spectrum: Spectrum,
    /// Margins of all limits.
    pub limits: Vec<LimitMargin>,
    /// True when all limits are kept.
    pub limits_hold: bool,
    /// What a rigid identification would make of the record; absent without passive coordinates.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rigid_bias: Option<RigidBias>,
    /// The simulated trajectory, for figures.
    #[serde(skip)]
    pub trace: Trace,
    /// Names of the joints, for figures.
    #[serde(skip)]
    pub joints: Vec<String>,
    /// Names of the passive coordinates, for figures.
    #[serde(skip)]
    pub passive: Vec<String>,
}

/// Judges a trajectory. Simulates it once, integrates its sensitivities once; allocates.
///
/// # Errors
/// [`PreflightError`].
///
/// # Panics
/// If `params` belongs to another model, or an index of `selected` does not exist.
pub fn judge(q: &Question<'_>) -> Result<Preflight, PreflightError> {
    check(q)?;
    let model = q.model;
    let Simulated { start, rest, modes, trace, substeps } = simulated(q)?;
    let seen = parameters::predict(q, &trace, substeps)?;
    let mut taken_as_exact = world::taken_as_exact(q, &trace, substeps)?;
    taken_as_exact.truncate(HARMFUL);
    let excursion = excursion::of(q, &trace);
    let mut limits = limits::of_joints(q, &trace);
    limits.extend(limits::of_system(q, &trace));
    Ok(Preflight {
        robot: model.name().to_owned(),
        duration_s: q.motion.duration(),
        samples: trace.len(),
        every: seen.every,
        sensing: q.sensing,
        unknowns: seen.uncertainty.unknowns.len(),
        rank: seen.uncertainty.rank,
        condition: seen.uncertainty.condition,
        weak_above: q.weak,
        null_directions: seen.uncertainty.null.clone(),
        weak_directions: weak_directions(&seen.known, q.selected.len()),
        parameters: seen.parameters,
        derived: seen.derived,
        nuisance: seen.nuisance,
        uncertain: seen.uncertain,
        budget: seen.budget,
        taken_as_exact,
        modes: modes::visibility(q, &modes, &trace, &rest)?,
        spectrum: spectrum::of(q, &modes, &trace, &start)?,
        rigid_bias: if model.np() > 0 { Some(bias::of(q, &trace)?) } else { None },
        limits_hold: limits.iter().all(|m| m.holds),
        limits,
        excursion,
        joints: model.joint_names(),
        passive: model.passive_coords().into_iter().map(|(n, _)| n).collect(),
        trace,
    })
}

/// A trajectory simulated from rest.
struct Simulated {
    start: Vec<f64>,
    rest: Vec<f64>,
    modes: Vec<Mode>,
    trace: Trace,
    /// Integration steps per sample.
    substeps: usize,
}

fn simulated(q: &Question<'_>) -> Result<Simulated, PreflightError> {
    let (model, params) = (q.model, q.params);
    let start = start_pose(q.motion);
    let rest = model.rest_position(params);
    let modes = ff_dynamics::modes(model, params, &start, &rest, Boundary::JointsHeld)?;
    let sample_s = 1.0 / q.sensing.rate_hz;
    let step_s = step(&modes, q.motion.duration(), sample_s);
    let mut from = State::zero(model);
    from.q.copy_from_slice(&start);
    from.eta.copy_from_slice(&rest);
    let options = SimOptions { duration_s: q.motion.duration(), step_s, sample_s };
    let trace = simulate(model, params, &from, &Drive::Prescribed(q.motion), &options)?;
    let substeps = (sample_s / step_s).ceil().max(1.0) as usize;
    Ok(Simulated { start, rest, modes, trace, substeps })
}

/// Covariance that a record of the trajectory leaves of the selected parameters, biases, initial state and what the mission is not sure of
/// marginalised, from about 1500 of its samples with the information of all; `None` where it does not determine all of them. What is
/// known beforehand of the selected ones themselves is left out. Simulates once; allocates.
///
/// # Errors
/// [`PreflightError`].
///
/// # Panics
/// As [`judge`].
pub fn marginal_covariance(q: &Question<'_>) -> Result<Option<DMatrix<f64>>, PreflightError> {
    check(q)?;
    let Simulated { trace, substeps, .. } = simulated(q)?;
    let exact = UncertainItems::default();
    let told = world::columns(q, &trace, substeps, q.uncertain.unwrap_or(&exact), Some(world::SURVEYED))?;
    let (u, _) = told.uncertainty(&[])?;
    let n = q.selected.len();
    let all = u.deviation[..n].iter().all(Option::is_some);
    Ok(all.then(|| u.covariance.view((0, 0), (n, n)).into_owned()))
}

/// Weak directions in which a parameter has the greatest part: an unknown bias alone worries nobody.
fn weak_directions(u: &Uncertainty, parameters: usize) -> Vec<Direction> {
    let names: Vec<&String> = u.unknowns[..parameters].iter().map(|k| &k.name).collect();
    u.weak.iter().filter(|d| d.terms.first().is_some_and(|t| names.contains(&&t.0))).cloned().collect()
}

fn check(q: &Question<'_>) -> Result<(), PreflightError> {
    if q.model.base_kind() != BaseKind::Floating || q.model.gravity().norm() > 0.0 {
        return Err(PreflightError::NotFreeFloating);
    }
    for (channel, value) in [("torque sensors (N m)", q.sensing.torque_nm), ("gyro (rad/s)", q.sensing.gyro_rad_per_s)]
    {
        if !(value > 0.0 && value.is_finite()) {
            return Err(PreflightError::Noise { channel, value });
        }
    }
    if q.selected.is_empty() {
        return Err(PreflightError::NoParameters);
    }
    let (got, want) = (q.motion.dof(), q.model.nj());
    if got != want {
        return Err(PreflightError::Joints { got, want });
    }
    let (duration, rate) = (q.motion.duration(), q.sensing.rate_hz);
    let samples = (duration * rate) as usize + 1;
    let unknowns = q.selected.len() + 6 + want + 2 * q.model.np();
    if samples < 8 || samples * (want + 3) < 2 * unknowns {
        return Err(PreflightError::TooShort { samples, duration, rate });
    }
    Ok(())
}

/// Joint positions at time 0.
pub fn start_pose(motion: &dyn JointMotion) -> Vec<f64> {
    let n = motion.dof();
    let (mut q, mut qd, mut qdd) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    motion.eval(0.0, &mut q, &mut qd, &mut qdd);
    q
}

/// A motion from samples: the quintic through them when rates and accelerations are given, else a least-squares spline
/// of the coarsest knots that reach their noise.
///
/// # Errors
/// What is wrong with the samples.
pub fn motion_of(s: &excitation::trajectory::Samples) -> Result<Box<dyn JointMotion>, String> {
    if let Some(table) = s.table() {
        let table: HermiteTable = table;
        return Ok(Box::new(table));
    }
    let dof = s.joints.len();
    let samples = ident::motion::JointSamples { dof, times: &s.times, q: &s.q, qd: None, rate_weight: 0.0 };
    let fit = ident::motion::choose_knots(&samples, None).map_err(|e| e.to_string())?;
    Ok(Box::new(fit.motion))
}
