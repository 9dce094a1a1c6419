//! Chains of the No-U-Turn sampler over a density of any kind.
//!
//! The sampler is that of nuts-rs (M. Hoffman, A. Gelman, *The No-U-Turn Sampler*, JMLR 15, 2014; multinomial choice of M.
//! Betancourt, arXiv 1701.02434). Densities here are close to standard normal, because their coordinates are whitened by a
//! fit. [`Trajectories::Short`] are for those that are as the fit says: one step, exact for a standard normal density, makes an
//! independent draw. [`Trajectories::Long`] are for the others.

use nuts_rs::{CpuLogpFunc, CpuMath, CpuMathError, DiagNutsSettings, HasDims, KineticEnergyKind, LogpError, Settings};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::cell::RefCell;
use std::collections::HashMap;
use std::error::Error;
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// The logarithm of a density, but for a constant, with its gradient.
pub trait LogDensity {
    /// Number of coordinates.
    fn dim(&self) -> usize;
    /// At `z`, with the gradient; `None` where the density is zero.
    ///
    /// # Errors
    /// What no other point could repair.
    fn log_density(&mut self, z: &[f64], gradient: &mut [f64]) -> Result<Option<f64>, Box<dyn Error + Send + Sync>>;
}

/// How far a trajectory goes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Trajectories {
    /// One step of a quarter of a turn at most, exact for a standard normal density: one evaluation for a draw.
    #[default]
    Short,
    /// Until it turns, in leapfrog steps.
    Long,
}

/// How chains are run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChainSettings {
    /// Number of chains; at least two say whether they have converged.
    pub chains: usize,
    /// Draws that tune the steps, and are thrown away.
    pub warm_up: usize,
    /// Draws that are kept, of each chain.
    pub draws: usize,
    /// How far a trajectory goes.
    pub trajectories: Trajectories,
    /// Most threads. The draws are the same for any number of them.
    pub threads: usize,
    /// Seed; every chain has random numbers of its own from it.
    pub seed: u64,
}

impl Default for ChainSettings {
    fn default() -> Self {
        Self { chains: 4, warm_up: 150, draws: 400, trajectories: Trajectories::Short, threads: 1, seed: 0 }
    }
}

/// What a chain has drawn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chain {
    /// Draws.
    pub draws: Vec<Vec<f64>>,
    /// Logarithm of the density at each of them.
    pub log_density: Vec<f64>,
    /// Draws whose trajectory met a point of zero density, or lost its energy.
    pub divergences: usize,
    /// What was looked up at each of them, if anything was.
    pub beside: Vec<f64>,
    /// Evaluations of the density, warm-up included.
    pub evaluations: usize,
    /// Size of the steps after the warm-up.
    pub step: f64,
}

/// Why there are no draws.
#[derive(Debug, thiserror::Error)]
pub enum SampleError {
    /// A direction is determined by neither data nor priors, so that there is no density to draw from.
    #[error("neither the data nor priors determine {0}: there is no posterior to draw from")]
    Improper(String),
    /// The fit has not ended inside of what is physical.
    #[error("the fit has not ended inside of what is physical ({0}), and draws are taken around it")]
    NotAtMinimum(String),
    /// The density could not be evaluated.
    #[error("the density could not be evaluated: {0}")]
    Density(Box<dyn Error + Send + Sync>),
    /// The sampler refused its settings, or found no place to begin.
    #[error("the sampler failed: {0}")]
    Sampler(String),
}

/// Longest trajectory of those that are long: `2^DEPTH - 1` evaluations.
const DEPTH: u64 = 6;
/// Parts of a standard normal draw at which a chain begins: the first that lies where the density is not absurdly small.
const BEGIN: [f64; 5] = [1.0, 0.7, 0.5, 0.25, 0.0];
/// Mean of the probabilities of acceptance along a trajectory that steps are tuned to.
const ACCEPTANCE: f64 = 0.8;

/// Longest step. Of a normal density every step is accepted, and would be tuned to pi, which turns a draw into its mirror image: means
/// are then exact, and distances from the mean never change. A quarter of a turn forgets where it began.
const STEP_MOST: f64 = core::f64::consts::FRAC_PI_2;

/// Places that were evaluated since the last draw, with their log densities.
type Seen = Rc<RefCell<Vec<(Vec<f64>, f64)>>>;

/// What is evaluated, and what has been since the last draw.
struct Evaluated<'a, D: LogDensity + ?Sized> {
    density: &'a mut D,
    seen: Seen,
}

/// Why an evaluation failed, as the sampler wants it.
#[derive(Debug, thiserror::Error)]
enum Failed {
    #[error("zero density")]
    Zero,
    #[error("{0}")]
    Broken(Box<dyn Error + Send + Sync>),
}

impl LogpError for Failed {
    fn is_recoverable(&self) -> bool {
        matches!(self, Self::Zero)
    }
}

impl<D: LogDensity + ?Sized> HasDims for Evaluated<'_, D> {
    fn dim_sizes(&self) -> HashMap<String, u64> {
        HashMap::from([("unconstrained_parameter".to_owned(), self.density.dim() as u64)])
    }
}

impl<D: LogDensity + ?Sized> CpuLogpFunc for Evaluated<'_, D> {
    type LogpError = Failed;
    type FlowParameters = ();
    type ExpandedVector = Vec<f64>;

    fn dim(&self) -> usize {
        self.density.dim()
    }
    fn logp(&mut self, z: &[f64], gradient: &mut [f64]) -> Result<f64, Failed> {
        let value = self.density.log_density(z, gradient).map_err(Failed::Broken)?;
        let value = value.filter(|v| v.is_finite() && gradient.iter().all(|g| g.is_finite()));
        let value = value.ok_or(Failed::Zero)?;
        self.seen.borrow_mut().push((z.to_vec(), value));
        Ok(value)
    }
    fn expand_vector<R: nuts_rs::rand::Rng + ?Sized>(
        &mut self,
        _: &mut R,
        z: &[f64],
    ) -> Result<Vec<f64>, CpuMathError> {
        Ok(z.to_vec())
    }
}

/// A chain, or none where it cannot be made.
type Made = Result<Option<Chain>, SampleError>;

/// All chains, each made by `one` from its number, on up to [`ChainSettings::threads`] threads; none where one of them cannot be made. All that
/// are given are of a length: of chains that were ended early, those that had hardly begun are left out.
///
/// # Errors
/// [`SampleError`], that of the first chain that failed.
pub(super) fn side_by_side(
    settings: &ChainSettings,
    one: impl Fn(usize) -> Made + Sync,
) -> Result<Option<Vec<Chain>>, SampleError> {
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<Option<Made>>> = Mutex::new((0..settings.chains).map(|_| None).collect());
    let work = || {
        loop {
            let k = next.fetch_add(1, Ordering::SeqCst);
            if k >= settings.chains {
                break;
            }
            let result = one(k);
            done.lock().unwrap_or_else(PoisonError::into_inner)[k] = Some(result);
        }
    };
    let threads = settings.threads.clamp(1, settings.chains.max(1));
    if threads == 1 {
        work();
    } else {
        std::thread::scope(|s| (0..threads).for_each(|_| drop(s.spawn(work))));
    }
    let done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    let made = done.into_iter().flatten().collect::<Result<Vec<Option<Chain>>, _>>()?;
    let Some(mut chains) = made.into_iter().collect::<Option<Vec<Chain>>>() else { return Ok(None) };
    // Interrupted, some chains may have hardly begun: those and that length are kept that hold the most draws.
    let lengths: Vec<usize> = chains.iter().map(|c| c.draws.len()).collect();
    let held = |n: usize| n * lengths.iter().filter(|l| **l >= n).count();
    let length = lengths.iter().copied().max_by_key(|&n| held(n)).unwrap_or(0);
    chains.retain(|c| c.draws.len() >= length);
    for c in &mut chains {
        c.draws.truncate(length);
        c.log_density.truncate(length);
        c.beside.truncate(length);
    }
    Ok(Some(chains))
}

/// What is looked up at a draw.
pub(super) type LookUp<'l> = &'l mut dyn FnMut(&[f64]) -> Result<f64, SampleError>;

/// The chain of this number. `beside` is looked up at each draw that is kept, as it is drawn, so that a chain that is ended early has it.
pub(super) fn run_chain<D: LogDensity + ?Sized>(
    density: &mut D,
    number: usize,
    s: &ChainSettings,
    stop: Option<&AtomicBool>,
    mut beside: Option<LookUp<'_>>,
) -> Result<Chain, SampleError> {
    let stopped = || stop.is_some_and(|s| s.load(Ordering::SeqCst));
    let mut out = Chain::default();
    let mut rng = ChaCha8Rng::seed_from_u64(s.seed);
    rng.set_stream(number as u64);
    let begin = begin(density, &mut rng, &mut out.evaluations)?;
    let (maxdepth, trajectory_kind) = match s.trajectories {
        Trajectories::Short => (1, KineticEnergyKind::ExactNormal),
        Trajectories::Long => (DEPTH, KineticEnergyKind::Euclidean),
    };
    let mut settings = DiagNutsSettings {
        num_tune: s.warm_up as u64,
        num_draws: s.draws as u64,
        maxdepth,
        trajectory_kind,
        ..DiagNutsSettings::default()
    };
    settings.adapt_options.step_size_settings.target_accept = ACCEPTANCE;
    settings.adapt_options.step_size_settings.initial_step = 0.5;
    settings.adapt_options.step_size_settings.adapt_options.dual_average.max_step_size = STEP_MOST;
    let failed = |e: &dyn std::fmt::Display| SampleError::Sampler(e.to_string());
    let seen = Rc::new(RefCell::new(Vec::new()));
    let math = CpuMath::new(Evaluated { density, seen: Rc::clone(&seen) });
    let mut chain = settings.new_chain(number as u64, math, &mut rng).map_err(|e| failed(&e))?;
    nuts_rs::Chain::set_position(&mut chain, &begin).map_err(|e| failed(&e))?;
    let mut last = (begin, f64::NAN);
    for k in 0..s.warm_up + s.draws {
        if stopped() {
            break;
        }
        let (z, progress) = nuts_rs::Chain::draw(&mut chain).map_err(|e| failed(&e))?;
        let mut seen = seen.borrow_mut();
        out.evaluations += seen.len();
        // What was drawn is a point of the trajectory, or where it began.
        if let Some(found) = seen.iter().rev().find(|(at, _)| at[..] == z[..]) {
            last.clone_from(found);
        }
        seen.clear();
        if k >= s.warm_up {
            if let Some(look) = &mut beside {
                out.beside.push(look(&z)?);
            }
            out.divergences += usize::from(progress.diverging);
            out.draws.push(z.to_vec());
            out.log_density.push(last.1);
            out.step = progress.step_size;
        }
    }
    Ok(out)
}

/// Where a chain begins: at a draw of the standard normal density, or nearer to zero where that is out of the question.
fn begin<D: LogDensity + ?Sized>(
    density: &mut D,
    rng: &mut ChaCha8Rng,
    evaluations: &mut usize,
) -> Result<Vec<f64>, SampleError> {
    let n = density.dim();
    let direction: Vec<f64> = (0..n).map(|_| StandardNormal.sample(rng)).collect();
    let mut gradient = vec![0.0; n];
    let mut at = |part: f64| {
        let z: Vec<f64> = direction.iter().map(|d| part * d).collect();
        *evaluations += 1;
        Ok((density.log_density(&z, &mut gradient).map_err(SampleError::Density)?, z))
    };
    let (top, _) = at(0.0)?;
    let top = top.ok_or_else(|| SampleError::Sampler("the density is zero at the fit".into()))?;
    for part in BEGIN {
        let (value, z) = at(part)?;
        if value.is_some_and(|v| v > top - 2.0 * n as f64 - 10.0) {
            return Ok(z);
        }
    }
    Ok(vec![0.0; n])
}
