//! Draws of the parameters of a fit.

use super::chains::{Chain, ChainSettings, SampleError, Trajectories, run_chain, side_by_side};
use super::density::{Frame, PosteriorDensity};
use super::diagnostics::Diagnosis;
use super::importance::{PARETO_K_MOST, Weights, resampled};
use crate::estimate::around::Around;
use crate::estimate::estimator::Estimator;
use crate::estimate::outcome::Estimate;
use crate::estimate::request::Request;
use ff_least_squares::EvalError;
use std::sync::atomic::{AtomicBool, Ordering};

/// Largest R-hat of chains that have converged.
pub const R_HAT_MOST: f64 = 1.01;
/// Least effective sample size, of bulk and tails, that intervals are given from: a hundred for each of four chains (Vehtari et al.,
/// 2021, section 4.4).
pub const ESS_LEAST: f64 = 400.0;
/// R-hat up to which more draws of the same kind are tried.
const R_HAT_NEAR: f64 = 1.05;
/// How many times as many they are.
const MORE: usize = 3;

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
    /// Trajectories that met the edge of what is physical, or lost their energy.
    pub divergences: usize,
    /// Evaluations of residuals with their derivatives, warm-up included, and trials that did not converge.
    pub evaluations: usize,
    /// Predictions of all rows that draws over fewer of them were weighed with.
    pub predictions: usize,
    /// The trajectories that led there.
    pub trajectories: Trajectories,
    /// How draws over fewer rows stand for those over all; none where chains went over all rows.
    pub weighed: Option<Weighed>,
}

/// How well draws over fewer rows stand for those over all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weighed {
    /// Shape of the tail of the weights ([`Weights`]): they are trusted below [`PARETO_K_MOST`].
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
    /// Whether the draws stand for the posterior as far as their weights say.
    pub fn trusted(&self) -> bool {
        self.weighed.and_then(|w| w.pareto_k).is_none_or(|k| k < PARETO_K_MOST)
    }
    /// Whether so many times as many draws would be enough.
    fn nearly(&self, times: usize) -> bool {
        self.within(R_HAT_NEAR, ESS_LEAST / times as f64)
    }
    fn within(&self, r_hat: f64, least: f64) -> bool {
        let good = |d: Diagnosis| d.r_hat < r_hat && d.ess_bulk.min(d.ess_tail) >= least;
        !self.is_empty() && (0..self.names.len()).all(|k| good(self.diagnosis(k)))
    }
    /// With what was spent on others before.
    fn after(mut self, before: &Self) -> Self {
        self.evaluations += before.evaluations;
        self.predictions += before.predictions;
        self
    }
    /// What the chains say of one quantity.
    pub fn diagnosis(&self, k: usize) -> Diagnosis {
        Diagnosis::of(&self.of(k))
    }
}

/// Draws from the posterior of `request` around its fit `at`. `make` gives estimators of the same data; `stop` ends the chains with what they
/// have.
///
/// Where fewer rows tell of all of them near the fit ([`Around`]), chains go over these, and every draw stands for as many as its density
/// over all rows says ([`Weights`]): a draw costs a linearisation of the fewer rows and a prediction of all. Where there are no fewer rows, or the
/// weights cannot be trusted, chains go over all rows. Short trajectories that have nearly converged are followed by more of them, and those that
/// still have not by twice as many long ones; the last are the draws.
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
    let mut fewer = passes.over(Rows::Fewer, settings)?;
    if let Some(draws) = fewer.take_if(|d| d.trusted() || passes.stopped()) {
        return Ok(draws);
    }
    let all = passes.over(Rows::All, settings)?.unwrap_or_default();
    Ok(all.after(&fewer.unwrap_or_default()))
}

/// Which rows chains go over.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Rows {
    /// Some that tell of all near the fit.
    Fewer,
    All,
}

/// What passes of chains over the same posterior have in common.
struct Passes<'a, 'r, M> {
    request: &'a Request<'r>,
    at: &'a Estimate,
    frame: Frame,
    make: M,
    stop: Option<&'a AtomicBool>,
}

impl<E: Estimator + ?Sized, M: Fn() -> Result<Box<E>, SampleError> + Sync> Passes<'_, '_, M> {
    fn stopped(&self) -> bool {
        self.stop.is_some_and(|s| s.load(Ordering::SeqCst))
    }
    /// As many passes as it takes; none where there are no such rows.
    fn over(&self, rows: Rows, s: &ChainSettings) -> Result<Option<Draws>, SampleError> {
        let Some(mut found) = self.pass(rows, s)? else { return Ok(None) };
        // Long ones draw the other side of the mean in turn: distances from it take twice as many draws to be known as well.
        for (trajectories, times) in [(Trajectories::Short, MORE), (Trajectories::Long, 2)] {
            let done = found.converged() || !found.trusted() || self.stopped();
            if done || s.trajectories == Trajectories::Long {
                break;
            }
            if trajectories == Trajectories::Short && !found.nearly(times) {
                continue;
            }
            let more = ChainSettings { trajectories, draws: times * s.draws, ..*s };
            let next = self.pass(rows, &more)?.filter(|d| !d.is_empty());
            found = next.map_or(found.clone(), |next| next.after(&found));
        }
        Ok(Some(found))
    }
    fn pass(&self, rows: Rows, s: &ChainSettings) -> Result<Option<Draws>, SampleError> {
        let one = |k: usize| match rows {
            Rows::All => {
                let mut density = PosteriorDensity::new(self.request, &self.frame, (self.make)()?)?;
                run_chain(&mut density, k, s, self.stop, None).map(Some)
            }
            Rows::Fewer => self.over_fewer(k, s),
        };
        let Some(chains) = side_by_side(s, one)? else { return Ok(None) };
        let logarithms: Vec<f64> =
            chains.iter().flat_map(|c| c.beside.iter().zip(&c.log_density)).map(|(all, fewer)| all - fewer).collect();
        let weights = Weights::new(&logarithms);
        let mut out = Draws {
            names: self.at.parameters.iter().chain(&self.at.nuisance).map(|p| p.name.clone()).collect(),
            units: self.at.parameters.iter().chain(&self.at.nuisance).map(|p| p.unit.clone()).collect(),
            parameters: self.at.parameters.len(),
            divergences: chains.iter().map(|c| c.divergences).sum(),
            evaluations: chains.iter().map(|c| c.evaluations).sum(),
            predictions: logarithms.len(),
            trajectories: s.trajectories,
            weighed: (rows == Rows::Fewer)
                .then(|| Weighed { pareto_k: weights.pareto_k, effective: weights.effective() }),
            ..Draws::default()
        };
        for (k, c) in chains.iter().enumerate() {
            let n = c.draws.len();
            let kept =
                if rows == Rows::All { (0..n).collect() } else { resampled(&weights.values[k * n..(k + 1) * n]) };
            let density = if rows == Rows::All { &c.log_density } else { &c.beside };
            out.chains.push(kept.iter().map(|&i| self.frame.physical(&c.draws[i])).collect());
            out.log_density.push(kept.iter().map(|&i| density[i]).collect());
        }
        Ok(Some(out))
    }
    /// A chain over fewer rows, with the density over all of them beside each draw; none where there are no fewer.
    fn over_fewer(&self, k: usize, s: &ChainSettings) -> Result<Option<Chain>, SampleError> {
        let (request, at) = (self.request, self.at);
        let whole = (self.make)()?;
        // All rows are fewer where some columns are spared.
        let spared = !request.marginal.is_empty();
        let thin = whole.coarse(&at.values).or_else(|| spared.then(|| whole.beginning(1.0)).flatten());
        let Some(thin) = thin else { return Ok(None) };
        let stays = |i: usize| request.marginal.iter().any(|m| m.0 == i);
        let failed = |e: EvalError| SampleError::Density(e.to_string().into());
        let Some(near) = Around::new(request, at, thin, stays).map_err(failed)? else { return Ok(None) };
        let mut fewer = PosteriorDensity::new(request, &self.frame, Box::new(near))?;
        let mut all = PosteriorDensity::new(request, &self.frame, (self.make)()?)?;
        let mut beside = |z: &[f64]| all.value(z).map_err(SampleError::Density);
        run_chain(&mut fewer, k, s, self.stop, Some(&mut beside)).map(Some)
    }
}
