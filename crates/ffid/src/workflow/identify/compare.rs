//! Comparison of model variants: rigid, flexible, sloshing, or both. Every variant is fitted to the same records, by the same
//! method, and judged by data that none of them has seen ([`ident::checks::compare`]).

use super::error::{IdentifyError, config};
use super::findings::{CandidateLine, ComparisonTable};
use super::held_out::predict_held_out;
use super::identified::Identified;
use super::labelled_record::LabelledRecord;
use super::observed_estimator::Observer;
use super::options::FitOptions;
use super::result::fit::Method;
use super::result::provenance::Provenance;
use super::run::identify;
use super::settings::Settings;
use super::signals::Signals;
use crate::open::Opened;
use ff_records::Record;
use ident::checks::ModelVariant;
use ident::checks::compare::{Candidate, compare};

/// Data and settings that all variants share.
pub struct Comparison<'a> {
    /// The mission.
    pub opened: &'a Opened,
    /// Records that are fitted.
    pub records: &'a [LabelledRecord],
    /// The held-out record.
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
/// [`IdentifyError`]; fewer than two distinct variants are refused.
pub fn compare_variants(
    data: &Comparison<'_>,
    variants: &[ModelVariant],
    provenance: &Provenance,
    watch: &Observer<'_>,
) -> Result<ComparisonTable, IdentifyError> {
    let model = &data.opened.model;
    let variants = ModelVariant::distinct(model, variants);
    if variants.len() < 2 {
        let what =
            "fewer than two models to compare: the mission has neither panels nor fuel, or one kind was asked for";
        return Err(IdentifyError::Refused(config("Config::Compare", what, "name appendages in the mission file")));
    }
    let s = Settings { method: Some(Method::OutputError), ..data.settings.clone() };
    let mut all = Vec::new();
    for variant in variants {
        all.push(one(data, variant, &s, provenance, watch)?);
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
        judged_by: data.source.to_owned(),
    })
}

fn one(
    data: &Comparison<'_>,
    variant: ModelVariant,
    s: &Settings,
    provenance: &Provenance,
    watch: &Observer<'_>,
) -> Result<Candidate, IdentifyError> {
    let whole = &data.opened.model;
    let model = variant.of(whole).map_err(IdentifyError::Refused)?;
    let names: Vec<String> = whole.param_decls().iter().map(|d| d.name.clone()).collect();
    let wanted: Vec<&str> = data.opened.estimated.iter().map(|&i| names[i].as_str()).collect();
    let estimated = (0..model.n_params()).zip(model.param_decls()).filter(|(_, d)| wanted.contains(&d.name.as_str()));
    let estimated: Vec<usize> = estimated.map(|(i, _)| i).collect();
    if estimated.is_empty() {
        let what = format!("the {} model has none of the parameters to estimate", variant.name());
        return Err(IdentifyError::Refused(config("Config::Compare", what, "estimate base.* as well")));
    }
    let opened = Opened { model, estimated, ..data.opened.clone() };
    let Identified { values, signals, result, .. } =
        identify(&opened, data.records, s, &FitOptions::default(), provenance.clone(), watch)?;
    let own = Settings { initial_state: s.initial_state || data.moving, ..s.clone() };
    let (_, held) = predict_held_out(&opened.model, &values, None, data.held, &own, data.source, watch)?;
    Ok(Candidate {
        name: variant.name().to_owned(),
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
