//! Passes over a posterior: every way of drawing from it, as often as it takes.

use super::chains::{Chain, ChainSettings, SampleError, Trajectories, run_chain, side_by_side};
use super::density::{Frame, PosteriorDensity};
use super::importance::{Weights, resampled};
use super::posterior::{Draws, MORE, UNSOLVED, Way, Weighed};
use super::rto::Basis;
use crate::estimate::around::Around;
use crate::estimate::estimator::Estimator;
use crate::estimate::outcome::Estimate;
use crate::estimate::request::Request;
use nalgebra::DVector;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::sync::atomic::{AtomicBool, Ordering};

/// Draws after which solving is given up if so many times as many have no solution as are trusted.
const LOOK: usize = 40;
/// See [`LOOK`].
const HOPELESS: f64 = 10.0;

/// What passes over the same posterior have in common.
pub(super) struct Passes<'a, 'r, M> {
    pub(super) request: &'a Request<'r>,
    pub(super) at: &'a Estimate,
    pub(super) frame: Frame,
    pub(super) make: M,
    pub(super) stop: Option<&'a AtomicBool>,
}

impl<E: Estimator + ?Sized, M: Fn() -> Result<Box<E>, SampleError> + Sync> Passes<'_, '_, M> {
    pub(super) fn stopped(&self) -> bool {
        self.stop.is_some_and(|s| s.load(Ordering::SeqCst))
    }
    /// As many passes as it takes; none where there are no such draws.
    pub(super) fn over(&self, way: Way, s: &ChainSettings) -> Result<Option<Draws>, SampleError> {
        let Some(mut found) = self.pass(way, s)? else { return Ok(None) };
        // Long ones draw the other side of the mean in turn: distances from it take twice as many draws to be known as well.
        for (trajectories, times) in [(Trajectories::Short, MORE), (Trajectories::Long, 2)] {
            let done = found.converged() || !found.trusted() || self.stopped();
            if done || s.trajectories == Trajectories::Long {
                break;
            }
            let short = trajectories == Trajectories::Short;
            if short && !found.nearly(times) || !short && way == Way::Solved {
                continue;
            }
            let more = ChainSettings { trajectories, draws: times * s.draws, ..*s };
            if let Some(next) = self.pass(way, &more)?.filter(|d| !d.is_empty()) {
                found = next.after(&found);
            }
        }
        Ok(Some(found))
    }
    fn pass(&self, way: Way, s: &ChainSettings) -> Result<Option<Draws>, SampleError> {
        let basis = if way == Way::Solved { self.basis()? } else { None };
        let one = |k: usize| match (way, &basis) {
            (Way::Solved, Some(basis)) => self.solved(basis, k, s),
            (Way::Solved, None) => Ok(None),
            (Way::FewerRows, _) => self.over_fewer(k, s),
            (Way::AllRows, _) => {
                let mut density = PosteriorDensity::new(self.request, &self.frame, (self.make)()?)?;
                run_chain(&mut density, k, s, self.stop, None).map(Some)
            }
        };
        let Some(chains) = side_by_side(s, one)? else { return Ok(None) };
        let logarithms: Vec<f64> =
            chains.iter().flat_map(|c| c.beside.iter().zip(&c.log_density)).map(|(p, q)| p - q).collect();
        let weights = Weights::new(&logarithms);
        let weighed = way != Way::AllRows;
        let mut out = Draws {
            names: self.at.parameters.iter().chain(&self.at.nuisance).map(|p| p.name.clone()).collect(),
            units: self.at.parameters.iter().chain(&self.at.nuisance).map(|p| p.unit.clone()).collect(),
            parameters: self.at.parameters.len(),
            divergences: chains.iter().map(|c| c.divergences).sum(),
            evaluations: chains.iter().map(|c| c.evaluations).sum(),
            predictions: logarithms.len(),
            way,
            trajectories: s.trajectories,
            weighed: weighed.then(|| Weighed { pareto_k: weights.pareto_k, effective: weights.effective() }),
            ..Draws::default()
        };
        let frame = basis.as_ref().map_or(&self.frame, |b| &b.frame);
        for (k, c) in chains.iter().enumerate() {
            let n = c.draws.len();
            let kept = if weighed { resampled(&weights.values[k * n..(k + 1) * n]) } else { (0..n).collect() };
            let density = if weighed { &c.beside } else { &c.log_density };
            out.chains.push(kept.iter().map(|&i| frame.physical(&c.draws[i])).collect());
            out.log_density.push(kept.iter().map(|&i| density[i]).collect());
        }
        // A chain in which nothing has a weight has no draws; all others are of a length.
        if out.chains.iter().any(|c| !c.is_empty()) {
            out.chains.retain(|c| !c.is_empty());
            out.log_density.retain(|c| !c.is_empty());
        }
        Ok(Some(out))
    }
    /// What draws that solve for their rows have in common.
    fn basis(&self) -> Result<Option<Basis>, SampleError> {
        let whole = (self.make)()?;
        let Some(near) = self.fewer(&*whole, false)? else { return Ok(None) };
        Basis::new(self.request, self.at, Box::new(near))
    }
    /// All rows near the fit by fewer of them, or by all; with `spared`, derivatives along what is not asked for are those at the fit. None
    /// where the estimator has no such look.
    fn fewer<'w>(&self, whole: &'w E, spared: bool) -> Result<Option<Around<'w>>, SampleError> {
        let (request, at) = (self.request, self.at);
        let Some(thin) = whole.coarse(&at.values).or_else(|| whole.beginning(1.0)) else { return Ok(None) };
        let stays = |i: usize| spared && request.marginal.iter().any(|m| m.0 == i);
        Around::new(request, at, thin, stays).map_err(|e| SampleError::Density(e.to_string().into()))
    }
    fn solved(&self, basis: &Basis, k: usize, s: &ChainSettings) -> Result<Option<Chain>, SampleError> {
        let whole = (self.make)()?;
        let (Some(way), Some(there)) = (self.fewer(&*whole, true)?, self.fewer(&*whole, false)?) else {
            return Ok(None);
        };
        let mut way = PosteriorDensity::new(self.request, &basis.frame, Box::new(way))?;
        let mut there = PosteriorDensity::new(self.request, &basis.frame, Box::new(there))?;
        let mut all = PosteriorDensity::new(self.request, &basis.frame, (self.make)()?)?;
        let mut rng = ChaCha8Rng::seed_from_u64(s.seed);
        rng.set_stream(k as u64);
        let (n, mut out) = (basis.frame.dim(), Chain::default());
        while out.draws.len() < s.draws && !self.stopped() {
            let y = DVector::from_fn(n, |_, _| StandardNormal.sample(&mut rng));
            let mut found = None;
            if let Some((z, half)) = basis.solve(&mut way, &y)? {
                let p = all.value(&z).map_err(SampleError::Density)?;
                // What is not physical has no weight, whatever the density that it was drawn from.
                let volume = if p.is_finite() { basis.log_volume(&mut there, &z)? } else { Some(0.0) };
                found = volume.map(|v| (z, v + half, p));
            }
            out.divergences += usize::from(found.is_none());
            let (z, q, p) = found.unwrap_or_else(|| (vec![0.0; n], 0.0, f64::NEG_INFINITY));
            out.draws.push(z);
            out.log_density.push(q);
            out.beside.push(p);
            let drawn = out.draws.len();
            if drawn >= LOOK && out.divergences as f64 > HOPELESS * UNSOLVED * drawn as f64 {
                break;
            }
        }
        out.evaluations = way.linearisations + there.linearisations;
        Ok(Some(out))
    }
    /// A chain over fewer rows, with the density over all of them beside each draw; none where there are no fewer.
    fn over_fewer(&self, k: usize, s: &ChainSettings) -> Result<Option<Chain>, SampleError> {
        let whole = (self.make)()?;
        let Some(near) = self.fewer(&*whole, true)? else { return Ok(None) };
        let mut fewer = PosteriorDensity::new(self.request, &self.frame, Box::new(near))?;
        let mut all = PosteriorDensity::new(self.request, &self.frame, (self.make)()?)?;
        let mut beside = |z: &[f64]| all.value(z).map_err(SampleError::Density);
        run_chain(&mut fewer, k, s, self.stop, Some(&mut beside)).map(Some)
    }
}
