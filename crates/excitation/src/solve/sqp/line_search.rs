//! Backtracking line search on the merit function.

use crate::solve::sqp::bfgs;
use crate::solve::sqp::joint_limits::JointLimitRows;
use crate::solve::sqp::state::{AIM, SearchState};
use crate::solve::sqp::subproblem::Step;
use nalgebra::DVector;

/// How a line search ended.
pub(crate) enum LineSearch {
    /// At a better point.
    Moved,
    /// At a constraint without derivatives, which the subproblem has to know.
    Blocked,
    /// Nowhere: no step decreases the merit function.
    Failed,
}

impl SearchState<'_, '_> {
    /// Backtracks along `step` until the merit function decreases enough (Armijo), with a second-order correction where
    /// the full step leaves a curved constraint. `fresh`: the Hessian has not been updated yet.
    pub(crate) fn line_search(&mut self, limits: &JointLimitRows, step: &Step, slope: f64, fresh: bool) -> LineSearch {
        let n = self.at.x.len();
        let merit = self.merit(self.at.f, &self.at.c);
        let v = Self::violation(&self.at.c);
        let (mut raw, mut c) = (vec![0.0; n], vec![0.0; self.at.c.len()]);
        let mut trial = vec![0.0; n];
        let mut alpha = limits.longest_step(step.d.as_slice());
        let mut blocked = false;
        for attempt in 0..30 {
            let s = &step.d * alpha;
            let (f, value) = self.evaluate_trial(&s, &mut trial, &mut raw, &mut c, &mut blocked);
            if value < merit && value <= merit + 1e-4 * alpha * slope {
                self.accept(&trial, &raw, f, &c, &s, &step.z, fresh);
                return LineSearch::Moved;
            }
            let usable = value.is_finite();
            if attempt == 0 && usable && Self::violation(&c) > v {
                let shift: Vec<f64> = (0..c.len()).map(|i| c[i] - self.at.j.row(i).tr_dot(&s)).collect();
                if let Some(second) = self.subproblem(&limits.rows, Some(&shift)) {
                    let s = &second.d * limits.longest_step(second.d.as_slice());
                    let (f, value) = self.evaluate_trial(&s, &mut trial, &mut raw, &mut c, &mut blocked);
                    if value < merit && value <= merit + 1e-4 * alpha * slope {
                        self.accept(&trial, &raw, f, &c, &s, &step.z, fresh);
                        return LineSearch::Moved;
                    }
                }
                alpha *= 0.5;
                continue;
            }
            // Minimum of the parabola through merit, slope and value, kept within sane bounds.
            let parabola = -0.5 * slope * alpha * alpha / (value - merit - slope * alpha);
            alpha = if usable && parabola.is_finite() { parabola.clamp(0.1 * alpha, 0.5 * alpha) } else { 0.5 * alpha };
        }
        if blocked { LineSearch::Blocked } else { LineSearch::Failed }
    }
    /// Cost and merit at `x + s`, with the gradient of the cost and the rows there; NaN where it is infeasible or undefined.
    fn evaluate_trial(
        &mut self,
        s: &DVector<f64>,
        trial: &mut [f64],
        raw: &mut [f64],
        c: &mut [f64],
        blocked: &mut bool,
    ) -> (f64, f64) {
        const REFUSED: (f64, f64) = (f64::NAN, f64::NAN);
        for i in 0..trial.len() {
            trial[i] = self.at.x[i] + self.scale[i] * s[i];
        }
        if self.problem.violated(trial).is_some() {
            return REFUSED;
        }
        let f = self.cost(trial, raw);
        self.evaluations += 1;
        if !f.is_finite() || raw.iter().any(|g| !g.is_finite()) {
            return REFUSED;
        }
        if !c.is_empty() {
            self.problem.evaluate(trial, c, None);
            for (i, c) in c.iter().enumerate() {
                if !self.differentiated[i] && !self.blocking[i] && *c > -AIM {
                    self.blocking[i] = true;
                    *blocked = true;
                }
            }
        }
        let merit = self.merit(f, c);
        if merit.is_finite() { (f, merit) } else { REFUSED }
    }
    /// Moves to `trial` and updates the Hessian of the Lagrangian.
    #[allow(clippy::too_many_arguments)] // everything that is known of the new point
    fn accept(&mut self, trial: &[f64], raw: &[f64], f: f64, c: &[f64], s: &DVector<f64>, z: &[f64], fresh: bool) {
        let g = self.scaled(raw);
        let mut y = &g - &self.at.g;
        self.at.x.copy_from_slice(trial);
        (self.at.f, self.at.g) = (f, g);
        if !self.at.c.is_empty() {
            let before = self.at.j.clone();
            self.at.c.copy_from_slice(c);
            self.blocking.fill(false);
            self.differentiate(|i| z[i] > 0.0);
            for (i, z) in z.iter().enumerate().filter(|(_, z)| **z > 0.0) {
                y += (self.at.j.row(i) - before.row(i)).transpose() * *z;
            }
        }
        bfgs::update(&mut self.h, s, &y, fresh);
        self.keep();
    }
}
