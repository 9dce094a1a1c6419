//! What was not known exactly, and which part of the uncertainty of the estimates is due to it.

use super::fit::Method;
use super::identification::IdentificationResult;
use crate::workflow::identify::uncertain::{UncertainKind, UncertainUnknown};
use crate::workflow::identify::unknowns::Unknowns;
use ff_model::ParamDecl;
use ident::Uncertainty;
use ident::belief::{PriorGroup, prior_shares, tightened};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Factor by which a group of errors would be known better in what is proposed.
const BETTER: f64 = 1.0 / 3.0;
/// Part of a variance from which a group is worth a proposal.
const WORTH: f64 = 0.1;

/// Something that the mission is not sure of, before and after.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UncertainLine {
    /// Its name.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// What kind of thing it is.
    pub kind: UncertainKind,
    /// What the mission says: mean.
    pub prior_mean: f64,
    /// And standard deviation.
    pub prior_std: f64,
    /// What mission and record say together.
    pub value: f64,
    /// Its standard deviation; absent where it is not determined.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub std: Option<f64>,
}

/// Errors of sensors and placements that an identification found and all records share, as
/// [`crate::workflow::identify::Settings::held_errors`] takes them: those of the mission, and those that were adopted.
pub fn held_errors(r: &IdentificationResult) -> Vec<(String, f64)> {
    let declared = r.uncertain.iter().filter(|u| u.kind.is_shared()).map(|u| (u.name.clone(), u.value));
    let of_model = |name: &str| r.model.iter().any(|v| v.name == name);
    let adopted = r.parameters.iter().filter(|p| !of_model(&p.name)).map(|p| (p.name.clone(), p.value));
    declared.chain(adopted).chain(of_joints(r)).collect()
}

/// Friction and gains of joints that were estimated with nothing known of them: the calibration on the ground has its own.
fn of_joints(r: &IdentificationResult) -> impl Iterator<Item = (String, f64)> + '_ {
    let is = |name: &str| {
        let of_drive = name.strip_prefix("drive.").is_some_and(|n| n.ends_with(".gain") || n.ends_with(".inertia"));
        r.method == Method::OutputError && (of_drive || name.starts_with("friction."))
    };
    r.nuisance.iter().filter(move |p| is(&p.name)).map(|p| (p.name.clone(), p.value))
}

/// Where the variance of an estimate comes from. The parts add up to one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BudgetLine {
    /// The parameter.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Its standard deviation.
    pub std: f64,
    /// Part of the variance that is due to the noise of the sensors, and to what is not known of the estimated parameters themselves.
    pub noise: f64,
    /// Part of the variance that is due to other minima between which the record does not choose ([`crate::workflow::identify::Minima`]).
    #[serde(skip_serializing_if = "is_zero", default)]
    pub minima: f64,
    /// Part of the variance that is due to each kind of error, the largest first.
    pub errors: Vec<BudgetShare>,
    /// What would help most.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub better: Option<Better>,
}

/// A part of a variance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BudgetShare {
    /// Kind of error.
    pub kind: UncertainKind,
    /// Its part, 0 to 1.
    pub share: f64,
}

/// What an estimate would gain if something were known better.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Better {
    /// What.
    pub kind: UncertainKind,
    /// By which factor its standard deviations would shrink.
    pub factor: f64,
    /// Standard deviation of the estimate then.
    pub std: f64,
}

/// The errors of a fit whose unknowns are `selected`, and the budget of what was asked for. Where the covariance covers several minima, `alone` is that
/// about the lowest.
pub(in crate::workflow::identify) fn lines(
    unknowns: &Unknowns,
    selected: &[usize],
    values: &[f64],
    u: &Uncertainty,
    alone: Option<&Uncertainty>,
) -> (Vec<UncertainLine>, Vec<BudgetLine>) {
    let column = |i: usize| selected.iter().position(|&s| s == i);
    let of: Vec<(usize, &UncertainUnknown, f64)> =
        unknowns.marginal.iter().filter_map(|(i, what)| Some((column(*i)?, what, values[*i]))).collect();
    let line = |&(c, what, value): &(usize, &UncertainUnknown, f64)| UncertainLine {
        name: what.name.clone(),
        unit: what.unit.to_owned(),
        kind: what.kind,
        prior_mean: what.mean,
        prior_std: what.std,
        value,
        std: u.deviation[c],
    };
    let asked = selected.iter().enumerate().filter(|(_, i)| unknowns.is_asked(**i));
    let asked: Vec<(usize, &ParamDecl)> = asked.map(|(k, &i)| (k, &unknowns.decls[i])).collect();
    let errors: Vec<(usize, UncertainKind, f64)> = of.iter().map(|(c, what, _)| (*c, what.kind, what.std)).collect();
    let mut budget = budget(&asked, &errors, alone.unwrap_or(u));
    if alone.is_some() {
        let std = |name: &str| asked.iter().find(|a| a.1.name == name).and_then(|a| u.deviation[a.0]);
        budget.iter_mut().for_each(|b| b.cover(std(&b.name).unwrap_or(b.std)));
    }
    (of.iter().map(line).collect(), budget)
}

// The form that serde asks for.
#[expect(clippy::trivially_copy_pass_by_ref)]
fn is_zero(x: &f64) -> bool {
    *x == 0.0
}

impl BudgetLine {
    /// With a deviation that covers other minima as well: their part is what the others leave.
    pub(in crate::workflow::identify) fn cover(&mut self, std: f64) {
        let part = (self.std / std).powi(2).min(1.0);
        self.minima = 1.0 - part;
        self.noise *= part;
        self.errors.iter_mut().for_each(|e| e.share *= part);
        if let Some(better) = &mut self.better {
            better.std = (better.std.powi(2) + std.powi(2) - self.std.powi(2)).max(0.0).sqrt();
        }
        self.std = std;
    }
}

/// Where the variance of what is asked for comes from: columns of the covariance, of the errors with their kind and the deviation of
/// their prior. Empty where there is none.
pub(in crate::workflow) fn budget(
    asked: &[(usize, &ParamDecl)],
    errors: &[(usize, UncertainKind, f64)],
    u: &Uncertainty,
) -> Vec<BudgetLine> {
    let mut groups: Vec<(UncertainKind, PriorGroup)> = Vec::new();
    for &(c, kind, std) in errors {
        match groups.iter_mut().find(|g| g.0 == kind) {
            Some(g) => g.1.push((c, std)),
            None => groups.push((kind, vec![(c, std)])),
        }
    }
    let priors: Vec<PriorGroup> = groups.iter().map(|g| g.1.clone()).collect();
    let mut out = Vec::new();
    for &(k, decl) in asked.iter().filter(|_| !groups.is_empty()) {
        let Some(std) = u.deviation[k] else { continue };
        let shares = prior_shares(&u.covariance, k, &priors);
        let mut errors: Vec<BudgetShare> =
            groups.iter().zip(&shares).map(|(g, &share)| BudgetShare { kind: g.0, share }).collect();
        errors.sort_by(|a, b| b.share.total_cmp(&a.share));
        let then = |group: usize| tightened(&u.covariance, k, &priors[group], BETTER);
        let better = (0..groups.len())
            .filter(|&g| shares[g] > WORTH)
            .map(|g| Better { kind: groups[g].0, factor: 1.0 / BETTER, std: then(g) })
            .min_by(|a, b| a.std.total_cmp(&b.std));
        out.push(BudgetLine {
            name: decl.name.clone(),
            unit: decl.unit.to_owned(),
            std,
            noise: (1.0 - shares.iter().sum::<f64>()).max(0.0),
            minima: 0.0,
            errors,
            better,
        });
    }
    out
}

/// Where the variance of what is asked for comes from when errors were considered: their kinds with the deviation of each, and the
/// change of the estimate per unit of them.
pub(in crate::workflow) fn considered_budget(
    asked: &[(usize, &ParamDecl)],
    errors: &[(UncertainKind, f64)],
    u: &Uncertainty,
    sensitivity: &DMatrix<f64>,
) -> Vec<BudgetLine> {
    let mut out = Vec::new();
    for &(k, decl) in asked {
        let Some(std) = u.deviation[k] else { continue };
        let mut of_kind: BTreeMap<UncertainKind, f64> = BTreeMap::new();
        for (c, &(kind, prior)) in errors.iter().enumerate() {
            *of_kind.entry(kind).or_default() += (sensitivity[(k, c)] * prior / std).powi(2);
        }
        let mut shares: Vec<BudgetShare> =
            of_kind.into_iter().map(|(kind, share)| BudgetShare { kind, share }).collect();
        shares.sort_by(|a, b| b.share.total_cmp(&a.share));
        let then = |share: f64| std * (1.0 - (1.0 - BETTER * BETTER) * share).max(0.0).sqrt();
        let better = shares.first().filter(|s| s.share > WORTH);
        let better = better.map(|s| Better { kind: s.kind, factor: 1.0 / BETTER, std: then(s.share) });
        let noise = (1.0 - shares.iter().map(|s| s.share).sum::<f64>()).max(0.0);
        out.push(BudgetLine {
            name: decl.name.clone(),
            unit: decl.unit.to_owned(),
            std,
            noise,
            minima: 0.0,
            errors: shares,
            better,
        });
    }
    out
}
