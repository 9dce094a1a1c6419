//! Sequential quadratic programming for a smooth cost under the limits of a plan and further constraints.
//!
//! Damped BFGS (M. J. D. Powell 1978; Nocedal and Wright, *Numerical Optimization*, 2nd ed., procedure 18.2),
//! subproblems by Clarabel, backtracking line search.
//!
//! *Joint limits* hold at every iterate. At fixed duration they are linear. With a free duration a limit reads `M x
//! <= L T^r`; `T^r` is convex, so its tangent lies below it and the linearised limit is an inner approximation.
//!
//! *Constraints* `c(x) <= 0` ([`crate::constraint`]) are linearised with one elastic variable (Nocedal and Wright,
//! section 18.5 with the maximum instead of the sum),
//!
//! ```text
//! min 1/2 d'Hd + g'd + mu s    under    c + J d <= s,  s >= 0,  joint limits,
//! ```
//!
//! which always has a solution, with the merit function `f + mu max(0, c)`, a second-order correction where the full step
//! leaves a curved constraint (section 18.3), and `H` for the Lagrangian. The penalty `mu` grows until it exceeds the
//! multipliers, and until the step reduces a violation as far as it can. The best iterate that keeps everything is
//! kept, whatever comes after it.
pub(crate) mod bfgs;
pub(crate) mod iterations;
pub(crate) mod joint_limits;
pub(crate) mod line_search;
pub(crate) mod outcome;
pub(crate) mod restoration;
pub(crate) mod state;
pub(crate) mod subproblem;

pub use outcome::{Outcome, SqpOptions, Status};

use crate::objective::Cost;
use crate::plan::error::PlanError;
use crate::plan::spline::SplinePlan;
use crate::solve::observer::{Observer, StartObserver};
use crate::solve::problem::Problem;
use state::SearchState;

/// Makes `cost` small from a feasible `start`. Never returns an infeasible plan. Allocates.
///
/// # Errors
/// [`PlanError`]: `Infeasible` names the limit that the start breaks, `Cost` tells that the cost or its
/// gradient is not finite there, `Argument` that `start` has the wrong length.
pub fn minimise(cost: &dyn Cost, plan: &SplinePlan, start: &[f64], options: &SqpOptions) -> Result<Outcome, PlanError> {
    minimise_under(&Problem::new(cost, plan), start, options, &Observer::default())
}

/// Makes the cost small from a `start` that keeps the joint limits; it may break constraints. The plan returned keeps
/// everything. Allocates.
///
/// # Errors
/// As [`minimise`]; [`PlanError::Broken`] names the constraint that the search could not satisfy.
pub fn minimise_under(
    problem: &Problem<'_>,
    start: &[f64],
    options: &SqpOptions,
    observer: &Observer<'_>,
) -> Result<Outcome, PlanError> {
    minimise_observed(problem, start, options, &StartObserver { observer: *observer, ..StartObserver::default() })
}

/// [`minimise_under`] as one of several searches.
pub(crate) fn minimise_observed(
    problem: &Problem<'_>,
    start: &[f64],
    options: &SqpOptions,
    observer: &StartObserver<'_>,
) -> Result<Outcome, PlanError> {
    let end = SearchState::new(problem, start, true)?.solve(options, observer);
    let outcome = |(f, x, excess): (f64, Vec<f64>, f64)| Outcome {
        x,
        cost: f,
        start_cost: end.start_cost,
        excess,
        status: end.status,
        iterations: end.iterations,
        evaluations: end.evaluations,
    };
    match end.best {
        Some(best) => Ok(outcome(best)),
        None if matches!(end.status, Status::Interrupted | Status::TimeLimit) => Err(PlanError::Interrupted),
        None => Err(problem.worst_broken(&end.at.c)),
    }
}
