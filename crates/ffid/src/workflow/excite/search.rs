//! The search: cheap problems from many starts, the flexible system's information from the best of them.

use super::goal::GoalCost;
use super::world::{InWorld, World};
use excitation::constraint::HeldSystem;
use excitation::plan::PlanError;
use excitation::solve::search_from;
use excitation::{Constraint, Found, Outcome, SearchOptions, SplinePlan, SqpOptions, search};
use ff_mission::mission::Excite;
use ff_model::Model;
use serde::Serialize;
use std::sync::atomic::{AtomicBool, Ordering};

/// Where a search stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// What is searched for, in words.
    pub stage: &'static str,
    /// Which start, from 0.
    pub start: usize,
    /// Iterations done.
    pub iteration: usize,
    /// Cost of the present plan; NaN while a feasible one is looked for.
    pub cost: f64,
}

/// Who looks on, and can end the search. Both may stay empty.
#[derive(Clone, Copy, Default)]
pub struct Observer<'a> {
    /// Set to true from anywhere to end the search with the best plan so far.
    pub stop: Option<&'a AtomicBool>,
    /// Called before every iteration, from the thread that runs it.
    pub progress: Option<&'a (dyn Fn(&Progress) + Sync)>,
}

impl Observer<'_> {
    fn stopped(&self) -> bool {
        self.stop.is_some_and(|s| s.load(Ordering::Relaxed))
    }
}

/// How one search ended.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Search {
    /// What it was for.
    pub stage: &'static str,
    /// Why it stopped.
    pub status: String,
    /// Its final cost; absent when there is no plan.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cost: Option<f64>,
    /// Iterations.
    pub iterations: usize,
    /// Evaluations of the cost.
    pub evaluations: usize,
}

pub(super) struct Best {
    pub(super) x: Vec<f64>,
    pub(super) cost: f64,
    pub(super) searches: Vec<Search>,
    pub(super) interrupted: bool,
    /// How often constraints were corrected by the full simulation.
    pub(super) rounds: usize,
    /// How it compares with other plans where not everything is exact.
    pub(super) in_world: Option<InWorld>,
}

/// What the search keeps to beside the limits of the joints.
#[derive(Clone, Copy)]
pub(super) struct Under<'a> {
    pub(super) model: &'a Model,
    pub(super) system: Option<&'a HeldSystem>,
    pub(super) constraints: &'a [&'a dyn Constraint],
}

/// How many of the plans for the cheap problem are refined.
const REFINED: usize = 2;

pub(super) fn run(
    goal: &GoalCost,
    plan: &SplinePlan,
    under: Under<'_>,
    settings: &Excite,
    world: Option<&World<'_>>,
    watch: &Observer<'_>,
) -> Result<Best, PlanError> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let sqp = SqpOptions { iterations: settings.iterations as usize, ..SqpOptions::default() };
    let options = SearchOptions {
        seed: settings.seed,
        starts: settings.starts as usize,
        threads,
        sqp,
        ..SearchOptions::default()
    };
    let problem = |cost| excitation::solve::Problem::new(cost, plan).under(under.constraints).named(under.model);
    let mut searches = Vec::new();
    let Some(warm) = &goal.warm else {
        let found = watched(watch, "plan", |w| search(&problem(goal.cost.as_ref()), under.system, &options, w))?;
        list(&mut searches, "plan", &found);
        return Ok(best(found, searches, watch));
    };
    let found = watched(watch, "rigid start", |w| search(&problem(warm.as_ref()), under.system, &options, w))?;
    list(&mut searches, "rigid start", &found);
    let mut rated: Vec<(f64, &Outcome)> = found
        .all
        .iter()
        .flatten()
        .chain([&found.best])
        .map(|o| (goal.value(plan, &o.x), o))
        .filter(|r| r.0.is_finite())
        .collect();
    rated.sort_by(|a, b| a.0.total_cmp(&b.0));
    rated.dedup_by(|a, b| a.1.x == b.1.x);
    if watch.stopped() {
        // The verified one, rated by the true cost.
        let cost = goal.value(plan, &found.best.x);
        return Ok(Best { cost, ..best(found, searches, watch) });
    }
    if let Some(w) = world {
        rated = rated.into_iter().map(|(_, o)| (w.cost(plan, &o.x), o)).collect();
        rated.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
    let from: Vec<Vec<f64>> = rated.iter().take(REFINED).map(|r| r.1.x.clone()).collect();
    if from.is_empty() {
        return Err(PlanError::Cost(f64::NAN));
    }
    let refined =
        watched(watch, "refinement", |w| search_from(&problem(goal.cost.as_ref()), under.system, &from, &options, w))?;
    list(&mut searches, "refinement", &refined);
    let Some(world) = world else { return Ok(best(refined, searches, watch)) };
    // The refinement takes everything else as exact: what it started from may be better where it is not.
    let exact_choice = refined.best.clone();
    let others = refined.all.iter().flatten().map(|o| &o.x).chain(&from).filter(|x| **x != exact_choice.x);
    let mut ranked: Vec<(f64, Vec<f64>)> = others.map(|x| (world.cost(plan, x), x.clone())).collect();
    let compared = 1 + ranked.len();
    let cost_of_exact_choice = world.cost(plan, &exact_choice.x);
    ranked.retain(|r| r.0 < cost_of_exact_choice);
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut out = best(refined, searches, watch);
    let mut cost = cost_of_exact_choice;
    // As it is, verified by the full simulation; the next one where that refuses it.
    let as_it_is = SearchOptions { sqp: SqpOptions { iterations: 0, ..sqp }, ..options };
    for (_, x) in ranked {
        let problem = problem(goal.cost.as_ref());
        if let Ok(kept) = search_from(&problem, under.system, &[x], &as_it_is, &Default::default()) {
            let now = world.cost(plan, &kept.best.x);
            if now < cost {
                cost = now;
                out = Best { x: kept.best.x, cost: kept.best.cost, rounds: kept.rounds, ..out };
                break;
            }
        }
    }
    let (uncertain, cost_if_exact) = (world.uncertain(), out.cost);
    out.in_world = Some(InWorld { uncertain, compared, cost, cost_of_exact_choice, cost_if_exact });
    Ok(out)
}

fn best(found: Found, searches: Vec<Search>, watch: &Observer<'_>) -> Best {
    let (interrupted, rounds) = (watch.stopped(), found.rounds);
    Best { x: found.best.x, cost: found.best.cost, searches, interrupted, rounds, in_world: None }
}

/// Runs a search that reports to `watch`.
fn watched<R>(watch: &Observer<'_>, stage: &'static str, run: impl FnOnce(&excitation::solve::Observer<'_>) -> R) -> R {
    let report = |p: &excitation::Progress| {
        if let Some(f) = watch.progress {
            f(&Progress { stage, start: p.start, iteration: p.iteration, cost: p.cost });
        }
        !watch.stopped()
    };
    let inner = excitation::solve::Observer { stop: watch.stop, progress: Some(&report), ..Default::default() };
    run(&inner)
}

fn list(searches: &mut Vec<Search>, stage: &'static str, found: &Found) {
    searches.extend(found.all.iter().map(|o| match o {
        Ok(o) => Search {
            stage,
            status: o.status.to_string(),
            cost: Some(o.cost),
            iterations: o.iterations,
            evaluations: o.evaluations,
        },
        Err(e) => Search { stage, status: e.to_string(), cost: None, iterations: 0, evaluations: 0 },
    }));
}
