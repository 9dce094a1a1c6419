//! `--consider`: what the mission is not sure of is held at its values, and widens the deviations ([`ident::belief::consider`]).
//!
//! The estimates are those of a fit that takes everything else as exact. Residuals are tested off the considered columns: at the end of a
//! fit that goes on from there with the errors among its unknowns, so that what errors within what the mission says explain of them is
//! left out. One step is not enough for that: where a gyro is turned, the estimates are too far off for the first linearisation.

use super::error::IdentifyError;
use super::report::Fitted;
use super::result::uncertain::{BudgetLine, UncertainLine, considered_budget};
use super::uncertain::UncertainKind;
use super::unknowns::Unknowns;
use ff_least_squares::{Settings as Solver, Tall, triangle_of};
use ident::belief::consider;
use ident::estimate::attempt;
use ident::{Estimator, Request};
use nalgebra::DMatrix;

/// What comes of a fit with considered errors.
pub(super) struct Joint {
    /// The fit with the errors among the unknowns, at whose end residuals are tested.
    pub(super) fitted: Fitted,
    /// All parameters of the model there.
    pub(super) values: Vec<f64>,
    pub(super) lines: Vec<UncertainLine>,
    pub(super) budget: Vec<BudgetLine>,
}

/// Widens the deviations of a fit over the unknowns `own` by the errors among `joint`, which `whole` has columns of, and takes out of
/// its residuals what these explain, by a fit with `settings`.
pub(super) fn widen(
    whole: &mut dyn Estimator,
    joint: &Unknowns,
    own: &Unknowns,
    fitted: &mut Fitted,
    settings: Solver,
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
    let request = Request {
        marginal: joint.marginal.iter().map(|m| (m.0, m.1.std)).collect(),
        priors: joint.priors(&joint.selected)?,
        settings,
        centre: Some(&joint.start),
        ..Request::new(&joint.decls, &joint.selected, &values)
    };
    let told = attempt(&request, whole)?;
    let of_model = joint.expand(&told.values)?;
    (e.residuals, e.chi2_per_dof) = (told.residuals.clone(), told.chi2_per_dof);
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
    let columns = fitted.selected.iter().enumerate().map(|(k, &i)| (k, &own.decls[i]));
    let budget = considered_budget(&columns.collect::<Vec<_>>(), &kinds, &e.uncertainty, &wide.sensitivity);
    let fitted = Fitted {
        estimate: told,
        selected: joint.selected.clone(),
        full: fitted.full.clone(),
        minima: None,
        reduced: None,
    };
    Ok(Joint { fitted, values: of_model, lines, budget })
}
