//! Plans that identify the base: most information within the limits, quietly if asked.
//!
//! The cost is `-log det` of the information on the base parameters ([`crate::system::rigid`]), the search several
//! starts of [`crate::solve::sqp`]; random feasible plans tell what was gained. Appendages are frozen at rest, which
//! is what rigid identification assumes: a quiet plan keeps the assumption true.
//!
//! On the paper's robot with panels that matters more than the information: the loud plan predicts a standard
//! deviation of 4.7 kg for the base mass, but the swinging panels would bias a rigid fit by 230 kg
//! (`tests/quiet.rs`).
pub mod fisher;
pub(crate) mod meter;

use crate::objective::information::Information;
use crate::objective::{Cost, CostSum};
use crate::plan::limits::{JointLimits, LimitError, LimitReport, check_for_all_time};
use crate::plan::random::random_plan;
use crate::plan::spline::{Duration, End, PlanError, PlanSpec, SplinePlan};
use crate::solve::search::multi_start;
use crate::solve::sqp::{SqpOptions, Status};
use crate::system::prediction::{Prediction, deviations, medians, quantities};
use crate::system::rigid::{RigidError, RigidInformation, SensorNoise};
use ff_dynamics::analysis::ModesError;
use ff_dynamics::motion::bspline::BSplineMotion;
use ff_model::{Model, Params};
use meter::Meter;
use nalgebra::DMatrix;

/// Random plans that the plan is compared with.
const COMPARED: usize = 20;
/// Degree of the splines: acceleration and jerk are continuous.
const DEGREE: usize = 5;
/// Quadrature samples per knot span, and the fewest per second. Rows vary with joint angles and the splines'
/// accelerations; on the paper's robot half and a tenth of this spacing change the cost by less than 1e-4.
const PER_SPAN: usize = 8;
const PER_SECOND: f64 = 2.0;
/// Prior information on scaled parameters: one that is known to a hundred times its size. Far too little to
/// matter, but it keeps the determinant positive.
const PRIOR: f64 = 1e-4;

/// What to plan.
#[derive(Clone, Debug, PartialEq)]
pub struct InformationRequest {
    /// Start configuration, one entry per joint (rad or m).
    pub start: Vec<f64>,
    /// End configuration: given or free.
    pub end: End,
    /// Limits, one set per joint.
    pub limits: Vec<JointLimits>,
    /// Duration (s).
    pub duration: f64,
    /// Free control points per joint; 10 is plenty for a minute.
    pub control_points: usize,
    /// Seed of all randomness.
    pub seed: u64,
    /// Local searches from different random plans, at least 1.
    pub starts: usize,
    /// Sensors of the record that will be taken.
    pub noise: SensorNoise,
    /// Settings of the local searches.
    pub options: SqpOptions,
}

/// How a plan leaves flexible appendages alone.
#[derive(Clone, Debug, PartialEq)]
pub enum Quietness {
    /// Little effect of the modes on the sensors ([`Disturbance`](crate::objective::disturbance::Disturbance)); for appendages on the base.
    ///
    /// The cost is `-log det M + emphasis ln(1 + chi^2)`. With emphasis 1 this is the logarithm of the
    /// determinant of the mean square error of a rigid fit, covariance and bias together, at worst:
    /// `det(M^-1 + b b^T) = det(M^-1) (1 + b^T M b)` and `b^T M b <= chi^2`. Larger values trade more information for
    /// less bias; 3 suits the paper's panels.
    Modes {
        /// Weight, 0 or positive.
        emphasis: f64,
    },
    /// Little energy of the joint accelerations in a band, whatever they do to the modes (paper, Figs. 5C, 7B).
    ///
    /// A weak proxy: it does not know which joint moves the base how far. With equal weights on the paper's
    /// robot, 14 times less energy came with 6 times more `chi^2`. Needs no flexible model.
    Band(QuietBand),
}

/// A frequency band to keep out of.
#[derive(Clone, Debug, PartialEq)]
pub struct QuietBand {
    /// Lower edge (Hz).
    pub low: f64,
    /// Upper edge (Hz).
    pub high: f64,
    /// Cost of having the band energy of the median random plan, in units of `-log det`; 0 ignores the band.
    pub emphasis: f64,
    /// Weight per joint of the band energy; dimensionless.
    pub weights: Vec<f64>,
}

/// Why there is no plan.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlanningError {
    /// The model or the choice of parameters.
    #[error(transparent)]
    Rigid(#[from] RigidError),
    /// The request, or no feasible trajectory.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// The limits could not be tested.
    #[error(transparent)]
    Limits(#[from] LimitError),
    /// The modes could not be computed.
    #[error("modes at the start configuration: {0}")]
    Modes(#[from] ModesError),
    /// Quietness for modes that there are not, or that base acceleration alone does not drive.
    #[error("{0}; plan quietly for a band instead")]
    NoBaseModes(String),
    /// An emphasis that is negative or not a number.
    #[error("emphasis {0}; it must be 0 or positive")]
    Emphasis(f64),
    /// A band that is none.
    #[error("quiet band {low} .. {high} Hz with emphasis {emphasis}: {expected}")]
    Band {
        /// Lower edge (Hz).
        low: f64,
        /// Upper edge (Hz).
        high: f64,
        /// Emphasis.
        emphasis: f64,
        /// What was expected.
        expected: &'static str,
    },
}

/// What is kept small by a quiet plan: `chi^2` of [`Disturbance`](crate::objective::disturbance::Disturbance), or the band energy of [`Quiet`](crate::objective::spectrum::Quiet) (weights
/// included).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quieted {
    /// Median of the random plans.
    pub random: f64,
    /// Of the plan.
    pub planned: f64,
}

/// A plan, how it was found and what it will tell.
#[derive(Clone, Debug)]
pub struct Planned {
    /// The motion, rest to rest.
    pub motion: BSplineMotion,
    /// The decision problem it solves, and its variables.
    pub plan: SplinePlan,
    /// Variables of the plan.
    pub x: Vec<f64>,
    /// Final cost (`-log det`, plus the penalty of a quiet plan).
    pub cost: f64,
    /// `-log det` of the information over scaled parameters.
    pub information_cost: f64,
    /// Median of `-log det` over the random plans.
    pub random_information_cost: f64,
    /// How the best search ended.
    pub status: Status,
    /// How every search ended, in order of the starts, with its cost and evaluations; `None` if it failed.
    pub searches: Vec<Option<(Status, f64, usize)>>,
    /// Proof that the limits hold for all time.
    pub limits: LimitReport,
    /// Predicted standard deviations: every estimated parameter; centre of mass and inertia about it too when
    /// all ten are estimated.
    pub predictions: Vec<Prediction>,
    /// What a quiet plan kept small.
    pub quiet: Option<Quieted>,
}

/// Plans a rest-to-rest motion that makes `-log det` of the information on the base parameters `estimated`
/// (indices into the parameter vector) as small as possible. A function of its arguments only. Allocates.
///
/// # Errors
/// [`PlanningError`]: parameters that are not the base's, limits that cannot be kept, bad numbers.
///
/// # Panics
/// If `params` belongs to another model.
pub fn plan_information(
    model: &Model,
    params: &Params<f64>,
    estimated: &[usize],
    request: &InformationRequest,
) -> Result<Planned, PlanningError> {
    solve(model, params, estimated, request, None)
}

/// [`plan_information`] with a penalty that keeps flexible appendages quiet. Allocates.
///
/// Modes and their effect are taken at the start configuration and, like everything, at `params`, so that the
/// flexible parameters have to be known roughly; peaks are widened to what the duration resolves.
///
/// # Errors
/// As [`plan_information`]; [`PlanningError::Band`], [`PlanningError::Modes`], [`PlanningError::NoBaseModes`].
///
/// # Panics
/// If `params` belongs to another model.
pub fn plan_quiet(
    model: &Model,
    params: &Params<f64>,
    estimated: &[usize],
    request: &InformationRequest,
    quietness: &Quietness,
) -> Result<Planned, PlanningError> {
    solve(model, params, estimated, request, Some(quietness))
}

fn solve(
    model: &Model,
    params: &Params<f64>,
    estimated: &[usize],
    request: &InformationRequest,
    quietness: Option<&Quietness>,
) -> Result<Planned, PlanningError> {
    let source = RigidInformation::new(model, params, estimated, request.noise)?;
    if request.start.len() != model.nj() {
        let (got, expected) = (format!("{} joints", request.start.len()), model.nj().to_string());
        return Err(PlanError::Argument { what: "start configuration", got, expected }.into());
    }
    let plan = SplinePlan::new(PlanSpec {
        start: request.start.clone(),
        end: request.end.clone(),
        duration: Duration::Fixed(request.duration),
        degree: DEGREE,
        free: request.control_points,
        limits: request.limits.clone(),
        refine: 1,
    })?;
    let by_time = (PER_SECOND * request.duration).ceil().min(10_000.0) as usize;
    let samples = by_time.max(PER_SPAN * (request.control_points + 1)) + 1;
    let information = Information { source, samples, rate: request.noise.rate, delta: PRIOR };
    let meter = quietness.map(|q| Meter::new(q, model, params, request, &plan, &information.source)).transpose()?;

    // Streams after those of the starts, so that the comparison does not contain them.
    let random: Vec<Vec<f64>> = (0..COMPARED)
        .map(|i| random_plan(&plan, request.seed, (request.starts + i) as u64, 0.5))
        .collect::<Result<_, _>>()?;
    let reading = |x: &[f64]| meter.as_ref().map(|m| m.read(&plan, x));
    let before: Vec<Vec<f64>> = random
        .iter()
        .map(|x| {
            let m = information.matrix(&plan, x);
            let mut row = deviations(&information.source, &m);
            row.push(minus_log_det(&m));
            row.push(reading(x).unwrap_or(0.0));
            row
        })
        .collect();
    let named = quantities(&information.source);
    let medians = medians(&before, named.len() + 2);
    let (random_cost, random_reading) = (medians[named.len()], medians[named.len() + 1]);

    let mut terms: Vec<(f64, Box<dyn Cost>)> = vec![(1.0, Box::new(information.clone()))];
    terms.extend(meter.as_ref().map(|m| m.term(random_reading)));
    let found = multi_start(&CostSum(terms), &plan, request.seed, request.starts, &request.options)?;

    let x = found.best.x.clone();
    let motion = plan.motion(&x)?;
    let m = information.matrix(&plan, &x);
    let after = deviations(&information.source, &m);
    let predictions = named
        .into_iter()
        .zip(medians.iter().zip(after))
        .map(|((name, unit, value), (&random, planned))| Prediction { name, unit, value, random, planned })
        .collect();
    Ok(Planned {
        limits: check_for_all_time(&motion, &request.limits, 1)?,
        quiet: reading(&x).map(|planned| Quieted { random: random_reading, planned }),
        motion,
        plan,
        x,
        cost: found.best.cost,
        information_cost: minus_log_det(&m),
        random_information_cost: random_cost,
        status: found.best.status,
        searches: found.all.iter().map(|o| o.as_ref().ok().map(|o| (o.status, o.cost, o.evaluations))).collect(),
        predictions,
    })
}

/// Infinite when `m` is not positive definite.
fn minus_log_det(m: &DMatrix<f64>) -> f64 {
    m.clone().cholesky().map_or(f64::INFINITY, |c| -2.0 * c.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>())
}
