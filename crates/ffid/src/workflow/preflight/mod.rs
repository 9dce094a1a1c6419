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
pub(crate) mod excursion;
pub(crate) mod limits;
pub(crate) mod modes;
pub(crate) mod parameters;
pub(crate) mod spectrum;
pub(crate) mod text;
pub(crate) mod world;

pub use bias::{BiasedParameter, RigidBias};
pub use excursion::{Excursion, Peak, angle, displacement};
pub use limits::{LimitMargin, Proof, joint_limits, prove};
pub use modes::{ModeVisibility, Reading, SENSED, Seen};
pub use parameters::{Determination, Predicted, PredictedError};
pub use spectrum::{ModePower, Spectrum};

use crate::workflow::identify::{BudgetLine, Harm, UncertainItems};
use excitation::Constraint;
use excitation::plan::LimitReport;
use ff_dynamics::analysis::ModesError;
use ff_dynamics::analysis::advise_step;
use ff_dynamics::motion::{HermiteTable, JointMotion, MotionError};
use ff_dynamics::{Boundary, Drive, Mode, SimError, SimOptions, State, Trace, simulate};
use ff_least_squares::EvalError;
use ff_linalg::LinalgError;
use ff_mission::mission::Sensors;
use ff_model::{BaseKind, Model, Params, Problems};
use ff_records::{Record, RecordBuilder};
use ident::Noise;
use ident::SetupError;
use ident::Uncertainty;
use ident::belief::Direction;
use nalgebra::DMatrix;
use serde::Serialize;

/// Error of the simulation, relative to the amplitude of every mode.
const SIMULATION_ERROR: f64 = 1e-6;
/// Most numbers of the Jacobian (rows times columns): beyond it only every k-th sample is taken, and counts k times.
const MOST_NUMBERS: usize = 40_000_000;

/// Small errors that are listed.
const HARMFUL: usize = 10;

/// What the sensors do, as far as a fit is concerned.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sensing {
    /// Standard deviation of one torque sample, quantisation included (N m).
    pub torque_nm: f64,
    /// Standard deviation of one gyro sample, quantisation included (rad/s).
    pub gyro_rad_per_s: f64,
    /// Samples per second (Hz).
    pub rate_hz: f64,
}

impl Sensing {
    /// The sensors of a mission: white noise and quantisation (`lsb / sqrt(12)`).
    pub fn of(s: &Sensors) -> Self {
        let sigma = |noise: f64, lsb: f64| noise.hypot(lsb / 12f64.sqrt());
        Self {
            torque_nm: sigma(s.torque.noise_std_nm, s.torque.lsb_nm),
            gyro_rad_per_s: sigma(s.gyro.noise_std_rad_per_s, s.gyro.lsb_rad_per_s),
            rate_hz: s.rate_hz,
        }
    }
}

/// What is to be judged.
#[derive(Clone, Copy)]
pub struct Question<'a> {
    /// The robot.
    pub model: &'a Model,
    /// Its parameters, at which everything is predicted.
    pub params: &'a Params<f64>,
    /// Indices of the parameters that will be estimated, ascending.
    pub selected: &'a [usize],
    /// The joint motion.
    pub motion: &'a dyn JointMotion,
    /// The sensors.
    pub sensing: Sensing,
    /// Relative standard deviation above which a parameter is called weak.
    pub weak: f64,
    /// Margins to the joint limits, when they have been proven for all time.
    pub proven: Option<&'a LimitReport>,
    /// Limits of the mission; those of the joints are judged by them.
    pub limits: &'a ff_mission::mission::Limits,
    /// Limits of the whole system ([`crate::workflow::excite::demands()`]).
    pub constraints: &'a [&'a dyn Constraint],
    /// Index of the frame of the end effector, if there is one.
    pub end_effector: Option<usize>,
    /// What the mission is not sure of beside the selected parameters ([`UncertainItems::beside`]): marginalised with its priors, as
    /// the fit will do. Nothing, if not given.
    pub uncertain: Option<&'a UncertainItems>,
    /// Small errors ([`UncertainItems::small`]) of what is taken as exact, to be told what they would move.
    pub small: Option<&'a UncertainItems>,
}

/// Why there is no verdict.
#[derive(Debug, thiserror::Error)]
pub enum PreflightError {
    /// The base is fixed or gravity acts: identification knows free-floating systems only.
    #[error("the verdict needs a free-floating base and zero gravity, as identification does")]
    NotFreeFloating,
    /// Sensors without noise predict deviations of zero.
    #[error("noise of the {channel} is {value}; predictions need a positive number")]
    Noise {
        /// Which sensor.
        channel: &'static str,
        /// Its standard deviation.
        value: f64,
    },
    /// Nothing is to be estimated.
    #[error("no parameters are named; nothing can be predicted")]
    NoParameters,
    /// The motion has another number of joints.
    #[error("the motion has {got} joints, the robot {want}")]
    Joints {
        /// Of the motion.
        got: usize,
        /// Of the robot.
        want: usize,
    },
    /// The motion is not finite, or too short for its sensors.
    #[error("joint motion: {0}")]
    Motion(#[from] MotionError),
    /// Fewer samples than unknowns.
    #[error("{samples} samples ({duration} s at {rate} Hz) are too few")]
    TooShort {
        /// Samples.
        samples: usize,
        /// Duration (s).
        duration: f64,
        /// Rate (Hz).
        rate: f64,
    },
    /// The trajectory could not be simulated.
    #[error("simulation of the trajectory: {0}")]
    Simulation(#[from] SimError),
    /// The modes could not be computed.
    #[error("modes at the start: {0}")]
    Modes(#[from] ModesError),
    /// The simulated record was refused.
    #[error("simulated record: {0}")]
    Record(#[from] Problems),
    /// The estimator was refused.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// What the mission is not sure of makes no unknowns.
    #[error("what the mission is not sure of: {0}")]
    Uncertain(String),
    /// The estimator failed.
    #[error("sensitivities: {0}")]
    Sensitivities(String),
    /// A factorisation failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

impl From<EvalError> for PreflightError {
    fn from(e: EvalError) -> Self {
        Self::Sensitivities(e.to_string())
    }
}

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

/// The longest integration step (s) that resolves modes and sampling, a whole fraction of the sample time.
pub fn step(modes: &[Mode], duration: f64, sample: f64) -> f64 {
    let advised = advise_step(modes, duration, SIMULATION_ERROR).map_or(sample, |a| a.step_s);
    let parts = (sample / advised).ceil().clamp(1.0, 1000.0);
    sample / parts
}

/// The record of a trace as perfect sensors read it, every `every`-th sample.
pub(crate) fn record(q: &Question<'_>, t: &Trace, every: usize) -> Result<Record, PreflightError> {
    let rows: Vec<usize> = (0..t.len()).step_by(every).collect();
    let thin = |m: &DMatrix<f64>| m.select_rows(&rows);
    let builder = RecordBuilder::new(q.model.joint_names()).uniform(0.0, 1.0 / (t.dt * every as f64));
    let builder = builder.q(thin(&t.q)).qd(thin(&t.qd)).qdd(thin(&t.qdd)).tau(thin(&t.tau)).gyro(thin(&t.gyro()));
    // A joint that holds, and a robot that turns faster than usual, are no faults of a simulated record.
    let builder = builder.allow("Data::Stuck").allow("Data::LooksLikeDegrees");
    Ok(builder.build()?.0)
}

pub(crate) fn noise(s: &Sensing) -> Noise {
    Noise { torque: s.torque_nm, gyro: s.gyro_rad_per_s }
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
