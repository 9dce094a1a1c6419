//! How a search is watched, limited in time, and interrupted.

use crate::solve::sqp::Status;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Where a search stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Which start, from 0.
    pub start: usize,
    /// Iterations done.
    pub iteration: usize,
    /// Cost of the present iterate; NaN while a feasible plan is looked for.
    pub cost: f64,
    /// Largest relative excess of a constraint, negative when all hold; minus infinity without constraints.
    pub excess: f64,
}

/// Who looks on. All fields may stay empty.
#[derive(Clone, Copy, Default)]
pub struct Watch<'a> {
    /// Set to true from anywhere (a signal handler, another thread) to end the search.
    pub stop: Option<&'a AtomicBool>,
    /// When to end the search.
    pub deadline: Option<Instant>,
    /// Called before every iteration, from the thread that runs it; false ends the search.
    pub progress: Option<&'a (dyn Fn(&Progress) -> bool + Sync)>,
}

/// Who looks on at one local search.
#[derive(Clone, Copy, Default)]
pub(crate) struct Eye<'a> {
    pub(crate) watch: Watch<'a>,
    /// Start that is reported.
    pub(crate) start: usize,
    /// Set once `progress` has asked for an end: for all threads, and for what comes after.
    pub(crate) latch: Option<&'a AtomicBool>,
}

impl Eye<'_> {
    /// True when the search is to end now.
    pub(crate) fn cut_short(&self) -> bool {
        let set = |s: Option<&AtomicBool>| s.is_some_and(|s| s.load(Ordering::Relaxed));
        set(self.watch.stop) || set(self.latch) || self.watch.deadline.is_some_and(|d| Instant::now() >= d)
    }
    /// Reports, and tells how the search ends if it is to end now.
    pub(crate) fn ended(&self, progress: &Progress) -> Option<Status> {
        let set = |s: Option<&AtomicBool>| s.is_some_and(|s| s.load(Ordering::Relaxed));
        let go_on = self.watch.progress.is_none_or(|f| f(progress));
        if !go_on && let Some(latch) = self.latch {
            latch.store(true, Ordering::Relaxed);
        }
        if !go_on || set(self.watch.stop) || set(self.latch) {
            return Some(Status::Interrupted);
        }
        self.watch.deadline.filter(|d| Instant::now() >= *d).map(|_| Status::TimeLimit)
    }
}

impl std::fmt::Debug for Watch<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Watch").field("stop", &self.stop).field("deadline", &self.deadline).finish_non_exhaustive()
    }
}
