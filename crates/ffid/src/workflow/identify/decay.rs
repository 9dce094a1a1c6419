//! Modes of the free decay in a record as lines of the result ([`ident::checks::free_decay`]).

use super::error::IdentifyError;
use super::findings::{DecayMode, DecayModes, UnseenMode};
use super::labelled_record::LabelledRecord;
use super::record_estimator::sigmas;
use super::settings::Settings;
use crate::open::MAX_DENSE;
use ff_model::{Area, Model, Problem, Problems};
use ff_records::Record;
use ff_spectral::modal::ModalError;
use ff_spectral::psd::PsdError;
use ident::checks::{ALIASED, FreeDecay, FreeDecayError, free_decay};
use ident::modal::Stray;

/// Modes of a free decay, or why there are none.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum DecayOutcome {
    /// Modes.
    Found(Box<DecayModes>, Problems),
    /// None, and why: problems of area data, whose first code is that of `bad-inputs.md` (rows D23 to D25).
    None(Problems),
}

fn none(code: &'static str, what: String, hint: &str) -> DecayOutcome {
    DecayOutcome::None(Problems(vec![Problem::error(Area::Data, code, what).hint(hint)]))
}

/// Looks for the modes of the free decay in a record and matches them to those of the model at `values`. Allocates.
pub(crate) fn decay_modes(
    model: &Model,
    values: &[f64],
    labelled: &LabelledRecord,
    s: &Settings,
) -> Result<DecayOutcome, IdentifyError> {
    if model.nv() > MAX_DENSE {
        return refusal(FreeDecayError::NoPassiveCoordinates);
    }
    let Ok(even) = labelled.record.bridged() else { return refusal(FreeDecayError::NoPassiveCoordinates) };
    let record = &even;
    let found = match free_decay(model, values, record, &sigmas(model, &s.noise)) {
        Ok(found) => found,
        Err(e) => return refusal(e),
    };
    let FreeDecay { samples: (from, to), fit, model_modes: known, matched, .. } = &found;
    let line = |i: usize| {
        let m = &fit.modes[i];
        let pair = matched.pairs.iter().find(|p| p.measured == i);
        DecayMode {
            frequency_hz: m.frequency,
            frequency_std_hz: m.frequency_deviation,
            damping_ratio: m.damping,
            damping_std: m.damping_deviation,
            model_hz: pair.map(|p| known[p.model].frequency()),
            model_damping: pair.map(|p| known[p.model].damping()),
            mac: pair.map(|p| p.mac),
            note: stray(&found, i),
        }
    };
    let lines = DecayModes {
        record: labelled.label.clone(),
        from_s: *from as f64 * record.dt(),
        to_s: *to as f64 * record.dt(),
        resolution_hz: fit.df,
        noise_ratio: fit.noise_ratio,
        modes: (0..fit.modes.len()).map(line).collect(),
        unresolved: fit.unresolved.iter().map(|u| (u.f1, u.f2)).collect(),
        unseen: matched
            .unseen
            .iter()
            .map(|(j, why)| UnseenMode { frequency_hz: known[*j].frequency(), why: why.words().to_owned() })
            .collect(),
    };
    Ok(DecayOutcome::Found(Box::new(lines), warnings(&found, record, &labelled.label)))
}

/// Modes that are too close, and channels that were not filtered before sampling (row D24).
fn warnings(found: &FreeDecay, record: &Record, label: &str) -> Problems {
    let mut out = Problems::default();
    for u in &found.fit.unresolved {
        let what = format!(
            "modes at {:.4} and {:.4} Hz are closer than the {:.4} Hz that the record keeps apart",
            u.f1, u.f2, u.df
        );
        let p = Problem::warning(Area::Data, "Data::Unresolved", what).on(label);
        out.push(p.hint("read their frequencies and damping together, or record a longer decay"));
    }
    let loud: Vec<String> =
        found.aliased.iter().map(|(share, name)| format!("{:.1} % of {name}", 100.0 * share)).collect();
    if !loud.is_empty() {
        let what = format!(
            "above {:.3} Hz, nine tenths of half the rate, lies {} (limit {} %): what is faster than half the rate appears slower, and may \
             pass for a mode",
            0.45 * record.rate_hz(),
            ff_model::diagnostics::list(loud.iter().map(String::as_str), 6),
            100.0 * ALIASED
        );
        let hint = "sample faster, or behind an anti-alias filter";
        out.push(Problem::warning(Area::Data, "Data::Aliasing", what).on(label).hint(hint));
    }
    out
}

/// What a measured mode is that the model has not.
fn stray(found: &FreeDecay, i: usize) -> String {
    match found.matched.strays.iter().find(|s| s.0 == i).map(|s| &s.1) {
        None => String::new(),
        Some(Stray::Combination { of }) => {
            let hz = |k: usize| found.fit.modes[k].frequency;
            format!("a product of {:.4} and {:.4} Hz, not a mode", hz(of.0), hz(of.1))
        }
        Some(Stray::NoCounterpart { nearest, mac }) => match nearest {
            Some(f) => format!("not in the model (nearest {f:.4} Hz, MAC {mac:.2})"),
            None => "not in the model".to_owned(),
        },
    }
}

fn refusal(e: FreeDecayError) -> Result<DecayOutcome, IdentifyError> {
    Ok(match e {
        FreeDecayError::NoPassiveCoordinates => {
            none("Data::NoDecay", "the model has nothing that rings".into(), "leave --modes out")
        }
        FreeDecayError::NoOscillation => {
            none("Data::NoDecay", "no mode of the model oscillates".into(), "leave --modes out")
        }
        FreeDecayError::TimeBase(e) => none("Data::TimeBase", e.to_string(), "bring the record to one clock"),
        FreeDecayError::TooShort { longest, needed, slowest_hz, resolution_hz } => {
            let what = format!(
                "the joints stand still for {longest:.2} s at most; modes from {slowest_hz:.4} Hz need {needed:.2} s (a spectrum of \
                 that part resolves {resolution_hz:.4} Hz)"
            );
            none("Data::Resolution", what, "hold the joints longer after the motion, such as with --hold")
        }
        FreeDecayError::Model(e) => return Err(IdentifyError::Model(e.to_string())),
        FreeDecayError::Record(p) => return Err(IdentifyError::Refused(p)),
        FreeDecayError::Fit(e) => {
            let (code, hint) = match &e {
                ModalError::Signal(PsdError::Nyquist { .. }) => {
                    ("Data::Nyquist", "sample faster, or leave out the stiffest appendage")
                }
                ModalError::TooShort { .. } => ("Data::Resolution", "hold the joints longer after the motion"),
                ModalError::NoMode { .. } => ("Data::NoPeak", "excite more strongly before the joints stop"),
                ModalError::Linalg(_) | ModalError::Fit(_) => return Err(IdentifyError::Model(e.to_string())),
                _ => ("Data::NoDecay", "look at the record while the joints stand still"),
            };
            none(code, e.to_string(), hint)
        }
    })
}
