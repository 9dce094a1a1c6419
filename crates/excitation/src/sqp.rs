//! Sequential quadratic programming for a smooth cost under the limits of a plan.
//!
//! Damped BFGS (M. J. D. Powell 1978; Nocedal and Wright, *Numerical Optimization*, 2nd ed., procedure 18.2),
//! subproblems by Clarabel, backtracking line search. At fixed duration all limits are linear. With a free
//! duration a limit reads `M x <= L T^r`; `T^r` is convex, so its tangent lies below it and the linearised
//! limit is an inner approximation. Either way every iterate from a feasible start stays feasible.

use crate::cost::Cost;
use crate::qp::{self, Inequality};
use crate::random::random_plan;
use crate::spline_plan::{Duration, PlanError, SplinePlan};
use nalgebra::{DMatrix, DVector};

/// Distance (relative to the limit) that steps keep from limits, so that solver tolerance cannot break them.
const INSIDE: f64 = 1e-8;

/// How an optimisation ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// The decrease predicted by the quadratic model is below the tolerance.
    Converged,
    /// No step decreases the cost, or the subproblem failed, before the tolerance was met.
    Stalled,
    /// The iteration limit came first.
    IterationLimit,
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
    let n = plan.variables();
    plan.motion(start)?;
    if let Some(which) = plan.violated(start) {
        return Err(PlanError::Infeasible { which });
    }
    let scale = scales(plan, start);
    let mut x = start.to_vec();
    let mut raw = vec![0.0; n];
    let mut f = cost.value_gradient(plan, &x, &mut raw);
    if !f.is_finite() || raw.iter().any(|g| !g.is_finite()) {
        return Err(PlanError::Cost(f));
    }
    let gradient = |raw: &[f64]| DVector::from_fn(n, |i, _| raw[i] * scale[i]);
    let mut g = gradient(&raw);
    let mut out =
        Outcome { x: x.clone(), cost: f, start_cost: f, status: Status::IterationLimit, iterations: 0, evaluations: 1 };
    let mut h = DMatrix::identity(n, n) * g.norm().max(1e-12);
    let mut fresh = true;
    let mut trial = vec![0.0; n];
    while out.iterations < options.iterations {
        out.iterations += 1;
        let (rows, rooms) = constraints(plan, &x, &scale);
        let Ok(d) = qp::solve(&h, g.as_slice(), &rows) else {
            out.status = Status::Stalled;
            break;
        };
        let d = DVector::from_vec(d);
        let slope = g.dot(&d);
        let predicted = -(slope + 0.5 * d.dot(&(&h * &d)));
        if predicted.max(-slope) <= options.tolerance * (1.0 + f.abs()) {
            out.status = Status::Converged;
            break;
        }
        let mut alpha = largest_step(&rows, &rooms, d.as_slice());
        let mut accepted = None;
        for _ in 0..30 {
            for i in 0..n {
                trial[i] = x[i] + alpha * scale[i] * d[i];
            }
            let mut value = f64::NAN;
            if plan.violated(&trial).is_none() {
                value = cost.value_gradient(plan, &trial, &mut raw);
                out.evaluations += 1;
            }
            let usable = value.is_finite() && raw.iter().all(|g| g.is_finite());
            if usable && value <= f + 1e-4 * alpha * slope && value < f {
                accepted = Some(value);
                break;
            }
            // Minimum of the parabola through f, slope and value, kept within sane bounds.
            let parabola = -0.5 * slope * alpha * alpha / (value - f - slope * alpha);
            alpha = if usable && parabola.is_finite() { parabola.clamp(0.1 * alpha, 0.5 * alpha) } else { 0.5 * alpha };
        }
        let Some(value) = accepted else {
            if fresh {
                out.status = Status::Stalled;
                break;
            }
            // A spoilt Hessian is the usual culprit: once more along the steepest descent.
            h = DMatrix::identity(n, n) * g.norm().max(1e-12);
            fresh = true;
            continue;
        };
        let g_new = gradient(&raw);
        let s = &d * alpha;
        update(&mut h, &s, &(&g_new - &g), fresh);
        fresh = false;
        x.copy_from_slice(&trial);
        (f, g) = (value, g_new);
    }
    (out.x, out.cost) = (x, f);
    Ok(out)
}

/// Outcomes of several starts.
#[derive(Clone, Debug)]
pub struct MultiStart {
    /// The best feasible outcome.
    pub best: Outcome,
    /// All outcomes, in the order of the starts; an error where a start was unusable.
    pub all: Vec<Result<Outcome, PlanError>>,
}

/// [`minimise`] from `starts` random plans (streams `0..starts` of `seed`). Local minima differ far more than
/// solvers do, so this is the global strategy. A function of its arguments only. Allocates.
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
    let all: Vec<_> = (0..starts)
        .map(|i| random_plan(plan, seed, i as u64, 0.5).and_then(|x| minimise(cost, plan, &x, options)))
        .collect();
    let best = all.iter().flatten().min_by(|a, b| a.cost.total_cmp(&b.cost)).cloned();
    match (best, all.first()) {
        (Some(best), _) => Ok(MultiStart { best, all }),
        (None, Some(Err(e))) => Err(e.clone()),
        _ => Err(PlanError::Argument { what: "starts", got: "0".into(), expected: "at least 1".into() }),
    }
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

/// Limits linearised at `x`, over scaled steps, relative to the limits; and the true room left in each.
fn constraints(plan: &SplinePlan, x: &[f64], scale: &[f64]) -> (Vec<Inequality>, Vec<f64>) {
    let t = plan.duration(x);
    let index = plan.duration_index();
    let (mut rows, mut rooms) = (Vec::new(), Vec::new());
    let mut push = |columns, slack: f64| {
        // At or inside the safety distance the step may only lead away.
        let bound = (slack - INSIDE).max(0.0);
        rows.push(Inequality { columns, bound });
        // Half of the safety distance is there to be used.
        rooms.push(bound + (slack - bound).clamp(0.0, 0.5 * INSIDE));
    };
    for r in &plan.rows {
        let s = r.scale * t.powi(r.power);
        let mut columns: Vec<_> = r.columns.iter().map(|(c, v)| (*c, v * scale[*c] / s)).collect();
        if let Some(i) = index.filter(|_| r.power > 0) {
            columns.push((i, -r.limit * f64::from(r.power) * t.powi(r.power - 1) * scale[i] / s));
        }
        push(columns, r.slack(x, t));
    }
    if let (Some(i), Duration::Free { min, max }) = (index, plan.spec().duration) {
        push(vec![(i, scale[i] / max)], (max - t) / max);
        push(vec![(i, -scale[i] / min)], (t - min) / min);
    }
    (rows, rooms)
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
