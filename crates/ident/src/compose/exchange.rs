//! Minima that an exchange of like elements leads to.
//!
//! The base feels two equal wings through sums and products of their springs first, and through which of them is the stiffer
//! one hardly at all: with stiffnesses `k1`, `k2` of two mirrored hinges the cost is nearly even in `k1 - k2`, and has a minimum on either side of
//! `k1 = k2`. A fit ends in one of them, and its covariance knows nothing of the other. The same holds for hinges of one chain, two tanks, and
//! the two axes of one tank.
//!
//! Elements are alike when they have parameters of the same names and units: `left.k[1]`, `left.d[1]` and `right.k[1]`, `right.d[1]`. The
//! fit is begun again with the values of two of them exchanged, and of two whole appendages, first over the thinned record ([`Estimator::coarse`]). Where that ends
//! lower, the fit was in the wrong minimum, and the lower one is taken. Where it ends within [`LIMIT`] of the best, at a place `d` from it that the
//! parabola of the fit puts farther up (`d^T H d`, H the information matrix), the posterior has a second mode there, of the weight
//! `exp(-D/2)` for an excess D (R. Kass, A. Raftery, *Bayes factors*, J. Am. Stat. Assoc. 90, 1995, eq. 5, with volumes that exchanged minima share).

use crate::belief::covariance::Uncertainty;
use crate::belief::prior::{PriorRow, Priors};
use crate::estimate::estimation::attempt;
use crate::estimate::estimator::Estimator;
use crate::estimate::outcome::{Estimate, Estimated};
use crate::estimate::request::Request;
use ff_least_squares::Settings;
use ff_model::{ParamDecl, ParamGroup};
use std::collections::{BTreeMap, BTreeSet};

/// Excess of twice the negative log posterior from which a mode has less than a hundredth of the weight.
const LIMIT: f64 = 9.2;
/// Deviations by which an exchange has to move a parameter: what is nearer is within the interval.
const MOVED: f64 = 1.5;
/// What the parabola has to put a place above its cost, for it to be another mode.
const BESIDE: f64 = 4.0;
/// Deviations within which two places are one.
const SAME: f64 = 0.5;
/// Linearisations over the thinned record that show where an exchange leads, and the excess up to which it is followed: a few of each, then
/// over the whole.
const TRIED: [(usize, f64); 2] = [(3, 1000.0), (8, 30.0)];
/// Exchanges that are tried, and those that are followed.
const MOST: (usize, usize) = (16, 4);
/// Times that a lower minimum is taken for the place to exchange from.
const ROUNDS: usize = 3;

/// Another minimum that explains the record as well.
#[derive(Clone, Debug)]
pub struct Exchange {
    /// Names of the parameters whose values were exchanged, in pairs.
    pub pairs: Vec<(String, String)>,
    /// Where the fit ended from there.
    pub estimate: Estimate,
    /// By how much what is minimised lies above the estimate.
    pub excess: f64,
}

/// What [`exchanges`] found.
#[derive(Clone, Debug)]
pub struct Exchanged {
    /// The lowest minimum.
    pub best: Estimate,
    /// The others of at least a hundredth of the weight (an excess of at most 9.2), nearest first by cost.
    pub others: Vec<Exchange>,
}

/// Looks for minima beside `first` that exchanges of like elements lead to. Fits: some over the thinned record for each pair, at most four over
/// the whole. What fails on the way is no error. Allocates.
pub fn exchanges<E: Estimator + ?Sized>(request: &Request<'_>, first: Estimate, estimator: &mut E) -> Exchanged {
    let mut best = first;
    let mut others = Vec::new();
    for _ in 0..ROUNDS {
        if !best.is_solution() {
            break;
        }
        let before = best.objective;
        let mut found = followed(request, &best, estimator);
        let lowest = (0..found.len())
            .filter(|&k| found[k].estimate.is_solution())
            .min_by(|&a, &b| found[a].estimate.objective.total_cmp(&found[b].estimate.objective));
        if let Some(k) = lowest.filter(|&k| found[k].estimate.objective < before) {
            let mut lower = found.swap_remove(k);
            let (way, steps) = (best.descent.clone(), best.iterations);
            lower.estimate.descent.splice(0..0, way);
            lower.estimate.iterations += steps;
            for (p, &i) in lower.estimate.parameters.iter_mut().zip(request.selected) {
                p.start = request.start[i];
            }
            found.push(Exchange {
                pairs: lower.pairs,
                estimate: core::mem::replace(&mut best, lower.estimate),
                excess: 0.0,
            });
        }
        others = found;
        if before - best.objective < LIMIT {
            break;
        }
    }
    others.iter_mut().for_each(|o| o.excess = o.estimate.objective - best.objective);
    others.sort_by(|a, b| a.excess.total_cmp(&b.excess));
    let mut kept: Vec<Exchange> = Vec::new();
    for o in others {
        let new = |k: &Exchange| distance(&o.estimate, &k.estimate) > SAME;
        if o.excess <= LIMIT && is_beside(&best, &o) && kept.iter().all(new) {
            kept.push(o);
        }
    }
    Exchanged { best, others: kept }
}

/// Whether a place of this cost is one that the parabola of the fit knows nothing of.
fn is_beside(best: &Estimate, other: &Exchange) -> bool {
    distance(best, &other.estimate) > MOVED
        && parabola(&best.uncertainty, &difference(best, &other.estimate)) > other.excess + BESIDE
}

/// `b - a` of all unknowns.
pub fn difference(a: &Estimate, b: &Estimate) -> Vec<f64> {
    let all = |e: &Estimate| e.parameters.iter().chain(&e.nuisance).map(|p| p.value).collect::<Vec<_>>();
    all(b).iter().zip(all(a)).map(|(y, x)| y - x).collect()
}

/// `d^T H d` with the information of a fit.
fn parabola(u: &Uncertainty, d: &[f64]) -> f64 {
    let along = |k: usize| -> f64 {
        let of = |i: usize| u.directions[(i, k)] * d[i] / u.unknowns[i].size;
        (0..d.len()).map(of).sum::<f64>() * u.singular_values[k]
    };
    (0..u.rank).map(|k| along(k).powi(2)).sum()
}

/// The largest distance of two places among positive parameters, in deviations of the first.
fn distance(a: &Estimate, b: &Estimate) -> f64 {
    let of = |(x, y): (&Estimated, &Estimated)| Some((y.value - x.value).abs() / x.std.filter(|s| *s > 0.0)?);
    a.parameters.iter().zip(&b.parameters).filter_map(of).fold(0.0, f64::max)
}

/// Columns whose values are exchanged.
type Swap = Vec<(usize, usize)>;

/// Fits from the exchanges of `at` that lead somewhere.
fn followed<E: Estimator + ?Sized>(request: &Request<'_>, at: &Estimate, estimator: &mut E) -> Vec<Exchange> {
    let swaps = swaps(request, at);
    if swaps.is_empty() {
        return Vec::new();
    }
    let moved: BTreeSet<usize> = swaps.iter().flatten().flat_map(|s| [s.0, s.1]).collect();
    let swapped = |swap: &Swap| {
        let mut start = at.values.clone();
        for &(a, b) in swap {
            start.swap(request.selected[a], request.selected[b]);
        }
        start
    };
    let centre = request.centre.or(Some(request.start));
    let mut promising: Vec<(f64, Vec<f64>)> = Vec::new();
    match estimator.coarse(&at.values) {
        Some(thin) => {
            let mut thin = thin.estimator;
            let (selected, priors) = asked(request);
            let mut lead = |start: &[f64], most: usize| {
                let settings = Settings { max_iterations: most, ..request.settings.clone() };
                let (selected, priors, marginal) = (&selected[..], priors.clone(), Vec::new());
                let tried =
                    Request { selected, start, centre, priors, marginal, settings, coarse: false, ..request.clone() };
                attempt(&tried, &mut *thin).ok()
            };
            let Some(here) = lead(&at.values, TRIED[1].0) else { return Vec::new() };
            let mut ends = vec![here];
            for swap in &swaps {
                let mut end = None;
                let mut start = swapped(swap);
                for (most, limit) in TRIED {
                    end = lead(&start, most).filter(|e| e.objective - ends[0].objective < limit);
                    let Some(e) = &end else { break };
                    start.clone_from(&e.values);
                }
                // Several exchanges may lead to one place, or back.
                let Some(e) = end.filter(|e| ends.iter().all(|o| distance(o, e) > SAME)) else { continue };
                promising.push((e.objective, start));
                ends.push(e);
            }
        }
        None => promising.extend(swaps.iter().map(|s| (0.0, swapped(s)))),
    }
    promising.sort_by(|a, b| a.0.total_cmp(&b.0));
    let off = |values: &[f64], e: &Estimate| -> f64 {
        let part = |&c: &usize| Some((values[request.selected[c]] - e.parameters[c].value) / e.parameters[c].std?);
        moved.iter().filter_map(part).map(|d| d * d).sum()
    };
    let name = |c: usize| request.decls[request.selected[c]].name.clone();
    let mut out = Vec::new();
    for (_, start) in promising.into_iter().take(MOST.1) {
        let follow = Request { start: &start, centre, coarse: false, ..request.clone() };
        if let Ok(estimate) = attempt(&follow, &mut *estimator) {
            // It may have gone on to where another exchange leads.
            let nearest =
                swaps.iter().min_by(|a, b| off(&swapped(a), &estimate).total_cmp(&off(&swapped(b), &estimate)));
            let pairs = nearest.into_iter().flatten().map(|&(a, b)| (name(a), name(b))).collect();
            out.push(Exchange { pairs, estimate, excess: 0.0 });
        }
    }
    out
}

/// What is asked for, with its own priors: what the mission is not sure of stays where it is while it is found out where an exchange leads.
fn asked(request: &Request<'_>) -> (Vec<usize>, Priors) {
    let columns: Vec<usize> =
        (0..request.selected.len()).filter(|&c| request.marginal.iter().all(|m| m.0 != request.selected[c])).collect();
    let rows = request.priors.rows().iter();
    let own = rows.filter_map(|r| Some(PriorRow { column: columns.binary_search(&r.column).ok()?, ..*r }));
    (columns.iter().map(|&c| request.selected[c]).collect(), own.fold(Priors::default(), |all, row| all.with(row)))
}

/// Parameters of one element: what they are and their column.
type Element = BTreeMap<(String, String), usize>;

/// `left.k[1]` is parameter `k` of element 1 of `left`, `tank.mass` one of the element without number of `tank`.
fn place(name: &str) -> Option<(&str, &str, &str)> {
    let (owner, local) = name.rsplit_once('.')?;
    Some(match local.split_once('[') {
        Some((what, number)) => (owner, number, what),
        None => (owner, "", local),
    })
}

/// Exchanges of like elements that would move a parameter by more than its interval, those first that the parabola of the fit puts least
/// above it.
fn swaps(request: &Request<'_>, at: &Estimate) -> Vec<Swap> {
    let mut owners: BTreeMap<&str, BTreeMap<&str, Element>> = BTreeMap::new();
    for (column, &i) in request.selected.iter().enumerate() {
        let d: &ParamDecl = &request.decls[i];
        let asked = request.marginal.iter().all(|m| m.0 != i);
        if let Some((owner, number, what)) = place(&d.name).filter(|_| asked && d.group == ParamGroup::Positive) {
            let element = owners.entry(owner).or_default().entry(number).or_default();
            element.insert((what.to_owned(), d.unit.to_string()), column);
        }
    }
    let elements: Vec<&Element> = owners.values().flat_map(BTreeMap::values).collect();
    let pair = |a: &Element, b: &Element| -> Option<Swap> {
        a.keys().eq(b.keys()).then(|| a.values().copied().zip(b.values().copied()).collect())
    };
    let mut all: Vec<Swap> = Vec::new();
    for (k, a) in elements.iter().enumerate() {
        all.extend(elements[..k].iter().filter_map(|b| pair(b, a)));
    }
    let whole: Vec<&BTreeMap<&str, Element>> = owners.values().filter(|o| o.len() > 1).collect();
    for (k, a) in whole.iter().enumerate() {
        for b in whole[..k].iter().filter(|b| b.keys().eq(a.keys())) {
            let parts: Option<Vec<Swap>> = b.values().zip(a.values()).map(|(x, y)| pair(x, y)).collect();
            all.extend(parts.map(|p| p.concat()));
        }
    }
    let moves = |s: &Swap| {
        let mut d = vec![0.0; at.parameters.len() + at.nuisance.len()];
        let mut most = 0.0_f64;
        for &(a, b) in s {
            let by = at.parameters[b].value - at.parameters[a].value;
            (d[a], d[b]) = (by, -by);
            let least = [a, b].iter().filter_map(|&c| at.parameters[c].std).fold(f64::INFINITY, f64::min);
            most = most.max(by.abs() / least);
        }
        (most, parabola(&at.uncertainty, &d))
    };
    let mut ranked: Vec<(f64, Swap)> =
        all.into_iter().map(|s| (moves(&s), s)).filter(|(m, _)| m.0 > MOVED).map(|(m, s)| (m.1, s)).collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    ranked.into_iter().take(MOST.0).map(|r| r.1).collect()
}
