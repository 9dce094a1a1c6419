//! Settings of an optimisation, and what comes of it.

/// How an optimisation ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// The decrease predicted by the quadratic model is below the tolerance.
    Converged,
    /// No step decreases the cost, or the subproblem failed, before the tolerance was met.
    Stalled,
    /// The iteration limit came first.
    IterationLimit,
    /// The caller asked for an end; this is the best plan until then.
    Interrupted,
    /// Time was up; this is the best plan until then.
    TimeLimit,
}

impl std::fmt::Display for Status {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Converged => "converged",
            Self::Stalled => "stalled: no step improves the plan",
            Self::IterationLimit => "stopped at the iteration limit",
            Self::Interrupted => "interrupted",
            Self::TimeLimit => "stopped at the time limit",
        })
    }
}

/// Settings of `minimise`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SqpOptions {
    /// Greatest number of iterations.
    pub iterations: usize,
    /// Converged when the predicted decrease is below `tolerance (1 + |cost|)`.
    pub tolerance: f64,
}

impl Default for SqpOptions {
    fn default() -> Self {
        Self { iterations: 200, tolerance: 1e-6 }
    }
}

/// A feasible trajectory and how it was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Variables of the best iterate; feasible.
    pub x: Vec<f64>,
    /// Its cost.
    pub cost: f64,
    /// Cost of the start.
    pub start_cost: f64,
    /// Largest relative excess of a constraint at `x`, not above 0; minus infinity without constraints.
    pub excess: f64,
    /// How the search ended.
    pub status: Status,
    /// Iterations done.
    pub iterations: usize,
    /// Evaluations of the cost.
    pub evaluations: usize,
}
