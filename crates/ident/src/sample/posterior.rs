//! Draws of the parameters of a fit.

use super::chains::{Chain, ChainSettings, SampleError, Trajectories, run_chains};
use super::density::{Frame, PosteriorDensity};
use super::diagnostics::Diagnosis;
use crate::estimate::estimator::Estimator;
use crate::estimate::outcome::Estimate;
use crate::estimate::request::Request;
use std::sync::atomic::{AtomicBool, Ordering};

/// Largest R-hat of chains that have converged.
pub const R_HAT_MOST: f64 = 1.01;
/// Least effective sample size, of bulk and tails, that intervals are given from: a hundred for each of four chains (Vehtari et al.,
/// 2021, section 4.4).
pub const ESS_LEAST: f64 = 400.0;

/// Draws from a posterior: parameters, then nuisance unknowns, in their units.
#[derive(Clone, Debug, PartialEq)]
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
    /// Trajectories that met the edge of what is physical, or lost their energy.
    pub divergences: usize,
    /// Evaluations of residuals with their derivatives, warm-up included, and trials that did not converge.
    pub evaluations: usize,
    /// The trajectories that led there.
    pub trajectories: Trajectories,
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
    /// Whether R-hat and effective sizes of every quantity are within [`R_HAT_MOST`] and [`ESS_LEAST`].
    pub fn converged(&self) -> bool {
        let good = |d: Diagnosis| d.r_hat < R_HAT_MOST && d.ess_bulk.min(d.ess_tail) >= ESS_LEAST;
        !self.is_empty() && (0..self.names.len()).all(|k| good(self.diagnosis(k)))
    }
    /// What the chains say of one quantity.
    pub fn diagnosis(&self, k: usize) -> Diagnosis {
        Diagnosis::of(&self.of(k))
    }
}

/// Draws from the posterior of `request` around its fit `at`. `make` gives an estimator of the same data for every chain; `stop` ends the
/// chains with what they have. Where short trajectories are asked for and do not converge, twice as many long ones
/// follow, and theirs are the draws.
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
    let all = || at.parameters.iter().chain(&at.nuisance);
    let run = |settings: &ChainSettings| -> Result<Draws, SampleError> {
        let chains = run_chains(|| PosteriorDensity::new(request, &frame, make()?), settings, stop)?;
        let physical = |c: &Chain| c.draws.iter().map(|z| frame.physical(z)).collect();
        Ok(Draws {
            names: all().map(|p| p.name.clone()).collect(),
            units: all().map(|p| p.unit.clone()).collect(),
            parameters: at.parameters.len(),
            chains: chains.iter().map(physical).collect(),
            log_density: chains.iter().map(|c| c.log_density.clone()).collect(),
            divergences: chains.iter().map(|c| c.divergences).sum(),
            evaluations: chains.iter().map(|c| c.evaluations).sum(),
            trajectories: settings.trajectories,
        })
    };
    let first = run(settings)?;
    let stopped = || stop.is_some_and(|s| s.load(Ordering::SeqCst));
    if settings.trajectories == Trajectories::Long || stopped() || first.converged() {
        return Ok(first);
    }
    // Long ones draw the other side of the mean in turn: distances from it take twice as many draws to be known as well.
    let more = 2 * settings.draws;
    let mut second = run(&ChainSettings { trajectories: Trajectories::Long, draws: more, ..*settings })?;
    if second.is_empty() {
        return Ok(first);
    }
    second.evaluations += first.evaluations;
    Ok(second)
}
