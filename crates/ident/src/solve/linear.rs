//! Linear least squares over a record: the solution, what it is worth, and what the data cannot tell.
//!
//! The estimators that are linear in the parameters (complete form, ground calibration) reduce their rows to
//! triangles ([`ff_least_squares::tall_qr`]) and are solved here: `min sum_g |A_g x - b_g|^2 / sigma_g^2`, kinds `g` of rows with one
//! standard deviation each. With the scaled triangle `R diag(s) = U diag(w) V^T` the solution is
//!
//! ```text
//! x = x0 + diag(s) V_1 diag(1/w_1) U_1^T (d - R x0)
//! ```
//!
//! over the singular values above the tolerance: what the data cannot tell stays where the start `x0` had it, measured in the
//! sizes `s` of the parameters, instead of taking values of size 1e13. Unknown standard deviations come from the residuals
//! of their own kind of row in two or more steps (feasible generalised least squares), without a second pass over the data.
//! Derivation: `docs/theory/linear-estimators.md`.

use crate::belief::covariance::{Uncertainty, Unknown, analyse};
use crate::estimate::outcome::{Estimated, RANK_TOLERANCE};
use crate::estimate::setup::SetupError;
use crate::parameters::scale;
use ff_least_squares::{Merged, Triangle, merge};
use ff_linalg as linalg;
use ff_linalg::LinalgError;
use ff_model::Inertia;
use ff_model::{ParamDecl, ParamGroup};
use nalgebra::{DMatrix, DVector};

/// Why a linear estimator gave nothing.
#[derive(Debug, thiserror::Error)]
pub enum LinearError {
    /// Record and model do not fit together, or the joint motion could not be fitted.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// A channel that the estimator needs was not recorded.
    #[error("{estimator} needs the {channel}, which the record does not have; {hint}")]
    Channel {
        /// Which estimator.
        estimator: &'static str,
        /// What is missing.
        channel: &'static str,
        /// What to do.
        hint: &'static str,
    },
    /// The model has another kind of base than the estimator is for.
    #[error("{estimator} needs a {needed} base; {hint}")]
    Base {
        /// Which estimator.
        estimator: &'static str,
        /// `floating` or `fixed`.
        needed: &'static str,
        /// What to do.
        hint: &'static str,
    },
    /// An option outside its range.
    #[error("{what} is {value}, must be {needed}")]
    Option {
        /// Which.
        what: String,
        /// Its value.
        value: f64,
        /// Its range.
        needed: &'static str,
    },
    /// Too few samples, unknown indices, or values of the wrong length.
    #[error("{0}")]
    Shape(String),
    /// A factorisation refused its input.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

/// Where the standard deviations of the kinds of rows come from.
#[derive(Clone, Debug, PartialEq)]
pub enum Weights {
    /// Known beforehand, one per kind, in the order that the estimator states.
    Given(Vec<f64>),
    /// From the residuals: solved with equal relative weights, then this often with the deviations that the residuals of
    /// each kind show.
    FromResiduals(usize),
}

/// A combination of parameters that the data determine, in the user's names.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct BaseParameter {
    /// Parameters and their factors; the first has factor 1 and gives the combination its unit.
    pub terms: Vec<(String, f64)>,
    /// SI unit.
    pub unit: String,
    /// Value.
    pub value: f64,
    /// Standard deviation.
    pub std: f64,
}

impl core::fmt::Display for BaseParameter {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        for (i, (name, w)) in self.terms.iter().enumerate() {
            match (i, *w < 0.0) {
                (0, _) => write!(f, "{name}")?,
                (_, true) => write!(f, " - {:.6} {name}", -w)?,
                (_, false) => write!(f, " + {w:.6} {name}")?,
            }
        }
        Ok(())
    }
}

/// The residual of one kind of row.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct RowKind {
    /// What the rows are.
    pub name: String,
    /// How many.
    pub rows: usize,
    /// The standard deviation they were divided by, in the unit of the row.
    pub sigma: f64,
    /// Root mean square of their residuals, in the unit of the row.
    pub rms: f64,
}

/// The result of a linear fit.
#[derive(Clone, Debug)]
pub struct LinearEstimate {
    /// Full parameter vector of the model with the estimates in place.
    pub values: Vec<f64>,
    /// The estimated parameters of the model.
    pub parameters: Vec<Estimated>,
    /// Unknowns besides them, such as friction.
    pub extra: Vec<Estimated>,
    /// Rank, null directions, covariance of all unknowns.
    pub uncertainty: Uncertainty,
    /// Combinations that the data determine, as many as the rank.
    pub base: Vec<BaseParameter>,
    /// Residuals by kind of row.
    pub kinds: Vec<RowKind>,
    /// Sum of squared whitened residuals by the degrees of freedom.
    pub chi2_per_dof: f64,
    /// Selected bodies whose estimate no body has: [`crate::solve::project`] finds the nearest one that exists.
    pub unphysical: Vec<String>,
    /// The whitened triangle `r x = d` that was solved, for projection and sequences.
    pub equations: Merged,
}

/// What [`solve`] is given.
pub(crate) struct Task<'a> {
    pub(crate) decls: &'a [ParamDecl],
    pub(crate) selected: &'a [usize],
    pub(crate) start: &'a [f64],
    /// Unknowns besides the parameters, with their start.
    pub(crate) extra: Vec<(Unknown, f64)>,
    pub(crate) weights: &'a Weights,
    /// Unknowns that are known beforehand, by their number: mean and standard deviation.
    pub(crate) priors: &'a [(usize, f64, f64)],
}

/// Refuses selections and values that do not belong to the declarations.
pub(crate) fn check(decls: &[ParamDecl], selected: &[usize], values: &[f64]) -> Result<(), LinearError> {
    if values.len() != decls.len() {
        return Err(LinearError::Shape(format!("{} parameters, but {} values", decls.len(), values.len())));
    }
    if !selected.windows(2).all(|w| w[0] < w[1]) || selected.last().is_none_or(|&i| i >= decls.len()) {
        return Err(LinearError::Shape("selected indices must ascend, exist, and be at least one".into()));
    }
    linalg::check_finite_slice("parameter values", values)?;
    Ok(())
}

fn check_weights(weights: &Weights, kinds: &[Triangle]) -> Result<(), LinearError> {
    if let Weights::Given(s) = weights {
        if s.len() != kinds.len() {
            return Err(LinearError::Shape(format!("{} deviations for {} kinds of rows", s.len(), kinds.len())));
        }
        if let Some(k) = s.iter().position(|x| !(x.is_finite() && *x > 0.0)) {
            let what = format!("standard deviation of {}", kinds[k].name);
            return Err(LinearError::Option { what, value: s[k], needed: "positive and finite" });
        }
    }
    Ok(())
}

/// Residuals below this part of the terms they are the difference of are rounding.
const ROUNDING: f64 = 1e-12;

/// What [`solve`] has found before it is told what it is worth.
struct Weighted {
    unknowns: Vec<Unknown>,
    x0: Vec<f64>,
    sigma: Vec<f64>,
    equations: Merged,
    solution: Solution,
}

/// Values of `selected`, then of `extra`, alone: those of [`solve`] in a fraction of its time. Allocates.
pub(crate) fn values(task: &Task<'_>, kinds: &[Triangle]) -> Result<Vec<f64>, LinearError> {
    Ok(weighted(task, kinds)?.solution.x)
}

fn weighted(task: &Task<'_>, kinds: &[Triangle]) -> Result<Weighted, LinearError> {
    let Task { decls, selected, start, extra, weights, priors } = task;
    check_weights(weights, kinds)?;
    let all_sizes = scale::sizes(decls, start);
    let mut unknowns = Unknown::of_parameters(decls, selected, &all_sizes);
    unknowns.extend(extra.iter().map(|e| e.0.clone()));
    let n = unknowns.len();
    let rows: usize = kinds.iter().map(|t| t.rows).sum();
    if rows < n {
        return Err(LinearError::Shape(format!("{rows} equations for {n} unknowns; record longer or estimate fewer")));
    }
    let sizes: Vec<f64> = unknowns.iter().map(|u| u.size).collect();
    let mut x0: Vec<f64> = selected.iter().map(|&i| start[i]).collect();
    x0.extend(extra.iter().map(|e| e.1));
    let floors: Vec<f64> = kinds.iter().map(|t| ROUNDING * t.scale(&sizes)).collect();
    let (mut sigma, steps) = match weights {
        Weights::Given(s) => (s.clone(), 0),
        // Before anything is known of them, errors are taken in proportion to what the rows hold.
        Weights::FromResiduals(k) => (kinds.iter().map(|t| t.scale(&sizes).max(f64::MIN_POSITIVE)).collect(), *k),
    };
    let whole = |sigma: &[f64]| with_priors(merge(n, kinds, sigma)?, priors);
    let mut equations = whole(&sigma)?;
    let mut solution = pseudo_solve(&equations, &sizes, &x0)?;
    for _ in 0..steps {
        let share = solution.rank as f64 / rows as f64;
        for ((s, t), floor) in sigma.iter_mut().zip(kinds).zip(&floors) {
            let dof = (t.rows as f64 * (1.0 - share)).max(1.0);
            *s = (t.cost(&solution.x) / dof).sqrt().max(*floor).max(f64::MIN_POSITIVE);
        }
        // Rows that are not there, those of a joint at rest, say nothing of their noise: taken as the largest of the others, it excuses nothing.
        let largest = sigma.iter().zip(kinds).filter(|(_, t)| t.rows > 0).map(|(s, _)| *s).fold(0.0, f64::max);
        sigma.iter_mut().zip(kinds).filter(|(_, t)| t.rows == 0).for_each(|(s, _)| *s = largest);
        equations = whole(&sigma)?;
        solution = pseudo_solve(&equations, &sizes, &x0)?;
    }
    Ok(Weighted { unknowns, x0, sigma, equations, solution })
}

/// Solves for `selected`, then `extra`. Allocates.
pub(crate) fn solve(task: &Task<'_>, kinds: &[Triangle]) -> Result<LinearEstimate, LinearError> {
    let Weighted { unknowns, x0, sigma, equations, solution } = weighted(task, kinds)?;
    let Task { decls, selected, start, .. } = task;
    let n = unknowns.len();
    let rows: usize = kinds.iter().map(|t| t.rows).sum();
    let uncertainty = analyse(&equations.r, &unknowns, RANK_TOLERANCE)?;
    let x = solution.x;
    let chi2: f64 = kinds.iter().zip(&sigma).map(|(t, s)| t.cost(&x) / (s * s)).sum();
    let mut values = start.to_vec();
    selected.iter().zip(&x).for_each(|(&i, &v)| values[i] = v);
    let listed = |k: usize, start: f64| Estimated {
        name: unknowns[k].name.clone(),
        unit: unknowns[k].unit.clone(),
        start,
        value: x[k],
        std: uncertainty.deviation[k],
    };
    let m = selected.len();
    Ok(LinearEstimate {
        parameters: (0..m).map(|k| listed(k, x0[k])).collect(),
        extra: (m..n).map(|k| listed(k, x0[k])).collect(),
        base: base_parameters(&equations, &unknowns, &x, uncertainty.rank)?,
        kinds: kinds
            .iter()
            .zip(&sigma)
            .map(|(t, &sigma)| RowKind {
                name: t.name.clone(),
                rows: t.rows,
                sigma,
                rms: (t.cost(&x) / t.rows.max(1) as f64).sqrt(),
            })
            .collect(),
        chi2_per_dof: chi2 / rows.saturating_sub(uncertainty.rank).max(1) as f64,
        unphysical: unphysical(decls, selected, &values),
        values,
        uncertainty,
        equations,
    })
}

/// Equations with a row for everything that is known beforehand.
pub(crate) fn with_priors(m: Merged, priors: &[(usize, f64, f64)]) -> Result<Merged, LinalgError> {
    if priors.is_empty() {
        return Ok(m);
    }
    let n = m.r.ncols();
    let mut all = DMatrix::zeros(n + priors.len() + 1, n + 1);
    all.view_mut((0, 0), (n, n)).copy_from(&m.r);
    all.view_mut((0, n), (n, 1)).copy_from(&m.d);
    for (k, &(column, mean, std)) in priors.iter().enumerate() {
        (all[(n + k, column)], all[(n + k, n)]) = (1.0 / std, mean / std);
    }
    let r = linalg::qr_r(&all)?;
    let d = r.view((0, n), (n, 1)).column(0).into_owned();
    Ok(Merged { rest: m.rest + r[(n, n)].powi(2), d, r: r.view((0, 0), (n, n)).into_owned(), rows: m.rows })
}

struct Solution {
    x: Vec<f64>,
    rank: usize,
}

/// The formula of the module documentation.
fn pseudo_solve(m: &Merged, sizes: &[f64], x0: &[f64]) -> Result<Solution, LinalgError> {
    let mut a = m.r.clone();
    for (k, s) in sizes.iter().enumerate() {
        a.column_mut(k).scale_mut(*s);
    }
    let svd = linalg::svd(&a)?;
    let rank = svd.rank(RANK_TOLERANCE);
    let gap = &m.d - &m.r * DVector::from_column_slice(x0);
    let mut x = x0.to_vec();
    for k in 0..rank {
        let c = svd.u.column(k).dot(&gap) / svd.s[k];
        for i in 0..x.len() {
            x[i] += c * sizes[i] * svd.v[(i, k)];
        }
    }
    Ok(Solution { x, rank })
}

/// Factors below this, in units of the sizes, are rounding of the elimination.
const NEGLIGIBLE: f64 = 1e-9;

/// Base parameters by column-pivoted QR of the scaled triangle (M. Gautier, *Numerical calculation of the base inertial
/// parameters of robots*, J. Robotic Systems 8(4), 1991): with `A P = [Q_1 Q_2] [R_11 R_12; 0 0]` the data see
/// `x_1 + R_11^-1 R_12 x_2` of the unknowns and nothing else.
fn base_parameters(
    m: &Merged,
    unknowns: &[Unknown],
    x: &[f64],
    rank: usize,
) -> Result<Vec<BaseParameter>, LinalgError> {
    let mut a = m.r.clone();
    for (k, u) in unknowns.iter().enumerate() {
        a.column_mut(k).scale_mut(u.size);
    }
    let linalg::Elimination { kept: own, left: rest, r, c } = linalg::eliminate(&a, rank)?;
    let singular = || LinalgError::RankDeficient { rank, columns: unknowns.len(), dependent: rest.clone() };
    let inverse = r.solve_upper_triangular(&DMatrix::identity(rank, rank)).ok_or_else(singular)?;
    let mut order: Vec<usize> = (0..rank).collect();
    order.sort_by_key(|&i| own[i]);
    Ok(order
        .into_iter()
        .map(|i| {
            let u = &unknowns[own[i]];
            let mut terms = vec![(u.name.clone(), 1.0)];
            let mut value = x[own[i]];
            let mut others: Vec<(usize, f64)> = rest.iter().enumerate().map(|(j, &o)| (o, c[(i, j)])).collect();
            others.retain(|(_, f)| f.abs() > NEGLIGIBLE);
            others.sort_by_key(|o| o.0);
            for (o, f) in others {
                let f = f * u.size / unknowns[o].size;
                value += f * x[o];
                terms.push((unknowns[o].name.clone(), f));
            }
            BaseParameter { terms, unit: u.unit.clone(), value, std: u.size * inverse.row(i).norm() }
        })
        .collect())
}

/// Bodies of which all ten parameters are selected and whose values no body has.
pub(crate) fn unphysical(decls: &[ParamDecl], selected: &[usize], values: &[f64]) -> Vec<String> {
    whole_bodies(decls, selected)
        .into_iter()
        .filter(|(_, i)| Inertia::from_params(&values[*i..i + 10]).pseudo().cholesky().is_none())
        .map(|(name, _)| name)
        .collect()
}

/// Name and first parameter of every body of which all ten are selected.
pub(crate) fn whole_bodies(decls: &[ParamDecl], selected: &[usize]) -> Vec<(String, usize)> {
    let mut out = Vec::new();
    let mut k = 0;
    while k < selected.len() {
        let i = selected[k];
        match &decls[i].group {
            ParamGroup::Inertial(body)
                if selected.get(k + 9) == Some(&(i + 9)) && (i..i + 10).all(|p| decls[p].group == decls[i].group) =>
            {
                out.push((body.clone(), i));
                k += 10;
            }
            _ => k += 1,
        }
    }
    out
}
