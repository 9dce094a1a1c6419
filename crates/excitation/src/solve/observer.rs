//! Progress, time limit and interruption of a search.

use crate::solve::sqp::outcome::Status;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Where a search stands.
///
/// ```
/// # use excitation::{Duration, End, JointLimits, PlanSpec, SplinePlan, random_plan};
/// # let limits = JointLimits { lower: -1.5, upper: 1.7, velocity: 0.17, acceleration: 0.15, jerk: None };
/// # let (start, end, duration) = (vec![0.3, -0.2], End::Free, Duration::Fixed(30.0));
/// # let plan = SplinePlan::new(PlanSpec { start, end, duration, degree: 5, free: 8, limits: vec![limits; 2], refine: 1 })?;
/// # use excitation::solve::Problem;
/// # use excitation::*;
/// # /// Control points near zero: a lazy motion.
/// # struct Lazy;
/// # impl Cost for Lazy {
/// #     fn value_gradient(&self, _: &SplinePlan, x: &[f64], grad: &mut [f64]) -> f64 {
/// #         grad.iter_mut().zip(x).for_each(|(g, x)| *g = 2.0 * x);
/// #         x.iter().map(|x| x * x).sum()
/// #     }
/// # }
/// # let problem = Problem::new(&Lazy, &plan);
/// use std::sync::Mutex;
///
/// let costs = Mutex::new(Vec::new());
/// let watch = |p: &Progress| {
///     costs.lock().unwrap().push(p.cost);
///     p.iteration < 4 // enough for a look
/// };
/// let found = search(&problem, None, &SearchOptions::default(), &Observer { progress: Some(&watch), ..Observer::default() })?;
/// assert!(costs.lock().unwrap().len() >= 4 && found.best.iterations <= 5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
///
/// ```
/// # use excitation::{Duration, End, JointLimits, PlanSpec, SplinePlan, random_plan};
/// # let limits = JointLimits { lower: -1.5, upper: 1.7, velocity: 0.17, acceleration: 0.15, jerk: None };
/// # let (start, end, duration) = (vec![0.3, -0.2], End::Free, Duration::Fixed(30.0));
/// # let plan = SplinePlan::new(PlanSpec { start, end, duration, degree: 5, free: 8, limits: vec![limits; 2], refine: 1 })?;
/// # use excitation::solve::Problem;
/// # use excitation::*;
/// # /// Control points near zero: a lazy motion.
/// # struct Lazy;
/// # impl Cost for Lazy {
/// #     fn value_gradient(&self, _: &SplinePlan, x: &[f64], grad: &mut [f64]) -> f64 {
/// #         grad.iter_mut().zip(x).for_each(|(g, x)| *g = 2.0 * x);
/// #         x.iter().map(|x| x * x).sum()
/// #     }
/// # }
/// # let problem = Problem::new(&Lazy, &plan);
/// use std::sync::atomic::AtomicBool;
///
/// // A signal handler would set this; the search then ends with the best plan it has, or says that there is none.
/// let stop = AtomicBool::new(true);
/// let ended = search(&problem, None, &SearchOptions::default(), &Observer { stop: Some(&stop), ..Observer::default() });
/// assert!(ended.map_or(true, |found| found.best.iterations == 0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
