//! What would bring a record to its prediction: errors of its outputs, and errors of its joint motion, each of which is simulated.
//!
//! Every hypothesis is a record put right. They are ranked by the mean distance of torques and gyro from what the values of the mission
//! predict (see `candidates`), which takes one simulation; the first few are fitted quickly, and the best of these is taken if it leaves a
//! quarter of the misfit that the record leaves as it is. A base whose inertia is free follows a gyro in any unit: where the values of the
//! mission see the factor of a unit, hypotheses are asked as well.

use super::candidates::{Hypothesis, SIMPLER, is_plausible, mistakes, ranked, turns};
use super::case::{Case, Scales};
use super::diagnosis::{Finding, Judgement, Topic};
use super::late;
use super::mismatch::{Output, distance_with, explain, is_gyro_reversed, put_right};
use super::motion_error::MotionError;
use super::prediction::Prediction;
use super::prior::FAR_OFF;
use super::quick_fit::{FOLLOWS, QuickFit, quick_fit, thinned, tuned_starts};
use super::sensor_errors;
use super::told;
use super::words::{Grounds, findings_of, named};
use ff_model::Params;
use ff_records::Record;
use std::slice;

/// Mean distance below which nothing is looked for before a fit.
const EXPLAINED: f64 = 0.3;
/// What fits are compared by.
const MISFIT: &str = "the misfit of a quick fit";
/// Part of the mean distance that an error taken before a fit must leave at most, and the most that it may leave.
const BETTER: f64 = 0.4;
const LEFT: f64 = 0.35;
/// Samples below which a record has no shape to go by.
const FEWEST: usize = 100;
/// Part of the misfit that an error may leave.
const UNEXPLAINED: f64 = 0.25;
/// Starts that are tried where one from the values of the mission leads nowhere.
const TUNED: usize = 3;
/// Hypotheses that are fitted.
const FITTED: usize = 4;
/// Another hypothesis explains as much as the best where its misfit, or the misfit below which both follow, and its distance are no larger.
const RIVAL: f64 = 1.5;
const FOLLOWED: f64 = 1.0;
const NEARLY: f64 = 0.02;
/// Mean square of the signals over what a quick fit is to follow them to, below which it explains nothing.
const HEARD: f64 = 5.0;
/// Masses and moments of inertia of a quick fit beyond this ratio to those of the mission are no fit, if a unit brings them half the way back.
const STRAYS: f64 = 4.0;

/// Findings on units, axes and signs.
pub(super) struct Hypotheses {
    pub(super) findings: Vec<Finding>,
    pub(super) scales: Scales,
    /// With base rate and passive state at the first sample estimated, the record is explained, and by nothing else.
    pub(super) starts_in_motion: bool,
    /// Units of positions and time are right.
    pub(super) motion_is_right: bool,
    /// Of the record as it is.
    pub(super) fit: Option<QuickFit>,
}

/// What makes a fit useless, by the values of the mission alone; `predicted` is absent where the record as it is cannot be simulated.
pub(super) fn before_fit(case: &Case<'_>, predicted: Option<&Prediction>) -> Vec<Finding> {
    if case.record.samples() < FEWEST {
        return Vec::new();
    }
    let price = |motion, outputs: &[Output]| SIMPLER.powi(mistakes(motion, outputs, case.record.joints()));
    let own = predicted.map(|p| explain(case.record, p));
    let (before, left) = own.as_ref().map_or((f64::INFINITY, 2.0), |e| (e.before, e.after));
    let mut least = own.as_ref().map_or(2.0, |e| e.after * price(MotionError::None, &e.outputs));
    let mut best = (MotionError::None, own);
    if left > EXPLAINED
        && let Some(thin) = thinned(case, case.record)
    {
        let turns = turns(case);
        let as_recorded = Prediction::coarse(case, &thin).and_then(|p| explain(&thin, &p).torques_left);
        let mut limit = BETTER * least;
        for h in MotionError::all(&turns, thin.dt(), false) {
            let record = h.put_right(&thin, &turns);
            let Some(p) = Prediction::coarse(case, &record) else { continue };
            let e = explain(&record, &p);
            if !is_plausible(h, &e.outputs) {
                continue;
            }
            // What is predicted so small that it is lost in the noise is not explained: torques are not to be left larger.
            if let (Some(before), Some(after)) = (as_recorded, e.torques_left)
                && after > before
            {
                continue;
            }
            let priced = e.after * price(h, &e.outputs);
            if e.after < LEFT && priced < limit.min(least) {
                (least, limit) = (priced, limit.min(priced));
                best = (h, Some(e));
            }
        }
    }
    let (motion, Some(e)) = best else { return Vec::new() };
    let measure = "the mean distance of torques and gyro from their prediction";
    let why = Grounds { measure, before, after: e.after, limit: EXPLAINED, rivals: Vec::new() };
    // What leaves most of the distance explains nothing.
    let outputs = if e.after < BETTER || e.after < 0.5 * e.before { &e.outputs[..] } else { &[] };
    findings_of(case, motion, outputs, &why)
}

/// Units, axes and signs of a record.
pub(super) fn findings(case: &Case<'_>) -> Hypotheses {
    let mut found = Hypotheses {
        findings: Vec::new(),
        scales: Scales::none(case),
        starts_in_motion: false,
        motion_is_right: true,
        fit: None,
    };
    let Some(thin) = thinned(case, case.record) else { return found };
    let limit = FOLLOWS;
    let Begun { start, fit, others } = begun(case, &thin);
    found.fit = fit;
    let before = found.fit.as_ref().map_or(f64::INFINITY, |f| f.misfit);
    let good = |text: String| case.finding(Topic::Units, Judgement::Good, text).figures(before, 1.0, "");
    let few = case.record.samples() < FEWEST;
    let predicted = Prediction::coarse_at(case, &thin, &start);
    let seen = predicted
        .as_ref()
        .is_some_and(|p| explain(&thin, p).outputs.iter().any(Output::is_unit) || is_gyro_reversed(p, thin.joints()));
    let strays = found.fit.as_ref().map_or(0.0, QuickFit::strays);
    let suspected = !few && (seen || strays > STRAYS.ln());
    if before <= limit && !suspected {
        let text =
            format!("torques and gyro are as predicted: a quick fit follows them, misfit {before:.3}, limit {limit}");
        found.findings.push(good(text));
        if let Some(fit) = found.fit.as_ref().filter(|_| !few) {
            found.findings.extend(told::findings(case, &thin, fit));
        }
        return found;
    }
    if few {
        let text =
            format!("{} samples, at least {FEWEST} are needed to tell unit, axis and sign", case.record.samples());
        found.findings.push(good(text));
        return found;
    }
    let explains = |after: f64| after < UNEXPLAINED * before;
    // First what costs one fit.
    let moving = quick_fit(case, &thin, &found.scales, &start, true).map_or(f64::INFINITY, |f| f.misfit);
    if explains(moving) && moving < limit && !suspected {
        found.starts_in_motion = true;
        found.findings.push(good(format!(
            "a quick fit with base and appendages moving at the first sample leaves the misfit {moving:.3}, one from rest {before:.3}"
        )));
        return found;
    }
    let late = found.fit.as_ref().and_then(|fit| late::found(case, &thin, fit, &start));
    let follows =
        |fit: &QuickFit| explains(fit.misfit) && fit.misfit < limit.min(moving) && fit.strays() <= STRAYS.ln();
    if let Some((fit, device, late)) = late.filter(|l| follows(&l.0)) {
        let (ms, after) = (1e3 * late, fit.misfit);
        let what = device.name();
        found.fit = Some(fit);
        found.findings.push(good(format!(
            "a quick fit follows torques and gyro with {what} put {ms:.1} ms earlier, misfit {after:.3}, and {before:.3} as it is"
        )));
        return found;
    }
    // By the values that fits begin from, of which one may stray into a wrong valley; a single mistake may then be taken from the distance alone.
    let Ranked { start, hypotheses } = nearest(case, &thin, start, others);
    let predicted = Prediction::coarse_at(case, &thin, &start);
    let as_it_is = predicted.map_or(2.0, |p| distance_with(&thin, &p, &[]));
    let is_taken = |fit: &QuickFit, h: &Hypothesis| {
        let (after, single) = (fit.misfit, h.price <= SIMPLER);
        let alone = single && h.distance < LEFT && h.distance < BETTER * as_it_is;
        let back = strays > STRAYS.ln() && after < limit && fit.strays() < 0.5 * strays;
        // A joint that a unit stops may take what is wrong with the mission along.
        let nearer = h.distance < if h.is_of_one_joint() { 0.5 * as_it_is } else { as_it_is };
        // Signals that are made so small that noise hides them are followed by anything.
        if fit.loudness < HEARD {
            return false;
        }
        (explains(after) && nearer && after < moving)
            || (alone
                && (after < before.min(moving) || (seen && after < if h.is_unit() { limit } else { 0.7 * before })))
            || (back && h.is_gyro_unit())
    };
    let mut fitted = fitted(case, &thin, &start, hypotheses);
    fitted.retain(|(fit, h)| is_taken(fit, h));
    // Of two that explain the record, the one of fewer mistakes, then the one nearer to the values of the mission.
    let cost = |(fit, h): &(QuickFit, Hypothesis)| fit.misfit.max(FOLLOWED) * h.price;
    fitted.sort_by(|a, b| cost(a).total_cmp(&cost(b)).then(a.1.distance.total_cmp(&b.1.distance)));
    match fitted.first() {
        Some((fit, h)) => {
            let after = fit.misfit;
            let as_good = |r: &&(QuickFit, Hypothesis)| {
                let near = r.1.distance < RIVAL * h.distance + NEARLY;
                r.1.price <= h.price && r.0.misfit < (RIVAL * after).max(FOLLOWED) && near
            };
            let put_right = |h: &Hypothesis| put_right(&h.motion.put_right(&thin, &turns(case)), &h.outputs);
            let best = put_right(h);
            let rivals = fitted[1..].iter().filter(as_good).filter(|(_, r)| put_right(r) != best);
            let rivals = rivals.map(|(_, r)| named(case, r.motion, &r.outputs)).collect();
            let why = Grounds { measure: MISFIT, before, after, limit: FAR_OFF, rivals };
            found.scales = Scales::of(case, h.motion, &h.outputs);
            found.motion_is_right = !h.motion.is_unit();
            found.findings.extend(findings_of(case, h.motion, &h.outputs, &why));
        }
        None if before <= limit => {
            found
                .findings
                .push(good(format!("a quick fit follows torques and gyro, misfit {before:.3}, limit {limit}")));
        }
        None => {
            let numbers = sensor_errors::found(case, &thin, &start, before);
            let Some((fit, first)) = numbers.first() else {
                let text = format!(
                    "no unit, axis or sign explains what a quick fit leaves, misfit {before:.3}, limit {limit}"
                );
                found.findings.push(good(text));
                return found;
            };
            let after = fit.misfit;
            let as_good = |r: &&(QuickFit, Output)| r.0.misfit < (RIVAL * after).max(FOLLOWED);
            let rivals =
                numbers[1..].iter().filter(as_good).map(|(_, o)| named(case, MotionError::None, slice::from_ref(o)));
            let why = Grounds { measure: MISFIT, before, after, limit: FAR_OFF, rivals: rivals.collect() };
            found.findings.extend(findings_of(case, MotionError::None, slice::from_ref(first), &why));
        }
    }
    found
}

/// Where quick fits of a record begin.
struct Begun {
    start: Vec<f64>,
    /// Of the record as it is, from there.
    fit: Option<QuickFit>,
    /// Other starts that were tried.
    others: Vec<Vec<f64>>,
}

/// The values of the mission, or, where a quick fit from them does not follow the record, those at which an appendage rings as the record does
/// if that leads nearer: springs that are a third too stiff slip by a period within some, and no step leads back.
fn begun(case: &Case<'_>, thin: &Record) -> Begun {
    let scales = Scales::none(case);
    let misfit = |fit: &Option<QuickFit>| fit.as_ref().map_or(f64::INFINITY, |f| f.misfit);
    let nominal = Params::nominal(case.model).values().to_vec();
    let mut best = Begun { fit: quick_fit(case, thin, &scales, &nominal, false), start: nominal, others: Vec::new() };
    if misfit(&best.fit) <= FOLLOWS || thin.samples() < FEWEST {
        return best;
    }
    let left = |values: &[f64]| Prediction::coarse_at(case, thin, values).map(|p| distance_with(thin, &p, &[]));
    let mut tuned: Vec<(f64, Vec<f64>)> =
        tuned_starts(case).into_iter().filter_map(|values| Some((left(&values)?, values))).collect();
    tuned.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (_, mut values) in tuned.into_iter().take(TUNED) {
        let fit = quick_fit(case, thin, &scales, &values, false);
        if misfit(&fit) < misfit(&best.fit) {
            core::mem::swap(&mut best.start, &mut values);
            best.fit = fit;
        }
        best.others.push(values);
        if misfit(&best.fit) <= FOLLOWS {
            break;
        }
    }
    best
}

/// Hypotheses by what they leave at the start.
struct Ranked {
    start: Vec<f64>,
    hypotheses: Vec<Hypothesis>,
}

/// The start from which one of the hypotheses leaves the least: what is wrong with a record hides which start is right until it is put right.
fn nearest(case: &Case<'_>, thin: &Record, start: Vec<f64>, others: Vec<Vec<f64>>) -> Ranked {
    let rank = |start: Vec<f64>| Ranked { hypotheses: ranked(case, thin, &start), start };
    let least = |r: &Ranked| r.hypotheses.first().map_or(f64::INFINITY, |h| h.distance * h.price);
    let first = rank(start);
    others.into_iter().map(rank).fold(first, |best, r| if least(&r) < least(&best) { r } else { best })
}

/// Quick fits, from `start`, of the hypotheses that are nearest to what is predicted there, and of units that only a fit can tell.
fn fitted(case: &Case<'_>, thin: &Record, start: &[f64], mut ranked: Vec<Hypothesis>) -> Vec<(QuickFit, Hypothesis)> {
    let turns = turns(case);
    let one = |h: Hypothesis| {
        let record = put_right(&h.motion.put_right(thin, &turns), &h.outputs);
        let fit = quick_fit(case, &record, &Scales::of(case, h.motion, &h.outputs), start, false)?;
        Some((fit, h))
    };
    let rest = ranked.split_off(FITTED.min(ranked.len()));
    ranked.extend(rest.into_iter().filter(Hypothesis::is_of_device));
    ranked.into_iter().filter_map(one).collect()
}

impl Scales {
    /// All units are right.
    pub(super) fn none(case: &Case<'_>) -> Self {
        let n = case.record.joints();
        Self { position: vec![1.0; n], torque: vec![1.0; n], gyro: 1.0 }
    }
    pub(super) fn of(case: &Case<'_>, motion: MotionError, outputs: &[Output]) -> Self {
        let mut out = Self::none(case);
        match motion {
            MotionError::Factor(f) => {
                turns(case).iter().zip(&mut out.position).filter(|(turns, _)| **turns).for_each(|(_, s)| *s = f);
            }
            MotionError::OneFactor(j, f) => out.position[j] = f,
            MotionError::None | MotionError::Time(_) | MotionError::Reversed(_) | MotionError::Swapped(..) => {}
        }
        for o in outputs {
            match o {
                Output::TorqueUnit { factor, .. } => out.torque.iter_mut().for_each(|s| *s *= factor),
                Output::MotorSide { factors } => out.torque.iter_mut().zip(factors).for_each(|(s, f)| *s *= f),
                Output::OneTorqueUnit { joint, factor, .. } => out.torque[*joint] *= factor,
                Output::GyroUnit { factor, .. } => out.gyro = *factor,
                Output::TorqueGain(gain) => out.torque.iter_mut().for_each(|s| *s *= gain),
                Output::GyroGain(gain) => out.gyro *= gain,
                Output::Axis(_) | Output::Swapped { .. } | Output::Turned(_) => {}
            }
        }
        out
    }
}
