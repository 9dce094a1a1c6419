//! State of one search: the iterate, the merit function, and the best feasible plan so far.

use crate::plan::error::PlanError;
use crate::plan::spline::{Duration, SplinePlan};
use crate::solve::problem::{Problem, largest};
use crate::solve::sqp::joint_limits::JointOrder;
use crate::solve::sqp::outcome::Status;
use nalgebra::{DMatrix, DVector};

/// Distance (relative) that steps aim to keep from constraints.
pub(crate) const AIM: f64 = 1e-6;

/// An iterate with everything that is known there.
pub(crate) struct Iterate {
    /// Variables.
    pub(crate) x: Vec<f64>,
    /// Cost.
    pub(crate) f: f64,
    /// Gradient over scaled variables.
    pub(crate) g: DVector<f64>,
    /// Rows of the constraints.
    pub(crate) c: Vec<f64>,
    /// Jacobian of the rows over scaled variables.
    pub(crate) j: DMatrix<f64>,
}

/// A search under way: its iterate, its approximation of the Lagrangian, its best plan, and what it has cost.
pub(crate) struct SearchState<'a, 'b> {
    pub(crate) problem: &'a Problem<'b>,
    /// False when any feasible plan will do.
    pub(crate) with_cost: bool,
    /// Natural size of each variable.
    pub(crate) scale: Vec<f64>,
    pub(crate) at: Iterate,
    /// Hessian of the Lagrangian.
    pub(crate) h: DMatrix<f64>,
    /// Penalty of the merit function.
    pub(crate) mu: f64,
    /// Rows with derivatives, which enter the subproblem.
    pub(crate) differentiated: Vec<bool>,
    /// Rows without derivatives that a trial step has broken.
    pub(crate) blocking: Vec<bool>,
    pub(crate) start_cost: f64,
    /// Cost, variables and largest row of the best feasible iterate.
    pub(crate) best: Option<(f64, Vec<f64>, f64)>,
    pub(crate) status: Status,
    pub(crate) iterations: usize,
    pub(crate) evaluations: usize,
    /// Active joint limits with the sums of their multipliers, at the last subproblem.
    pub(crate) joint_multipliers: Vec<(JointOrder, f64)>,
    /// Multipliers of the constraints, at the last subproblem.
    pub(crate) multipliers: Vec<f64>,
}

impl<'a, 'b> SearchState<'a, 'b> {
    /// At `start`, which must keep the joint limits.
    ///
    /// # Errors
    /// [`PlanError::Infeasible`], [`PlanError::Cost`], [`PlanError::Undefined`], [`PlanError::Argument`].
    pub(crate) fn new(problem: &'a Problem<'b>, start: &[f64], with_cost: bool) -> Result<Self, PlanError> {
        let plan = problem.plan;
        let n = plan.variables();
        plan.motion(start)?;
        if let Some(which) = problem.violated(start) {
            return Err(PlanError::Infeasible { which });
        }
        let rows = problem.rows();
        let at =
            Iterate { x: start.to_vec(), f: 0.0, g: DVector::zeros(n), c: vec![0.0; rows], j: DMatrix::zeros(rows, n) };
        let mut state = Self {
            problem,
            with_cost,
            scale: variable_scales(plan, start),
            at,
            h: DMatrix::identity(n, n),
            mu: 1.0,
            differentiated: vec![false; rows],
            blocking: vec![false; rows],
            start_cost: 0.0,
            best: None,
            status: Status::IterationLimit,
            iterations: 0,
            evaluations: 1,
            joint_multipliers: Vec::new(),
            multipliers: vec![0.0; rows],
        };
        let mut raw = vec![0.0; n];
        state.at.f = state.cost(start, &mut raw);
        if !state.at.f.is_finite() || raw.iter().any(|g| !g.is_finite()) {
            return Err(PlanError::Cost(state.at.f));
        }
        state.at.g = state.scaled(&raw);
        state.start_cost = state.at.f;
        problem.evaluate(start, &mut state.at.c, None);
        state.differentiate(|_| false);
        if !state.at.c.iter().chain(state.at.j.iter()).all(|v| v.is_finite()) {
            return Err(PlanError::Undefined);
        }
        if with_cost {
            state.h *= state.at.g.norm().max(1e-12);
            state.mu = state.at.g.norm().max(1.0);
        }
        state.keep();
        Ok(state)
    }
    /// Cost at `x`, with its gradient in `raw`; zero while any feasible plan will do.
    pub(crate) fn cost(&self, x: &[f64], raw: &mut [f64]) -> f64 {
        if self.with_cost { self.problem.cost.value_gradient(self.problem.plan, x, raw) } else { 0.0 }
    }
    /// A gradient over scaled variables.
    pub(crate) fn scaled(&self, raw: &[f64]) -> DVector<f64> {
        DVector::from_fn(raw.len(), |i, _| raw[i] * self.scale[i])
    }
    /// Derivatives of the rows at the iterate, whose values are known: of those near their limits, and of `also`.
    pub(crate) fn differentiate(&mut self, also: impl Fn(usize) -> bool) {
        if self.at.c.is_empty() {
            return;
        }
        self.problem.select(&self.at.c, &mut self.differentiated);
        self.differentiated.iter_mut().enumerate().for_each(|(i, w)| *w |= also(i));
        self.problem.evaluate(&self.at.x, &mut self.at.c, Some((&self.differentiated, &mut self.at.j)));
        for (i, s) in self.scale.iter().enumerate() {
            self.at.j.column_mut(i).iter_mut().for_each(|v| *v *= s);
        }
    }
    /// Keeps the iterate if it is the best feasible one so far.
    pub(crate) fn keep(&mut self) {
        let excess = largest(&self.at.c);
        if excess <= 0.0 && self.best.as_ref().is_none_or(|b| self.at.f < b.0) {
            self.best = Some((self.at.f, self.at.x.clone(), excess));
        }
    }
    /// Violation that the merit function penalises: `max(0, largest row + AIM)`.
    pub(crate) fn violation(c: &[f64]) -> f64 {
        let worst = largest(c) + AIM;
        if worst.is_nan() { f64::NAN } else { worst.max(0.0) }
    }
    /// Merit function `f + mu max(0, c)`.
    pub(crate) fn merit(&self, f: f64, c: &[f64]) -> f64 {
        f + self.mu * Self::violation(c)
    }
}

/// Natural size of each variable: the part of the range that one control point can move against its
/// neighbours.
fn variable_scales(plan: &SplinePlan, x: &[f64]) -> Vec<f64> {
    let t = plan.duration(x);
    let spans = plan.spec().free as f64 + 1.0;
    let mut out = Vec::with_capacity(plan.variables());
    for l in &plan.spec().limits {
        let s = (0.5 * (l.upper - l.lower)).min(l.velocity * t / spans);
        out.extend(std::iter::repeat_n(if s.is_finite() { s } else { 1.0 }, plan.per_joint()));
    }
    if let Duration::Free { min, max } = plan.spec().duration {
        out.push((max - min).min(t));
    }
    out
}
