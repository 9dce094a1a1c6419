//! Progress, time limit and interruption of a search.

use crate::solve::sqp::outcome::Status;
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

/// Optional callbacks and limits of a search; all fields may stay empty.
#[derive(Clone, Copy, Default)]
pub struct Observer<'a> {
    /// Set to true from anywhere (a signal handler, another thread) to end the search.
    pub stop: Option<&'a AtomicBool>,
    /// When to end the search.
    pub deadline: Option<Instant>,
    /// Called before every iteration, from the thread that runs it; false ends the search.
    pub progress: Option<&'a (dyn Fn(&Progress) -> bool + Sync)>,
}

/// The observer of one local search of several.
#[derive(Clone, Copy, Default)]
pub(crate) struct StartObserver<'a> {
    pub(crate) observer: Observer<'a>,
    /// Start that is reported.
    pub(crate) start: usize,
    /// Set once `progress` has asked for an end: for all threads, and for what comes after.
    pub(crate) latch: Option<&'a AtomicBool>,
}

impl StartObserver<'_> {
    /// True when the search is to end now.
    pub(crate) fn cut_short(&self) -> bool {
        let set = |s: Option<&AtomicBool>| s.is_some_and(|s| s.load(Ordering::Relaxed));
        set(self.observer.stop) || set(self.latch) || self.observer.deadline.is_some_and(|d| Instant::now() >= d)
    }
    /// Reports the progress; the status with which the search ends if it is to end now.
    pub(crate) fn ended(&self, progress: &Progress) -> Option<Status> {
        let set = |s: Option<&AtomicBool>| s.is_some_and(|s| s.load(Ordering::Relaxed));
        let go_on = self.observer.progress.is_none_or(|f| f(progress));
        if !go_on && let Some(latch) = self.latch {
            latch.store(true, Ordering::Relaxed);
        }
        if !go_on || set(self.observer.stop) || set(self.latch) {
            return Some(Status::Interrupted);
        }
        self.observer.deadline.filter(|d| Instant::now() >= *d).map(|_| Status::TimeLimit)
    }
}

impl std::fmt::Debug for Observer<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Observer").field("stop", &self.stop).field("deadline", &self.deadline).finish_non_exhaustive()
    }
}
