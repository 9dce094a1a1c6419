//! Why a plan cannot be made, and which limit of a joint or of the duration stands against it.

use crate::plan::limits::{LimitError, Quantity};
use crate::solve::demand::Conflict;
use ff_dynamics::SimError;
use ff_dynamics::motion::bspline::BSplineError;
use thiserror::Error;

/// Why a plan is impossible.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum PlanError {
    /// Bad limits.
    #[error(transparent)]
    Limits(#[from] LimitError),
    /// Bad degree, number of points or duration.
    #[error(transparent)]
    Spline(#[from] BSplineError),
    /// Lengths or numbers that do not fit.
    #[error("{what}: {got}, expected {expected}")]
    Argument {
        /// Which argument.
        what: &'static str,
        /// What was given.
        got: String,
        /// What was expected.
        expected: String,
    },
    /// A constraint is broken by what is asked for.
    #[error("{which} is broken")]
    Infeasible {
        /// The constraint.
        which: PlanLimit,
    },
    /// The cost is not finite at the start.
    #[error("the cost at the start is {0}; give a start that moves")]
    Cost(f64),
    /// A constraint that a single search could not satisfy.
    #[error("{name} of {item} stays at {value} {unit}, limit {limit} {unit}; search from other starts")]
    Broken {
        /// What is limited.
        name: &'static str,
        /// Of what.
        item: String,
        /// Value at the end of the search.
        value: f64,
        /// The limit.
        limit: f64,
        /// Unit of both.
        unit: &'static str,
    },
    /// Demands that contradict each other; exit code 13.
    #[error(transparent)]
    Conflict(Box<Conflict>),
    /// A constraint is not defined (not finite) at the start of the search.
    #[error("a constraint is not defined at the start of the search; check masses, inertias and solids")]
    Undefined,
    /// The search was ended before it found a plan that keeps everything.
    #[error("ended before a feasible plan was found; allow more time")]
    Interrupted,
    /// The plan cannot be verified by simulation.
    #[error("the plan cannot be simulated: {0}")]
    Simulation(#[from] SimError),
    /// Constraints that hold for the appendages held do not hold with the appendages swinging.
    #[error(
        "{name} of {item} is {value} {unit} in the full simulation, limit {limit} {unit}, and keeping away from the \
             limit did not help; loosen it, or plan slower"
    )]
    Unverified {
        /// What is limited.
        name: &'static str,
        /// Of what.
        item: String,
        /// Value in the full simulation.
        value: f64,
        /// The limit.
        limit: f64,
        /// Unit of both.
        unit: &'static str,
    },
}

impl PlanError {
    /// True when what is asked for cannot be had (exit code 13), rather than being asked for wrongly.
    pub fn is_ill_posed(&self) -> bool {
        use PlanError::{Broken, Conflict, Infeasible, Unverified};
        matches!(self, Broken { .. } | Conflict(_) | Infeasible { .. } | Unverified { .. })
    }
}

/// One limit of a joint, or one bound of the duration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanLimit {
    /// Joint index; `None` for the bounds of the duration.
    pub joint: Option<usize>,
    /// Which limit.
    pub quantity: Quantity,
    /// Value of the limit.
    pub limit: f64,
    /// How far it is broken (same unit), 0 when only an infeasibility certificate is known.
    pub excess: f64,
}

impl std::fmt::Display for PlanLimit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.joint {
            Some(j) => write!(f, "{} {} of joint {j} (by {:.3e})", self.quantity, self.limit, self.excess),
            None => write!(f, "bound {} s of the duration (by {:.3e} s)", self.limit, self.excess),
        }
    }
}
