//! Which demands contradict each other, when no plan keeps them all.
//!
//! A set of demands is in conflict when no plan keeps all of it. The answer is a set from which nothing can be left out
//! (deletion filter, J. Chinneck and E. Dravnieks, *Locating minimal infeasible constraint sets in linear programs*,
//! ORSA J. on Computing 3(2), 1991): start from the demands that press where the search for a feasible plan
//! stands still, leave out one after the other, and put back those without which a plan is found. For joint limits alone at
//! a given duration this is exact (a convex problem); with constraints, "no plan" means that no local search found one.

use crate::constraint::{Constraint, Sense, Wanted};
use crate::objective::Cost;
use crate::plan::limits::{JointLimits, Quantity};
use crate::plan::random::{feasible_start, random_plan};
use crate::plan::spline::{Duration, End, PlanError, SplinePlan};
use crate::solve::observer::Eye;
use crate::solve::problem::Problem;
use crate::solve::sqp::{Obstacle, SqpOptions, minimise_seen, restore};
use crate::solve::verdict::{quantity_name, quantity_unit};
use std::fmt;

/// Random starts of every local search for a feasible plan, besides the straight plan.
const TRIES: u64 = 2;
/// Iterations of each.
const ITERATIONS: usize = 36;
/// Iterations spent on how far a constraint could be kept.
const LEAST: usize = 40;

/// One of the demands that cannot be kept together.
#[derive(Clone, Debug, PartialEq)]
pub struct Demand {
    /// What is demanded.
    pub name: String,
    /// Of what: joint, body, frame, coordinate.
    pub item: String,
    /// The limit.
    pub limit: f64,
    /// A value with which a plan exists if everything else stays, if one was found.
    pub possible: Option<f64>,
    /// Unit of both.
    pub unit: &'static str,
}

/// Demands that contradict each other: leave out any one of them, and there is a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Conflict {
    /// The demands.
    pub demands: Vec<Demand>,
    /// One next step.
    pub next: String,
}

impl fmt::Display for Demand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of {}: limit {} {}", self.name, self.item, self.limit, self.unit)?;
        match self.possible {
            Some(v) => write!(f, ", possible if all else stays {v:.4} {}", self.unit),
            None => Ok(()),
        }
    }
}

impl fmt::Display for Conflict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("no plan keeps all of this: ")?;
        for (i, d) in self.demands.iter().enumerate() {
            if i > 0 {
                f.write_str("; ")?;
            }
            write!(f, "{d}")?;
        }
        write!(f, ". {}", self.next)
    }
}

impl std::error::Error for Conflict {}

/// A demand that can be left out.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Group {
    /// Channel of a constraint.
    Channel(usize, usize),
    /// Limits of a joint on a derivative.
    Joint(usize, i32),
}

/// What a closer look at a problem without a plan found.
pub(crate) enum Answer {
    /// A plan that keeps everything after all.
    Plan(Vec<f64>),
    /// Why there is none.
    Conflict(Conflict),
}

/// The conflict of a problem for which no plan was found, or a plan after all. Allocates.
///
/// # Errors
/// [`PlanError::Interrupted`].
pub(crate) fn diagnose(problem: &Problem<'_>, watch: &Eye<'_>) -> Result<Answer, PlanError> {
    if let Some(conflict) = of_joints(problem) {
        return Ok(Answer::Conflict(conflict));
    }
    let first = starts(problem)?;
    let obstacle = match infeasible(problem, &first, watch)? {
        Err(x) => return Ok(Answer::Plan(x)),
        Ok(obstacle) => obstacle,
    };
    // What is left to be told is near: from where the search stood still, and from the straight plan.
    let from = [obstacle.x.clone(), first[0].clone()];
    let mut candidates = pressing(problem, &obstacle);
    // All other demands leave at once, if the conflict stays without them.
    let mut without = problem.clone();
    for g in everything(problem).into_iter().filter(|g| !candidates.contains(g)) {
        drop_group(&mut without, g);
    }
    if infeasible(&without, &from, watch)?.is_err() {
        without = problem.clone();
        candidates = everything(problem);
    }
    let mut members = Vec::new();
    for &g in &candidates {
        let mut trial = without.clone();
        drop_group(&mut trial, g);
        match infeasible(&trial, &from, watch)? {
            Ok(_) => without = trial,
            Err(x) => members.push((g, x)),
        }
    }
    let mut demands = Vec::new();
    for (g, x) in members {
        demands.push(demand(problem, g, &[x.as_slice(), &first[0], &obstacle.x], watch)?);
    }
    let next = advice(problem.plan, &demands);
    Ok(Answer::Conflict(Conflict { demands, next }))
}

/// Everything that can be left out.
fn everything(problem: &Problem<'_>) -> Vec<Group> {
    let channels = problem
        .constraints
        .iter()
        .enumerate()
        .flat_map(|(k, c)| (0..c.channels().len()).map(move |ch| Group::Channel(k, ch)));
    let mut out: Vec<Group> = channels.collect();
    for r in &problem.plan.rows {
        let g = Group::Joint(r.joint, r.power);
        if !out.contains(&g) {
            out.push(g);
        }
    }
    out
}

/// The demands with multipliers, or broken, where the search stood still.
fn pressing(problem: &Problem<'_>, obstacle: &Obstacle) -> Vec<Group> {
    let most = obstacle.pull.iter().copied().fold(0.0, f64::max);
    let mut out = Vec::new();
    for (row, (k, ch)) in problem.origin().into_iter().enumerate() {
        let g = Group::Channel(k, ch);
        let presses = obstacle.pull[row] > 1e-4 * most || obstacle.rows[row] > 0.5 * obstacle.excess;
        if presses && !out.contains(&g) {
            out.push(g);
        }
    }
    let most = obstacle.joints.iter().map(|j| j.1).fold(0.0, f64::max);
    out.extend(obstacle.joints.iter().filter(|j| j.1 > 1e-2 * most).map(|j| Group::Joint(j.0.0, j.0.1)));
    out
}

fn drop_group(problem: &mut Problem<'_>, g: Group) {
    match g {
        Group::Channel(k, ch) => problem.dropped.push((k, ch)),
        Group::Joint(j, power) => problem.freed.push((j, power)),
    }
}

/// Where the searches stood still, or a plan as the error.
fn infeasible(
    problem: &Problem<'_>,
    from: &[Vec<f64>],
    watch: &Eye<'_>,
) -> Result<Result<Obstacle, Vec<f64>>, PlanError> {
    let mut least: Option<Obstacle> = None;
    for x in from {
        match restore(problem, x, ITERATIONS, watch)? {
            Ok(x) => return Ok(Err(x)),
            Err(o) if least.as_ref().is_none_or(|l| o.excess < l.excess) => least = Some(o),
            Err(_) => {}
        }
    }
    least.map(Ok).ok_or(PlanError::Undefined)
}

/// The slowest straight plan, and random ones.
fn starts(problem: &Problem<'_>) -> Result<Vec<Vec<f64>>, PlanError> {
    let plan = problem.plan;
    let mut out = vec![feasible_start(plan, plan.longest())?];
    for i in 0..TRIES {
        out.push(random_plan(plan, 0x00c0_ff11c7, i, 0.3)?);
    }
    Ok(out)
}

/// The best value of `g` when everything else of `problem` is kept, if a plan for that is found from one of `from`.
fn demand(problem: &Problem<'_>, g: Group, from: &[&[f64]], watch: &Eye<'_>) -> Result<Demand, PlanError> {
    let mut others = problem.clone();
    drop_group(&mut others, g);
    let mut found = None;
    for x in from.iter().filter(|x| others.violated(x).is_none()) {
        if let Ok(x) = restore(&others, x, ITERATIONS, watch)? {
            found = Some(x);
            break;
        }
    }
    match g {
        Group::Channel(k, ch) => {
            let constraint = problem.constraints[k];
            let channel = &constraint.channels()[ch];
            let lowest = Lowest { constraint, channel: ch };
            let possible = found.map(|found| {
                let least = Problem { cost: &lowest, ..others.clone() };
                let options = SqpOptions { iterations: LEAST, tolerance: 1e-5 };
                let x = minimise_seen(&least, &found, &options, watch).map_or(found, |o| o.x);
                let most = lowest.rows(problem.plan, &x).iter().copied().fold(f64::NEG_INFINITY, f64::max);
                let beyond = most * channel.scale;
                if channel.sense == Sense::AtMost { channel.limit + beyond } else { channel.limit - beyond }
            });
            let (name, item) = (channel.name.to_owned(), channel.item.clone());
            Ok(Demand { name, item, limit: channel.limit, possible, unit: channel.unit })
        }
        Group::Joint(joint, power) => {
            let l = problem.limits(joint);
            let (quantity, limit) = match power {
                0 => (Quantity::Upper, l.upper),
                _ => crate::plan::limits::rate_limit(l, power as usize),
            };
            let possible = found.filter(|_| power > 0).map(|x| {
                let t = problem.plan.duration(&x);
                let rows = problem.plan.rows.iter().filter(|r| r.joint == joint && r.power == power);
                rows.map(|r| r.value(&x) / t.powi(power)).fold(0.0, f64::max)
            });
            let name = if power == 0 { "joint range" } else { quantity_name(quantity) };
            let (item, prismatic) = problem.joint(joint);
            let unit = quantity_unit(quantity, prismatic);
            Ok(Demand { name: name.into(), item, limit, possible, unit })
        }
    }
}

/// The largest row of one channel, smoothly.
struct Lowest<'a> {
    constraint: &'a dyn Constraint,
    channel: usize,
}

impl Lowest<'_> {
    /// Rows of the channel.
    fn rows(&self, plan: &SplinePlan, x: &[f64]) -> Vec<f64> {
        let samples = self.constraint.samples(plan);
        let mut rows = vec![0.0; samples * self.constraint.channels().len()];
        self.constraint.evaluate(plan, x, &mut rows, None);
        rows[self.channel * samples..(self.channel + 1) * samples].to_vec()
    }
}

impl Cost for Lowest<'_> {
    /// The aggregate of Kreisselmeier and Steinhauser, `max + ln(sum exp(rho (row - max))) / rho`.
    fn value_gradient(&self, plan: &SplinePlan, x: &[f64], grad: &mut [f64]) -> f64 {
        const SHARPNESS: f64 = 50.0;
        let rows = self.rows(plan, x);
        let most = rows.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<f64> = rows.iter().map(|r| (SHARPNESS * (r - most)).exp()).collect();
        let sum: f64 = weights.iter().sum();
        let count = rows.len() * self.constraint.channels().len();
        let here = self.channel * rows.len();
        let (mut all, mut wanted) = (vec![0.0; count], vec![false; count]);
        weights.iter().enumerate().for_each(|(i, w)| wanted[here + i] = *w > 1e-9 * sum);
        let mut j = nalgebra::DMatrix::zeros(count, plan.variables());
        self.constraint.evaluate(plan, x, &mut all, Some(Wanted { rows: &wanted, jacobian: &mut j }));
        grad.fill(0.0);
        for (i, w) in weights.iter().enumerate() {
            grad.iter_mut().enumerate().for_each(|(k, g)| *g += w / sum * j[(here + i, k)]);
        }
        most + sum.ln() / SHARPNESS
    }
}

/// The conflict of joint limits alone, at the longest duration, exactly; `None` when a plan keeps them.
fn of_joints(problem: &Problem<'_>) -> Option<Conflict> {
    let plan = problem.plan;
    let t = plan.longest();
    let fits = |t: f64, limits: &[JointLimits]| {
        let mut spec = plan.spec().clone();
        spec.duration = Duration::Fixed(t);
        spec.limits = limits.to_vec();
        SplinePlan::new(spec).is_ok_and(|p| feasible_start(&p, t).is_ok())
    };
    let mut limits = plan.spec().limits.clone();
    if fits(t, &limits) {
        return None;
    }
    let mut members = Vec::new();
    for joint in 0..plan.dof() {
        for power in (0..=3).rev() {
            let mut trial = limits.clone();
            free(&mut trial[joint], power);
            if trial[joint] == limits[joint] {
                continue;
            }
            if fits(t, &trial) {
                members.push((joint, power));
            } else {
                limits = trial;
            }
        }
    }
    let mut demands: Vec<Demand> = members
        .iter()
        .map(|&(joint, power)| {
            let l = &plan.spec().limits[joint];
            let (quantity, limit) = match power {
                0 => (Quantity::Upper, l.upper),
                _ => crate::plan::limits::rate_limit(l, power),
            };
            let possible = (power > 0).then(|| {
                smallest(limit, |v| {
                    let mut trial = limits.clone();
                    match power {
                        1 => trial[joint].velocity = v,
                        2 => trial[joint].acceleration = v,
                        _ => trial[joint].jerk = Some(v),
                    }
                    fits(t, &trial)
                })
            });
            let name = if power == 0 { "joint range" } else { quantity_name(quantity) };
            let (item, prismatic) = problem.joint(joint);
            let unit = quantity_unit(quantity, prismatic);
            Demand { name: name.into(), item, limit, possible: possible.flatten(), unit }
        })
        .collect();
    if let Some(longer) = smallest(t, |t| fits(t, &limits)) {
        let (name, item) = ("duration".into(), "the plan".into());
        demands.push(Demand { name, item, limit: t, possible: Some(longer), unit: "s" });
    }
    let next = advice(plan, &demands);
    Some(Conflict { demands, next })
}

fn free(l: &mut JointLimits, power: usize) {
    match power {
        0 => (l.lower, l.upper) = (f64::NEG_INFINITY, f64::INFINITY),
        1 => l.velocity = f64::INFINITY,
        2 => l.acceleration = f64::INFINITY,
        _ => l.jerk = None,
    }
}

/// The smallest value above `from`, to a thousandth, with which it works; `None` if none up to 1000 times does.
fn smallest(from: f64, works: impl Fn(f64) -> bool) -> Option<f64> {
    let (mut low, mut high) = (from, 2.0 * from);
    while !works(high) {
        (low, high) = (high, 2.0 * high);
        if high > 1000.0 * from {
            return None;
        }
    }
    while high > low * 1.001 {
        let middle = 0.5 * (low + high);
        if works(middle) { high = middle } else { low = middle }
    }
    Some(high)
}

fn advice(plan: &SplinePlan, demands: &[Demand]) -> String {
    if let Some(d) = demands.iter().find(|d| d.name == "duration") {
        return format!("Allow {:.4} s, or loosen one of the others.", d.possible.unwrap_or(d.limit));
    }
    match demands.iter().find_map(|d| d.possible.map(|v| (d, v))) {
        Some((d, v)) => {
            let side = if v >= d.limit { "raise" } else { "lower" };
            format!("For example, {side} the limit of {} of {} to {v:.4} {}.", d.name, d.item, d.unit)
        }
        None if matches!(plan.spec().end, End::Fixed(_)) => "Move the end configuration, or loosen one of them.".into(),
        None => "Loosen one of them.".into(),
    }
}
