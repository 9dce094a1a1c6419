//! `--consider`: what the mission is not sure of is held at its values, and widens the deviations ([`ident::belief::consider`]).
//!
//! The estimates are those of a fit that takes everything else as exact. Residuals are tested off the considered columns: with the
//! Jacobian `[J_x J_c]`, residuals `r` and rows of priors, the step
//!
//! ```text
//! d = -(J^T J + diag(0, 1 / s_c^2))^-1 J^T r,    r' = r + J d
//! ```
//!
//! takes out of the residuals what errors within what the mission says explain of them, to first order.

use super::error::IdentifyError;
use super::report::Fitted;
use super::result::uncertain::{BudgetLine, UncertainLine, considered_budget};
use super::uncertain::UncertainKind;
use super::unknowns::Unknowns;
use ff_least_squares::{Tall, triangle_of};
use ident::Estimator;
use ident::belief::{Unknown, analyse, consider};
use ident::estimate::RANK_TOLERANCE;
use ident::parameters::sizes;
use nalgebra::{DMatrix, DVector};

/// What comes of a fit with considered errors.
pub(super) struct Joint {
    /// The linearised joint estimate, which residuals are tested at.
    pub(super) fitted: Fitted,
    /// All parameters of the model there.
    pub(super) values: Vec<f64>,
    pub(super) lines: Vec<UncertainLine>,
    pub(super) budget: Vec<BudgetLine>,
}

/// Widens the deviations of a fit over the unknowns `own` by the errors among `joint`, which `whole` has columns of, and takes out of
/// its residuals what these explain.
pub(super) fn widen(
    whole: &mut dyn Estimator,
    joint: &Unknowns,
    own: &Unknowns,
    fitted: &mut Fitted,
) -> Result<Joint, IdentifyError> {
    let model = |e: String| IdentifyError::Model(e);
    let e = &mut fitted.estimate;
    let place = |name: &str| joint.decls.iter().position(|d| d.name == name);
    let mut values = joint.start.clone();
    for (d, value) in own.decls.iter().zip(&e.values) {
        if let Some(k) = place(&d.name) {
            values[k] = *value;
        }
    }
    let asked = fitted.selected.iter().map(|&i| {
        let name = &own.decls[i].name;
        place(name).ok_or_else(|| model(format!("{name} is estimated and considered")))
    });
    let asked: Vec<usize> = asked.collect::<Result<_, _>>()?;
    let mut selected: Vec<usize> = asked.iter().copied().chain(joint.marginal.iter().map(|m| m.0)).collect();
    selected.sort_unstable();
    let beside = whole.nuisance();
    let extra: Vec<f64> = e.nuisance.iter().map(|n| n.value).collect();
    let (rows, n, all) = (whole.rows(), selected.len(), selected.len() + beside.len());
    let (mut r, mut j) = (vec![0.0; rows], DMatrix::zeros(rows, all));
    whole.jacobian(&values, &extra, &selected, &mut r, &mut j).map_err(|e| model(e.to_string()))?;
    let triangle = triangle_of(&Tall::new(&j).with(&r)).map_err(|e| model(e.to_string()))?;
    let (a, b) = (triangle.columns(0, all).into_owned(), triangle.column(all).into_owned());
    let column = |i: usize| selected.binary_search(&i).unwrap_or_default();
    let estimated: Vec<usize> = asked.iter().map(|&i| column(i)).chain(n..all).collect();
    let errors: Vec<usize> = joint.marginal.iter().map(|m| column(m.0)).collect();
    let stds: Vec<f64> = joint.marginal.iter().map(|m| m.1.std).collect();
    let exact = e.uncertainty.covariance.clone();
    let wide = consider(&exact, &a.select_columns(&estimated), &a.select_columns(&errors), &stds);
    // The step that errors within what the mission says explain.
    let priors = joint.priors(&selected)?;
    let mut stacked = a.resize_vertically(triangle.nrows() + priors.len(), 0.0);
    let mut tail = DMatrix::zeros(priors.len(), n);
    priors.fill_jacobian(&mut tail, 0);
    stacked.view_mut((triangle.nrows(), 0), (priors.len(), n)).copy_from(&tail);
    let mut known = Vec::new();
    priors.push_residuals(&selected.iter().map(|&i| values[i]).collect::<Vec<_>>(), &mut known);
    let right = DVector::from_iterator(stacked.nrows(), b.iter().copied().chain(known));
    let mut unknowns = Unknown::of_parameters(&joint.decls, &selected, &sizes(&joint.decls, &values));
    unknowns.extend(beside);
    let u = analyse(&stacked, &unknowns, RANK_TOLERANCE).map_err(|e| model(e.to_string()))?;
    let step = -(&u.covariance * stacked.tr_mul(&right));
    (DVector::from_vec(r) + &j * &step).iter().zip(&mut e.residuals).for_each(|(new, old)| *old = *new);
    let held: f64 = errors.iter().zip(&stds).filter_map(|(&c, s)| Some((u.deviation[c]? / s).powi(2).min(1.0))).sum();
    let freedom = (rows as f64 - (u.rank as f64 - held)).max(1.0);
    e.chi2_per_dof = e.residuals.iter().map(|r| r * r).sum::<f64>() / freedom;
    let mut linearised = e.clone();
    for (k, &i) in selected.iter().enumerate() {
        values[i] += step[k];
    }
    linearised.values = values;
    linearised.nuisance.iter_mut().enumerate().for_each(|(k, p)| p.value += step[n + k]);
    linearised.uncertainty = u.clone();
    linearised.data_only = u;
    let of_model = joint.expand(&linearised.values)?;
    // What is stated.
    for (k, std) in e.uncertainty.deviation.iter_mut().enumerate() {
        *std = std.map(|_| wide.covariance[(k, k)].sqrt());
    }
    e.uncertainty.covariance = wide.covariance;
    let told = &e.uncertainty.deviation;
    e.parameters.iter_mut().chain(&mut e.nuisance).zip(told).for_each(|(p, std)| p.std = *std);
    let line = |(i, u): &(usize, super::uncertain::UncertainUnknown)| UncertainLine {
        name: u.name.clone(),
        unit: u.unit.to_owned(),
        kind: u.kind,
        prior_mean: u.mean,
        prior_std: u.std,
        value: joint.start[*i],
        std: Some(u.std),
    };
    let lines = joint.marginal.iter().map(line).collect();
    let kinds: Vec<(UncertainKind, f64)> = joint.marginal.iter().map(|(_, u)| (u.kind, u.std)).collect();
    let columns = fitted.selected.iter().enumerate().map(|(k, &i)| (k, &own.decls[i]));
    let budget = considered_budget(&columns.collect::<Vec<_>>(), &kinds, &e.uncertainty, &wide.sensitivity);
    let fitted = Fitted { estimate: linearised, selected, full: fitted.full.clone(), minima: None, reduced: None };
    Ok(Joint { fitted, values: of_model, lines, budget })
}
