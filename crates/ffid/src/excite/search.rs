//! The search, watched.

use crate::excitation::{Cost, PlanError, SplinePlan, SqpOptions, multi_start};
use crate::model::mission::Excite;
use serde::Serialize;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Where a search stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Evaluations of the cost so far.
    pub evaluations: usize,
    /// Cost of the trajectory just looked at.
    pub cost: f64,
}

/// Who looks on, and can end the search. Both may stay empty.
#[derive(Clone, Copy, Default)]
pub struct Watch<'a> {
    /// Set to true from anywhere to end the search with the best plan so far.
    pub stop: Option<&'a AtomicBool>,
    /// Called after every evaluation of the cost.
    pub progress: Option<&'a (dyn Fn(&Progress) + Sync)>,
}

/// How one search ended.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Search {
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
}

/// A cost that reports, and has no value once the search is to end: no step is then accepted, and the optimiser returns
/// the best plan it has.
struct Watched<'a> {
    inner: &'a dyn Cost,
    watch: Watch<'a>,
    count: AtomicUsize,
}

impl Watched<'_> {
    fn stopped(&self) -> bool {
        self.watch.stop.is_some_and(|s| s.load(Ordering::Relaxed))
    }
}

impl Cost for Watched<'_> {
    fn value_gradient(&self, plan: &SplinePlan, x: &[f64], grad: &mut [f64]) -> f64 {
        if self.stopped() {
            return f64::NAN;
        }
        let cost = self.inner.value_gradient(plan, x, grad);
        let evaluations = self.count.fetch_add(1, Ordering::Relaxed) + 1;
        if let Some(f) = self.watch.progress {
            f(&Progress { evaluations, cost });
        }
        cost
    }
}

pub(super) fn run(cost: &dyn Cost, plan: &SplinePlan, settings: &Excite, watch: &Watch<'_>) -> Result<Best, PlanError> {
    let watched = Watched { inner: cost, watch: *watch, count: AtomicUsize::new(0) };
    let options = SqpOptions { iterations: settings.iterations as usize, ..SqpOptions::default() };
    let found = multi_start(&watched, plan, settings.seed, settings.starts as usize, &options)?;
    let searches = found.all.iter().map(|o| match o {
        Ok(o) => Search {
            status: format!("{:?}", o.status),
            cost: Some(o.cost),
            iterations: o.iterations,
            evaluations: o.evaluations,
        },
        Err(e) => Search { status: e.to_string(), cost: None, iterations: 0, evaluations: 0 },
    });
    Ok(Best {
        x: found.best.x.clone(),
        cost: found.best.cost,
        searches: searches.collect(),
        interrupted: watched.stopped(),
    })
}
