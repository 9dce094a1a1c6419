//! Predicted standard deviations, from the Jacobian of the fit that will be made.

use super::error::PreflightError;
use super::question::Question;
use super::world::columns;
use crate::workflow::identify::{BudgetLine, UncertainItems, UncertainKind, UncertainUnknown, variance_budget};
use excitation::system::prediction::{DERIVED, about_com};
use ff_dynamics::Trace;
use ff_model::{Dual, Model, ParamDecl};
use ident::Uncertainty;
use serde::Serialize;

/// How well a record will determine a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Determination {
    /// Its relative standard deviation is at most the threshold.
    Well,
    /// Its relative standard deviation is above the threshold.
    Weakly,
    /// It has a part in a combination on which the record is silent.
    NotAtAll,
}

/// The prediction for one quantity.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Predicted {
    /// Full name, such as `base.mass`.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Value at which it is predicted.
    pub value: f64,
    /// Standard deviation, in the unit; none when the record is silent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub std: Option<f64>,
    /// Standard deviation relative to the size of the parameter: its value, or for moments and products of inertia of
    /// a body its mass and radius of gyration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relative_std: Option<f64>,
    /// The verdict.
    pub told: Determination,
}

pub(super) struct Seen {
    pub(super) every: usize,
    pub(super) parameters: Vec<Predicted>,
    pub(super) derived: Vec<Predicted>,
    pub(super) nuisance: Vec<Predicted>,
    pub(super) uncertain: Vec<PredictedError>,
    pub(super) budget: Vec<BudgetLine>,
    /// What the record tells, priors of the errors as measurements.
    pub(super) uncertainty: Uncertainty,
    /// Together with what is known beforehand of what is requested.
    pub(super) known: Uncertainty,
}

/// Something that the mission is not sure of, before and after the record.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PredictedError {
    /// Its name.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// What kind of thing it is.
    pub kind: UncertainKind,
    /// Standard deviation that the mission gives.
    pub prior_std: f64,
    /// Standard deviation after the record; none where it is not determined.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub std: Option<f64>,
}

pub(super) fn predict(q: &Question<'_>, trace: &Trace, substeps: usize) -> Result<Seen, PreflightError> {
    let (model, n) = (q.model, q.selected.len());
    let exact = UncertainItems::default();
    let items = q.uncertain.unwrap_or(&exact);
    let told = columns(q, trace, substeps, items, None)?;
    let column = |p: &(usize, f64, f64)| Some((q.selected.iter().position(|&i| i == p.0)?, p.2));
    let before: Vec<(usize, f64)> = items.priors.iter().filter_map(column).collect();
    let (uncertainty, u) = told.uncertainty(&before)?;
    let one = |k: usize, value: f64| {
        let (unknown, std) = (&u.unknowns[k], u.deviation[k]);
        predicted(unknown.name.clone(), unknown.unit.clone(), value, std, unknown.size, q.weak)
    };
    let decls = model.param_decls();
    let asked: Vec<(usize, &ParamDecl)> = q.selected.iter().enumerate().map(|(k, &i)| (k, &decls[i])).collect();
    let errors: Vec<(usize, UncertainKind, f64)> = told.errors.iter().map(|(c, e)| (*c, e.kind, e.std)).collect();
    let error = |(c, e): &(usize, UncertainUnknown)| PredictedError {
        name: e.name.clone(),
        unit: e.unit.to_owned(),
        kind: e.kind,
        prior_std: e.std,
        std: u.deviation[*c],
    };
    let nuisance = n..u.unknowns.len() - errors.len();
    Ok(Seen {
        every: told.every,
        parameters: q.selected.iter().enumerate().map(|(k, &i)| one(k, q.params.values()[i])).collect(),
        derived: derived(model, q, &u),
        nuisance: nuisance.map(|k| one(k, 0.0)).collect(),
        uncertain: told.errors.iter().map(error).collect(),
        budget: variance_budget(&asked, &errors, &u),
        uncertainty,
        known: u,
    })
}

fn predicted(name: String, unit: String, value: f64, std: Option<f64>, size: f64, weak: f64) -> Predicted {
    let relative_std = std.map(|s| s / size);
    let told = match relative_std {
        None => Determination::NotAtAll,
        Some(r) if r > weak => Determination::Weakly,
        Some(_) => Determination::Well,
    };
    Predicted { name, unit, value, std, relative_std, told }
}

/// Centre of mass and inertia about it of every body whose ten parameters are estimated: the covariance carried through
/// their derivatives. The centre of mass may be determined where the inertia is not.
fn derived(model: &Model, q: &Question<'_>, u: &Uncertainty) -> Vec<Predicted> {
    let mut out = Vec::new();
    for body in 0..model.n_bodies() {
        let at: Vec<usize> =
            (10 * body..10 * body + 10).filter_map(|i| q.selected.iter().position(|&s| s == i)).collect();
        if at.len() < 10 {
            continue;
        }
        let values = &q.params.values()[10 * body..10 * body + 10];
        let phi: Vec<Dual<f64, 10>> = values.iter().enumerate().map(|(k, &x)| Dual::variable(x, k)).collect();
        let mass = values[0];
        let radius = ((values[4] + values[6] + values[9]).abs() / (2.0 * mass.abs())).sqrt();
        let prefix = if body == 0 { "base" } else { model.body_name(body) };
        for ((name, unit), y) in DERIVED.iter().zip(about_com(&phi)) {
            let mut gradient = vec![0.0; u.unknowns.len()];
            at.iter().zip(&y.eps).for_each(|(&k, &g)| gradient[k] = g);
            let std = u.combination(&gradient);
            // A product of inertia or an offset may be zero; the body's own length and inertia have a size.
            let size = if *unit == "m" { radius } else { mass * radius * radius };
            out.push(predicted(format!("{prefix}.{name}"), (*unit).to_owned(), y.re, std, size, q.weak));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_threshold_decides_what_is_weak() {
        let p = |std| predicted("x".into(), "kg".into(), 600.0, std, 600.0, 0.1).told;
        assert_eq!(
            [p(Some(59.0)), p(Some(61.0)), p(None)],
            [Determination::Well, Determination::Weakly, Determination::NotAtAll]
        );
    }
}
