//! What is wrong with a record before anything is fitted: units, axes, signs, rest, excitation, noise, gaps, clocks, modes.
//!
//! One simulation of the mission's values along the recorded joint motion says what torques and gyro should have read. A wrong unit, sign or
//! axis is far from that by a factor, a sign or a permutation; a mission whose masses are wrong threefold or whose stiffness is wrong
//! fivefold is not.
//!
//! ```text
//! diagnose            everything; for `ffid doctor`
//!   case, level       one record as every part sees it; noise and steps of its channels
//!   gaps, sampling    sample times and what reading warned of; readings of a slower sensor, each once (held: as warnings)
//!   excitation        which joints move; nothing moves
//!   noise             differences of neighbours against [sensors]; steps of the readings
//!   rest              rates of joints and base at the first samples
//!   prediction        torques and gyro at the values of the mission
//!   dead, clipped     channels that say nothing, or stay at the end of their range, while the prediction goes on
//!   quick_fit         a few steps over the thinned record: how near the mission can come to it
//!   hypotheses        where it cannot: candidates, errors of outputs (mismatch) and of joint motion (motion_error), each put right;
//!                     then turns and gains of sensors (sensor_errors)
//!   units, words      factors of units; hypotheses as findings
//!   told              signs and columns that the record does not tell
//!   clocks, modes     ident::checks
//!   prior             the values of the mission against the record
//! before_fit          what would make a fit useless, in a fraction of its time, and noise that is another; for `ffid identify`
//! columns             units, axes and signs of a record that a fit does not come near; for `ffid identify`
//! likelier_columns    signs and orders of columns at the values of a fit that does not explain it; for `ffid identify`
//! standing_still      the same of an arm on the ground, whose torques are not predicted
//! ```
mod candidates;
mod case;
mod clipped;
mod clocks;
mod dead;
mod diagnosis;
mod excitation;
mod gaps;
mod held;
mod hypotheses;
mod late;
mod level;
mod mismatch;
mod modes;
mod motion_error;
mod noise;
mod prediction;
mod prior;
mod quick_fit;
mod rest;
mod sampling;
mod sensor_errors;
mod text;
mod told;
mod units;
mod words;

pub use diagnosis::{Diagnosis, Finding, Judgement, Topic};

use super::identify::{IdentifyError, LabelledRecord, Method, Settings, behind_gears, method, segments};
use crate::open::Opened;
use case::{Case, Scales};
use ff_model::{Area, Model, Params, Problem, Problems};
use ff_records::Record;
use prediction::Prediction;
use std::borrow::Cow;

/// The record as it is judged: on one clock, for factors, signs and axes, which interpolation leaves.
fn on_one_clock(labelled: &LabelledRecord) -> Result<Cow<'_, Record>, IdentifyError> {
    if labelled.record.is_uniform() {
        return Ok(Cow::Borrowed(&labelled.record));
    }
    labelled.record.bridged().map(Cow::Owned).map_err(|e| {
        let p = Problem::error(Area::Data, "Data::TimeBase", e.to_string()).on(&labelled.label);
        IdentifyError::Refused(Problems(vec![p.hint("cut the record to what all channels cover")]))
    })
}

/// The record with torques of the bodies in place of what is read on the motor's side, at the values of the mission; settings and gains of a fit of it.
/// As it is on a base that is bolted down, and where its motion cannot be followed, which the prediction says.
fn torques_behind<'r>(
    opened: &Opened,
    record: &'r Record,
    s: &Settings,
) -> (Cow<'r, Record>, Settings, Vec<Option<f64>>) {
    let model = &opened.model;
    let plain = || (Cow::Borrowed(record), s.clone(), Vec::new());
    if !is_predicted(model, s) {
        return plain();
    }
    behind_gears(model, Params::nominal(model).values(), record, s).unwrap_or_else(|_| plain())
}

/// Whether torques and gyro follow from a simulation: not on a base that is bolted down, whose joints have friction.
fn is_predicted(model: &Model, s: &Settings) -> bool {
    method(model, s.method) != Method::Ground
}

/// Judges records by the values of the mission. `warnings` are those of reading, a list for each record. Allocates.
///
/// # Errors
/// [`IdentifyError::Refused`] for records of another robot, or on several clocks. What is wrong with a record is no error here:
/// [`Diagnosis::problems`].
pub fn diagnose(
    opened: &Opened,
    records: &[LabelledRecord],
    warnings: &[Problems],
    settings: &Settings,
) -> Result<Diagnosis, IdentifyError> {
    let mut findings = Vec::new();
    for (k, whole) in records.iter().enumerate() {
        // Nothing is predicted across a gap that the motion cannot be told across: one part is judged.
        let cut = segments(&whole.label, &whole.record)?;
        let said = Problems([warnings.get(k).map_or(&[][..], |w| &w.0), &cut.warnings.0].concat());
        let &LabelledRecord { ref label, resampled, continues, ago, .. } = whole;
        let record = cut.main().unwrap_or_else(|| whole.record.clone());
        let labelled = &LabelledRecord { label: label.clone(), record, resampled, continues, ago };
        let own = judged(opened, labelled, Some(&said), settings)?;
        // What reading warned of may follow from what is wrong.
        if own.iter().all(|f| f.judgement != Judgement::Wrong) {
            findings.extend(gaps::others(labelled, Some(&said), &own));
        }
        findings.extend(own);
    }
    Ok(Diagnosis::new(opened.model.name(), findings))
}

/// What is asked of a record as every part of the doctor sees it.
fn as_case<V>(
    opened: &Opened,
    labelled: &LabelledRecord,
    settings: &Settings,
    of: impl FnOnce(&Case<'_>) -> Result<V, IdentifyError>,
) -> Result<V, IdentifyError> {
    let even = on_one_clock(labelled)?;
    let (even, own, gains) = torques_behind(opened, &even, settings);
    let jumps = own.drives.len() < settings.drives.len() || !gains.is_empty();
    of(&Case { gains, ..Case::new(opened, labelled, &even, (&own, settings), jumps)? })
}

/// Findings on one record.
fn judged(
    opened: &Opened,
    labelled: &LabelledRecord,
    warnings: Option<&Problems>,
    settings: &Settings,
) -> Result<Vec<Finding>, IdentifyError> {
    as_case(opened, labelled, settings, |case| findings_on(case, opened, settings, warnings))
}

fn findings_on(
    case: &Case<'_>,
    opened: &Opened,
    settings: &Settings,
    warnings: Option<&Problems>,
) -> Result<Vec<Finding>, IdentifyError> {
    let mut findings = vec![gaps::finding(case, warnings)];
    findings.extend(held::findings(case));
    let moves = excitation::findings(case);
    let still = moves.iter().any(|f| f.judgement == Judgement::Wrong);
    findings.extend(moves);
    if still || !is_predicted(&opened.model, settings) {
        findings.extend(noise::findings(case, &Scales::none(case)));
        return Ok(findings);
    }
    let predicted = Prediction::new(case, case.record);
    let dead = predicted.as_ref().map_or_else(|_| Vec::new(), |p| dead::findings(case, p));
    if !dead.is_empty() {
        // Nothing is told from what the others read of a base that has an axis too few.
        findings.extend(dead);
        return Ok(findings);
    }
    let found = hypotheses::findings(case);
    let of_positions = |f: &Finding| f.channel.as_deref().is_some_and(|c| c == "q" || c.starts_with("q."));
    let noise = noise::findings(case, &found.scales);
    findings.extend(noise.into_iter().filter(|f| found.motion_is_right || !of_positions(f)));
    if found.motion_is_right {
        findings.extend(rest::findings(case, predicted.as_ref().ok(), found.starts_in_motion));
    }
    let right = !found.findings.iter().any(|f| f.judgement == Judgement::Wrong);
    findings.extend(found.findings);
    // What is predicted wrongly tells nothing of clocks, modes and values.
    if !right {
        return Ok(findings);
    }
    match (predicted, &found.fit) {
        (Ok(p), Some(fit)) => {
            let at_the_end = clipped::judged(case, &p, fit);
            if !at_the_end.is_empty() {
                findings.extend(at_the_end);
                return Ok(findings);
            }
            findings.extend(clocks::findings(case, fit));
            // Noise that is larger than stated looks like what was aliased.
            let noisy = findings.iter().any(|f| f.topic == Topic::Noise && f.judgement != Judgement::Good);
            let aliased = |f: &Finding| f.problem.as_ref().is_some_and(|p| p.code == "Data::Aliasing");
            findings.extend(modes::findings(case, opened)?.into_iter().filter(|f| !(noisy && aliased(f))));
            let bad = |f: &&Finding| f.record == case.label && f.judgement != Judgement::Good;
            let explained = findings.iter().filter(bad).any(|f| f.topic != Topic::Sensors);
            findings.push(prior::finding(case, &p, fit, explained));
        }
        (Err(e), _) => findings.push(prediction::failed(case, &e.to_string())),
        (_, None) => findings.push(prediction::failed(case, "a quick fit failed")),
    }
    Ok(findings)
}

/// Joints of a record that stand still, where that matters: on the ground, and where no joint moves and outputs change all the same. To be asked
/// before the motion passes a filter, whose output has less noise than what it travels. Allocates.
///
/// # Errors
/// [`IdentifyError::IllPosed`] when nothing moves; [`IdentifyError::Refused`] for the record of another robot, or on several clocks.
pub fn standing_still(
    opened: &Opened,
    labelled: &LabelledRecord,
    settings: &Settings,
) -> Result<Problems, IdentifyError> {
    let even = on_one_clock(labelled)?;
    moving(&Case::new(opened, labelled, &even, (settings, settings), false)?)
}

fn moving(case: &Case<'_>) -> Result<Problems, IdentifyError> {
    let found = Problems(excitation::findings(case).into_iter().filter_map(|f| f.problem).collect());
    if found.has_errors() { Err(IdentifyError::IllPosed(found)) } else { Ok(found) }
}

/// Problems of a record that would make a fit useless: nothing moves, a unit, a sign or axes are wrong; and noise that is far from what the
/// mission says, as a warning: deviations and tests are those of the noise that is given. One simulation, and two more where
/// its outputs are far from the prediction. Nothing is asked of the record of a base that is bolted down: see [`standing_still`]. Allocates.
///
/// # Errors
/// [`IdentifyError::IllPosed`] when nothing moves; [`IdentifyError::Refused`] for the record of another robot, or on several clocks.
pub fn before_fit(opened: &Opened, labelled: &LabelledRecord, settings: &Settings) -> Result<Problems, IdentifyError> {
    // Units, signs and axes are those of the part that the record begins with.
    if labelled.continues || !is_predicted(&opened.model, settings) {
        return Ok(Problems::default());
    }
    as_case(opened, labelled, settings, useless)
}

/// See [`before_fit`].
fn useless(case: &Case<'_>) -> Result<Problems, IdentifyError> {
    let mut found = moving(case)?;
    let is_wrong = |f: &Finding| f.judgement == Judgement::Wrong;
    let wrong = |f: Finding| f.problem.filter(|_| f.judgement == Judgement::Wrong);
    let predicted = Prediction::new(case, case.record);
    if let Ok(p) = &predicted {
        let dead = dead::findings(case, p);
        if !dead.is_empty() {
            found.0.extend(dead.into_iter().filter_map(wrong));
            return Ok(found);
        }
    }
    let of_outputs = hypotheses::before_fit(case, predicted.as_ref().ok());
    // What is off by a factor has the noise of another unit.
    if !of_outputs.iter().any(is_wrong) {
        let noise = noise::findings(case, &Scales::none(case));
        found.0.extend(noise.into_iter().filter_map(|f| f.problem));
    }
    found.0.extend(of_outputs.into_iter().filter_map(wrong));
    Ok(found)
}

/// What of units, axes and signs of a record speaks against it, as thorough as [`diagnose`]: to be asked where a fit leads nowhere. Takes a second
/// for each minute of the record, or a few. Nothing is asked of a part behind a gap, and of a base that is bolted down. Allocates.
///
/// # Errors
/// [`IdentifyError::Refused`] for the record of another robot, or on several clocks. What is wrong with the record is no error here.
pub fn columns(opened: &Opened, labelled: &LabelledRecord, settings: &Settings) -> Result<Problems, IdentifyError> {
    let problems =
        |case: &Case<'_>| hypotheses::findings(case).findings.into_iter().filter_map(|f| f.problem).collect();
    on_columns(opened, labelled, settings, problems)
}

/// Signs and orders of columns with which a record would be likelier at the values of a fit that does not explain it, down to the noise of the
/// sensors. Allocates.
///
/// # Errors
/// As [`columns`].
pub fn likelier_columns(
    opened: &Opened,
    labelled: &LabelledRecord,
    settings: &Settings,
    values: &[f64],
) -> Result<Problems, IdentifyError> {
    on_columns(opened, labelled, settings, |case| {
        let thin = quick_fit::thinned(case, case.record);
        thin.and_then(|thin| told::behind_fit(case, &thin, values)?.problem).into_iter().collect()
    })
}

fn on_columns(
    opened: &Opened,
    labelled: &LabelledRecord,
    settings: &Settings,
    of: impl Fn(&Case<'_>) -> Vec<Problem>,
) -> Result<Problems, IdentifyError> {
    if labelled.continues || !is_predicted(&opened.model, settings) {
        return Ok(Problems::default());
    }
    as_case(opened, labelled, settings, |case| Ok(Problems(of(case))))
}
