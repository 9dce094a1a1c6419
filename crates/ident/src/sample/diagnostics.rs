//! Have the chains converged, and how many independent draws are theirs worth?
//!
//! Rank-normalised split R-hat and bulk and tail effective sample sizes of A. Vehtari, A. Gelman, D. Simpson, B. Carpenter,
//! P.-C. Buerkner, *Rank-normalization, folding, and localization: an improved R-hat for assessing convergence of MCMC*, Bayesian
//! Analysis 16(2), 2021 (arXiv 1903.08008): section 4.1 (split, equations 3 and 4), 4.2 (rank normalisation, equation 14), 4.3
//! (folding, tails). Autocorrelations are summed by the initial monotone sequence of C. Geyer, *Practical Markov chain Monte
//! Carlo*, Statistical Science 7(4), 1992. Conventions of details are those of ArviZ, whose values the tests hold.

use super::intervals::quantile;
use statrs::distribution::{ContinuousCDF, Normal};

/// What the chains say of one quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Diagnosis {
    /// Rank-normalised split R-hat, the larger of that of the values and that of their distances from the median.
    pub r_hat: f64,
    /// Effective sample size of the bulk: for means and medians.
    pub ess_bulk: f64,
    /// Effective sample size of the tails: for the 5 % and 95 % quantiles.
    pub ess_tail: f64,
}

impl Diagnosis {
    /// Of one quantity in chains of equal length.
    pub fn of(chains: &[Vec<f64>]) -> Self {
        Self { r_hat: r_hat(chains), ess_bulk: ess_bulk(chains), ess_tail: ess_tail(chains) }
    }
}

/// Fewest draws of a chain of which anything can be said: halves of four.
const LEAST: usize = 8;

/// Rank-normalised split R-hat. NaN for chains of less than eight draws, or that do not move.
pub fn r_hat(chains: &[Vec<f64>]) -> f64 {
    let Some(halves) = split(chains) else { return f64::NAN };
    let mut all = halves.concat();
    all.sort_by(f64::total_cmp);
    let median = quantile(&all, 0.5);
    let folded: Vec<Vec<f64>> = halves.iter().map(|c| c.iter().map(|x| (x - median).abs()).collect()).collect();
    let (bulk, tail) = (plain_r_hat(&rank_normalised(&halves)), plain_r_hat(&rank_normalised(&folded)));
    if bulk.is_nan() || tail.is_nan() { f64::NAN } else { bulk.max(tail) }
}

/// Effective sample size of the bulk. NaN where [`r_hat`] is.
pub fn ess_bulk(chains: &[Vec<f64>]) -> f64 {
    split(chains).map_or(f64::NAN, |halves| effective(&rank_normalised(&halves)))
}

/// Effective sample size of the tails: the smaller of those of `x <= q5` and `x <= q95`. NaN where [`r_hat`] is.
pub fn ess_tail(chains: &[Vec<f64>]) -> f64 {
    let Some(halves) = split(chains) else { return f64::NAN };
    let mut all = chains.concat();
    all.sort_by(f64::total_cmp);
    let of = |p: f64| {
        let q = quantile(&all, p);
        let below: Vec<Vec<f64>> =
            halves.iter().map(|c| c.iter().map(|x| f64::from(u8::from(*x <= q))).collect()).collect();
        effective(&below)
    };
    of(0.05).min(of(0.95))
}

/// Every chain in two halves, the middle draw left out where the number is odd; none where they are too short or not finite.
fn split(chains: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
    let n = chains.iter().map(Vec::len).min()?;
    if n < LEAST || chains.iter().flatten().any(|x| !x.is_finite()) {
        return None;
    }
    Some(chains.iter().flat_map(|c| [c[..n / 2].to_vec(), c[n - n / 2..n].to_vec()]).collect())
}

/// Normal scores `Phi^-1((r - 3/8) / (S + 1/4))` of the ranks among all draws; equal values share the mean of their ranks.
fn rank_normalised(chains: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let n = chains.first().map_or(0, Vec::len);
    let all = chains.concat();
    let mut order: Vec<usize> = (0..all.len()).collect();
    order.sort_by(|&a, &b| all[a].total_cmp(&all[b]));
    let mut rank = vec![0.0; all.len()];
    let mut from = 0;
    while from < order.len() {
        let equal = order[from..].iter().take_while(|&&i| all[i] == all[order[from]]).count();
        let mean = from as f64 + 0.5 * (equal as f64 + 1.0);
        order[from..from + equal].iter().for_each(|&i| rank[i] = mean);
        from += equal;
    }
    let (normal, total) = (Normal::standard(), all.len() as f64);
    let scores: Vec<f64> = rank.iter().map(|r| normal.inverse_cdf((r - 0.375) / (total + 0.25))).collect();
    scores.chunks(n.max(1)).map(<[f64]>::to_vec).collect()
}

fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len() as f64
}

/// With the divisor `n - 1`.
fn variance(x: &[f64]) -> f64 {
    let m = mean(x);
    x.iter().map(|v| (v - m).powi(2)).sum::<f64>() / (x.len() as f64 - 1.0)
}

/// `sqrt((B/W + n - 1) / n)`.
fn plain_r_hat(chains: &[Vec<f64>]) -> f64 {
    let n = chains[0].len() as f64;
    let means: Vec<f64> = chains.iter().map(|c| mean(c)).collect();
    let within = mean(&chains.iter().map(|c| variance(c)).collect::<Vec<_>>());
    ((n * variance(&means) / within + n - 1.0) / n).sqrt()
}

/// Effective number of draws: `S / (1 + 2 sum rho_t)`, at most `S log10 S`.
fn effective(chains: &[Vec<f64>]) -> f64 {
    let (count, n) = (chains.len() as f64, chains[0].len());
    let draws = n as f64;
    let total = count * draws;
    let flat = |c: &Vec<f64>| c.iter().all(|x| *x == c[0]);
    if chains.iter().all(flat) && chains.iter().all(|c| c[0] == chains[0][0]) {
        return total;
    }
    let centred: Vec<Vec<f64>> = chains
        .iter()
        .map(|c| {
            let m = mean(c);
            c.iter().map(|x| x - m).collect()
        })
        .collect();
    // Only lags that are asked for are summed: chains of this sampler forget in a few draws.
    let covariance = |lag: usize| {
        let of = |c: &Vec<f64>| c.iter().zip(&c[lag..]).map(|(a, b)| a * b).sum::<f64>() / draws;
        centred.iter().map(of).sum::<f64>() / count
    };
    let within = covariance(0) * draws / (draws - 1.0);
    let mut plus = within * (draws - 1.0) / draws;
    if chains.len() > 1 {
        plus += variance(&chains.iter().map(|c| mean(c)).collect::<Vec<_>>());
    }
    let rho = |lag: usize| 1.0 - (within - covariance(lag)) / plus;
    let mut all = vec![0.0; n];
    let (mut even, mut odd) = (1.0, rho(1));
    (all[0], all[1]) = (even, odd);
    let mut t = 1;
    while t + 3 < n && even + odd > 0.0 {
        (even, odd) = (rho(t + 1), rho(t + 2));
        if even + odd >= 0.0 {
            (all[t + 1], all[t + 2]) = (even, odd);
        }
        t += 2;
    }
    // `t - 2`, where the first pair already ends the sum.
    let last = t.saturating_sub(2);
    if even > 0.0 {
        all[last + 1] = even;
    }
    let mut t = 1;
    while t + 2 <= last {
        if all[t + 1] + all[t + 2] > all[t - 1] + all[t] {
            all[t + 1] = 0.5 * (all[t - 1] + all[t]);
            all[t + 2] = all[t + 1];
        }
        t += 2;
    }
    let sum: f64 = all[..=last].iter().sum();
    let tau = (2.0 * sum - 1.0 + all[last + 1]).max(1.0 / total.log10());
    total / tau
}
