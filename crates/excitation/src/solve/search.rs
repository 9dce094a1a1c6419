//! Search from many starts, in parallel, and verification of what is found.
//!
//! Local minima differ far more than solvers do, so several starts are the global strategy. Start `i` is a function of
//! the seed and `i` alone: a random plan inside the joint limits; if it breaks constraints, contracted towards the
//! straight (or resting) plan until it does not, and if that does not help, moved by the optimiser without the cost.
//! Results do not depend on the number of threads.
//!
//! The best plan is simulated in full ([`crate::solve::verdict`]). What the simulation shows beyond the rows of the search is
//! added to them, sample by sample, and the search goes on from that plan with the derivatives it has (defect
//! correction), until both agree: at most [`ROUNDS`] times. What is returned is the best plan that held in simulation.

use crate::constraint::HeldSystem;
use crate::objective::Cost;
use crate::plan::error::PlanError;
use crate::plan::random::{feasible_start, random_plan};
use crate::plan::spline::SplinePlan;
use crate::solve::conflict::{Diagnosis, diagnose};
use crate::solve::observer::{Observer, StartObserver};
use crate::solve::problem::Problem;
use crate::solve::sqp::minimise_observed;
use crate::solve::sqp::outcome::{Outcome, SqpOptions};
use crate::solve::sqp::restoration::restore;
use crate::solve::verdict::{Verdict, inspect};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// How often rows are corrected after the full simulation.
pub const ROUNDS: usize = 12;
/// Verified room (relative) with which a constraint counts as used up.
const USED: f64 = 2e-3;
/// Gain (relative to `1 + |cost|`) below which no further round is made.
const GAIN: f64 = 1e-3;
/// What corrected constraints are kept away from the limit (relative).
const AIM: f64 = 1e-4;
/// Iterations without the cost that a start may take to become feasible.
const RESTORING: usize = 60;
/// Random plans use at least this part of the way to their limits.
const FRACTION: f64 = 0.5;

/// Settings of [`search`].
///
/// ```
/// # use excitation::{Duration, End, JointLimits, PlanSpec, SplinePlan, random_plan};
/// # let limits = JointLimits { lower: -1.5, upper: 1.7, velocity: 0.17, acceleration: 0.15, jerk: None };
/// # let (start, end, duration) = (vec![0.3, -0.2], End::Free, Duration::Fixed(30.0));
/// # let plan = SplinePlan::new(PlanSpec { start, end, duration, degree: 5, free: 8, limits: vec![limits; 2], refine: 1 })?;
/// # use excitation::solve::Problem;
/// # use excitation::*;
/// # /// Control points near zero: a lazy motion.
/// # struct Lazy;
/// # impl Cost for Lazy {
/// #     fn value_gradient(&self, _: &SplinePlan, x: &[f64], grad: &mut [f64]) -> f64 {
/// #         grad.iter_mut().zip(x).for_each(|(g, x)| *g = 2.0 * x);
/// #         x.iter().map(|x| x * x).sum()
/// #     }
/// # }
/// # let problem = Problem::new(&Lazy, &plan);
///
/// // The result does not depend on the number of threads.
/// let options = SearchOptions { seed: 7, starts: 3, ..SearchOptions::default() };
/// let one = search(&problem, None, &options, &Observer::default())?;
/// let two = search(&problem, None, &SearchOptions { threads: 2, ..options }, &Observer::default())?;
/// assert_eq!((one.all.len(), one.best.x), (3, two.best.x));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchOptions {
    /// Seed of all randomness.
    pub seed: u64,
    /// Local searches, at least 1.
    pub starts: usize,
    /// Threads, at least 1; the result does not depend on them.
    pub threads: usize,
    /// Settings of the local searches.
    pub sqp: SqpOptions,
    /// Time after which every local search ends with the best it has.
    pub time_limit: Option<Duration>,
}

impl Default for SearchOptions {
    fn default() -> Self {
        Self { seed: 1, starts: 6, threads: 1, sqp: SqpOptions::default(), time_limit: None }
    }
}

/// The best plan, how it was found, and proof that it keeps everything.
///
/// ```
/// # use excitation::{Duration, End, JointLimits, PlanSpec, SplinePlan, random_plan};
/// # let limits = JointLimits { lower: -1.5, upper: 1.7, velocity: 0.17, acceleration: 0.15, jerk: None };
/// # let (start, end, duration) = (vec![0.3, -0.2], End::Free, Duration::Fixed(30.0));
/// # let plan = SplinePlan::new(PlanSpec { start, end, duration, degree: 5, free: 8, limits: vec![limits; 2], refine: 1 })?;
/// # use excitation::solve::Problem;
/// # use excitation::*;
/// # /// Control points near zero: a lazy motion.
/// # struct Lazy;
/// # impl Cost for Lazy {
/// #     fn value_gradient(&self, _: &SplinePlan, x: &[f64], grad: &mut [f64]) -> f64 {
/// #         grad.iter_mut().zip(x).for_each(|(g, x)| *g = 2.0 * x);
/// #         x.iter().map(|x| x * x).sum()
/// #     }
/// # }
/// # let problem = Problem::new(&Lazy, &plan);
///
/// let found: Found = search(&problem, None, &SearchOptions::default(), &Observer::default())?;
/// assert!(found.verdict.holds); // proved for all time
/// assert!(found.all.iter().flatten().all(|other| other.cost >= found.best.cost));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Found {
    /// The plan: variables, cost, why the search stopped.
    pub best: Outcome,
    /// Every local search, in the order of the starts; after them one from a plan found by other means, if no start led to
    /// one.
    pub all: Vec<Result<Outcome, PlanError>>,
    /// Margins: joint limits for all time, constraints by full simulation.
    pub verdict: Verdict,
    /// How often rows were corrected.
    pub rounds: usize,
}

/// Finds a plan that makes the cost of `problem` small and keeps its joint limits and constraints, or says which of them
/// contradict each other. `system` is what the plan is verified on; it may be absent only without
/// constraints. Allocates; starts `options.threads` threads.
///
/// ```
/// # use excitation::{Duration, End, JointLimits, PlanSpec, SplinePlan, random_plan};
/// # let limits = JointLimits { lower: -1.5, upper: 1.7, velocity: 0.17, acceleration: 0.15, jerk: None };
/// # let (start, end, duration) = (vec![0.3, -0.2], End::Free, Duration::Fixed(30.0));
/// # let plan = SplinePlan::new(PlanSpec { start, end, duration, degree: 5, free: 8, limits: vec![limits; 2], refine: 1 })?;
/// # use excitation::solve::Problem;
/// # use excitation::*;
/// # /// Control points near zero: a lazy motion.
/// # struct Lazy;
/// # impl Cost for Lazy {
/// #     fn value_gradient(&self, _: &SplinePlan, x: &[f64], grad: &mut [f64]) -> f64 {
/// #         grad.iter_mut().zip(x).for_each(|(g, x)| *g = 2.0 * x);
/// #         x.iter().map(|x| x * x).sum()
/// #     }
/// # }
/// # let problem = Problem::new(&Lazy, &plan);
///
/// let found = search(&problem, None, &SearchOptions::default(), &Observer::default())?;
/// // Both joints begin away from zero; the best plan brings them there and stays.
/// let end = plan.motion(&found.best.x)?.control().column(8).norm();
/// assert!(found.best.cost < 0.3 * found.best.start_cost && end < 0.1, "{end}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`PlanError`]: `Conflict` names what cannot be kept together, `Interrupted` when there is no plan yet, `Unverified`
/// when the full simulation breaks a constraint in spite of all correction, that of the first start otherwise.
pub fn search(
    problem: &Problem<'_>,
    system: Option<&HeldSystem>,
    options: &SearchOptions,
    observer: &Observer<'_>,
) -> Result<Found, PlanError> {
    search_with(problem, system, options, observer, &|i, w| start(problem, options.seed, i as u64, w))
}

/// [`search`] from given plans, which must keep the limits of the joints, instead of random ones: one local search each.
/// Allocates; starts threads.
///
/// # Errors
/// As [`search`].
pub fn search_from(
    problem: &Problem<'_>,
    system: Option<&HeldSystem>,
    from: &[Vec<f64>],
    options: &SearchOptions,
    observer: &Observer<'_>,
) -> Result<Found, PlanError> {
    let options = SearchOptions { starts: from.len(), ..*options };
    search_with(problem, system, &options, observer, &|i, w| feasible_near(problem, &from[i], w))
}

/// The plan that start `i` begins with.
type Begin<'a> = dyn Fn(usize, &StartObserver<'_>) -> Result<Vec<f64>, PlanError> + Sync + 'a;

fn search_with(
    problem: &Problem<'_>,
    system: Option<&HeldSystem>,
    options: &SearchOptions,
    observer: &Observer<'_>,
    begin: &Begin<'_>,
) -> Result<Found, PlanError> {
    let argument =
        |what, got: usize| Err(PlanError::Argument { what, got: got.to_string(), expected: "at least 1".into() });
    if options.starts == 0 {
        return argument("starts", 0);
    }
    if options.threads == 0 {
        return argument("threads", 0);
    }
    if system.is_none() && !problem.constraints.is_empty() {
        let (got, expected) = ("none".into(), "the system, when there are constraints".into());
        return Err(PlanError::Argument { what: "system to verify on", got, expected });
    }
    let named = system.filter(|_| problem.joints.is_empty()).map(|s| problem.clone().named(s.model()));
    let problem = named.as_ref().unwrap_or(problem);
    let deadline = options.time_limit.and_then(|t| Instant::now().checked_add(t));
    let deadline = [deadline, observer.deadline].into_iter().flatten().min();
    let latch = AtomicBool::new(false);
    let observer = StartObserver { observer: Observer { deadline, ..*observer }, start: 0, latch: Some(&latch) };
    let mut all = run_all(problem, options, &observer, begin);
    if all.iter().all(Result::is_err) {
        all.push(Ok(diagnosed(problem, &all, options, &observer)?));
    }
    let best = all.iter().flatten().min_by(|a, b| a.cost.total_cmp(&b.cost)).cloned();
    let Some(best) = best else { return Err(PlanError::Undefined) };
    let (best, verdict, rounds) = verify_and_correct(problem, system, best, options, &observer)?;
    Ok(Found { best, all, verdict, rounds })
}

/// When no start led to a plan: why, as an error, or a plan that the diagnosis has found.
fn diagnosed(
    problem: &Problem<'_>,
    all: &[Result<Outcome, PlanError>],
    options: &SearchOptions,
    observer: &StartObserver<'_>,
) -> Result<Outcome, PlanError> {
    let errors: Vec<&PlanError> = all.iter().filter_map(|r| r.as_ref().err()).collect();
    if let Some(e) = errors.iter().find(|e| matches!(e, PlanError::Interrupted)) {
        return Err((*e).clone());
    }
    if errors.iter().any(|e| matches!(e, PlanError::Broken { .. } | PlanError::Infeasible { .. })) {
        return match diagnose(problem, observer)? {
            Diagnosis::Plan(x) => minimise_observed(problem, &x, &options.sqp, observer),
            Diagnosis::Conflict(c) => Err(PlanError::Conflict(Box::new(c))),
        };
    }
    Err(errors[0].clone())
}

fn run_all(
    problem: &Problem<'_>,
    options: &SearchOptions,
    observer: &StartObserver<'_>,
    begin: &Begin<'_>,
) -> Vec<Result<Outcome, PlanError>> {
    let one = |i: usize| {
        let observer = StartObserver { start: i, ..*observer };
        // Searches not started when the search is cut short report `Interrupted`; the first ones always start.
        if i >= options.threads && observer.cut_short() {
            return Err(PlanError::Interrupted);
        }
        let x = begin(i, &observer)?;
        minimise_observed(problem, &x, &options.sqp, &observer)
    };
    let threads = options.threads.min(options.starts);
    if threads == 1 {
        return (0..options.starts).map(one).collect();
    }
    let (next, results) = (AtomicUsize::new(0), Mutex::new(vec![None; options.starts]));
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    if i >= options.starts {
                        break;
                    }
                    let result = one(i);
                    if let Ok(mut r) = results.lock() {
                        r[i] = Some(result);
                    }
                }
            });
        }
    });
    let results = results.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    results.into_iter().map(|r| r.unwrap_or(Err(PlanError::Interrupted))).collect()
}

/// A feasible plan for start `stream`.
pub(crate) fn start(
    problem: &Problem<'_>,
    seed: u64,
    stream: u64,
    observer: &StartObserver<'_>,
) -> Result<Vec<f64>, PlanError> {
    let x = random_plan(problem.plan, seed, stream, FRACTION)?;
    feasible_near(problem, &x, observer)
}

/// `x` itself, or a plan near it that keeps the constraints.
pub(crate) fn feasible_near(
    problem: &Problem<'_>,
    x: &[f64],
    observer: &StartObserver<'_>,
) -> Result<Vec<f64>, PlanError> {
    if problem.constraints.is_empty() || problem.excess(x) <= 0.0 {
        return Ok(x.to_vec());
    }
    if let Some(x) = contracted(problem, x) {
        return Ok(x);
    }
    match restore(problem, x, RESTORING, observer)? {
        Ok(x) => Ok(x),
        Err(obstacle) => Err(problem.worst_broken(&obstacle.rows)),
    }
}

/// The farthest plan towards `x` from the straight one, of the same duration, that keeps the constraints.
fn contracted(problem: &Problem<'_>, x: &[f64]) -> Option<Vec<f64>> {
    let plan = problem.plan;
    let centre = feasible_start(plan, plan.duration(x)).ok()?;
    let towards = |a: f64| -> Vec<f64> { centre.iter().zip(x).map(|(c, x)| c + a * (x - c)).collect() };
    let fine = |y: &[f64]| problem.violated(y).is_none() && problem.excess(y) <= 0.0;
    let mut a = 1.0;
    for _ in 0..20 {
        a *= 0.8;
        let y = towards(a);
        if fine(&y) {
            return Some(y);
        }
    }
    None
}

/// Verifies, corrects the rows by what the simulation shows, and goes on from there until both agree.
fn verify_and_correct(
    problem: &Problem<'_>,
    system: Option<&HeldSystem>,
    first: Outcome,
    options: &SearchOptions,
    observer: &StartObserver<'_>,
) -> Result<(Outcome, Verdict, usize), PlanError> {
    let (mut verdict, mut seen) = inspect(problem, system, &first.x)?;
    let mut corrected = problem.clone();
    let mut rows = vec![0.0; problem.rows()];
    let (mut last, mut misses) = (first, 0);
    let mut kept: Option<(Outcome, Verdict)> = None;
    for round in 0..=ROUNDS {
        let mut gain = f64::INFINITY;
        if verdict.holds {
            gain = kept.as_ref().map_or(gain, |k| k.0.cost - last.cost);
            if gain > 0.0 {
                kept = Some((last.clone(), verdict.clone()));
            }
        }
        // The correction is that of this plan; where it was not enough, the next plan keeps some distance too.
        misses += u32::from(round > 0 && !verdict.holds);
        let further = (AIM * f64::from(1 << misses)).max(0.3 * seen.iter().copied().fold(0.0, f64::max));
        let further = if round == 0 { AIM } else { further };
        let near = |rows: &[f64]| rows.iter().any(|r| *r > -USED);
        problem.evaluate(&last.x, &mut rows, None);
        let settled = verdict.holds
            // At the limit in simulation too, or far from it in both, or nothing more to gain.
            && (near(&seen) || !near(&rows) || gain < GAIN * (1.0 + last.cost.abs()));
        if (settled || round == ROUNDS || observer.cut_short())
            && let Some((best, verdict)) = kept.take()
        {
            return Ok((best, verdict, round));
        }
        if round == ROUNDS {
            break;
        }
        corrected.correction = seen.iter().zip(&rows).map(|(seen, row)| seen - row + further).collect();
        let next = match minimise_observed(&corrected, &last.x, &options.sqp, observer) {
            Ok(next) => next,
            // Cut short, or stuck outside: a plan closer to the straight one will do.
            Err(_) => match feasible_near(&corrected, &last.x, observer) {
                Ok(x) => minimise_observed(&corrected, &x, &options.sqp, observer)?,
                Err(_) => break,
            },
        };
        last = Outcome {
            start_cost: last.start_cost,
            iterations: last.iterations + next.iterations,
            evaluations: last.evaluations + next.evaluations,
            ..next
        };
        (verdict, seen) = inspect(problem, system, &last.x)?;
    }
    kept.map(|(best, verdict)| (best, verdict, ROUNDS)).ok_or_else(|| unverified(&verdict))
}

fn unverified(verdict: &Verdict) -> PlanError {
    match verdict.worst() {
        Some(m) => {
            PlanError::Unverified { name: m.name, item: m.item.clone(), value: m.value, limit: m.limit, unit: m.unit }
        }
        None => PlanError::Undefined,
    }
}

/// Outcomes of several starts without constraints.
#[derive(Clone, Debug)]
pub struct MultiStart {
    /// The best feasible outcome.
    pub best: Outcome,
    /// All outcomes, in the order of the starts; an error where a start was unusable.
    pub all: Vec<Result<Outcome, PlanError>>,
}

/// [`crate::solve::sqp::minimise`] from `starts` random plans (streams `0..starts` of `seed`), joint limits only, in this thread.
/// A function of its arguments only. Allocates.
///
/// # Errors
/// [`PlanError`] of the first start if none succeeds; `Argument` if `starts` is zero.
pub fn multi_start(
    cost: &dyn Cost,
    plan: &SplinePlan,
    seed: u64,
    starts: usize,
    options: &SqpOptions,
) -> Result<MultiStart, PlanError> {
    let search = SearchOptions { seed, starts, threads: 1, sqp: *options, time_limit: None };
    let problem = Problem::new(cost, plan);
    let all = run_all(&problem, &search, &StartObserver::default(), &|i, w| start(&problem, seed, i as u64, w));
    let best = all.iter().flatten().min_by(|a, b| a.cost.total_cmp(&b.cost)).cloned();
    match (best, all.first()) {
        (Some(best), _) => Ok(MultiStart { best, all }),
        (None, Some(Err(e))) => Err(e.clone()),
        _ => Err(PlanError::Argument { what: "starts", got: "0".into(), expected: "at least 1".into() }),
    }
}
