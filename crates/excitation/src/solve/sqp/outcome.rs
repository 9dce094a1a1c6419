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
/// let options = SearchOptions { sqp: SqpOptions { iterations: 3, tolerance: 1e-9 }, starts: 1, ..SearchOptions::default() };
/// let found = search(&problem, None, &options, &Observer::default())?;
/// assert!(found.best.iterations <= 3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
/// let best: Outcome = search(&problem, None, &SearchOptions::default(), &Observer::default())?.best;
/// assert!(best.cost < best.start_cost && plan.violated(&best.x).is_none());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
