//! Search for a plan that keeps the constraints, whatever its cost.

use crate::plan::error::PlanError;
use crate::solve::observer::StartObserver;
use crate::solve::problem::{Problem, largest};
use crate::solve::sqp::joint_limits::JointOrder;
use crate::solve::sqp::outcome::{SqpOptions, Status};
use crate::solve::sqp::state::SearchState;

/// Where a search for a feasible plan ended without one.
pub(crate) struct Obstacle {
    /// Variables there.
    pub(crate) x: Vec<f64>,
    /// Largest relative excess.
    pub(crate) excess: f64,
    /// All rows.
    pub(crate) rows: Vec<f64>,
    /// Active joint limits with the sums of their multipliers.
    pub(crate) joints: Vec<(JointOrder, f64)>,
    /// Multipliers of the rows.
    pub(crate) multipliers: Vec<f64>,
}

/// A plan that keeps all constraints, near `start`, which keeps the joint limits; if the search finds none, the last
/// iterate and the multipliers there.
///
/// # Errors
/// [`PlanError::Interrupted`], and those of a bad start.
pub(crate) fn restore(
    problem: &Problem<'_>,
    start: &[f64],
    iterations: usize,
    observer: &StartObserver<'_>,
) -> Result<Result<Vec<f64>, Obstacle>, PlanError> {
    let options = SqpOptions { iterations, tolerance: 1e-9 };
    let end = SearchState::new(problem, start, false)?.solve(&options, observer);
    if matches!(end.status, Status::Interrupted | Status::TimeLimit) && end.best.is_none() {
        return Err(PlanError::Interrupted);
    }
    Ok(match end.best {
        Some((_, x, _)) => Ok(x),
        None => Err(Obstacle {
            x: end.at.x,
            excess: largest(&end.at.c),
            rows: end.at.c,
            joints: end.joint_multipliers,
            multipliers: end.multipliers,
        }),
    })
}
