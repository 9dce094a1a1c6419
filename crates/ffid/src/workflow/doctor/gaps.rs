//! Samples that are missing or late, as reading the file found them (rows D13 and D14).

use super::case::Case;
use super::diagnosis::{Finding, Judgement, Topic};
use super::level::step;
use crate::workflow::identify::LabelledRecord;
use ff_model::diagnostics::Severity;
use ff_model::{Problem, Problems};
use nalgebra::DVectorView;

/// Codes of what reading says about sample times.
const CODES: [&str; 6] =
    ["Data::Dropped", "Data::Gap", "Data::Jitter", "Data::Merged", "Data::Resampled", "Data::Segments"];
/// What is right as it is: columns that are not used, groups with times of their own.
const CARRIED: [&str; 2] = ["Data::NotUsed", "Data::SampledApart"];

pub(super) fn finding(case: &Case<'_>, warnings: Option<&Problems>) -> Finding {
    let r = case.record;
    let of_time: Vec<&str> =
        warnings.iter().flat_map(|w| &w.0).filter(|p| CODES.contains(&p.code)).map(|p| p.message.as_str()).collect();
    let rate = r.rate_hz();
    let head = format!("{} samples at {:.4} Hz, {:.3} s", r.samples(), rate, r.seconds());
    if of_time.is_empty() {
        return case.finding(Topic::Gaps, Judgement::Good, format!("{head}, without gaps"));
    }
    // The problem itself is among those of reading.
    case.finding(Topic::Gaps, Judgement::Suspicious, format!("{head}; {}", of_time.join("; ")))
}

/// Everything else that reading warned of; joints that stand still are named by the excitation, and readings that are held at the end of a
/// range are no end of the sensor.
pub(super) fn others(labelled: &LabelledRecord, warnings: Option<&Problems>, own: &[Finding]) -> Vec<Finding> {
    let other =
        |p: &&Problem| p.severity == Severity::Warning && !CODES.contains(&p.code) && !CARRIED.contains(&p.code);
    let of = |p: &Problem, head: &str| p.object.as_deref().is_some_and(|o| o.starts_with(head));
    let is_held = |f: &Finding| f.problem.as_ref().is_some_and(|p| p.code == "Data::HeldReadings");
    let held = |p: &Problem| own.iter().filter(|f| is_held(f)).any(|f| f.channel.as_deref().is_some_and(|c| of(p, c)));
    // A joint stands still where it likes, at the end of its travel as well.
    let rests = |p: &Problem| of(p, "q.") && ["Data::Stuck", "Data::Saturated"].contains(&p.code);
    // Nor is it a spike that the last digit of an encoder flickers while the joint rests.
    let flickers = |p: &Problem| {
        let of_joint = |(name, _): &(&String, DVectorView<'_, f64>)| p.object.as_deref() == Some(&format!("q.{name}"));
        let joints = labelled.record.joint_names().iter().zip(labelled.record.q().column_iter());
        p.code == "Data::Spikes" && joints.filter(of_joint).any(|(_, q)| step(q) > 0.0)
    };
    let known = |p: &Problem| rests(p) || flickers(p) || p.code == "Data::Saturated" && held(p);
    let one = |p: &Problem| Finding {
        channel: p.object.clone(),
        ..Finding::new(&labelled.label, Topic::Sensors, Judgement::Suspicious, &p.message)
    };
    warnings.iter().flat_map(|w| &w.0).filter(other).filter(|p| !known(p)).map(one).collect()
}
