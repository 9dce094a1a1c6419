//! Draws of the parameters of a fit.

use super::chains::{ChainSettings, SampleError, Trajectories};
use super::density::Frame;
use super::diagnostics::Diagnosis;
use super::importance::PARETO_K_MOST;
use super::passes::Passes;
use crate::estimate::estimator::Estimator;
use crate::estimate::outcome::Estimate;
use crate::estimate::request::Request;
use std::sync::atomic::AtomicBool;

/// Largest R-hat of chains that have converged.
pub const R_HAT_MOST: f64 = 1.01;
/// Least effective sample size, of bulk and tails, that intervals are given from: a hundred for each of four chains (Vehtari et al.,
/// 2021, section 4.4).
pub const ESS_LEAST: f64 = 400.0;
/// R-hat up to which more draws of the same kind are tried.
const R_HAT_NEAR: f64 = 1.05;
/// How many times as many they are.
pub(super) const MORE: usize = 3;
/// Largest part of draws without a solution: what is left out may lie in one place.
pub(super) const UNSOLVED: f64 = 0.01;

/// How draws are made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Way {
    /// Each by itself, as the solution of its rows (`docs/theory/sampling.md`), weighed by all rows.
    Solved,
    /// By chains over some rows that tell of all near the fit ([`crate::estimate::Around`]), weighed by all rows.
    FewerRows,
    /// By chains over all rows.
    #[default]
    AllRows,
}

/// Draws from a posterior: parameters, then nuisance unknowns, in their units.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Draws {
    /// Full names.
    pub names: Vec<String>,
    /// SI units.
    pub units: Vec<String>,
    /// How many of them are parameters.
    pub parameters: usize,
    /// Chains of draws, all of a length; every draw has a value for each name.
    pub chains: Vec<Vec<Vec<f64>>>,
    /// Logarithm of the density over the coordinates that are drawn in, but for a constant.
    pub log_density: Vec<Vec<f64>>,
    /// Trajectories that met the edge of what is physical, or lost their energy; draws for which no solution was found.
    pub divergences: usize,
    /// Evaluations of residuals with their derivatives, warm-up included, and trials that did not converge.
    pub evaluations: usize,
    /// Predictions of all rows that draws of another density were weighed with.
    pub predictions: usize,
    /// How they were made.
    pub way: Way,
    /// The trajectories of the chains, if there were any.
    pub trajectories: Trajectories,
    /// How draws of another density stand for those of the posterior; none where chains went over all rows.
    pub weighed: Option<Weighed>,
}

/// How well draws of another density stand for those of the posterior.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weighed {
    /// Shape of the tail of the weights ([`super::Weights`]): they are trusted below [`PARETO_K_MOST`].
    pub pareto_k: Option<f64>,
    /// Number of draws with equal weights that they are worth.
    pub effective: f64,
}

impl Draws {
    /// Draws of each chain.
    pub fn len(&self) -> usize {
        self.chains.first().map_or(0, Vec::len)
    }
    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// One quantity in every chain. Allocates.
    pub fn of(&self, k: usize) -> Vec<Vec<f64>> {
        self.chains.iter().map(|c| c.iter().map(|d| d[k]).collect()).collect()
    }
    /// All draws of one quantity, ascending. Allocates.
    pub fn sorted(&self, k: usize) -> Vec<f64> {
        let mut all = self.of(k).concat();
        all.sort_by(f64::total_cmp);
        all
    }
    /// Whether R-hat and effective sizes of every quantity are within [`R_HAT_MOST`] and [`ESS_LEAST`], and weights, if there are any, can be
    /// trusted.
    pub fn converged(&self) -> bool {
        self.trusted() && self.within(R_HAT_MOST, ESS_LEAST)
    }
    /// Whether the draws stand for the posterior as far as their weights say: a tail of weights below [`PARETO_K_MOST`], and nearly
    /// every draw with a solution.
    pub fn trusted(&self) -> bool {
        let unsolved = if self.way == Way::Solved { self.divergences as f64 } else { 0.0 };
        let drawn = (self.chains.len() * self.len()) as f64;
        self.weighed.and_then(|w| w.pareto_k).is_none_or(|k| k < PARETO_K_MOST) && unsolved <= UNSOLVED * drawn
    }
    /// Whether so many times as many draws would be enough.
    pub(super) fn nearly(&self, times: usize) -> bool {
        self.within(R_HAT_NEAR, ESS_LEAST / times as f64)
    }
    fn within(&self, r_hat: f64, least: f64) -> bool {
        let good = |d: Diagnosis| d.r_hat < r_hat && d.ess_bulk.min(d.ess_tail) >= least;
        !self.is_empty() && (0..self.names.len()).all(|k| good(self.diagnosis(k)))
    }
    /// With what was spent on others before.
    pub(super) fn after(mut self, before: &Self) -> Self {
        self.evaluations += before.evaluations;
        self.predictions += before.predictions;
        self
    }
    /// What the chains say of one quantity.
    pub fn diagnosis(&self, k: usize) -> Diagnosis {
        Diagnosis::of(&self.of(k))
    }
}

/// Draws from the posterior of `request` around its fit `at`. `make` gives estimators of the same data; `stop` ends it with the draws that there
/// are.
///
/// Three ways are tried in turn until draws have converged ([`Way`]): independent ones that solve for their rows, and chains over fewer
/// rows, both of which are weighed by the density over all rows; then, where these weights cannot be trusted, chains over all rows. Where a
/// way has nearly converged, three times as many draws follow; chains of short trajectories that have not are followed by twice as many long
/// ones. What was drawn last is given.
///
/// # Errors
/// [`SampleError`].
pub fn sample<E: Estimator + ?Sized>(
    request: &Request<'_>,
    at: &Estimate,
    make: impl Fn() -> Result<Box<E>, SampleError> + Sync,
    settings: &ChainSettings,
    stop: Option<&AtomicBool>,
) -> Result<Draws, SampleError> {
    let frame = Frame::new(request, at)?;
    let passes = Passes { request, at, frame, make, stop };
    let mut before = Draws::default();
    for way in [Way::Solved, Way::FewerRows, Way::AllRows] {
        if let Some(draws) = passes.over(way, settings)? {
            // What was ended before it had drawn anything is no better than what there was.
            before = if draws.is_empty() && !before.is_empty() { before.after(&draws) } else { draws.after(&before) };
            // Chains over all rows would mix as slowly as those over fewer that stand for them.
            let no_better = way == Way::FewerRows && before.trusted();
            if before.converged() || no_better || passes.stopped() {
                break;
            }
        }
    }
    Ok(before)
}
