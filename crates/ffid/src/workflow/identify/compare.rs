//! Which model: rigid, flexible, sloshing, or both? Every candidate is fitted to the same records, by the same method, and
//! judged by data that none of them has seen ([`ident::checks::compare`]).
//!
//! A candidate without some appendages has them frozen at rest, their inertia added to their hosts: what is left out is their
//! motion, not their mass.

use super::findings::{CandidateLine, ComparisonTable};
use super::result::Provenance;
use super::{Asked, Identified, IdentifyError, Method, Settings, Signals, Take, Watch, config, explain, identify};
use crate::open::Opened;
use ff_model::{Model, Params};
use ff_records::Record;
use ident::checks::compare::{Candidate, compare};

/// A model that may be compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Kind {
    /// Panels and fuel frozen.
    Rigid,
    /// Fuel frozen.
    Flexible,
    /// Panels frozen.
    Slosh,
    /// The mission as it is.
    Both,
}

impl Kind {
    /// All.
    pub const ALL: [Self; 4] = [Self::Rigid, Self::Flexible, Self::Slosh, Self::Both];
    /// Its name in results.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rigid => "rigid",
            Self::Flexible => "flexible",
            Self::Slosh => "slosh",
            Self::Both => "both",
        }
    }
    fn moves(self, kind: &str) -> bool {
        let (panel, fuel) = (matches!(kind, "flex_panel" | "modal"), kind.starts_with("slosh"));
        match self {
            Self::Both => true,
            Self::Rigid => !panel && !fuel,
            Self::Flexible => !fuel,
            Self::Slosh => !panel,
        }
    }
}

/// The model with the appendages frozen that a candidate does without; the same model when it does without none.
fn without(model: &Model, kind: Kind) -> Result<Model, IdentifyError> {
    let params = Params::nominal(model);
    let refused = IdentifyError::Refused;
    let put = |to: &mut Model, keep: bool| -> Result<(), IdentifyError> {
        for (k, a) in model.appendages().iter().enumerate() {
            if kind.moves(a.decl().kind) == keep {
                to.mount(a.name.clone(), a.host, a.mount, a.appendage.clone()).map_err(refused)?;
                let first = to.appendages().last().map_or(0, |a| a.param_offset);
                let values: Vec<(usize, f64)> =
                    params.appendage(model, k).iter().enumerate().map(|(i, v)| (first + i, *v)).collect();
                to.set_nominal(&values).map_err(refused)?;
            }
        }
        Ok(())
    };
    let mut still = model.without_appendages();
    put(&mut still, false)?;
    let mut out = still.frozen(&Params::nominal(&still));
    put(&mut out, true)?;
    Ok(out)
}

/// The candidates that a mission has: those that differ from one another, in order of what moves.
pub fn candidates(model: &Model, asked: &[Kind]) -> Vec<Kind> {
    let moving = |k: Kind| -> Vec<bool> { model.appendages().iter().map(|a| k.moves(a.decl().kind)).collect() };
    let mut out: Vec<Kind> = Vec::new();
    // The whole mission comes last and is named by what it has.
    for k in Kind::ALL {
        if asked.contains(&k) && !out.iter().any(|o| moving(*o) == moving(k)) {
            out.push(k);
        }
    }
    out
}

/// What every candidate is fitted to and judged by.
pub struct Trial<'a> {
    /// The mission.
    pub opened: &'a Opened,
    /// Records that are fitted.
    pub takes: &'a [Take],
    /// The record that judges.
    pub held: &'a Record,
    /// Where it is from, in words.
    pub source: &'a str,
    /// Whether it begins in the middle of a motion.
    pub moving: bool,
    /// Settings of the fit.
    pub settings: &'a Settings,
}

/// Fits and judges. The fits are those of output error, rigid ones too, so that all predict the same channels.
///
/// # Errors
/// [`IdentifyError`]; fewer than two candidates are refused.
pub fn judge(
    trial: &Trial<'_>,
    kinds: &[Kind],
    provenance: &Provenance,
    watch: &Watch<'_>,
) -> Result<ComparisonTable, IdentifyError> {
    let model = &trial.opened.model;
    let kinds = candidates(model, kinds);
    if kinds.len() < 2 {
        let what =
            "fewer than two models to compare: the mission has neither panels nor fuel, or one kind was asked for";
        return Err(IdentifyError::Refused(config("Config::Compare", what, "name appendages in the mission file")));
    }
    let s = Settings { method: Some(Method::OutputError), ..trial.settings.clone() };
    let mut all = Vec::new();
    for kind in kinds {
        all.push(one(trial, kind, &s, provenance, watch)?);
    }
    let hint = "hold out more, or another record";
    let found = compare(&all).map_err(|e| IdentifyError::Refused(config("Config::Compare", e.to_string(), hint)))?;
    let line = |j: &ident::checks::compare::Judged| CandidateLine {
        name: j.name.clone(),
        unknowns: j.estimated,
        aic: j.aic,
        bic: j.bic,
        held_out: j.held_out,
        held_out_std: j.held_out_std,
        held_out_mean_square: j.held_out_mean_square,
    };
    Ok(ComparisonTable {
        candidates: found.candidates.iter().map(line).collect(),
        recommended: found.recommended,
        reason: found.reason,
        explains: found.explains,
        judged_by: trial.source.to_owned(),
    })
}

fn one(
    trial: &Trial<'_>,
    kind: Kind,
    s: &Settings,
    provenance: &Provenance,
    watch: &Watch<'_>,
) -> Result<Candidate, IdentifyError> {
    let whole = &trial.opened.model;
    let model = without(whole, kind)?;
    let names: Vec<String> = whole.param_decls().iter().map(|d| d.name.clone()).collect();
    let wanted: Vec<&str> = trial.opened.estimated.iter().map(|&i| names[i].as_str()).collect();
    let estimated = (0..model.n_params()).zip(model.param_decls()).filter(|(_, d)| wanted.contains(&d.name.as_str()));
    let estimated: Vec<usize> = estimated.map(|(i, _)| i).collect();
    if estimated.is_empty() {
        let what = format!("the {} model has none of the parameters to estimate", kind.name());
        return Err(IdentifyError::Refused(config("Config::Compare", what, "estimate base.* as well")));
    }
    let opened = Opened { model, estimated, ..trial.opened.clone() };
    let Identified { values, signals, result, .. } =
        identify(&opened, trial.takes, s, &Asked::default(), provenance.clone(), watch)?;
    let own = Settings { initial_state: s.initial_state || trial.moving, ..s.clone() };
    let (_, held) = explain(&opened.model, &values, None, trial.held, &own, trial.source, watch)?;
    Ok(Candidate {
        name: kind.name().to_owned(),
        estimated: result.rank,
        training: signals.iter().flat_map(whitened).collect(),
        held_out: whitened(&held),
    })
}

/// Residuals over the noise, sample after sample.
fn whitened(s: &Signals) -> Vec<f64> {
    let k = s.names.len();
    (0..s.time.len() * k)
        .map(|i| (i / k, i % k))
        .map(|(i, j)| (s.predicted[(i, j)] - s.measured[(i, j)]) / s.sigma[j])
        .collect()
}
