//! What was not known exactly, and which part of the uncertainty of the estimates is due to it.

use super::identification::IdentificationResult;
use crate::workflow::identify::uncertain::{UncertainKind, UncertainUnknown};
use crate::workflow::identify::unknowns::Unknowns;
use ident::Uncertainty;
use ident::belief::{PriorGroup, prior_shares, tightened};
use serde::{Deserialize, Serialize};

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
    declared.chain(adopted).collect()
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

/// The errors of a fit whose unknowns are `selected`, and the budget of what was asked for.
pub(in crate::workflow::identify) fn lines(
    unknowns: &Unknowns,
    selected: &[usize],
    values: &[f64],
    u: &Uncertainty,
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
    let mut groups: Vec<(UncertainKind, PriorGroup)> = Vec::new();
    for (c, what, _) in &of {
        match groups.iter_mut().find(|g| g.0 == what.kind) {
            Some(g) => g.1.push((*c, what.std)),
            None => groups.push((what.kind, vec![(*c, what.std)])),
        }
    }
    let priors: Vec<PriorGroup> = groups.iter().map(|g| g.1.clone()).collect();
    let mut budget = Vec::new();
    for (k, &i) in selected.iter().enumerate().filter(|(_, i)| !groups.is_empty() && unknowns.is_asked(**i)) {
        let Some(std) = u.deviation[k] else { continue };
        let shares = prior_shares(&u.covariance, k, &priors);
        let mut errors: Vec<BudgetShare> =
            groups.iter().zip(&shares).map(|(g, &share)| BudgetShare { kind: g.0, share }).collect();
        errors.sort_by(|a, b| b.share.total_cmp(&a.share));
        let then = |k_group: usize| tightened(&u.covariance, k, &priors[k_group], BETTER);
        let better = (0..groups.len())
            .filter(|&g| shares[g] > WORTH)
            .map(|g| Better { kind: groups[g].0, factor: 1.0 / BETTER, std: then(g) })
            .min_by(|a, b| a.std.total_cmp(&b.std));
        budget.push(BudgetLine {
            name: unknowns.decls[i].name.clone(),
            unit: unknowns.decls[i].unit.to_owned(),
            std,
            noise: (1.0 - shares.iter().sum::<f64>()).max(0.0),
            errors,
            better,
        });
    }
    (of.iter().map(line).collect(), budget)
}
