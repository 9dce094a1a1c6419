//! `--consider`: what the mission is not sure of is held at its values, and widens the deviations ([`ident::belief::consider`]).
//!
//! Two fits: one with the errors among its unknowns, as without the flag, at whose end residuals are tested, so that what errors within
//! what the mission says explain of them is left out; and one from there with the errors held, whose estimates are stated.
//! (One linear step from the second to the first is not enough: where a gyro is turned, it is too long.)

use super::error::IdentifyError;
use super::fitted::Fitted;
use super::result::uncertain::{BudgetLine, UncertainLine, considered_budget};
use super::uncertain::UncertainKind;
use super::unknowns::Unknowns;
use ff_least_squares::{Tall, triangle_of};
use ident::belief::consider;
use ident::estimate::attempt;
use ident::{Estimator, Request};
use nalgebra::DMatrix;

/// A fit with the errors held.
pub(super) struct Considered {
    /// With deviations that allow for the errors, and the residuals of the fit with the errors among the unknowns.
    pub(super) fitted: Fitted,
    /// All parameters of the model.
    pub(super) values: Vec<f64>,
    pub(super) lines: Vec<UncertainLine>,
    pub(super) budget: Vec<BudgetLine>,
}

/// The unknowns of a fit, and its estimator.
pub(super) struct Side<'a> {
    pub(super) unknowns: &'a Unknowns,
    pub(super) estimator: &'a mut dyn Estimator,
}

/// Goes on from the end `told` of a fit of `joint` with the unknowns of `own`, which has the errors at the mission's values, and widens the
/// deviations by them. `request` is that of the first fit.
pub(super) fn hold(
    joint: Side<'_>,
    own: Side<'_>,
    told: &Fitted,
    request: &Request<'_>,
) -> Result<Considered, IdentifyError> {
    let model = |e: String| IdentifyError::Model(e);
    let (Side { unknowns: joint, estimator: whole }, Side { unknowns: own, estimator: bare }) = (joint, own);
    let place = |name: &str| joint.decls.iter().position(|d| d.name == name);
    let mut start = own.start.clone();
    for &i in &own.selected {
        if let Some(k) = place(&own.decls[i].name) {
            start[i] = told.estimate.values[k];
        }
    }
    let priors = own.priors(&own.selected)?;
    let held = Request {
        anchor: request.anchor,
        loss: request.loss,
        priors,
        settings: request.settings.clone(),
        centre: Some(&own.start),
        coarse: false,
        ..Request::new(&own.decls, &own.selected, &start)
    };
    let mut e = attempt(&held, bare)?;
    let full = e.data_only.clone();
    let mut values = joint.start.clone();
    for (d, value) in own.decls.iter().zip(&e.values) {
        if let Some(k) = place(&d.name) {
            values[k] = *value;
        }
    }
    let asked = own.selected.iter().map(|&i| {
        let name = &own.decls[i].name;
        place(name).ok_or_else(|| model(format!("{name} is estimated and considered")))
    });
    let asked: Vec<usize> = asked.collect::<Result<_, _>>()?;
    let mut selected: Vec<usize> = asked.iter().copied().chain(joint.marginal.iter().map(|m| m.0)).collect();
    selected.sort_unstable();
    let extra: Vec<f64> = e.nuisance.iter().map(|n| n.value).collect();
    let (rows, n, all) = (whole.rows(), selected.len(), selected.len() + whole.nuisance().len());
    let (mut r, mut j) = (vec![0.0; rows], DMatrix::zeros(rows, all));
    whole.jacobian(&values, &extra, &selected, &mut r, &mut j).map_err(|e| model(e.to_string()))?;
    let a = triangle_of(&Tall::new(&j)).map_err(|e| model(e.to_string()))?;
    let column = |i: usize| selected.binary_search(&i).unwrap_or_default();
    let estimated: Vec<usize> = asked.iter().map(|&i| column(i)).chain(n..all).collect();
    let errors: Vec<usize> = joint.marginal.iter().map(|m| column(m.0)).collect();
    let stds: Vec<f64> = joint.marginal.iter().map(|m| m.1.std).collect();
    let exact = e.uncertainty.covariance.clone();
    let wide = consider(&exact, &a.select_columns(&estimated), &a.select_columns(&errors), &stds);
    (e.residuals, e.chi2_per_dof) = (told.estimate.residuals.clone(), told.estimate.chi2_per_dof);
    // What is stated.
    for (k, std) in e.uncertainty.deviation.iter_mut().enumerate() {
        *std = std.map(|_| wide.covariance[(k, k)].sqrt());
    }
    e.uncertainty.covariance = wide.covariance;
    let stds_of = &e.uncertainty.deviation;
    e.parameters.iter_mut().chain(&mut e.nuisance).zip(stds_of).for_each(|(p, std)| p.std = *std);
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
    let columns = own.selected.iter().enumerate().map(|(k, &i)| (k, &own.decls[i]));
    let mut budget = considered_budget(&columns.collect::<Vec<_>>(), &kinds, &e.uncertainty, &wide.sensitivity);
    if let Some(m) = &told.minima {
        let names: Vec<String> = e.uncertainty.unknowns.iter().map(|u| u.name.clone()).collect();
        e.uncertainty.covariance += m.moment(&names);
        let c = &e.uncertainty.covariance;
        let stds = e.uncertainty.deviation.iter_mut().enumerate();
        stds.for_each(|(k, std)| *std = std.map(|_| c[(k, k)].sqrt()));
        let stated = &e.uncertainty.deviation;
        e.parameters.iter_mut().chain(&mut e.nuisance).zip(stated).for_each(|(p, std)| p.std = *std);
        let std = |name: &str| e.parameters.iter().find(|p| p.name == name).and_then(|p| p.std);
        budget.iter_mut().for_each(|b| b.cover(std(&b.name).unwrap_or(b.std)));
    }
    let values = own.expand(&e.values)?;
    // Values of the mission, where the fit starts.
    for (p, &i) in e.parameters.iter_mut().zip(&own.selected) {
        p.start = own.start[i];
    }
    let fitted = Fitted {
        estimate: e,
        selected: own.selected.clone(),
        full,
        minima: told.minima.clone(),
        alone: None,
        bent: Vec::new(),
        reduced: None,
    };
    Ok(Considered { fitted, values, lines, budget })
}
