//! Seeded random plans that keep all limits: trajectories for rigid identification and for validation.

use crate::plan::spline::{Duration, End, PlanError, SplinePlan};
use crate::solve::qp;
use crate::solve::qp::{Inequality, QpFailure};
use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Random plans stay this far (relative) inside the limits, so that rounding cannot break them.
const INSIDE: f64 = 1e-7;

/// Variables of a feasible plan with the given duration (s), near the straight path from start to end.
/// Allocates.
///
/// # Errors
/// [`PlanError::Infeasible`] naming a constraint that cannot be kept; `Argument` for a bad duration.
pub fn feasible_start(plan: &SplinePlan, duration: f64) -> Result<Vec<f64>, PlanError> {
    let positive = duration.is_finite() && duration > 0.0;
    if !positive {
        let (got, expected) = (duration.to_string(), "positive".into());
        return Err(PlanError::Argument { what: "duration", got, expected });
    }
    let mut x = straight(plan, duration);
    if plan.violated(&x).is_none() {
        return Ok(x);
    }
    // Nearest feasible point: a small convex program at fixed duration.
    let m = plan.dof() * plan.per_joint();
    let rows: Vec<Inequality> = plan
        .rows
        .iter()
        .map(|r| {
            let s = r.scale * duration.powi(r.power);
            let columns = r.columns.iter().map(|(c, v)| (*c, v / s)).collect();
            Inequality { columns, bound: r.slack(&x, duration) - 1e-7 }
        })
        .collect();
    match qp::solve(&DMatrix::identity(m, m), &vec![0.0; m], &rows) {
        Ok(d) => x.iter_mut().zip(d.z).for_each(|(x, d)| *x += d),
        Err(QpFailure::Infeasible(i)) => {
            return Err(PlanError::Infeasible { which: plan.rows[i].which(0.0) });
        }
        Err(QpFailure::Solver) => {} // the test below names what is broken
    }
    plan.violated(&x).map_or(Ok(x), |which| Err(PlanError::Infeasible { which }))
}

fn straight(plan: &SplinePlan, duration: f64) -> Vec<f64> {
    let spec = plan.spec();
    let mut x = Vec::with_capacity(plan.variables());
    for j in 0..plan.dof() {
        let a = spec.start[j];
        let b = if let End::Fixed(e) = &spec.end { e[j] } else { a };
        x.extend((1..=spec.free).map(|i| a + (b - a) * i as f64 / (spec.free + 1) as f64));
        if spec.end == End::Free {
            x.push(a);
        }
    }
    if plan.duration_index().is_some() {
        x.push(duration);
    }
    x
}

/// A random feasible plan, a function of `seed` and `stream` only.
///
/// Control points are drawn evenly over the position range (or a range that the speed limit can reach) and,
/// joint by joint, pulled towards a feasible plan until all limits of that joint hold; then a random
/// fraction in `[low, 1]` of the way is used, `low = fraction`. A free duration is drawn evenly between its
/// bounds. Allocates.
///
/// # Errors
/// [`PlanError::Infeasible`] if no plan exists (at the longest duration, when that is free).
pub fn random_plan(plan: &SplinePlan, seed: u64, stream: u64, fraction: f64) -> Result<Vec<f64>, PlanError> {
    let within = (0.0..=1.0).contains(&fraction);
    if !within {
        let (got, expected) = (fraction.to_string(), "0..=1".into());
        return Err(PlanError::Argument { what: "fraction", got, expected });
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(stream);
    let (centre, t) = match plan.spec().duration {
        Duration::Fixed(t) => (feasible_start(plan, t)?, t),
        Duration::Free { min, max } => {
            let mut t = min + (max - min) * rng.random::<f64>();
            let mut found = feasible_start(plan, t);
            // Longer is easier; the longest decides.
            for _ in 0..8 {
                if found.is_ok() {
                    break;
                }
                t = 0.5 * (t + max);
                found = feasible_start(plan, t);
            }
            if found.is_err() {
                t = max;
            }
            (found.or_else(|_| feasible_start(plan, max))?, t)
        }
    };
    let mut x = centre.clone();
    let m = plan.per_joint();
    for j in 0..plan.dof() {
        let l = &plan.spec().limits[j];
        let reach = 0.5 * l.velocity.min(1e3) * t;
        let lo = l.lower.max(plan.spec().start[j] - reach);
        let hi = l.upper.min(plan.spec().start[j] + reach);
        for v in &mut x[j * m..(j + 1) * m] {
            *v = lo + (hi - lo) * rng.random::<f64>();
        }
        let mut step: f64 = 1.0;
        for r in plan.rows.iter().filter(|r| r.joint == j) {
            let s = r.scale * t.powi(r.power);
            let growth = (r.value(&x) - r.value(&centre)) / s;
            let slack = r.slack(&centre, t) - INSIDE;
            if growth > slack {
                step = step.min((slack / growth).max(0.0));
            }
        }
        step *= fraction + (1.0 - fraction) * rng.random::<f64>();
        for i in j * m..(j + 1) * m {
            x[i] = centre[i] + step * (x[i] - centre[i]);
        }
    }
    plan.violated(&x).map_or(Ok(x), |which| Err(PlanError::Infeasible { which }))
}
