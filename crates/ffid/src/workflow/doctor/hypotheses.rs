//! What would bring a record to its prediction: errors of its outputs, and errors of its joint positions, each of which is simulated.
//!
//! A hypothesis on positions is taken where the mean distance of the outputs (see `mismatch`) falls to a part of what it was. Each comes
//! with what it leaves for the outputs to explain: a joint whose axis is reversed has another sign in its position and in its torque.

use super::diagnosis::{Finding, Judgement, Topic};
use super::mismatch::{DEGREES, Explained, Output, explain};
use super::prediction::{Prediction, coarse};
use super::{Case, Scales};
use crate::workflow::identify::{RecordEstimator, Settings, axes};
use ff_model::diagnostics::Limit;
use ff_model::{Area, JointKind, Params, Problem};
use ff_records::Record;
use ident::estimate::fit_nuisance;
use nalgebra::DMatrix;

/// Mean distance, and largest of a channel, below which nothing is looked for.
const EXPLAINED: f64 = 0.3;
const EXPLAINED_WORST: f64 = 0.7;
/// Part of the mean distance that a hypothesis must leave at most, and the most that it may leave.
const BETTER: f64 = 0.4;
const LEFT: f64 = 0.35;
/// Advantage of simpler hypotheses over others, in the same ratio.
const SIMPLER: f64 = 0.7;
/// Linearisations for an initial state.
const ITERATIONS: usize = 8;

/// What may be wrong with joint positions.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Positions {
    /// Nothing.
    AsRecorded,
    /// All that turn are this many times too large.
    Factor(f64),
    /// One is.
    OneFactor(usize, f64),
    Reversed(usize),
    Swapped(usize, usize),
}

impl Positions {
    /// The record with that put right.
    fn put_right(self, record: &Record, turns: &[bool]) -> Record {
        let mut q: DMatrix<f64> = record.q().clone();
        match self {
            Self::AsRecorded => return record.clone(),
            Self::Factor(f) => {
                (0..q.ncols()).filter(|&j| turns[j]).for_each(|j| q.column_mut(j).scale_mut(1.0 / f));
            }
            Self::OneFactor(j, f) => q.column_mut(j).scale_mut(1.0 / f),
            Self::Reversed(j) => q.column_mut(j).neg_mut(),
            Self::Swapped(i, j) => q.swap_columns(i, j),
        }
        record.clone().with_positions(q)
    }
    /// All of them, or those that a fit is to be refused for.
    fn all(turns: &[bool], thorough: bool) -> Vec<Self> {
        let mut out = vec![Self::Factor(DEGREES), Self::Factor(1.0 / DEGREES)];
        if thorough {
            let n = turns.len();
            for j in 0..n {
                if turns[j] {
                    out.extend([Self::OneFactor(j, DEGREES), Self::OneFactor(j, 1.0 / DEGREES)]);
                }
                out.push(Self::Reversed(j));
                out.extend((j + 1..n).filter(|&k| turns[j] == turns[k]).map(|k| Self::Swapped(j, k)));
            }
        }
        out
    }
    /// Of one joint or two, not of the record as a whole.
    fn is_single(self) -> bool {
        !matches!(self, Self::AsRecorded | Self::Factor(_))
    }
}

/// Findings on units, axes and signs.
pub(super) struct Hypotheses {
    pub(super) findings: Vec<Finding>,
    pub(super) scales: Scales,
    /// With an initial state estimated, outputs are near their prediction, and nothing else explains them.
    pub(super) starts_in_motion: bool,
}

/// What explains the outputs of a record; `predicted` is absent where the record as it is cannot be simulated. `thorough`: each joint is
/// tried as well.
pub(super) fn findings(case: &Case<'_>, predicted: Option<&Prediction>, thorough: bool) -> Hypotheses {
    let own = predicted.map(|p| explain(case.record, p));
    let before = own.as_ref().map_or(2.0, |e| e.before);
    let mut best = (Positions::AsRecorded, own);
    let mut starts_in_motion = false;
    let left = |e: &Option<Explained>| e.as_ref().map_or(2.0, |e| e.after);
    let unexplained = best.1.as_ref().is_none_or(|e| e.after > EXPLAINED || e.worst > EXPLAINED_WORST);
    if unexplained {
        let turns: Vec<bool> = case.model.bodies().iter().map(|b| b.joint.kind != JointKind::Prismatic).collect();
        if let Some(thin) = coarse(case.record) {
            let mut tried: Vec<(f64, Positions, Explained)> = Vec::new();
            let moving = if thorough { from_motion(case, &thin) } else { None };
            for h in Positions::all(&turns, thorough) {
                let record = h.put_right(&thin, &turns);
                let Ok(p) = Prediction::new(case, &record) else { continue };
                let e = explain(&record, &p);
                // Errors of the outputs beside one of the positions count against it.
                let cost = SIMPLER.powi(-i32::from(h.is_single())) * SIMPLER.powi(-(e.outputs.len().min(4) as i32));
                tried.push((e.after * cost, h, e));
            }
            let as_is = left(&best.1);
            let bound = as_is * SIMPLER.powi(-(best.1.as_ref().map_or(0, |e| e.outputs.len().min(4)) as i32));
            if let Some((cost, h, e)) = tried.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))
                && e.after < LEFT
                && cost < BETTER * bound
                && moving.is_none_or(|m| cost < m)
            {
                best = (h, Some(e));
            } else if let Some(m) = moving
                && m < BETTER * as_is
                && m < LEFT
            {
                starts_in_motion = true;
            }
        }
    }
    let (positions, explained) = best;
    // What is left unexplained explains nothing.
    let explained =
        explained.filter(|e| !starts_in_motion && (e.outputs.is_empty() || e.after < BETTER.max(0.6 * e.before)));
    let mut findings = Vec::new();
    findings.extend(of_positions(case, positions, before, explained.as_ref()));
    let mut scales = Scales::default();
    for o in explained.iter().flat_map(|e| &e.outputs) {
        findings.push(of_output(case, o));
    }
    if let Some(e) = &explained {
        scales = e.scales;
    }
    if findings.is_empty() {
        let text = match &explained {
            Some(e) if e.after <= EXPLAINED => "torques and gyro are as the mission predicts, in unit, axis and sign",
            _ if starts_in_motion => "torques and gyro are as predicted from a start in motion, in unit, axis and sign",
            Some(_) => "no unit, axis or sign would bring torques and gyro nearer to their prediction",
            None => "torques and gyro are not told apart from noise by the prediction",
        };
        findings.push(case.finding(Topic::Units, Judgement::Good, text).figures(before, 0.0, ""));
    }
    Hypotheses { findings, scales, starts_in_motion }
}

/// Mean distance with base rate and passive state at the first sample estimated.
fn from_motion(case: &Case<'_>, record: &Record) -> Option<f64> {
    let s = Settings { initial_state: true, biases: true, ..case.settings.clone() };
    let mut fit = RecordEstimator::new(case.model, record, &s).ok()?;
    let nominal = Params::nominal(case.model);
    let found = fit_nuisance(fit.estimator(), nominal.values(), ITERATIONS).ok()?;
    let p = Prediction::of(case, record, found.residuals);
    Some(explain(record, &p).before)
}

fn wrong(case: &Case<'_>, topic: Topic, p: Problem, text: String) -> Finding {
    let channel = p.object.clone();
    let f = case.finding(topic, Judgement::Wrong, text).raising(p);
    Finding { channel, ..f }
}

/// `f` as a reader would say it.
fn times(f: f64) -> String {
    if f >= 1.0 { format!("{f:.4} times too large") } else { format!("{:.4} times too small", 1.0 / f) }
}

fn of_positions(case: &Case<'_>, h: Positions, before: f64, e: Option<&Explained>) -> Option<Finding> {
    let names = case.record.joint_names();
    let after = e.map_or(0.0, |e| e.after);
    let why = format!(
        "the mean distance of torques and gyro from their prediction falls from {before:.3} to {after:.3} with that put right"
    );
    let unit = |f: f64, on: String, what: &str| {
        let (is, write) = if f > 1.0 { ("in degrees", "[deg]") } else { ("in radians, labelled as degrees", "[rad]") };
        let text = format!("{what} {is} (factor {f:.4}); {why}");
        let p = Problem::error(Area::Data, "Data::LooksLikeDegrees", text.clone())
            .on(&on)
            .violating(f, Limit::Within(0.5, 2.0), "")
            .hint(format!("write the unit {write} in the header of the column"));
        let code = wrong(case, Topic::Units, p, text);
        code.figures(f, 1.0, "")
    };
    Some(match h {
        Positions::AsRecorded => return None,
        Positions::Factor(f) => unit(f, "q".to_owned(), "joint positions are"),
        Positions::OneFactor(j, f) => unit(f, format!("q.{}", names[j]), "the position is"),
        Positions::Reversed(j) => {
            let text = format!("the sign of the position is reversed; {why}");
            let p = Problem::error(Area::Data, "Data::AxisMismatch", text.clone())
                .on(format!("q.{}", names[j]))
                .violating(-1.0, Limit::Above(0.0), "")
                .hint("positions are positive along the axis of the joint in the URDF; change the sign");
            wrong(case, Topic::Signs, p, text).figures(-1.0, 1.0, "")
        }
        Positions::Swapped(i, j) => {
            let text = format!("the positions of {} and {} are swapped; {why}", names[i], names[j]);
            let p = Problem::error(Area::Data, "Data::AxisMismatch", text.clone())
                .on(format!("q.{}", names[i]))
                .hint("exchange the names of the two columns");
            wrong(case, Topic::Axes, p, text)
        }
    })
}

fn of_output(case: &Case<'_>, o: &Output) -> Finding {
    let names = case.record.joint_names();
    let unit = |code, on: String, factor: f64, measured: f64, what: String, hint: String| {
        let p = Problem::error(Area::Data, code, what.clone())
            .on(on)
            .violating(measured, Limit::Within(1.0 / 3.0, 3.0), "")
            .hint(hint);
        wrong(case, Topic::Units, p, what).figures(measured, factor, "")
    };
    match o {
        Output::TorqueUnit { factor, measured } | Output::OneTorqueUnit { factor, measured, .. } => {
            let on = match o {
                Output::OneTorqueUnit { joint, .. } => format!("tau.{}", names[*joint]),
                _ => "tau".to_owned(),
            };
            let (is, write) = if *factor > 1.0 { ("mN m", "[mN m]") } else { ("kN m", "[kN m]") };
            let what = format!(
                "amplitudes are {} (measured over predicted {measured:.4e}): {is}, labelled as N m (factor {factor})",
                times(*measured)
            );
            unit(
                "Data::UnitMismatch",
                on,
                *factor,
                *measured,
                what,
                format!("write the unit {write} in the header, or multiply by {}", 1.0 / factor),
            )
        }
        Output::GyroUnit { factor, measured } => {
            let (is, write) = if (*factor - 1e3).abs() < 1.0 {
                ("mrad/s, labelled as rad/s", "[mrad/s]")
            } else if *factor > 1.0 {
                ("deg/s, labelled as rad/s", "[deg/s]")
            } else {
                ("rad/s, labelled as deg/s", "[rad/s]")
            };
            let what = format!(
                "rates are {} (measured over predicted {measured:.4}): {is} (factor {factor:.4})",
                times(*measured)
            );
            let code = if (*factor - 1e3).abs() < 1.0 { "Data::UnitMismatch" } else { "Data::LooksLikeDegrees" };
            unit(
                code,
                "gyro".to_owned(),
                *factor,
                *measured,
                what,
                format!("write the unit {write} in the header of the columns"),
            )
        }
        Output::Axis(m) => {
            let p = axes::problem(m, case.record);
            let (topic, text) = match m {
                ident::checks::AxisMismatch::Torque { .. } => (Topic::Signs, p.message.clone()),
                ident::checks::AxisMismatch::Gyro { .. } => (Topic::Axes, p.message.clone()),
            };
            let f = wrong(case, topic, p, text);
            match m {
                ident::checks::AxisMismatch::Torque { correlation, .. } => f.figures(*correlation, 1.0, ""),
                ident::checks::AxisMismatch::Gyro { improvement, .. } => f.figures(*improvement, 1.0, ""),
            }
        }
        Output::Swapped { joints: (i, j), before, after } => {
            let text = format!(
                "the columns of {} and {} are swapped: each is nearer to the prediction of the other (distance {after:.3}, as recorded {before:.3})",
                names[*i], names[*j]
            );
            let p = Problem::error(Area::Data, "Data::AxisMismatch", text.clone())
                .on(format!("tau.{}", names[*i]))
                .hint("exchange the names of the two columns");
            wrong(case, Topic::Axes, p, text).figures(*before, *after, "")
        }
    }
}
