//! How dense the knots of a fitted joint motion need be.
//!
//! Knots too far apart bend the motion, knots too close let noise through, whose part in the acceleration grows with
//! `spacing^-2.5`. Spacings from a sixth of the record down are tried, each `1 / sqrt 2` of the one before, and judged by their
//! accelerations, and by their rates where a gyro feels these: by what finer knots change beyond noise, and by the noise they let through
//! (`knot_risk`, equations in `docs/theory/joint-motion.md`). Where it is known how much noise costs nothing, because sensors are noisier,
//! the finest spacing that lets through no more is taken, or a finer one that the motion needs.
//!
//! Above the frequency where the spectrum of the positions meets the floor of its noise there is nothing to follow: a spline of
//! degree 7 needs some four knots per period there ([`KNOTS_PER_PERIOD`]), and no more. [`crate::motion::spline_fit::choose_knots`] knows no
//! such end and, told too little noise, follows what there is down to 2.5 samples.

use crate::motion::kink::{Kink, with_times};
use crate::motion::kink_search::{Search, usual_noise};
use crate::motion::knot_risk::{Candidate, JUDGED, best, biases, cost, quantum, variance_of};
use crate::motion::spline_fit::{
    FitError, JointSamples, MotionFit, SAMPLES_PER_KNOT, fit_of_degree, fit_with_kinks, is_even, noise_of,
};
use crate::motion::tied_knots::{Tied, tied};
use crate::motion::torque_corners::Corner;
use ff_records::ChannelGroup;
use ff_records::time_base::{TimeBaseError, on_grid_across};
use ff_spectral::Welch;
use ff_spectral::psd::PsdError;
use nalgebra::DMatrix;

/// Knots per period of the highest frequency that stands out of the noise. At four, a spline of degree 7 follows a sine to
/// 1.5e-4 of its amplitude in position.
pub const KNOTS_PER_PERIOD: f64 = 4.0;
/// Times as many that are candidates where sensors judge the motion: what lies below its noise may still be bent by more than theirs lets pass.
const FINER: f64 = 2.0;
/// Instants at which accelerations are compared.
const INSTANTS: usize = 4000;
/// Residual of the positions over their noise up to which a spacing is a candidate: what is bent so slowly that accelerations
/// do not show it.
const RESIDUAL: f64 = 1.5;

/// Why the knots are as dense as they are.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum KnotReason {
    /// Finer knots do not change the accelerations by more than the noise they let through.
    AccelerationsSettled,
    /// Finer knots would follow the motion better, and let through more noise than that is worth: what is left is the least.
    NoiseAgainstDetail,
    /// Finer knots change the accelerations by more than noise, but beyond this frequency (Hz) the spectrum shows nothing that
    /// they could follow: the figure given for the noise is too low.
    SpectrumAtFloor {
        /// Where the last joint meets its floor (Hz).
        band: f64,
    },
    /// The spectrum stands out of the floor up to the highest frequency that 2.5 samples per knot can follow: sample faster.
    AllOfTheBand,
}

/// A fit with the spectrum behind its knots.
#[derive(Clone, Debug)]
pub struct SpectralFit {
    /// The fit.
    pub fit: MotionFit,
    /// Per joint, the frequency (Hz) above which its positions are at the floor of their noise; 0 for one that stands still.
    pub bands: Vec<f64>,
    /// Per joint, the floor (rad^2 / Hz or m^2 / Hz).
    pub floors: Vec<f64>,
    /// Per joint, the standard deviation of the positions (rad or m): given, or estimated.
    pub noise: Vec<f64>,
    /// Per joint, the step in which its positions are read (rad or m); 0 where they are not.
    pub steps: Vec<f64>,
    /// Whether all joints move in polynomials that meet at their kinks.
    pub planned: bool,
    /// What errors of the times of kinks add that torques tell: kinks of one order less, and the deviation of the size of each.
    pub(crate) tied: Vec<(Kink, f64)>,
    /// Deviation of the positions over that of the rates (s); 0 when rates were not used.
    pub rate_weight: f64,
    /// Sampling interval (s).
    pub dt: f64,
    /// Why these knots.
    pub reason: KnotReason,
}

impl SpectralFit {
    /// Standard deviation of the accelerations of joint `j` (rad/s^2 or m/s^2) away from the ends, for knots `spacing` (s) apart.
    pub fn acceleration_noise(&self, j: usize, spacing: f64) -> f64 {
        self.noise[j] * variance_of(2, spacing, self.dt, self.rate_weight).sqrt()
    }
}

/// What acceleration and rate of every joint weigh, and what noise may cost nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct Stake {
    /// Per joint, what an error of 1 rad/s^2 (or m/s^2) is worth, such as the torque it makes over the noise of the torque sensors.
    pub weights: Vec<f64>,
    /// Per joint, what an error of 1 rad/s (or m/s) is worth, such as the rate of the base it makes over the noise of the gyro; empty for
    /// nothing.
    pub rates: Vec<f64>,
    /// Sum over joints of the squared weights times variances of acceleration and rate that may pass.
    pub free: f64,
    /// Whether kinks of the motion are looked for ([`crate::motion::Kink`]).
    pub kinks: bool,
    /// Instants of them that torques tell.
    pub corners: Vec<Corner>,
}

impl Stake {
    /// Accelerations of `joints` joints count alike, rates nothing, and no noise is free.
    pub(crate) fn alike(joints: usize) -> Self {
        Self { weights: vec![1.0; joints], rates: Vec::new(), free: 0.0, kinks: false, corners: Vec::new() }
    }
}

/// Why there is no spectral choice.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum KnotError {
    /// The fit failed.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// The spectrum failed.
    #[error(transparent)]
    Psd(#[from] PsdError),
    /// Samples at uneven times that no spectrum can be made of.
    #[error(transparent)]
    Resample(#[from] TimeBaseError),
}

/// Fits `samples` with knots judged by their accelerations. `noise` is the standard deviation of the positions per joint
/// where it is known; otherwise it is estimated, and not below that of the steps of an encoder. Every joint counts alike. Allocates.
///
/// # Errors
/// [`KnotError`]; at least 64 samples are needed.
pub fn fit_by_spectrum(samples: &JointSamples<'_>, noise: Option<&[f64]>) -> Result<SpectralFit, KnotError> {
    fit_at_stake(samples, noise, &Stake::alike(samples.dof))
}

/// [`fit_by_spectrum`] with what accelerations are worth. Where the acceleration of a joint jumps or bends ([`Kink`]) and knots may be wider with that
/// in the spline, it is. Allocates.
///
/// # Errors
/// As [`fit_by_spectrum`].
pub fn fit_at_stake(
    samples: &JointSamples<'_>,
    noise: Option<&[f64]>,
    stake: &Stake,
) -> Result<SpectralFit, KnotError> {
    let (n, m) = (samples.dof, samples.times.len());
    let estimated = noise_of(samples)?;
    if m < 64 {
        return Err(FitError::Length { what: "samples", got: m, expected: 64 }.into());
    }
    let of_rates = if stake.rates.is_empty() { n } else { stake.rates.len() };
    for (what, got) in [("noise", noise.map_or(n, <[f64]>::len)), ("weights", stake.weights.len()), ("rates", of_rates)]
    {
        if got != n {
            return Err(FitError::Length { what, got, expected: n }.into());
        }
    }
    let steps: Vec<f64> =
        (0..n).map(|j| quantum(samples.q.iter().skip(j).step_by(n).copied()).unwrap_or(0.0)).collect();
    let level = noise.map_or_else(|| above_steps(&estimated, &steps), <[f64]>::to_vec);
    let plain = chosen(samples, level, stake)?;
    let found = if stake.kinks {
        // Jumps are noise to differences, of which half are between them.
        let usual = || above_steps(&usual_noise(samples, &estimated), &steps);
        let usual = noise.map_or_else(usual, <[f64]>::to_vec);
        let search = Search { samples, noise: &usual, steps: &steps, corners: &stake.corners };
        // What fails on the way to kinks is no error: there are none then.
        let bent = |chosen: Chosen, kinks: &[Kink]| {
            let fit = fit_with_kinks(samples, chosen.spacing, kinks, false).ok()?;
            Some(Chosen { candidate: fit, ..chosen })
        };
        let planned = planned(&search, &plain, noise, stake).unwrap_or(None);
        let planned = planned.and_then(|(chosen, tied)| Some((bent(chosen, &tied.kinks)?, Some(tied.errors))));
        planned.or_else(|| {
            let (chosen, kinks) = kinked(&search, &plain, noise, stake).unwrap_or(None)?;
            Some((bent(chosen, &kinks)?, None))
        })
    } else {
        None
    };
    let (bent, tied) = found.map_or((None, None), |(chosen, tied)| (Some(chosen), tied));
    let (planned, tied) = (tied.is_some(), tied.unwrap_or_default());
    let Chosen { bands, floors, noise, rho, reason, candidate: fit, .. } = bent.unwrap_or_else(|| {
        // Where samples are too few for one more of its points, the spline that was judged stays.
        let fit = fit_with_kinks(samples, plain.spacing, &[], false);
        Chosen { candidate: fit.unwrap_or_else(|_| plain.candidate.clone()), ..plain }
    });
    let dt = samples.times[m - 1] / (m - 1) as f64;
    Ok(SpectralFit { fit, bands, floors, noise, steps, planned, tied, rate_weight: rho, dt, reason })
}

/// Noise of readings in these steps: where a joint rests its readings repeat, and differences see less than the steps.
fn above_steps(noise: &[f64], steps: &[f64]) -> Vec<f64> {
    noise.iter().zip(steps).map(|(s, step)| s.max(step / 12f64.sqrt())).collect()
}

/// Factors on the spacing of knots that follow the motion, at which kinks are looked for: they stand out of the noise there.
const WIDER: [f64; 6] = [2.0, 2.8, 4.0, 5.6, 8.0, 16.0];
/// Part of the cost of knots without kinks that those with some must stay below.
const BETTER: f64 = 0.5;
/// Cost over what noise may cost, up to which there is nothing to gain.
const ENOUGH: f64 = 2.0;

/// Squares of deviations of the torques that knots may cost without a look for plans: less than whoever reads a result can see, and the look takes as long as a fit.
const MINOR: f64 = 0.1;

/// Times as far apart as knots may be that let no noise through, knots beside plans are: what a plan misses next to a knot that is hardly told is followed.
const COARSER: f64 = 1.5;

/// Kinks where polynomials meet that all joints move in, and knots as far apart as these are; `None` where a joint moves otherwise.
fn planned(
    search: &Search<'_>,
    plain: &Chosen,
    given: Option<&[f64]>,
    stake: &Stake,
) -> Result<Option<(Chosen, Tied)>, KnotError> {
    if plain.cost < MINOR.max(ENOUGH * stake.free) {
        return Ok(None);
    }
    let Some(kinks) = search.planned(plain.spacing)? else { return Ok(None) };
    let s = search.samples;
    let times_of = |joint: usize| {
        let own: Vec<Kink> = kinks.iter().filter(|k| k.joint == joint).copied().collect();
        with_times(&own).0.len()
    };
    let most = (0..s.dof).map(times_of).max().unwrap_or(0);
    if most == 0 {
        return Ok(None);
    }
    let apart = s.times[s.times.len() - 1] / (most + 1) as f64;
    let spacing = apart.max(WIDER[0] * plain.spacing);
    let tied = tied(s, spacing, &kinks, (search.noise, &stake.weights), &stake.corners)?;
    let next = beside(search, spacing, &tied.kinks, given, stake)?;
    Ok(Some((Chosen { spacing: spacing.min(COARSER * next.spacing), ..next }, tied)))
}

/// The knots of what kinks leave of the motion, and the kinks; `None` where there are none, or where knots cost as much without them.
fn kinked(
    search: &Search<'_>,
    plain: &Chosen,
    given: Option<&[f64]>,
    stake: &Stake,
) -> Result<Option<(Chosen, Vec<Kink>)>, KnotError> {
    let mut best: Option<(Chosen, Vec<Kink>)> = None;
    let mut pieces = search.pieces(WIDER[0] * plain.spacing)?;
    for ramps in [false, true] {
        if ramps {
            // As they were, they have been looked at.
            pieces = search.ramps(&pieces).unwrap_or_default();
        }
        if pieces.is_empty() && (ramps || stake.corners.is_empty()) {
            break;
        }
        let known = search.at_corners(&pieces);
        for wider in WIDER {
            let spacing = wider * plain.spacing;
            let kinks = search.kinks(spacing, &known)?;
            let next = beside(search, spacing, &kinks, given, stake)?;
            let least = best.as_ref().map_or(plain.cost, |b| b.0.cost);
            if next.cost > plain.cost {
                break;
            }
            if best.is_none() || next.cost < least {
                best = Some((next, kinks));
            }
        }
        if best.as_ref().is_some_and(|b| b.0.cost < ENOUGH * stake.free) {
            break;
        }
    }
    Ok(best.filter(|b| b.0.cost < BETTER * plain.cost))
}

/// The knots of what is left of the motion without these kinks, of the sizes that they have beside a spline with knots `spacing` apart.
fn beside(
    search: &Search<'_>,
    spacing: f64,
    kinks: &[Kink],
    given: Option<&[f64]>,
    stake: &Stake,
) -> Result<Chosen, KnotError> {
    let smooth = search.without(spacing, kinks)?;
    let left = JointSamples { q: &smooth.q, qd: smooth.qd.as_deref(), ..*search.samples };
    let level = match given {
        Some(noise) => noise.to_vec(),
        None => above_steps(&noise_of(&left)?, search.steps),
    };
    chosen(&left, level, stake)
}

/// Knots, and what they were chosen by.
struct Chosen {
    spacing: f64,
    /// What noise and bias cost together.
    cost: f64,
    bands: Vec<f64>,
    floors: Vec<f64>,
    noise: Vec<f64>,
    rho: f64,
    reason: KnotReason,
    /// The spline that was judged.
    candidate: MotionFit,
}

/// The knots of positions with this noise.
fn chosen(samples: &JointSamples<'_>, noise: Vec<f64>, stake: &Stake) -> Result<Chosen, KnotError> {
    let (n, m) = (samples.dof, samples.times.len());
    let end = samples.times[m - 1];
    let dt = end / (m - 1) as f64;
    // What the spectrum is for is where the motion ends: of samples at uneven times it is that of their interpolation, whose
    // noise is a little lower.
    let even = evenly(samples, dt)?;
    let (bands, floors) = spectrum(&JointSamples { q: even.as_deref().unwrap_or(samples.q), ..*samples }, &noise, dt)?;
    let band = bands.iter().copied().fold(0.0, f64::max);
    let rho = if samples.qd.is_some() { samples.rate_weight } else { 0.0 };
    let weighted = |w: &[f64]| noise.iter().zip(w).map(|(s, w)| (s * w).powi(2)).sum::<f64>();
    let (of_accelerations, of_rates) = (weighted(&stake.weights), weighted(&stake.rates));
    let variance = |h: f64| of_accelerations * variance_of(2, h, dt, rho) + of_rates * variance_of(1, h, dt, rho);
    let finest = SAMPLES_PER_KNOT * dt;
    // Rates stand out of their noise further up than positions do.
    let finer = if stake.free > 0.0 { FINER } else { 1.0 };
    let limited = if rho > 0.0 { finest } else { 1.0 / (finer * KNOTS_PER_PERIOD * band.max(1.0 / end)) };
    // V goes with the fifth power, with rates with the third at least.
    let costless = if stake.free > 0.0 {
        (0..200).map(|k| finest * 1.05f64.powi(k)).find(|h| variance(*h) <= stake.free).unwrap_or(f64::INFINITY)
    } else {
        f64::INFINITY
    };
    let densest = limited.min(costless).max(finest);
    let every = m.div_ceil(INSTANTS);
    let instants: Vec<f64> = samples.times.iter().step_by(every).copied().collect();
    let mut candidates = Vec::new();
    let mut spacing = (end / 6.0).max(densest);
    loop {
        let fit = fit_of_degree(samples, spacing, JUDGED)?;
        let passes = variance(fit.spacing);
        candidates.push(Candidate::new(fit, &instants, passes, stake));
        if spacing <= densest {
            break;
        }
        spacing = (spacing / core::f64::consts::SQRT_2).max(densest);
    }
    let least = |j: usize| candidates.iter().map(|c| c.fit.residual[j]).fold(f64::INFINITY, f64::min);
    let floor: Vec<f64> = (0..n).map(|j| RESIDUAL * noise[j].max(least(j))).collect();
    // The finest always is one, as far as rounding goes.
    let follows = |c: &Candidate| c.fit.residual.iter().zip(&floor).all(|(r, f)| r <= f);
    let first = candidates.iter().position(follows).unwrap_or(candidates.len() - 1);
    // The last that does not follow tells how much the first that does may still bend. From there on, noise and bias change by powers of the
    // spacing so high that the best may lie between two candidates.
    let coarse = candidates.split_off(first.saturating_sub(1));
    let mut candidates: Vec<Candidate> = Vec::with_capacity(2 * coarse.len());
    for c in coarse {
        if let Some(last) = candidates.last() {
            let fit = fit_of_degree(samples, (last.fit.spacing * c.fit.spacing).sqrt(), JUDGED)?;
            let passes = variance(fit.spacing);
            candidates.push(Candidate::new(fit, &instants, passes, stake));
        }
        candidates.push(c);
    }
    let follow = candidates.iter().position(follows).unwrap_or(candidates.len() - 1);
    let biases = biases(&candidates, &instants);
    let chosen = best(&candidates, &biases, follow, stake.free);
    // The finest has no finer one to be judged by: that the one before it was bent says that it may be as well.
    let last = chosen + 1 == candidates.len() && chosen > follow && biases[chosen - 1] > 0.0;
    let reason = match (biases[chosen] > 0.0, last) {
        (true, _) => KnotReason::NoiseAgainstDetail,
        (false, true) if limited > finest && densest == limited => KnotReason::SpectrumAtFloor { band },
        (false, true) if densest == finest => KnotReason::AllOfTheBand,
        _ => KnotReason::AccelerationsSettled,
    };
    let cost = cost(&candidates, &biases, stake.free)[chosen];
    let candidate = candidates.swap_remove(chosen).fit;
    Ok(Chosen { spacing: candidate.spacing, cost, bands, floors, noise, rho, reason, candidate })
}

/// Longest gap that the spectrum is told across, in usual intervals. Records are cut where a gap is longer than the spacing of the knots.
const WIDEST: f64 = 16.0;

/// Positions at `0, dt, 2 dt, ...`, sample after sample; `None` where they are there already.
fn evenly(samples: &JointSamples<'_>, dt: f64) -> Result<Option<Vec<f64>>, TimeBaseError> {
    if is_even(samples.times).is_ok() {
        return Ok(None);
    }
    let q = DMatrix::from_row_slice(samples.times.len(), samples.dof, samples.q);
    let even = on_grid_across(WIDEST, ChannelGroup::Motion, samples.times, &q, dt, samples.times.len())?;
    Ok(Some(even.transpose().as_slice().to_vec()))
}

/// Per joint, where its spectrum meets the floor of `noise`, and that floor.
fn spectrum(samples: &JointSamples<'_>, noise: &[f64], dt: f64) -> Result<(Vec<f64>, Vec<f64>), PsdError> {
    let (n, m) = (samples.dof, samples.times.len());
    // Four segments with half overlap: enough averages to tell a line from the floor, enough length to see slow ones.
    let segment = (2 * m / 5).max(32);
    let mut welch = Welch::new(segment, 1.0 / dt)?;
    let (mut bands, mut floors) = (Vec::with_capacity(n), Vec::with_capacity(n));
    let mut x = vec![0.0; m];
    for j in 0..n {
        // Second differences: a ramp leaks across the whole spectrum of positions, and is gone from theirs. White noise of
        // deviation s has the density 2 s^2 dt (2 sin(pi f dt))^4 there.
        for (i, v) in x.iter_mut().enumerate().take(m - 1).skip(1) {
            *v = samples.q[(i + 1) * n + j] - 2.0 * samples.q[i * n + j] + samples.q[(i - 1) * n + j];
        }
        let p = welch.run(&x[1..m - 1])?;
        let floor = 2.0 * noise[j] * noise[j] * dt;
        let white = |f: f64| floor * (2.0 * (core::f64::consts::PI * f * dt).sin()).powi(4);
        // The window leaks a line into its neighbours, and rounding is a floor of its own.
        let rounding = 1e-30 * p.density.iter().copied().fold(0.0, f64::max);
        let low = p.confidence(0.998)?;
        // Twice the floor: a figure for the noise that is a little low must not count as motion. A single bin in some
        // hundreds is above by chance; two side by side are not.
        let above = |k: usize| low[k].0 > 2.0 * white(p.frequency[k]) + rounding;
        let top = (1..p.density.len() - 1).rev().find(|&k| above(k) && above(k + 1));
        bands.push(top.map_or(0.0, |k| p.frequency[k + 1]));
        floors.push(floor);
    }
    Ok((bands, floors))
}
