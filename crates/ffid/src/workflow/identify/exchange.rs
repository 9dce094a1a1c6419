//! Like elements whose values a record cannot assign: estimates and deviations that allow for the other minima ([`ident::compose::exchanges`]).

use super::error::IdentifyError;
use super::result::identification::IdentificationResult;
use super::result::parameter::ParameterVerdict;
use ident::compose::{Exchange, difference};
use ident::estimate::{Estimate, RANK_TOLERANCE};
use ident::{Request, Uncertainty};
use serde::{Deserialize, Serialize};

/// Part of the probability from which the interval covers another minimum.
const COVERED: f64 = 0.025;
/// Deviations by which a parameter differs between two minima for it to be listed.
const LISTED: f64 = 1.0;
/// Deviations of a half of a 95 % interval.
const HALF95: f64 = 1.96;

/// Another minimum that explains the record as well, with the values of like elements exchanged.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExchangeLine {
    /// Parameters whose values were exchanged.
    pub exchanged: Vec<String>,
    /// Those with which, in the same order.
    pub with: Vec<String>,
    /// By how much twice the negative log posterior is higher there.
    pub excess: f64,
    /// Its part of the probability.
    pub weight: f64,
    /// Whether 95 % intervals about the two minima leave a gap for some parameter: its value is one of two. Else one interval covers both.
    pub separate: bool,
    /// The parameters that differ by more than a deviation, largest first.
    pub parameters: Vec<ExchangedValue>,
}

/// A parameter at two minima.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExchangedValue {
    /// Full name.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Estimate.
    pub value: f64,
    /// Its deviation about this minimum alone.
    pub std: f64,
    /// The value at the other minimum.
    pub other: f64,
    /// Its deviation there.
    pub other_std: f64,
}

impl ExchangedValue {
    /// Whether the two intervals leave a gap.
    pub fn separate(&self) -> bool {
        (self.other - self.value).abs() > HALF95 * (self.std + self.other_std)
    }
    fn hull95(&self) -> (f64, f64) {
        let (a, b) = (HALF95 * self.std, HALF95 * self.other_std);
        ((self.value - a).min(self.other - b), (self.value + a).max(self.other + b))
    }
}

/// The other minima of a fit, and what it says without them.
#[derive(Clone, Debug, Default)]
pub(super) struct Exchanges {
    /// Covariance about the estimate alone; absent where there is no other minimum.
    within: Option<Uncertainty>,
    others: Vec<Exchange>,
    /// The part of the probability of each.
    weights: Vec<f64>,
}

impl Exchanges {
    /// Of the fit `e`, whose covariance then allows for the other minima.
    pub(super) fn allow(e: &mut Estimate, others: Vec<Exchange>) -> Result<Self, IdentifyError> {
        if others.is_empty() {
            return Ok(Self::default());
        }
        let density: Vec<f64> = others.iter().map(|o| (-0.5 * o.excess).exp()).collect();
        let all = 1.0 + density.iter().sum::<f64>();
        let out =
            Self { within: Some(e.uncertainty.clone()), weights: density.iter().map(|d| d / all).collect(), others };
        for (o, w) in out.others.iter().zip(&out.weights) {
            let step = difference(e, &o.estimate);
            let wider = e.uncertainty.with_second_place(&step, *w, RANK_TOLERANCE);
            e.uncertainty = wider.map_err(|e| IdentifyError::Model(e.to_string()))?;
        }
        let stds = &e.uncertainty.deviation;
        e.parameters.iter_mut().chain(&mut e.nuisance).zip(stds).for_each(|(p, std)| p.std = *std);
        Ok(out)
    }
    /// The covariance of a fit with some of these unknowns held (`--consider`) made to allow for the other minima as well.
    pub(super) fn hold(&self, joint: &Estimate, own: &mut Estimate) {
        for (o, w) in self.others.iter().zip(&self.weights) {
            let (from, to) = (unknowns(joint), unknowns(&o.estimate));
            let step: Vec<f64> = unknowns(own)
                .iter()
                .map(|u| from.iter().position(|f| f.0 == u.0).map_or(0.0, |k| to[k].1 - from[k].1))
                .collect();
            let c = &mut own.uncertainty;
            for (i, a) in step.iter().enumerate() {
                step.iter().enumerate().for_each(|(k, b)| c.covariance[(i, k)] += w * a * b);
                c.deviation[i] = c.deviation[i].map(|_| c.covariance[(i, i)].sqrt());
            }
        }
        let stds = &own.uncertainty.deviation;
        own.parameters.iter_mut().chain(&mut own.nuisance).zip(stds).for_each(|(p, std)| p.std = *std);
    }
    /// Covariance about the estimate alone.
    pub(super) fn within<'a>(&'a self, all: &'a Uncertainty) -> &'a Uncertainty {
        self.within.as_ref().unwrap_or(all)
    }
    /// What the result says of them: lines, intervals that cover both, verdicts, shares of the larger variance.
    pub(super) fn state(&self, request: &Request<'_>, result: &mut IdentificationResult) {
        let Some(within) = &self.within else { return };
        let asked = |name: &str| {
            let of = |&i: &usize| request.decls[i].name == name && request.marginal.iter().all(|m| m.0 != i);
            request.selected.iter().any(of)
        };
        for (o, w) in self.others.iter().zip(&self.weights) {
            let mut parameters = Vec::new();
            for (k, u) in within.unknowns.iter().enumerate().filter(|(_, u)| asked(&u.name)) {
                let at = |p: &IdentificationResult| p.parameters.iter().position(|p| p.name == u.name);
                let (Some(i), Some(std)) = (at(result), within.deviation[k]) else { continue };
                let there = &o.estimate.parameters[k];
                let line = &mut result.parameters[i];
                let both = ExchangedValue {
                    name: u.name.clone(),
                    unit: u.unit.clone(),
                    value: line.value,
                    std,
                    other: there.value,
                    other_std: there.std.unwrap_or(std),
                };
                if *w >= COVERED {
                    let (low, high) = both.hull95();
                    line.interval95 = line.interval95.map(|(a, b)| (a.min(low), b.max(high)));
                }
                if both.separate() {
                    line.verdict = ParameterVerdict::NotUnique;
                }
                parameters.push(both);
            }
            let far = |v: &ExchangedValue| (v.other - v.value).abs() / v.std;
            parameters.retain(|v| far(v) > LISTED);
            parameters.sort_by(|a, b| far(b).total_cmp(&far(a)));
            let separate = parameters.iter().any(ExchangedValue::separate);
            let ((exchanged, with), excess) = (o.pairs.iter().cloned().unzip(), o.excess);
            result.exchanges.push(ExchangeLine { exchanged, with, excess, weight: *w, separate, parameters });
        }
        for b in &mut result.budget {
            let Some(std) = result.parameters.iter().find(|p| p.name == b.name).and_then(|p| p.std) else { continue };
            let part = (b.std / std).powi(2).min(1.0);
            b.errors.iter_mut().for_each(|e| e.share *= part);
            b.noise = 1.0 - b.errors.iter().map(|e| e.share).sum::<f64>();
            if let Some(better) = &mut b.better {
                better.std = (better.std.powi(2) + std.powi(2) - b.std.powi(2)).max(0.0).sqrt();
            }
            b.std = std;
        }
    }
}

fn unknowns(e: &Estimate) -> Vec<(&str, f64)> {
    e.parameters.iter().chain(&e.nuisance).map(|p| (p.name.as_str(), p.value)).collect()
}

/// What the other minima mean, in words.
pub(super) fn sentences(all: &[ExchangeLine]) -> Vec<String> {
    use super::number::num;
    let names = |l: &ExchangeLine| {
        let pairs: Vec<String> = l.exchanged.iter().zip(&l.with).map(|(a, b)| format!("{a} with {b}")).collect();
        ff_model::diagnostics::list(pairs.iter().map(String::as_str), 6)
    };
    let value = |v: &ExchangedValue| {
        format!(
            "{} is {} +- {} or {} +- {} {}",
            v.name,
            num(v.value),
            num(v.std),
            num(v.other),
            num(v.other_std),
            v.unit
        )
    };
    let one = |l: &ExchangeLine| {
        let (what, by) = (names(l), num(l.excess.max(0.0)));
        if l.separate {
            let apart: Vec<String> = l.parameters.iter().filter(|v| v.separate()).map(value).collect();
            format!(
                "The assignment is NOT unique: with {what} exchanged the model fits as well (chi-squared {by} higher). {}. Only one of the two is \
                 true, and this record does not tell which; deviations and intervals cover both. Move them unequally, or give a prior that tells them apart.",
                ff_model::diagnostics::list(apart.iter().map(String::as_str), 4)
            )
        } else {
            format!(
                "With {what} exchanged the model fits as well (chi-squared {by} higher): deviations and intervals cover both assignments."
            )
        }
    };
    all.iter().map(one).collect()
}
