//! Which model? Rigid, flexible, sloshing, or both, fitted to the same data and judged by what they predict.
//!
//! Every candidate is fitted to the training record and then predicts a held-out one. With whitened residuals r (N of them),
//! k estimated combinations (the rank, nuisance unknowns included) and the noise believed:
//!
//! ```text
//! -2 ln L = sum r^2 + const          AIC = sum r^2 + 2 k          BIC = sum r^2 + k ln N
//! ```
//!
//! (H. Akaike 1974; G. Schwarz 1978). The held-out record was not fitted, so its `-2 ln L` needs no correction: it is the
//! cross-validated likelihood. Its mean square of about one says that the model explains the record to the noise; how far it is
//! above says how much is left.
//!
//! Two candidates are told apart when their held-out `-2 ln L` differ by more than twice the standard deviation of that
//! difference, estimated over blocks of the record (neighbouring residuals of a wrong model are alike, so single ones cannot be
//! counted). Of those not told apart from the best the one with fewest unknowns is recommended.

use serde::Serialize;

/// Blocks of the held-out record over which differences are averaged.
const BLOCKS: usize = 20;

/// One fitted model.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Its name, such as `rigid`.
    pub name: String,
    /// Combinations of unknowns that were estimated.
    pub estimated: usize,
    /// Whitened residuals of the training record.
    pub training: Vec<f64>,
    /// Whitened residuals of the held-out record, in the same order for all candidates.
    pub held_out: Vec<f64>,
}

/// A candidate, judged.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Judged {
    /// Its name.
    pub name: String,
    /// Combinations of unknowns that were estimated.
    pub estimated: usize,
    /// Akaike's criterion, less that of the best.
    pub aic: f64,
    /// Schwarz's criterion, less that of the best.
    pub bic: f64,
    /// `-2 ln L` of the held-out record, less that of the best.
    pub held_out: f64,
    /// One standard deviation of that difference.
    pub held_out_std: f64,
    /// Mean square of the held-out residuals; one when the model explains them.
    pub held_out_mean_square: f64,
}

/// All candidates, best prediction first.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// The candidates.
    pub candidates: Vec<Judged>,
    /// The one to use.
    pub recommended: String,
    /// Why, in a sentence.
    pub reason: String,
    /// Whether the recommended one explains the held-out record to its noise (mean square at most 1.1).
    pub explains: bool,
}

/// Why models cannot be compared.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CompareError {
    /// Nothing to compare.
    #[error("no candidate; give at least one")]
    None,
    /// Residuals of other records.
    #[error(
        "'{name}' has {got} residuals of the {record} record, '{first}' has {want}; use the same record and channels"
    )]
    Length {
        /// A candidate.
        name: String,
        /// The first one.
        first: String,
        /// `training` or `held-out`.
        record: &'static str,
        /// Its residuals.
        got: usize,
        /// Those of the first.
        want: usize,
    },
    /// Too few residuals to judge by.
    #[error("{0} held-out residuals, at least 200 needed; hold out more")]
    TooShort(usize),
    /// A residual is not finite.
    #[error("a residual of '{0}' is not finite; its fit has failed")]
    NotFinite(String),
}

/// Compares candidates fitted to one record by another one. Allocates.
///
/// # Errors
/// [`CompareError`].
pub fn compare(candidates: &[Candidate]) -> Result<Comparison, CompareError> {
    let first = candidates.first().ok_or(CompareError::None)?;
    for c in candidates {
        for (record, got, want) in
            [("training", c.training.len(), first.training.len()), ("held-out", c.held_out.len(), first.held_out.len())]
        {
            if got != want {
                let (name, first) = (c.name.clone(), first.name.clone());
                return Err(CompareError::Length { name, first, record, got, want });
            }
        }
        if c.training.iter().chain(&c.held_out).any(|r| !r.is_finite()) {
            return Err(CompareError::NotFinite(c.name.clone()));
        }
    }
    let n = first.held_out.len();
    if n < 10 * BLOCKS {
        return Err(CompareError::TooShort(n));
    }
    let squares = |r: &[f64]| r.iter().map(|x| x * x).sum::<f64>();
    let samples = (first.training.len() as f64).ln();
    let mut judged: Vec<(Judged, &Candidate)> = candidates
        .iter()
        .map(|c| {
            let (own, k, other) = (squares(&c.training), c.estimated as f64, squares(&c.held_out));
            let j = Judged {
                name: c.name.clone(),
                estimated: c.estimated,
                aic: own + 2.0 * k,
                bic: own + samples * k,
                held_out: other,
                held_out_std: 0.0,
                held_out_mean_square: other / n as f64,
            };
            (j, c)
        })
        .collect();
    judged.sort_by(|a, b| a.0.held_out.total_cmp(&b.0.held_out));
    let least = |f: fn(&Judged) -> f64| judged.iter().map(|j| f(&j.0)).fold(f64::INFINITY, f64::min);
    let (aic, bic, held_out) = (least(|j| j.aic), least(|j| j.bic), least(|j| j.held_out));
    let best = judged[0].1;
    for (j, c) in &mut judged {
        (j.aic, j.bic, j.held_out) = (j.aic - aic, j.bic - bic, j.held_out - held_out);
        j.held_out_std = spread(&c.held_out, &best.held_out);
    }
    let close = |j: &Judged| j.held_out <= 2.0 * j.held_out_std;
    let candidates: Vec<Judged> = judged.into_iter().map(|j| j.0).collect();
    let alike: Vec<&Judged> = candidates.iter().filter(|j| close(j)).collect();
    let winner = alike.iter().copied().min_by_key(|j| j.estimated).unwrap_or(&candidates[0]);
    let rivals: Vec<&str> = alike.iter().filter(|j| j.name != winner.name).map(|j| j.name.as_str()).collect();
    let beaten = candidates.iter().find(|j| !close(j));
    let mut reason = format!("'{}' predicts the held-out record", winner.name);
    if rivals.is_empty() {
        reason += " best";
    } else {
        reason += &format!(" as well as {} and has the fewest unknowns of them", rivals.join(", "));
    }
    if let Some(b) = beaten {
        let distance = b.held_out - winner.held_out;
        reason += &format!("; the next, '{}', is worse by {distance:.0} in -2 ln L", b.name);
    }
    let explains = winner.held_out_mean_square <= 1.1;
    if !explains {
        let left = winner.held_out_mean_square;
        reason += &format!("; yet its residuals are {left:.2} times the noise in power, so something is missing");
    }
    let recommended = winner.name.clone();
    Ok(Comparison { recommended, reason, explains, candidates })
}

/// One standard deviation of the difference of sums of squares, from its scatter over blocks.
fn spread(a: &[f64], b: &[f64]) -> f64 {
    let per = a.len().div_ceil(BLOCKS);
    let each: Vec<f64> =
        a.chunks(per).zip(b.chunks(per)).map(|(a, b)| a.iter().zip(b).map(|(a, b)| a * a - b * b).sum()).collect();
    let n = each.len() as f64;
    let mean = each.iter().sum::<f64>() / n;
    (each.iter().map(|d| (d - mean).powi(2)).sum::<f64>() * n / (n - 1.0)).sqrt()
}
