//! `cargo xtask study posterior`: are draws from the posterior draws from the posterior?
//!
//! Part `calibration` (S. Talts, M. Betancourt, D. Simpson, A. Vehtari, A. Gelman, *Validating Bayesian inference algorithms with
//! simulation-based calibration*, arXiv 1804.06788): 100 sloshing robots whose parameters are drawn from the prior, a noisy record of
//! each, the fit from the mean of the prior, draws around the fit. The rank of the truth among independent draws is uniform for every
//! parameter if all of it is right: prior, likelihood, coordinates with their determinant, sampler. So is the rank of its distance from
//! the mean of the draws in the measure of their covariance, for all parameters at once; and the interval of highest density holds the truth in 95 of
//! 100. The same figures for the Gaussian of the fit stand beside them.
//!
//! Part `cost`: 31 or so unknowns of panels and fuel over a minute, four chains on two threads: R-hat, effective sizes, seconds.

use super::case::{COMBINED, Case, SLOSH};
use super::settings;
use crate::study::figures::{Op, Study};
use crate::study::options::Options;
use crate::study::trials::{Number, Trial, Trials};
use anyhow::Context;
use ff_dynamics::measure;
use ff_model::Params;
use ff_records::Record;
use ff_spectral::chi_square::chi_square_quantile;
use ident::belief::Sigma;
use ident::estimate::{Estimate, attempt};
use ident::sample::{ChainSettings, Draws, Trajectories, hdi, sample};
use ident::{OutputError, Priors, Request, Transform};
use nalgebra::{DMatrix, DVector};
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Record of the calibration (s) and its sampling.
const RECORD_S: f64 = 12.0;
const SAMPLE_S: f64 = 0.04;
/// Relative standard deviation of the prior.
const PRIOR: f64 = 0.15;
/// Trials, and draws that a rank is among.
const TRIALS: u64 = 100;
const AMONG: usize = 99;
/// Bins of the histograms of ranks.
const BINS: usize = 10;
/// Chains of a trial.
const CHAINS: ChainSettings =
    ChainSettings { chains: 2, warm_up: 150, draws: 400, trajectories: Trajectories::Short, threads: 1, seed: 0 };

/// What came of one truth.
#[derive(Serialize, Deserialize)]
struct Outcome {
    /// Why there are no draws.
    refused: Option<String>,
    /// Rank of the truth among [`AMONG`] draws, of every parameter.
    ranks: Vec<usize>,
    /// Rank of the distance of the truth from the mean.
    distance: usize,
    /// Parameters whose truth is in the interval of highest density that holds 95 %, and in that of the fit.
    inside: usize,
    inside_fit: usize,
    /// Normalised squared error of the fit: parameters together, in its covariance; and of the draws.
    nees_fit: Number,
    nees: Number,
    r_hat: Number,
    ess: Number,
    divergences: usize,
    evaluations: usize,
}

/// Runs the study.
///
/// # Errors
/// Files that cannot be read, and densities that cannot be evaluated.
pub fn run(options: &Options) -> anyhow::Result<Study> {
    let mut study = Study::new("posterior", options.seed);
    let trials = Trials::open("posterior", 1, options)?;
    if options.wants("calibration") {
        calibration(options, &trials, &mut study)?;
    }
    if options.wants("cost") {
        study.part(&trials, "cost", |s| cost(options, s))?;
    }
    trials.note().into_iter().for_each(|n| study.note(n));
    Ok(study)
}

fn calibration(options: &Options, trials: &Trials, study: &mut Study) -> anyhow::Result<()> {
    let case = Case::new(SLOSH, RECORD_S, false, options.seed)?;
    let count = if options.quick { 4 } else { TRIALS };
    let all = trials.run("calibration", 0..count, |t| one(&case, t))?;
    let drawn: Vec<&Outcome> = all.iter().filter(|o| o.refused.is_none()).collect();
    let n = case.selected.len();
    let (quick, total) = (options.quick, drawn.len() as f64);
    study.figure("calibration.parameters", "", n as f64);
    study.judged(quick, "calibration.drawn", "", total, (Op::AtLeast, 0.97 * count as f64));
    // Chi-squared of every histogram; of the worst of n, one in a thousand is allowed to be worse by chance.
    let limit = chi_square_quantile(1.0 - 1e-3 / n as f64, (BINS - 1) as f64);
    let mut pooled = [0.0; BINS];
    let (mut worst, mut of) = (0.0, "");
    for k in 0..n {
        let ranks: Vec<usize> = drawn.iter().map(|o| o.ranks[k]).collect();
        let counts = histogram(&ranks);
        pooled.iter_mut().zip(counts).for_each(|(p, c)| *p += c);
        let x = misfit(&counts);
        if x > worst {
            (worst, of) = (x, &case.decls[case.selected[k]].name);
        }
    }
    study.judged(quick, "calibration.rank_chi2_worst", "", worst, (Op::AtMost, limit));
    study.note(format!("the least uniform ranks are those of {of}"));
    let parts: Vec<String> = pooled.iter().map(|c| format!("{:.3}", c * BINS as f64 / (n as f64 * total))).collect();
    study.note(format!("ranks of all parameters, over what is expected, from low to high: {}", parts.join(" ")));
    let distances: Vec<usize> = drawn.iter().map(|o| o.distance).collect();
    let limit = chi_square_quantile(1.0 - 1e-3, (BINS - 1) as f64);
    study.judged(quick, "calibration.distance_chi2", "", misfit(&histogram(&distances)), (Op::AtMost, limit));
    let share =
        |of: fn(&Outcome) -> usize| 100.0 * drawn.iter().map(|o| of(o) as f64).sum::<f64>() / (total * n as f64);
    let inside = share(|o| o.inside);
    study.judged(quick, "calibration.hdi95", "%", inside, (Op::AtLeast, 93.0));
    if !quick {
        study.limited("calibration.hdi95_at_most", "%", inside, Op::AtMost, 97.0);
    }
    study.figure("calibration.fit95", "%", share(|o| o.inside_fit));
    let median = |of: fn(&Outcome) -> f64| {
        let mut x: Vec<f64> = drawn.iter().map(|o| of(o)).collect();
        x.sort_by(f64::total_cmp);
        (x.get(x.len() / 2).copied().unwrap_or(f64::NAN), x.last().copied().unwrap_or(f64::NAN))
    };
    let (nees, nees_most) = median(|o| o.nees.0);
    study.figure("calibration.nees_median", "", nees);
    study.figure("calibration.nees_most", "", nees_most);
    let (fit, fit_most) = median(|o| o.nees_fit.0);
    study.figure("calibration.nees_of_fit_median", "", fit);
    study.figure("calibration.nees_of_fit_most", "", fit_most);
    study.figure("calibration.r_hat_most", "", median(|o| o.r_hat.0).1);
    study.figure("calibration.ess_median", "", median(|o| o.ess.0).0);
    study.figure("calibration.evaluations_median", "", median(|o| o.evaluations as f64).0);
    study.figure("calibration.divergences", "", drawn.iter().map(|o| o.divergences as f64).sum());
    for (k, o) in all.iter().enumerate() {
        o.refused.iter().for_each(|why| study.note(format!("trial {k}: {why}")));
    }
    Ok(())
}

fn histogram(ranks: &[usize]) -> [f64; BINS] {
    let mut out = [0.0; BINS];
    ranks.iter().for_each(|r| out[r * BINS / (AMONG + 1)] += 1.0);
    out
}

/// Chi-squared of counts against equal ones.
fn misfit(counts: &[f64; BINS]) -> f64 {
    let expected = counts.iter().sum::<f64>() / BINS as f64;
    counts.iter().map(|c| (c - expected).powi(2) / expected).sum()
}

fn one(case: &Case, trial: Trial) -> anyhow::Result<Outcome> {
    let (nominal, mut rng) = (case.truth.values(), trial.rng());
    let priors = Priors::new(&case.decls, &case.selected, nominal, &[("*", Sigma::Relative(PRIOR))])?;
    // From the prior, where it is physical.
    let map = Transform::new(&case.decls, &case.selected, nominal)?;
    let mut truth = nominal.to_vec();
    for row in priors.rows() {
        truth[case.selected[row.column]] =
            row.mean + row.sigma * Distribution::<f64>::sample(&StandardNormal, &mut rng);
    }
    while map.inconsistent(&truth).is_some() {
        for row in priors.rows() {
            truth[case.selected[row.column]] =
                row.mean + row.sigma * Distribution::<f64>::sample(&StandardNormal, &mut rng);
        }
    }
    let trace = case.simulate_of(&Params::from_values(&case.model, truth.clone()), SAMPLE_S)?;
    // Joint motion exact: what is tested are the draws, not the splines.
    let r = measure(&trace, &case.sensors, trial.own_seed());
    let record = case.record(r.dt).q(trace.q).qd(trace.qd).qdd(trace.qdd).tau(r.tau).gyro(r.gyro).build()?.0;
    let request = Request { priors, settings: settings(), ..Request::new(&case.decls, &case.selected, nominal) };
    let (at, draws) = drawn(case, &record, &request, &ChainSettings { seed: trial.own_seed(), ..CHAINS })?;
    let truth: Vec<f64> = case.selected.iter().map(|&i| truth[i]).collect();
    Ok(match draws {
        Err(why) => Outcome {
            refused: Some(why),
            ranks: Vec::new(),
            distance: 0,
            inside: 0,
            inside_fit: 0,
            nees_fit: Number(f64::NAN),
            nees: Number(f64::NAN),
            r_hat: Number(f64::NAN),
            ess: Number(f64::NAN),
            divergences: 0,
            evaluations: 0,
        },
        Ok(d) => judged(&truth, &at, &d)?,
    })
}

/// A fit, and draws around it, or why there are none.
fn drawn(
    case: &Case,
    record: &Record,
    request: &Request<'_>,
    chains: &ChainSettings,
) -> anyhow::Result<(Estimate, Result<Draws, String>)> {
    let o = ident::Options { substeps: 1, gyro_bias: true, torque_bias: true, ..ident::Options::new(case.noise) };
    let at = attempt(request, &mut OutputError::new(&case.model, record, &o)?)?;
    let make = || {
        let made = OutputError::new(&case.model, record, &o);
        made.map(Box::new).map_err(|e| ident::sample::SampleError::Sampler(e.to_string()))
    };
    let draws = sample(request, &at, make, chains, None).map_err(|e| e.to_string());
    Ok((at, draws))
}

fn judged(truth: &[f64], at: &Estimate, d: &Draws) -> anyhow::Result<Outcome> {
    let n = truth.len();
    let all: Vec<&Vec<f64>> = d.chains.iter().flatten().collect();
    // Draws far enough apart to be independent.
    let thin: Vec<&Vec<f64>> = (0..AMONG).map(|k| all[k * all.len() / AMONG]).collect();
    let ranks = (0..n).map(|k| thin.iter().filter(|x| x[k] < truth[k]).count()).collect();
    let count = all.len() as f64;
    let mean = DVector::from_fn(n, |k, _| all.iter().map(|x| x[k]).sum::<f64>() / count);
    let off = |x: &[f64]| DVector::from_fn(n, |k, _| x[k] - mean[k]);
    let mut covariance = DMatrix::zeros(n, n);
    for x in &all {
        let o = off(x);
        covariance.ger(1.0 / (count - 1.0), &o, &o, 1.0);
    }
    let size: Vec<f64> = (0..n).map(|k| covariance[(k, k)].sqrt()).collect();
    let scaled = DMatrix::from_fn(n, n, |i, j| covariance[(i, j)] / (size[i] * size[j]));
    let factor = scaled.cholesky().context("draws that do not span their space")?;
    let distance = |x: &[f64]| {
        let o = DVector::from_fn(n, |k, _| (x[k] - mean[k]) / size[k]);
        o.dot(&factor.solve(&o))
    };
    let nees = distance(truth);
    let farther = thin.iter().filter(|x| distance(x) < nees).count();
    let told: Vec<_> = (0..n).map(|k| d.diagnosis(k)).collect();
    let inside = |k: usize| {
        let (a, b) = hdi(&d.sorted(k), 0.95);
        (a..=b).contains(&truth[k])
    };
    let inside_fit =
        |k: usize| at.parameters[k].std.is_some_and(|s| (at.parameters[k].value - truth[k]).abs() < 1.96 * s);
    let c = at.uncertainty.covariance.view((0, 0), (n, n));
    let std: Vec<f64> = (0..n).map(|k| c[(k, k)].sqrt()).collect();
    let scaled = DMatrix::from_fn(n, n, |i, j| c[(i, j)] / (std[i] * std[j]));
    let o = DVector::from_fn(n, |k, _| (at.parameters[k].value - truth[k]) / std[k]);
    let nees_fit = scaled.cholesky().map_or(f64::NAN, |f| o.dot(&f.solve(&o)));
    Ok(Outcome {
        refused: None,
        ranks,
        distance: farther,
        inside: (0..n).filter(|&k| inside(k)).count(),
        inside_fit: (0..n).filter(|&k| inside_fit(k)).count(),
        nees_fit: Number(nees_fit),
        nees: Number(nees),
        r_hat: Number(told.iter().map(|t| t.r_hat).fold(0.0, f64::max)),
        ess: Number(told.iter().map(|t| t.ess_bulk.min(t.ess_tail)).fold(f64::INFINITY, f64::min)),
        divergences: d.divergences,
        evaluations: d.evaluations,
    })
}

/// Panels and fuel over a minute.
fn cost(options: &Options, study: &mut Study) -> anyhow::Result<()> {
    let seconds = if options.quick { 20.0 } else { 60.0 };
    let case = Case::new(COMBINED, seconds, true, options.seed)?;
    let trace = case.simulate(0.01)?;
    let r = measure(&trace, &case.sensors, options.seed);
    let record = case.record(r.dt).q(trace.q).qd(trace.qd).qdd(trace.qdd).tau(r.tau).gyro(r.gyro).build()?.0;
    let nominal = case.truth.values();
    let priors = Priors::new(&case.decls, &case.selected, nominal, &[("*", Sigma::Relative(0.3))])?;
    let request = Request { priors, settings: settings(), ..Request::new(&case.decls, &case.selected, nominal) };
    let chains = ChainSettings { threads: 2, seed: options.seed, ..ChainSettings::default() };
    let clock = Instant::now();
    let (_, draws) = drawn(&case, &record, &request, &chains)?;
    let d = draws.map_err(anyhow::Error::msg)?;
    let seconds = clock.elapsed().as_secs_f64();
    let told: Vec<_> = (0..d.names.len()).map(|k| d.diagnosis(k)).collect();
    study.figure("cost.unknowns", "", d.names.len() as f64);
    study.judged(options.quick, "cost.seconds", "s", seconds, (Op::AtMost, 180.0));
    study.figure("cost.evaluations", "", d.evaluations as f64);
    study.figure("cost.per_evaluation", "ms", 2e3 * seconds / d.evaluations as f64);
    study.figure("cost.divergences", "", d.divergences as f64);
    let r_hat = told.iter().map(|t| t.r_hat).fold(0.0, f64::max);
    study.judged(options.quick, "cost.r_hat", "", r_hat, (Op::AtMost, ident::sample::R_HAT_MOST));
    for (name, of) in [
        ("cost.ess_bulk", told.iter().map(|t| t.ess_bulk).fold(f64::INFINITY, f64::min)),
        ("cost.ess_tail", told.iter().map(|t| t.ess_tail).fold(f64::INFINITY, f64::min)),
    ] {
        study.judged(options.quick, name, "", of, (Op::AtLeast, ident::sample::ESS_LEAST));
    }
    Ok(())
}
