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

use crate::objective::Cost;
use crate::plan::spline::{Duration, PlanError, SplinePlan};
use crate::solve::observer::{Eye, Progress, Watch};
use crate::solve::problem::{Problem, largest};
use crate::solve::qp;
use crate::solve::qp::{Inequality, Minimum};
use nalgebra::{DMatrix, DVector};

/// Distance (relative to the limit) that steps keep from limits, so that solver tolerance cannot break them.
const INSIDE: f64 = 1e-8;
/// Distance (relative) that steps aim to keep from constraints.
const AIM: f64 = 1e-6;
/// The penalty grows up to this many times the size of the cost.
const PENALTY: f64 = 1e8;

/// A search for a feasible plan gives up when this many iterations leave more than this part of the violation.
const LAP: usize = 6;
const PROGRESS: f64 = 0.95;

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

/// Settings of [`minimise`].
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

/// Makes `cost` small from a feasible `start`. Never returns an infeasible plan. Allocates.
///
/// # Errors
/// [`PlanError`]: `Infeasible` names the limit that the start breaks, `Cost` tells that the cost or its
/// gradient is not finite there, `Argument` that `start` has the wrong length.
pub fn minimise(cost: &dyn Cost, plan: &SplinePlan, start: &[f64], options: &SqpOptions) -> Result<Outcome, PlanError> {
    minimise_under(&Problem::new(cost, plan), start, options, &Watch::default())
}

/// Makes the cost small from a `start` that keeps the joint limits; it may break constraints. The plan returned keeps
/// everything. Allocates.
///
/// # Errors
/// As [`minimise`]; [`PlanError::Broken`] names the constraint that the search could not come to keep.
pub fn minimise_under(
    problem: &Problem<'_>,
    start: &[f64],
    options: &SqpOptions,
    watch: &Watch<'_>,
) -> Result<Outcome, PlanError> {
    minimise_seen(problem, start, options, &Eye { watch: *watch, ..Eye::default() })
}

/// [`minimise_under`] as one of several searches.
pub(crate) fn minimise_seen(
    problem: &Problem<'_>,
    start: &[f64],
    options: &SqpOptions,
    watch: &Eye<'_>,
) -> Result<Outcome, PlanError> {
    let run = Run::new(problem, start, true)?.solve(options, watch);
    let outcome = |(f, x, excess): (f64, Vec<f64>, f64)| Outcome {
        x,
        cost: f,
        start_cost: run.start_cost,
        excess,
        status: run.status,
        iterations: run.iterations,
        evaluations: run.evaluations,
    };
    match run.best {
        Some(best) => Ok(outcome(best)),
        None if matches!(run.status, Status::Interrupted | Status::TimeLimit) => Err(PlanError::Interrupted),
        None => Err(broken(problem, &run.at.c)),
    }
}

/// A plan that keeps all constraints, near `start`, which keeps the joint limits; also what stood in the way if there is
/// none: the last point and the multipliers there.
pub(crate) fn restore(
    problem: &Problem<'_>,
    start: &[f64],
    iterations: usize,
    watch: &Eye<'_>,
) -> Result<Result<Vec<f64>, Obstacle>, PlanError> {
    let options = SqpOptions { iterations, tolerance: 1e-9 };
    let run = Run::new(problem, start, false)?.solve(&options, watch);
    if matches!(run.status, Status::Interrupted | Status::TimeLimit) && run.best.is_none() {
        return Err(PlanError::Interrupted);
    }
    Ok(match run.best {
        Some((_, x, _)) => Ok(x),
        None => Err(Obstacle {
            x: run.at.x,
            excess: largest(&run.at.c),
            rows: run.at.c,
            joints: run.pressing,
            pull: run.pull,
        }),
    })
}

/// Where a search for a feasible plan ended without one.
pub(crate) struct Obstacle {
    /// Where.
    pub(crate) x: Vec<f64>,
    /// Largest relative excess.
    pub(crate) excess: f64,
    /// All rows.
    pub(crate) rows: Vec<f64>,
    /// Joint limits (joint, order) that press, with the sum of their multipliers.
    pub(crate) joints: Vec<((usize, i32), f64)>,
    /// Multipliers of the rows.
    pub(crate) pull: Vec<f64>,
}

/// Names the row that is broken most.
pub(crate) fn broken(problem: &Problem<'_>, rows: &[f64]) -> PlanError {
    let worst = (0..rows.len()).max_by(|a, b| rows[*a].total_cmp(&rows[*b])).unwrap_or(0);
    let (k, ch) = problem.origin()[worst];
    let channel = &problem.constraints[k].channels()[ch];
    let beyond = rows[worst] * channel.scale;
    let value = match channel.sense {
        crate::constraint::Sense::AtMost => channel.limit + beyond,
        crate::constraint::Sense::AtLeast => channel.limit - beyond,
    };
    let (name, item, limit, unit) = (channel.name, channel.item.clone(), channel.limit, channel.unit);
    PlanError::Broken { name, item, value, limit, unit }
}

/// An iterate with everything that is known there.
struct At {
    x: Vec<f64>,
    f: f64,
    g: DVector<f64>,
    c: Vec<f64>,
    j: DMatrix<f64>,
}

/// A step of the subproblem.
struct Step {
    d: DVector<f64>,
    /// Elastic variable: the violation that is left.
    s: f64,
    /// Multipliers of the constraints.
    z: Vec<f64>,
    /// Multipliers of the joint limits.
    pressing: Vec<f64>,
}

/// One search.
struct Run<'a, 'b> {
    problem: &'a Problem<'b>,
    /// False when any feasible plan will do.
    with_cost: bool,
    scale: Vec<f64>,
    at: At,
    h: DMatrix<f64>,
    mu: f64,
    /// Rows with derivatives, which the subproblem looks at.
    watched: Vec<bool>,
    /// Rows that stood in the way without being watched.
    sticky: Vec<bool>,
    start_cost: f64,
    best: Option<(f64, Vec<f64>, f64)>,
    status: Status,
    iterations: usize,
    evaluations: usize,
    pressing: Vec<((usize, i32), f64)>,
    pull: Vec<f64>,
}

impl<'a, 'b> Run<'a, 'b> {
    fn new(problem: &'a Problem<'b>, start: &[f64], with_cost: bool) -> Result<Self, PlanError> {
        let plan = problem.plan;
        let n = plan.variables();
        plan.motion(start)?;
        if let Some(which) = problem.violated(start) {
            return Err(PlanError::Infeasible { which });
        }
        let rows = problem.rows();
        let at = At { x: start.to_vec(), f: 0.0, g: DVector::zeros(n), c: vec![0.0; rows], j: DMatrix::zeros(rows, n) };
        let mut run = Self {
            problem,
            with_cost,
            scale: scales(plan, start),
            at,
            h: DMatrix::identity(n, n),
            mu: 1.0,
            watched: vec![false; rows],
            sticky: vec![false; rows],
            start_cost: 0.0,
            best: None,
            status: Status::IterationLimit,
            iterations: 0,
            evaluations: 1,
            pressing: Vec::new(),
            pull: vec![0.0; rows],
        };
        let mut raw = vec![0.0; n];
        run.at.f = run.cost(start, &mut raw);
        if !run.at.f.is_finite() || raw.iter().any(|g| !g.is_finite()) {
            return Err(PlanError::Cost(run.at.f));
        }
        run.at.g = run.scaled(&raw);
        run.start_cost = run.at.f;
        problem.evaluate(start, &mut run.at.c, None);
        run.differentiate(|_| false);
        if !run.at.c.iter().chain(run.at.j.iter()).all(|v| v.is_finite()) {
            return Err(PlanError::Undefined);
        }
        if with_cost {
            run.h *= run.at.g.norm().max(1e-12);
            run.mu = run.at.g.norm().max(1.0);
        }
        run.keep();
        Ok(run)
    }
    fn cost(&self, x: &[f64], raw: &mut [f64]) -> f64 {
        if self.with_cost { self.problem.cost.value_gradient(self.problem.plan, x, raw) } else { 0.0 }
    }
    fn scaled(&self, raw: &[f64]) -> DVector<f64> {
        DVector::from_fn(raw.len(), |i, _| raw[i] * self.scale[i])
    }
    /// Rows and their derivatives at the present point.
    /// The values are known; those of `also` are wanted besides what is near its limit.
    fn differentiate(&mut self, also: impl Fn(usize) -> bool) {
        if self.at.c.is_empty() {
            return;
        }
        self.problem.select(&self.at.c, &mut self.watched);
        self.watched.iter_mut().enumerate().for_each(|(i, w)| *w |= also(i));
        self.problem.evaluate(&self.at.x, &mut self.at.c, Some((&self.watched, &mut self.at.j)));
        for (i, s) in self.scale.iter().enumerate() {
            self.at.j.column_mut(i).iter_mut().for_each(|v| *v *= s);
        }
    }
    /// Keeps the present point if it is the best that breaks nothing.
    fn keep(&mut self) {
        let excess = largest(&self.at.c);
        if excess <= 0.0 && self.best.as_ref().is_none_or(|b| self.at.f < b.0) {
            self.best = Some((self.at.f, self.at.x.clone(), excess));
        }
    }
    /// What the merit function punishes.
    fn violation(c: &[f64]) -> f64 {
        let worst = largest(c) + AIM;
        if worst.is_nan() { f64::NAN } else { worst.max(0.0) }
    }
    fn merit(&self, f: f64, c: &[f64]) -> f64 {
        f + self.mu * Self::violation(c)
    }
    /// Solves the subproblem; `shift` replaces the rows by those of a second-order correction.
    fn subproblem(&self, linear: &[Inequality], shift: Option<&[f64]>) -> Option<Step> {
        let n = self.at.x.len();
        let indices: Vec<usize> = (0..self.at.c.len()).filter(|&i| self.watched[i]).collect();
        let elastic = usize::from(!indices.is_empty());
        let mut rows: Vec<Inequality> =
            linear.iter().map(|r| Inequality { columns: r.columns.clone(), bound: r.bound }).collect();
        let mut h = DMatrix::zeros(n + elastic, n + elastic);
        h.view_mut((0, 0), (n, n)).copy_from(&self.h);
        let mut g = self.at.g.as_slice().to_vec();
        if elastic == 1 {
            g.push(self.mu);
            rows.push(Inequality { columns: vec![(n, -1.0)], bound: 0.0 });
            for &i in &indices {
                let mut columns: Vec<(usize, f64)> =
                    self.at.j.row(i).iter().enumerate().filter(|(_, v)| **v != 0.0).map(|(c, v)| (c, *v)).collect();
                columns.push((n, -1.0));
                rows.push(Inequality { columns, bound: -shift.map_or(self.at.c[i], |s| s[i]) - AIM });
            }
        }
        let Minimum { z: d, multipliers } = qp::solve(&h, &g, &rows).ok()?;
        let mut z = vec![0.0; self.at.c.len()];
        for (&i, m) in indices.iter().zip(&multipliers[linear.len() + elastic..]) {
            z[i] = m.max(0.0);
        }
        let s = if elastic == 1 { d[n].max(0.0) } else { 0.0 };
        let pressing = multipliers[..linear.len()].to_vec();
        Some(Step { d: DVector::from_column_slice(&d[..n]), s, z, pressing })
    }
    fn solve(mut self, options: &SqpOptions, watch: &Eye<'_>) -> Self {
        let (mut fresh, mut lap) = (true, f64::INFINITY);
        while self.iterations < options.iterations {
            let worst = largest(&self.at.c);
            if !self.with_cost && self.best.is_some() {
                self.status = Status::Converged;
                break;
            }
            let cost = if self.with_cost { self.at.f } else { f64::NAN };
            let progress = Progress { start: watch.start, iteration: self.iterations, cost, excess: worst };
            if let Some(status) = watch.ended(&progress) {
                self.status = status;
                break;
            }
            self.iterations += 1;
            if !self.with_cost && self.iterations.is_multiple_of(LAP) {
                if worst > PROGRESS * lap {
                    self.status = Status::Stalled;
                    break;
                }
                lap = worst;
            }
            let (rows, rooms, names) = constraints(self.problem, &self.at.x, &self.scale);
            let Some((step, predicted, slope)) = self.direction(&rows) else {
                self.status = Status::Stalled;
                break;
            };
            self.remember(&names, &step);
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
            match self.line_search(&rows, &rooms, &step, slope, fresh) {
                Search::Moved => fresh = false,
                // A row that was left out stood in the way.
                Search::Again => {
                    let sticky = std::mem::take(&mut self.sticky);
                    self.differentiate(|i| sticky[i]);
                    self.sticky = sticky;
                }
                Search::Failed if fresh => {
                    self.status = Status::Stalled;
                    break;
                }
                // A spoilt Hessian is the usual culprit: once more along the steepest descent.
                Search::Failed => {
                    let n = self.at.x.len();
                    let size = if self.with_cost { self.at.g.norm().max(1e-12) } else { 1.0 };
                    self.h = DMatrix::identity(n, n) * size;
                    fresh = true;
                }
            }
        }
        self
    }
    /// Step, predicted decrease of the merit function, and a bound of its slope (negative).
    fn direction(&mut self, rows: &[Inequality]) -> Option<(Step, f64, f64)> {
        let v = Self::violation(&self.at.c);
        loop {
            let step = self.subproblem(rows, None)?;
            let most = PENALTY * (1.0 + self.at.f.abs());
            if self.with_cost && v > 0.0 && step.s > 0.5 * v && self.mu < most {
                self.mu *= 10.0;
                continue;
            }
            let sum: f64 = step.z.iter().sum();
            if self.with_cost && 1.5 * sum > self.mu {
                self.mu = 2.0 * sum;
            }
            let slope = self.at.g.dot(&step.d) - self.mu * (v - step.s);
            let predicted = -(slope + 0.5 * step.d.dot(&(&self.h * &step.d)));
            return Some((step, predicted, slope));
        }
    }
    /// Multipliers, for the answer to who stood in the way.
    fn remember(&mut self, names: &[Option<(usize, i32)>], step: &Step) {
        self.pull.copy_from_slice(&step.z);
        self.pressing.clear();
        for (name, m) in names.iter().zip(&step.pressing) {
            let Some(name) = name else { continue };
            match self.pressing.iter_mut().find(|p| p.0 == *name) {
                Some(p) => p.1 += m.max(0.0),
                None => self.pressing.push((*name, m.max(0.0))),
            }
        }
    }
    fn line_search(&mut self, rows: &[Inequality], rooms: &[f64], step: &Step, slope: f64, fresh: bool) -> Search {
        let n = self.at.x.len();
        let merit = self.merit(self.at.f, &self.at.c);
        let v = Self::violation(&self.at.c);
        let (mut raw, mut c) = (vec![0.0; n], vec![0.0; self.at.c.len()]);
        let mut trial = vec![0.0; n];
        let mut alpha = largest_step(rows, rooms, step.d.as_slice());
        let mut grew = false;
        for attempt in 0..30 {
            let s = &step.d * alpha;
            let (f, value) = self.look(&s, &mut trial, &mut raw, &mut c, &mut grew);
            if value < merit && value <= merit + 1e-4 * alpha * slope {
                self.accept(&trial, &raw, f, &c, &s, &step.z, fresh);
                return Search::Moved;
            }
            let usable = value.is_finite();
            if attempt == 0 && usable && Self::violation(&c) > v {
                let shift: Vec<f64> = (0..c.len()).map(|i| c[i] - self.at.j.row(i).tr_dot(&s)).collect();
                if let Some(second) = self.subproblem(rows, Some(&shift)) {
                    let s = &second.d * largest_step(rows, rooms, second.d.as_slice());
                    let (f, value) = self.look(&s, &mut trial, &mut raw, &mut c, &mut grew);
                    if value < merit && value <= merit + 1e-4 * alpha * slope {
                        self.accept(&trial, &raw, f, &c, &s, &step.z, fresh);
                        return Search::Moved;
                    }
                }
                alpha *= 0.5;
                continue;
            }
            // Minimum of the parabola through merit, slope and value, kept within sane bounds.
            let parabola = -0.5 * slope * alpha * alpha / (value - merit - slope * alpha);
            alpha = if usable && parabola.is_finite() { parabola.clamp(0.1 * alpha, 0.5 * alpha) } else { 0.5 * alpha };
        }
        if grew { Search::Again } else { Search::Failed }
    }
    /// Cost and merit at `x + s`, with the gradient of the cost and the rows there; NaN where it may not be.
    fn look(
        &mut self,
        s: &DVector<f64>,
        trial: &mut [f64],
        raw: &mut [f64],
        c: &mut [f64],
        grew: &mut bool,
    ) -> (f64, f64) {
        const OUT: (f64, f64) = (f64::NAN, f64::NAN);
        for i in 0..trial.len() {
            trial[i] = self.at.x[i] + self.scale[i] * s[i];
        }
        if self.problem.violated(trial).is_some() {
            return OUT;
        }
        let f = self.cost(trial, raw);
        self.evaluations += 1;
        if !f.is_finite() || raw.iter().any(|g| !g.is_finite()) {
            return OUT;
        }
        if !c.is_empty() {
            self.problem.evaluate(trial, c, None);
            for (i, c) in c.iter().enumerate() {
                if !self.watched[i] && !self.sticky[i] && *c > -AIM {
                    self.sticky[i] = true;
                    *grew = true;
                }
            }
        }
        let merit = self.merit(f, c);
        if merit.is_finite() { (f, merit) } else { OUT }
    }
    #[allow(clippy::too_many_arguments)] // everything that is known of the new point
    fn accept(&mut self, trial: &[f64], raw: &[f64], f: f64, c: &[f64], s: &DVector<f64>, z: &[f64], fresh: bool) {
        let g = self.scaled(raw);
        let mut y = &g - &self.at.g;
        self.at.x.copy_from_slice(trial);
        (self.at.f, self.at.g) = (f, g);
        if !self.at.c.is_empty() {
            let before = self.at.j.clone();
            self.at.c.copy_from_slice(c);
            self.sticky.fill(false);
            self.differentiate(|i| z[i] > 0.0);
            for (i, z) in z.iter().enumerate().filter(|(_, z)| **z > 0.0) {
                y += (self.at.j.row(i) - before.row(i)).transpose() * *z;
            }
        }
        update(&mut self.h, s, &y, fresh);
        self.keep();
    }
}

/// How a line search ended.
enum Search {
    Moved,
    Again,
    Failed,
}

/// Natural size of each variable: the part of the range that one control point can move against its
/// neighbours.
fn scales(plan: &SplinePlan, x: &[f64]) -> Vec<f64> {
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

/// Limits linearised at `x`, over scaled steps, relative to the limits; the true room left in each; and the joint and
/// order of derivative each belongs to (`None` for the duration).
#[allow(clippy::type_complexity)] // three parallel lists, used once
fn constraints(
    problem: &Problem<'_>,
    x: &[f64],
    scale: &[f64],
) -> (Vec<Inequality>, Vec<f64>, Vec<Option<(usize, i32)>>) {
    let plan = problem.plan;
    let t = plan.duration(x);
    let index = plan.duration_index();
    let (mut rows, mut rooms, mut names) = (Vec::new(), Vec::new(), Vec::new());
    let mut push = |columns, slack: f64, name| {
        // At or inside the safety distance the step may only lead away.
        let bound = (slack - INSIDE).max(0.0);
        rows.push(Inequality { columns, bound });
        // Half of the safety distance is there to be used.
        rooms.push(bound + (slack - bound).clamp(0.0, 0.5 * INSIDE));
        names.push(name);
    };
    for r in plan.rows.iter().filter(|r| !problem.is_freed(r.joint, r.power)) {
        let s = r.scale * t.powi(r.power);
        let mut columns: Vec<_> = r.columns.iter().map(|(c, v)| (*c, v * scale[*c] / s)).collect();
        if let Some(i) = index.filter(|_| r.power > 0) {
            columns.push((i, -r.limit * f64::from(r.power) * t.powi(r.power - 1) * scale[i] / s));
        }
        push(columns, r.slack(x, t), Some((r.joint, r.power)));
    }
    if let (Some(i), Duration::Free { min, max }) = (index, plan.spec().duration) {
        push(vec![(i, scale[i] / max)], (max - t) / max, None);
        push(vec![(i, -scale[i] / min)], (t - min) / min, None);
    }
    (rows, rooms, names)
}

/// The part of step `d`, at most all, that keeps every row: solver tolerance may overshoot by a hair.
fn largest_step(rows: &[Inequality], rooms: &[f64], d: &[f64]) -> f64 {
    rows.iter().zip(rooms).fold(1.0, |alpha: f64, (r, room)| {
        let growth: f64 = r.columns.iter().map(|(c, v)| v * d[*c]).sum();
        if growth > *room { alpha.min(room / growth) } else { alpha }
    })
}

/// Powell's damped BFGS update; the first one also sets the scale (Nocedal and Wright eq. 6.20).
fn update(h: &mut DMatrix<f64>, s: &DVector<f64>, y: &DVector<f64>, fresh: bool) {
    let sy = s.dot(y);
    if fresh && sy > 0.0 {
        let n = s.len();
        *h = DMatrix::identity(n, n) * (y.norm_squared() / sy);
    }
    let hs = &*h * s;
    let shs = s.dot(&hs);
    if shs <= 0.0 {
        return;
    }
    let theta = if sy >= 0.2 * shs { 1.0 } else { 0.8 * shs / (shs - sy) };
    let r = y * theta + &hs * (1.0 - theta);
    let sr = s.dot(&r);
    h.ger(-1.0 / shs, &hs, &hs, 1.0);
    h.ger(1.0 / sr, &r, &r, 1.0);
}
