//! Modes of the free decay against those of the mission (rows D23 to D26): seen, missing, unexpected.

use super::case::Case;
use super::diagnosis::{Finding, Judgement, Topic};
use crate::open::Opened;
use crate::workflow::identify::decay::{DecayOutcome, decay_modes};
use crate::workflow::identify::{DecayModes, IdentifyError, LabelledRecord};
use ff_model::{Area, Params, Problem};

/// Ratio of the frequencies of a measured mode and the nearest one of the mission, beyond which it is unexpected: a stiffness wrong by
/// a factor of four.
const NEAR: f64 = 2.0;
/// Largest damping ratio of a mode that is believed to be one, and relative standard deviation of its frequency.
const DAMPED: f64 = 0.3;
const SURE: f64 = 0.05;

pub(super) fn findings(case: &Case<'_>, opened: &Opened) -> Result<Vec<Finding>, IdentifyError> {
    let nominal = Params::nominal(&opened.model);
    let labelled = LabelledRecord {
        label: case.label.to_owned(),
        record: case.record.clone(),
        resampled: (false, false),
        continues: false,
        ago: 0,
    };
    Ok(match decay_modes(&opened.model, nominal.values(), &labelled, &case.settings)? {
        DecayOutcome::None(why) => {
            let text = why.0.first().map_or_else(String::new, |p| p.message.clone());
            vec![case.finding(Topic::Modes, Judgement::Good, text)]
        }
        DecayOutcome::Found(modes, warnings) => {
            let mut out = of_decay(case, &modes);
            out.extend(
                warnings
                    .0
                    .into_iter()
                    .filter(|p| p.code == "Data::Aliasing")
                    .map(|p| case.finding(Topic::Modes, Judgement::Suspicious, p.message.clone()).raising(p)),
            );
            out
        }
    })
}

fn of_decay(case: &Case<'_>, d: &DecayModes) -> Vec<Finding> {
    let mut known: Vec<f64> = d.modes.iter().filter_map(|m| m.model_hz).collect();
    known.extend(d.unseen.iter().map(|u| u.frequency_hz));
    let mut out = Vec::new();
    let mut taken = Vec::new();
    for m in &d.modes {
        let hz = m.frequency_hz;
        let nearest = known.iter().copied().min_by(|a, b| (a / hz).ln().abs().total_cmp(&(b / hz).ln().abs()));
        let sure = m.damping_ratio < DAMPED && m.frequency_std_hz < SURE * hz;
        let by_products = m.note.starts_with("a product");
        if by_products {
            out.push(
                case.finding(Topic::Modes, Judgement::Good, format!("{hz:.4} Hz: {}", m.note)).figures(hz, 0.0, "Hz"),
            );
            continue;
        }
        match nearest.filter(|n| (n / hz).ln().abs() < NEAR.ln()) {
            Some(n) => {
                let of = m.model_hz.unwrap_or(n);
                taken.push(of);
                let text = format!("{hz:.4} Hz seen, the mission has {of:.4} Hz");
                out.push(case.finding(Topic::Modes, Judgement::Good, text).figures(hz, of, "Hz"));
            }
            None if sure => {
                let text = format!(
                    "{hz:.4} +- {:.4} Hz rings while the joints stand still, and no mode of the mission is within a factor of {NEAR} of it",
                    m.frequency_std_hz
                );
                let p = Problem::warning(Area::Data, "Data::UnexpectedMode", text.clone())
                    .on(case.label)
                    .hint("compare with ffid modes; an appendage may be missing from the mission");
                let expected = nearest.unwrap_or(0.0);
                out.push(
                    case.finding(Topic::Modes, Judgement::Suspicious, text).figures(hz, expected, "Hz").raising(p),
                );
            }
            None => {}
        }
    }
    for u in d.unseen.iter().filter(|u| !taken.contains(&u.frequency_hz)) {
        let text = format!("{:.4} Hz of the mission not seen: {}", u.frequency_hz, u.why);
        out.push(case.finding(Topic::Modes, Judgement::Good, text).figures(0.0, u.frequency_hz, "Hz"));
    }
    if out.is_empty() {
        out.push(case.finding(Topic::Modes, Judgement::Good, "nothing rings while the joints stand still"));
    }
    out
}
