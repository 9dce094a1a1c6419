//! Iterations of a search: subproblem, line search, and the tests that end it.

use crate::solve::observer::{Progress, StartObserver};
use crate::solve::problem::largest;
use crate::solve::sqp::joint_limits::JointLimitRows;
use crate::solve::sqp::line_search::LineSearch;
use crate::solve::sqp::outcome::{SqpOptions, Status};
use crate::solve::sqp::state::SearchState;
use crate::solve::sqp::subproblem::{Direction, PENALTY, Step};
use nalgebra::DMatrix;

/// A search for a feasible plan gives up when this many iterations leave more than [`STANDSTILL`] of the violation.
const WINDOW: usize = 6;
/// Part of the violation that counts as no progress.
const STANDSTILL: f64 = 0.95;

impl SearchState<'_, '_> {
    /// Iterates until the search ends; `status` says how.
    pub(crate) fn solve(mut self, options: &SqpOptions, observer: &StartObserver<'_>) -> Self {
        let (mut fresh, mut before) = (true, f64::INFINITY);
        while self.iterations < options.iterations {
            let worst = largest(&self.at.c);
            if !self.with_cost && self.best.is_some() {
                self.status = Status::Converged;
                break;
            }
            let cost = if self.with_cost { self.at.f } else { f64::NAN };
            let progress = Progress { start: observer.start, iteration: self.iterations, cost, excess: worst };
            if let Some(status) = observer.ended(&progress) {
                self.status = status;
                break;
            }
            self.iterations += 1;
            if !self.with_cost && self.iterations.is_multiple_of(WINDOW) {
                if worst > STANDSTILL * before {
                    self.status = Status::Stalled;
                    break;
                }
                before = worst;
            }
            let limits = JointLimitRows::new(self.problem, &self.at.x, &self.scale);
            let Some(Direction { step, predicted, slope }) = self.direction(&limits.rows) else {
                self.status = Status::Stalled;
                break;
            };
            self.record_multipliers(&limits, &step);
            let small =
                if self.with_cost { options.tolerance * (1.0 + self.at.f.abs()) } else { 1e-3 * self.mu * worst };
            if predicted.max(-slope) <= small {
                if worst <= 0.0 {
                    self.status = Status::Converged;
                    break;
                }
                if !self.with_cost || self.mu >= PENALTY * (1.0 + self.at.f.abs()) {
                    self.status = Status::Stalled;
                    break;
                }
                self.mu *= 10.0;
                continue;
            }
            match self.line_search(&limits, &step, slope, fresh) {
                LineSearch::Moved => fresh = false,
                LineSearch::Blocked => {
                    let blocking = std::mem::take(&mut self.blocking);
                    self.differentiate(|i| blocking[i]);
                    self.blocking = blocking;
                }
                LineSearch::Failed if fresh => {
                    self.status = Status::Stalled;
                    break;
                }
                // The usual cause is a bad Hessian: once more along the steepest descent.
                LineSearch::Failed => {
                    let n = self.at.x.len();
                    let size = if self.with_cost { self.at.g.norm().max(1e-12) } else { 1.0 };
                    self.h = DMatrix::identity(n, n) * size;
                    fresh = true;
                }
            }
        }
        self
    }
    /// Keeps the multipliers, from which a conflict is diagnosed.
    fn record_multipliers(&mut self, limits: &JointLimitRows, step: &Step) {
        self.multipliers.copy_from_slice(&step.z);
        self.joint_multipliers.clear();
        for (name, m) in limits.names.iter().zip(&step.joints) {
            let Some(name) = name else { continue };
            match self.joint_multipliers.iter_mut().find(|p| p.0 == *name) {
                Some(p) => p.1 += m.max(0.0),
                None => self.joint_multipliers.push((*name, m.max(0.0))),
            }
        }
    }
}
