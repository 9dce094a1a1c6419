//! Levenberg-Marquardt for whitened nonlinear least squares, with box bounds and an honest status.
//!
//! Minimises `C(x) = |r(x)|^2 / 2` by steps `p = argmin |J p + r|` subject to `|D p| <= Delta`, where
//! `D_j` is the largest norm column j has shown so far (J. More, *The Levenberg-Marquardt algorithm*, LNM 630,
//! 1978). Each linearisation is first reduced to a triangle `R` with `R^T R = J^T J` and `c = Q^T r`
//! ([`reduce`]), so that the search for the damping works on n x n numbers only: with `R D^-1 = U S V^T`,
//!
//! ```text
//! D p(lambda) = -V diag(s / (s^2 + lambda)) U^T c,      lambda from |D p| = Delta (More's Newton iteration)
//! ```
//!
//! A variable at its bound whose gradient points outwards is held for the step; the step of the others is
//! projected onto the box. `Delta` follows the gain ratio (actual over predicted reduction).

use crate::linearise::{Dense, Linearise, curvature, finite};
use crate::problem::{LmError, Problem};
use crate::settings::{Scale, Settings};
use crate::solution::{Criterion, Iterate, Solution, Status};
use crate::step::Linear;
use nalgebra::DMatrix;

/// Relative reduction of the cost that its own rounding hides. Below it the gain ratio is noise, and steps
/// are judged by whether the promise (the projected gradient) still shrinks.
const UNRESOLVED: f64 = 1e-12;

/// Length of an undamped step ([`Scale::Unit`]) below which its second order is left to chords.
const NEAR: f64 = 0.1;

/// Gains of undamped steps whose length is right.
const KEPT: (f64, f64) = (0.8, 1.2);
/// Largest factor on the length of others.
const FARTHEST: f64 = 5.0;

fn half_norm2(r: &[f64]) -> f64 {
    0.5 * r.iter().map(|x| x * x).sum::<f64>()
}

/// `C(x) - C(x')` as `(r - r').(r + r') / 2`: near the minimum the two costs agree to all digits, and their
/// difference would be rounding noise.
fn reduction(r: &[f64], new: &[f64]) -> f64 {
    0.5 * r.iter().zip(new).map(|(a, b)| (a - b) * (a + b)).sum::<f64>()
}

/// Minimises from `start`.
///
/// Memory: two vectors of m and two m x n matrices, besides n x n work per iteration.
///
/// # Errors
/// [`LmError`]. A fit that ends without a minimum is not an error; look at [`Solution::status`].
pub fn minimise<P: Problem + ?Sized>(problem: &mut P, start: &[f64], set: &Settings) -> Result<Solution, LmError> {
    let mut dense = Dense::new(problem);
    let solution = minimise_linearised(&mut dense, start, set)?;
    Ok(Solution { jacobian: dense.j, ..solution })
}

/// As [`minimise`], for a problem that keeps its Jacobian: that of the solution is left empty.
///
/// A trait object, so that the solver is compiled once and not for every problem of every crate.
pub fn minimise_linearised(problem: &mut dyn Linearise, start: &[f64], set: &Settings) -> Result<Solution, LmError> {
    const TRIES: usize = 10;
    let n = problem.dim();
    check_start(n, start, &set.bounds)?;
    let bound = |i: usize| set.bounds.get(i).copied().unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
    let mut x = start.to_vec();
    let mut r = Vec::new();
    let (mut rr, mut c) = match problem.linearise(&x, &mut r)? {
        Ok(triangle) => triangle,
        Err(reason) => {
            return Err(LmError::NonFiniteResidual { attempts: 1, values: problem.describe(&x), best: x, reason });
        }
    };
    problem.accept();
    let mut cost = half_norm2(&r);
    let mut d: Vec<f64> = vec![0.0; n];
    let (mut radius, mut evaluations) = (f64::NAN, 1);
    let (mut trial, mut r_trial) = (x.clone(), Vec::with_capacity(r.len()));
    let mut history = Vec::new();
    let (mut bad, mut iteration, mut small_step, mut flat_from) = (0, 0, false, None);
    let (status, active) = 'outer: loop {
        for (i, d) in d.iter_mut().enumerate() {
            let norm = if set.scale == Scale::Unit { 1.0 } else { rr.column(i).norm() };
            *d = if *d == 0.0 && norm == 0.0 { 1.0 } else { d.max(norm) };
        }
        let gradient = rr.tr_mul(&c);
        let (lower, upper): (Vec<f64>, Vec<f64>) = (0..n).map(bound).unzip();
        let held: Vec<usize> = (0..n)
            .filter(|&i| (x[i] <= lower[i] && gradient[i] > 0.0) || (x[i] >= upper[i] && gradient[i] < 0.0))
            .collect();
        let free = (0..n).filter(|i| !held.contains(i)).collect();
        let lin = Linear::new(rr, c, &d, free, set.rank_tolerance)?;
        let x_norm = scaled_norm(&x, &d);
        if radius.is_nan() {
            let relative = set.scale == Scale::Columns && x_norm > 0.0;
            radius = (set.initial_radius * if relative { x_norm } else { 1.0 }).min(set.max_radius);
        }
        let decrement = if cost > 0.0 { lin.promised() / cost } else { 0.0 };
        let done = if cost <= set.cost_floor {
            Some(Criterion::Cost)
        } else if decrement <= set.decrement_tolerance {
            Some(Criterion::Decrement)
        } else if 2.0 * lin.promised() <= set.gain_tolerance * (2.0 * cost / r.len() as f64).min(1.0) {
            Some(Criterion::Statistics)
        } else if small_step {
            Some(Criterion::Step)
        } else if flat_from.is_some_and(|before| decrement > 0.9 * before) {
            Some(Criterion::Rounding)
        } else {
            None
        };
        if let Some(by) = done {
            let status = if held.is_empty() { Status::Converged { by } } else { Status::AtBound { at: vec![], by } };
            break 'outer (status, held);
        }
        if iteration >= set.max_iterations {
            break 'outer (Status::IterationLimit, held);
        }
        (rr, c) = loop {
            let lambda = lin.damping(radius);
            let p = lin.step(lambda, &d);
            for i in 0..n {
                trial[i] = (x[i] + p[i]).clamp(lower[i], upper[i]);
            }
            let p: Vec<f64> = trial.iter().zip(&x).map(|(t, x)| t - x).collect();
            // Near the end chords do as much, and are steps of their own.
            let near = set.chord && lambda == 0.0 && set.scale == Scale::Unit && scaled_norm(&p, &d) < NEAR;
            if set.acceleration && decrement > UNRESOLVED && !near {
                evaluations += 1;
                if let Some(g) = curvature(problem, &lin, &x, &p, &r, &mut r_trial)?
                    && let Some(a) = lin.correction(lambda, &d, &p, &g)
                {
                    for i in 0..n {
                        trial[i] = (trial[i] + a[i]).clamp(lower[i], upper[i]);
                    }
                }
            }
            let p_norm = scaled_norm(&p, &d);
            let predicted = lin.predicted(&p);
            let mut note = Iterate { iteration, cost, decrement, lambda, radius, gain: None, accepted: false };
            // Below this radius no representable change of x is left: the promise cannot be kept.
            if p_norm <= 4.0 * f64::EPSILON * x_norm || radius < 1e-30 {
                history.push(note);
                let by = Criterion::Rounding;
                let resolved = UNRESOLVED.max(problem.rounding(&x, &r) / cost);
                let status = match decrement <= resolved {
                    true if held.is_empty() => Status::Converged { by },
                    true => Status::AtBound { at: vec![], by },
                    false => Status::Stalled { promised: decrement },
                };
                break 'outer (status, held);
            }
            evaluations += 1;
            let mut tried = problem.residuals(&trial, &mut r_trial)?;
            let gain = if predicted > 0.0 && tried.is_ok() { reduction(&r, &r_trial) / predicted } else { -1.0 };
            let flat =
                decrement <= UNRESOLVED && lambda == 0.0 && (cost - half_norm2(&r_trial)).abs() <= UNRESOLVED * cost;
            let accept = tried.is_ok() && (gain > 1e-4 || flat);
            let mut triangle = None;
            if accept {
                if set.chord && lambda == 0.0 && decrement > UNRESOLVED && !(KEPT.0..KEPT.1).contains(&gain) {
                    let room = Room { x: &x, d: &d, lower: &lower, upper: &upper, radius: set.max_radius };
                    evaluations += along(problem, &room, gain, (&mut trial, &mut r_trial))?;
                }
                if set.chord && lambda == 0.0 && gain > 0.25 {
                    let room = Room { x: &x, d: &d, lower: &lower, upper: &upper, radius: set.max_radius };
                    evaluations += chord(problem, &lin, &room, set, &mut trial, &mut r_trial)?;
                }
                evaluations += 1;
                tried = problem.linearise(&trial, &mut r_trial)?.map(|t| triangle = Some(t));
            }
            if let Err(reason) = tried {
                bad += 1;
                history.push(note);
                if bad >= TRIES {
                    let values = problem.describe(&trial);
                    return Err(LmError::NonFiniteResidual { attempts: bad, values, best: x, reason });
                }
                radius = 0.1 * radius.min(p_norm);
                continue;
            }
            bad = 0;
            note.gain = Some(gain);
            note.accepted = accept;
            history.push(note);
            if gain < 0.25 {
                radius = radius.min(p_norm) * if gain < 0.0 { 0.25 } else { 0.5 };
            } else if gain > 0.75 || lambda == 0.0 {
                radius = radius.max(2.0 * p_norm).min(set.max_radius.max(radius));
            }
            if let Some(triangle) = triangle {
                problem.accept();
                flat_from = flat.then_some(decrement);
                small_step = lambda == 0.0 && gain > 0.25 && p_norm <= set.step_tolerance * x_norm;
                core::mem::swap(&mut x, &mut trial);
                core::mem::swap(&mut r, &mut r_trial);
                cost = half_norm2(&r);
                iteration += 1;
                break triangle;
            }
        };
    };
    let status = match status {
        Status::AtBound { by, .. } => Status::AtBound { at: active, by },
        s => s,
    };
    let jacobian = DMatrix::zeros(0, 0);
    Ok(Solution { x, cost, residuals: r, jacobian, status, evaluations, iterations: iteration, radius, history })
}

/// Where steps may lead: bounds, and how far from the linearisation.
struct Room<'a> {
    x: &'a [f64],
    d: &'a [f64],
    lower: &'a [f64],
    upper: &'a [f64],
    radius: f64,
}

/// Takes an undamped step that did not keep its promise to where the parabola through both its ends is lowest: `1 / (2 - gain)` times its
/// length, at most [`FARTHEST`] times, if the residuals there are smaller. Where the residuals are curved against what they leave,
/// Gauss-Newton steps are wrong by the factor `gain - 1` each, and converge as slowly. Returns the number of evaluations.
fn along<P: Linearise + ?Sized>(
    problem: &mut P,
    room: &Room<'_>,
    gain: f64,
    (trial, r_trial): (&mut Vec<f64>, &mut Vec<f64>),
) -> Result<usize, LmError> {
    let times = if gain < 2.0 { (1.0 / (2.0 - gain)).min(FARTHEST) } else { FARTHEST };
    let far = |k: usize| (room.x[k] + times * (trial[k] - room.x[k])).clamp(room.lower[k], room.upper[k]);
    let next: Vec<f64> = (0..trial.len()).map(far).collect();
    let way: Vec<f64> = next.iter().zip(room.x).map(|(a, b)| a - b).collect();
    if scaled_norm(&way, room.d) > room.radius {
        return Ok(0);
    }
    let mut r_next = Vec::with_capacity(r_trial.len());
    if problem.residuals(&next, &mut r_next)?.is_ok() && reduction(r_trial, &r_next) > 0.0 {
        *trial = next;
        core::mem::swap(r_trial, &mut r_next);
    }
    Ok(1)
}

/// Goes on from `trial` by steps of the linearisation at hand, as long as each finds less than a quarter left of what the one before
/// promised, and wins what it promises itself. Returns the number of evaluations.
fn chord<P: Linearise + ?Sized>(
    problem: &mut P,
    lin: &Linear,
    room: &Room<'_>,
    set: &Settings,
    trial: &mut Vec<f64>,
    r_trial: &mut Vec<f64>,
) -> Result<usize, LmError> {
    const STEPS: usize = 6;
    let (mut before, mut r_next) = (lin.promised(), Vec::with_capacity(r_trial.len()));
    for step in 0..STEPS {
        let Ok(gradient) = problem.transposed(r_trial)? else { return Ok(step) };
        let (p, promised) = lin.again(&gradient, room.d);
        let least = set.decrement_tolerance.max(UNRESOLVED) * half_norm2(r_trial);
        let next: Vec<f64> = (0..p.len()).map(|i| (trial[i] + p[i]).clamp(room.lower[i], room.upper[i])).collect();
        let way: Vec<f64> = next.iter().zip(room.x).map(|(a, b)| a - b).collect();
        let worth = promised > least && promised < 0.25 * before && scaled_norm(&way, room.d) < room.radius;
        if !worth {
            return Ok(step);
        }
        if problem.residuals(&next, &mut r_next)?.is_err() || reduction(r_trial, &r_next) < 0.5 * promised {
            return Ok(step + 1);
        }
        *trial = next;
        core::mem::swap(r_trial, &mut r_next);
        before = promised;
    }
    Ok(STEPS)
}

fn scaled_norm(p: &[f64], d: &[f64]) -> f64 {
    p.iter().zip(d).map(|(p, d)| (p * d).powi(2)).sum::<f64>().sqrt()
}

fn check_start(n: usize, start: &[f64], bounds: &[(f64, f64)]) -> Result<(), LmError> {
    if n == 0 || start.len() != n {
        return Err(LmError::Setup(format!("{n} unknowns, but the start has {}", start.len())));
    }
    if !bounds.is_empty() && bounds.len() != n {
        return Err(LmError::Setup(format!("{n} unknowns, but {} bounds", bounds.len())));
    }
    for (i, x) in start.iter().enumerate() {
        let (lo, hi) = bounds.get(i).copied().unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
        if !(x.is_finite() && lo <= *x && *x <= hi) {
            return Err(LmError::Setup(format!("start {i} is {x}, must be finite and in {lo} .. {hi}")));
        }
    }
    Ok(())
}

/// Largest difference between the Jacobian and central differences of step `h * max(1, |x_i|)`, relative to
/// the norm of the column. For tests of new problems; 2n + 1 evaluations.
///
/// # Errors
/// [`LmError::Fatal`] or [`LmError::NonFiniteResidual`] when a point cannot be evaluated.
pub fn jacobian_error<P: Problem + ?Sized>(problem: &mut P, x: &[f64], h: f64) -> Result<f64, LmError> {
    let (mut r, mut j) = (Vec::new(), DMatrix::zeros(0, 0));
    let ok = |res, r: &[f64], j: Option<&DMatrix<f64>>, x: &[f64]| match finite(res, r, j)? {
        Ok(()) => Ok(()),
        Err(reason) => {
            let values = x.iter().enumerate().map(|(i, v)| (format!("x[{i}]"), *v)).collect();
            Err(LmError::NonFiniteResidual { attempts: 1, values, best: x.to_vec(), reason })
        }
    };
    let res = problem.jacobian(x, &mut r, &mut j);
    ok(res, &r, Some(&j), x)?;
    let mut worst = 0.0f64;
    for i in 0..x.len() {
        let step = h * x[i].abs().max(1.0);
        let mut side = [Vec::new(), Vec::new()];
        for (out, sign) in side.iter_mut().zip([1.0, -1.0]) {
            let mut y = x.to_vec();
            y[i] += sign * step;
            let res = problem.residuals(&y, out);
            ok(res, out, None, &y)?;
        }
        let norm = j.column(i).norm().max(f64::MIN_POSITIVE);
        let diff = side[0].iter().zip(&side[1]).enumerate();
        let e2: f64 = diff.map(|(k, (a, b))| ((a - b) / (2.0 * step) - j[(k, i)]).powi(2)).sum();
        worst = worst.max(e2.sqrt() / norm);
    }
    Ok(worst)
}

#[cfg(test)]
#[path = "lm_tests.rs"]
mod tests;
