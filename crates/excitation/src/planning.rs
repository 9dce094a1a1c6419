//! Plans that identify the base: most information within the limits, quietly if asked.
//!
//! The cost is `-log det` of the information on the base parameters ([`crate::rigid`]), the search several
//! starts of [`crate::sqp`]; random feasible plans tell what was gained. Appendages are frozen at rest, which
//! is what rigid identification assumes: a quiet plan keeps the assumption true.

use crate::cost::information::Information;
use crate::cost::spectrum::Quiet;
use crate::cost::{Cost, CostSum};
use crate::limits::{JointLimits, LimitError, LimitReport, check_for_all_time};
use crate::prediction::{Prediction, deviations, medians, quantities};
use crate::random::random_plan;
use crate::rigid::{RigidError, RigidInformation, SensorNoise};
use crate::spline_plan::{Duration, End, PlanError, PlanSpec, SplinePlan};
use crate::sqp::{MultiStart, SqpOptions, Status, multi_start};
use ff_dynamics::bspline::BSplineMotion;
use ff_model::{Model, Params};

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

/// Energy of the joint accelerations in the band ([`Quiet`], weights included).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BandEnergy {
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
    /// Final cost (`-log det`, plus the band penalty for a quiet plan).
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
    /// Energy in the quiet band, for a quiet plan.
    pub band: Option<BandEnergy>,
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

/// [`plan_information`] with a penalty on the energy of the joint accelerations in `band`:
/// `-log det + emphasis E / E_random`, with `E_random` the median energy of the random plans. Allocates.
///
/// # Errors
/// As [`plan_information`], and [`PlanningError::Band`].
///
/// # Panics
/// If `params` belongs to another model.
pub fn plan_quiet(
    model: &Model,
    params: &Params<f64>,
    estimated: &[usize],
    request: &InformationRequest,
    band: &QuietBand,
) -> Result<Planned, PlanningError> {
    solve(model, params, estimated, request, Some(band))
}

fn solve(
    model: &Model,
    params: &Params<f64>,
    estimated: &[usize],
    request: &InformationRequest,
    band: Option<&QuietBand>,
) -> Result<Planned, PlanningError> {
    let source = RigidInformation::new(model, params, estimated, request.noise)?;
    let plan = SplinePlan::new(PlanSpec {
        start: request.start.clone(),
        end: request.end.clone(),
        duration: Duration::Fixed(request.duration),
        degree: DEGREE,
        free: request.control_points,
        limits: request.limits.clone(),
        refine: 1,
    })?;
    if plan.dof() != model.nj() {
        let (got, expected) = (format!("{} joints", plan.dof()), model.nj().to_string());
        return Err(PlanError::Argument { what: "start configuration", got, expected }.into());
    }
    let by_time = (PER_SECOND * request.duration).ceil().min(10_000.0) as usize;
    let samples = by_time.max(PER_SPAN * (request.control_points + 1)) + 1;
    let information = Information { source, samples, rate: request.noise.rate, delta: PRIOR };
    let quiet = band.map(|b| quiet_cost(b, &plan)).transpose()?;

    // Streams after those of the starts, so that the comparison does not contain them.
    let random: Vec<Vec<f64>> = (0..COMPARED)
        .map(|i| random_plan(&plan, request.seed, (request.starts + i) as u64, 0.5))
        .collect::<Result<_, _>>()?;
    let mut unused = vec![0.0; plan.variables()];
    let mut energy = |x: &[f64]| quiet.as_ref().map(|q| q.value_gradient(&plan, x, &mut unused));
    let before: Vec<Vec<f64>> = random
        .iter()
        .map(|x| {
            let m = information.matrix(&plan, x);
            let mut row = deviations(&information.source, &m);
            row.push(minus_log_det(&m));
            row.push(energy(x).unwrap_or(0.0));
            row
        })
        .collect();
    let named = quantities(&information.source);
    let medians = medians(&before, named.len() + 2);
    let (random_cost, random_energy) = (medians[named.len()], medians[named.len() + 1]);

    let found = match (&quiet, band) {
        (Some(q), Some(b)) => {
            let weight = if random_energy > 0.0 { b.emphasis / random_energy } else { 0.0 };
            let sum = CostSum(vec![(1.0, Box::new(information.clone())), (weight, Box::new(q.clone()))]);
            search(&sum, &plan, request)?
        }
        _ => search(&information, &plan, request)?,
    };
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
        band: energy(&x).map(|planned| BandEnergy { random: random_energy, planned }),
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

fn search(cost: &dyn Cost, plan: &SplinePlan, request: &InformationRequest) -> Result<MultiStart, PlanError> {
    multi_start(cost, plan, request.seed, request.starts, &request.options)
}

fn quiet_cost(band: &QuietBand, plan: &SplinePlan) -> Result<Quiet, PlanningError> {
    let &QuietBand { low, high, emphasis, .. } = band;
    let bad = |expected| Err(PlanningError::Band { low, high, emphasis, expected });
    let edges = low >= 0.0 && high > low && high.is_finite();
    if !edges {
        return bad("edges must be 0 <= low < high");
    }
    let usable = |x: f64| x >= 0.0 && x.is_finite();
    if !usable(emphasis) {
        return bad("the emphasis must be 0 or positive");
    }
    if band.weights.len() != plan.dof() || !band.weights.iter().all(|&w| usable(w)) {
        return bad("there must be one weight per joint, 0 or positive");
    }
    // A spacing of 1/(4 T) resolves the spectrum; the bound keeps a senseless band affordable.
    let span = match plan.spec().duration {
        Duration::Fixed(t) | Duration::Free { max: t, .. } => 4.0 * t * (high - low),
    };
    Ok(Quiet { low, high, points: span.ceil().clamp(1.0, 5000.0) as usize, weights: band.weights.clone() })
}

/// Infinite when `m` is not positive definite.
fn minus_log_det(m: &nalgebra::DMatrix<f64>) -> f64 {
    m.clone().cholesky().map_or(f64::INFINITY, |c| -2.0 * c.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>())
}
