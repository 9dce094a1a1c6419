//! Plans for the parameters of the real system: warm starts from the rigid one, then the Fisher information itself.
//!
//! One value and gradient of the flexible information costs as much as some hundred of the rigid one, and a plan that is
//! rich for the rigid base is rich for most of the rest. So the rigid problem is solved from several starts, its
//! outcomes and as many random plans are rated by the true cost, and the best few are refined on it.

use super::{DEGREE, PER_SECOND, PER_SPAN, PRIOR, PlanningError};
use crate::objective::criterion::{Criterion, RelativeQuantity};
use crate::objective::fisher::FisherCost;
use crate::objective::information::Information;
use crate::plan::limits::{JointLimits, LimitReport, check_for_all_time};
use crate::plan::random::random_plan;
use crate::plan::spline::{Duration, End, PlanError, PlanSpec, SplinePlan};
use crate::solve::search::multi_start;
use crate::solve::sqp::{Outcome, SqpOptions, minimise};
use crate::system::flexible::FlexibleInformation;
use crate::system::prediction::about_com;
use crate::system::rigid::{RigidInformation, SensorNoise};
use ff_dynamics::motion::bspline::BSplineMotion;
use ff_model::{Dual, Inertia, Model, Params};
use nalgebra::DMatrix;

/// What to plan.
#[derive(Clone, Debug, PartialEq)]
pub struct FisherRequest {
    /// Start configuration, one entry per joint (rad or m).
    pub start: Vec<f64>,
    /// End configuration: given or free.
    pub end: End,
    /// Limits, one set per joint.
    pub limits: Vec<JointLimits>,
    /// Duration: given or free.
    pub duration: Duration,
    /// Free control points per joint.
    pub control_points: usize,
    /// Seed of all randomness.
    pub seed: u64,
    /// Starts of the rigid problem, at least 1; as many random plans are rated beside their outcomes.
    pub starts: usize,
    /// How many of the best are refined, at least 1, and how many of them at a time.
    pub refined: usize,
    /// Threads; the result does not depend on it.
    pub threads: usize,
    /// Settings of the rigid searches.
    pub warm: SqpOptions,
    /// Settings of the refinement.
    pub options: SqpOptions,
}

/// A plan for the parameters of the real system.
#[derive(Clone, Debug)]
pub struct FisherPlanned {
    /// The motion, rest to rest.
    pub motion: BSplineMotion,
    /// The decision problem it solves, and its variables.
    pub plan: SplinePlan,
    /// Variables of the plan.
    pub x: Vec<f64>,
    /// The refinement that found it: costs before and after, status, evaluations.
    pub outcome: Outcome,
    /// Costs of the plans that could have been refined, best first.
    pub rated: Vec<f64>,
    /// Proof that the limits hold for all time.
    pub limits: LimitReport,
    /// Information matrix of the plan.
    pub information: DMatrix<f64>,
}

/// Plans a rest-to-rest motion under `criterion` of `information`. A function of its arguments only. Allocates.
///
/// # Errors
/// [`PlanningError`]: limits that cannot be kept, bad numbers, no start of finite cost.
///
/// # Panics
/// If `params` belongs to another model than `information`, or a thread does.
pub fn plan_fisher(
    model: &Model,
    params: &Params<f64>,
    information: &FlexibleInformation,
    criterion: &Criterion,
    noise: SensorNoise,
    request: &FisherRequest,
) -> Result<FisherPlanned, PlanningError> {
    let plan = SplinePlan::new(PlanSpec {
        start: request.start.clone(),
        end: request.end.clone(),
        duration: request.duration,
        degree: DEGREE,
        free: request.control_points,
        limits: request.limits.clone(),
        refine: 1,
    })?;
    let source = RigidInformation::new(model, params, &(0..10).collect::<Vec<_>>(), noise)?;
    let (Duration::Fixed(longest) | Duration::Free { max: longest, .. }) = request.duration;
    let by_time = (PER_SECOND * longest).ceil().min(10_000.0) as usize;
    let samples = by_time.max(PER_SPAN * (request.control_points + 1)) + 1;
    let rigid = Information { source, samples, rate: noise.rate, delta: PRIOR };
    let found = multi_start(&rigid, &plan, request.seed, request.starts, &request.warm)?;
    let mut candidates: Vec<Vec<f64>> = found.all.into_iter().flatten().map(|o| o.x).collect();
    for i in 0..request.starts {
        candidates.push(random_plan(&plan, request.seed, (request.starts + i) as u64, 1.0)?);
    }
    let cost = FisherCost { information: information.clone(), criterion: criterion.clone() };
    let named = information.named();
    let mut rated: Vec<(f64, Vec<f64>)> = Vec::new();
    for x in candidates {
        let value = information.of_motion(&plan.motion(&x)?).and_then(|f| criterion.value_slope(&f, named));
        rated.extend(value.map(|v| (v.0, x)));
    }
    rated.sort_by(|a, b| a.0.total_cmp(&b.0));
    if rated.is_empty() {
        return Err(PlanError::Cost(f64::NAN).into());
    }
    let best: Vec<&Vec<f64>> = rated.iter().take(request.refined.max(1)).map(|r| &r.1).collect();
    let outcomes = in_threads(&best, request.threads, |x| minimise(&cost, &plan, x, &request.options));
    let outcome = match outcomes.iter().flatten().min_by(|a, b| a.cost.total_cmp(&b.cost)) {
        Some(o) => o.clone(),
        None => return Err(outcomes.into_iter().find_map(Result::err).unwrap_or(PlanError::Cost(f64::NAN)).into()),
    };
    let motion = plan.motion(&outcome.x)?;
    let matrix = information.of_motion(&motion).ok_or(PlanError::Cost(f64::NAN))?;
    Ok(FisherPlanned {
        limits: check_for_all_time(&motion, &request.limits, 1)?,
        motion,
        x: outcome.x.clone(),
        plan,
        outcome,
        rated: rated.into_iter().map(|r| r.0).collect(),
        information: matrix,
    })
}

/// `f` of every item, in order, at most `threads` at a time.
fn in_threads<X: Sync, Y: Send>(items: &[X], threads: usize, f: impl Fn(&X) -> Y + Sync) -> Vec<Y> {
    let mut out = Vec::with_capacity(items.len());
    for group in items.chunks(threads.max(1)) {
        if let [one] = group {
            out.push(f(one));
            continue;
        }
        std::thread::scope(|scope| {
            let handles: Vec<_> = group.iter().map(|x| scope.spawn(|| f(x))).collect();
            // A panic of a thread goes on in the caller.
            out.extend(handles.into_iter().map(|h| h.join().unwrap_or_else(|e| std::panic::resume_unwind(e))));
        });
    }
    out
}

/// Mass, centre of mass and inertia of the base as [`RelativeQuantity`]s: errors of the mass relative to it, of the
/// centre of mass relative to its distance from the frame origin, of the inertia about the centre of mass relative to
/// its Frobenius norm. (Entries that are zero, such as products of inertia, have no relative error of their own.)
/// `None` unless all ten parameters of the base are named. Allocates.
pub fn base_quantities(information: &FlexibleInformation) -> Option<Vec<RelativeQuantity>> {
    let named = &information.parameters()[..information.named()];
    let columns: Vec<usize> = (0..10).map(|k| named.iter().position(|p| p.index == k)).collect::<Option<_>>()?;
    let phi: Vec<f64> = columns.iter().map(|&c| information.values()[c]).collect();
    let scale: Vec<f64> = columns.iter().map(|&c| information.sizes()[c]).collect();
    let row = |slopes: &dyn Fn(usize) -> f64, k: f64| {
        let mut out = DMatrix::zeros(1, named.len());
        for i in 0..10 {
            out[(0, columns[i])] = k * slopes(i) * scale[i];
        }
        out
    };
    let dual: Vec<Dual<f64, 10>> = phi.iter().enumerate().map(|(k, &x)| Dual::variable(x, k)).collect();
    let derived = about_com(&dual);
    let body = Inertia::from_params(&phi);
    let (distance, norm) = (body.com().map_or(0.0, |c| c.norm()), body.about_com().norm());
    let stack = |rows: Vec<DMatrix<f64>>| DMatrix::from_fn(rows.len(), named.len(), |i, j| rows[i][(0, j)]);
    let usable = |x: f64| if x > 0.0 { x } else { 1.0 };
    let com = (0..3).map(|r| row(&|i| derived[r].eps[i], 1.0 / usable(distance))).collect();
    // Off the diagonal each entry stands for two of the matrix.
    let twice = [1.0, 2.0, 1.0, 2.0, 2.0, 1.0];
    let inertia = (0..6).map(|r| row(&|i| derived[3 + r].eps[i], f64::sqrt(twice[r]) / usable(norm))).collect();
    let one = |name: &str, rows| RelativeQuantity { name: name.into(), rows };
    Some(vec![
        one("base mass", row(&|i| f64::from(i == 0), 1.0 / phi[0])),
        one("base centre of mass", stack(com)),
        one("base inertia", stack(inertia)),
    ])
}

/// Every named parameter relative to its value, or to its size where that is zero. Allocates.
pub fn named_quantities(information: &FlexibleInformation) -> Vec<RelativeQuantity> {
    let n = information.named();
    let one = |i: usize| {
        let (value, size) = (information.values()[i].abs(), information.sizes()[i]);
        let mut rows = DMatrix::zeros(1, n);
        rows[(0, i)] = if value > 0.0 { size / value } else { 1.0 };
        RelativeQuantity { name: information.names()[i].0.clone(), rows }
    };
    (0..n).map(one).collect()
}
