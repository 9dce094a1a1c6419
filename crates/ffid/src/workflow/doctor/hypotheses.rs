//! What would bring a record to its prediction: errors of its outputs, and errors of its joint positions, each of which is simulated.
//!
//! Every hypothesis is a record put right. They are ranked by the mean distance of torques and gyro from what the values of the mission
//! predict (see `mismatch`), which takes one simulation; the first few are fitted quickly, and the best of these is taken if it leaves a
//! quarter of the misfit that the record leaves as it is.

use super::case::{Case, Scales};
use super::diagnosis::{Finding, Judgement, Topic};
use super::mismatch::{DEGREES, Explained, Output, distance_with, explain, put_right};
use super::prediction::Prediction;
use super::quick_fit::{FOLLOWS, QuickFit, quick_fit, thinned};
use crate::workflow::identify::axes;
use ff_model::diagnostics::Limit;
use ff_model::{Area, JointKind, Problem};
use ff_records::Record;
use ident::checks::AxisMismatch;
use nalgebra::DMatrix;

/// Mean distance below which nothing is looked for before a fit.
const EXPLAINED: f64 = 0.3;
/// Part of the mean distance that an error taken before a fit must leave at most, and the most that it may leave.
const BETTER: f64 = 0.4;
const LEFT: f64 = 0.35;
/// Samples below which a record has no shape to go by.
const FEWEST: usize = 100;
/// Part of the misfit that an error may leave.
const UNEXPLAINED: f64 = 0.25;
/// Factor by which distance and misfit of a hypothesis count more with each mistake that it consists of.
const SIMPLER: f64 = 1.3;
/// Hypotheses that are fitted.
const FITTED: usize = 4;

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
}

/// Findings on units, axes and signs.
pub(super) struct Hypotheses {
    pub(super) findings: Vec<Finding>,
    pub(super) scales: Scales,
    /// With base rate and passive state at the first sample estimated, the record is explained, and by nothing else.
    pub(super) starts_in_motion: bool,
    /// Of the record as it is.
    pub(super) fit: Option<QuickFit>,
}

/// By how much a measure falls with an error put right.
struct Grounds {
    measure: &'static str,
    before: f64,
    after: f64,
}

impl Grounds {
    fn words(&self) -> String {
        let Self { measure, before, after } = self;
        if before.is_finite() {
            format!("with that put right {measure} falls from {before:.4} to {after:.4}")
        } else {
            format!("with that put right {measure} is {after:.4}; as it is, the record cannot be predicted")
        }
    }
}

/// Kinds of joint: true where it turns.
fn turns(case: &Case<'_>) -> Vec<bool> {
    case.model.own_bodies().map(|b| b.joint.kind != JointKind::Prismatic).collect()
}

/// What makes a fit useless, by the values of the mission alone; `predicted` is absent where the record as it is cannot be simulated.
pub(super) fn before_fit(case: &Case<'_>, predicted: Option<&Prediction>) -> Vec<Finding> {
    let own = predicted.map(|p| explain(case.record, p));
    let left = own.as_ref().map_or(2.0, |e| e.after);
    let mut best = (Positions::AsRecorded, own);
    if case.record.samples() < FEWEST {
        return Vec::new();
    }
    if left > EXPLAINED
        && let Some(thin) = thinned(case, case.record)
    {
        let turns = turns(case);
        let as_recorded = Prediction::coarse(case, &thin).and_then(|p| explain(&thin, &p).torques_left);
        for h in Positions::all(&turns, false) {
            let record = h.put_right(&thin, &turns);
            let Some(p) = Prediction::coarse(case, &record) else { continue };
            let e = explain(&record, &p);
            // What is predicted so small that it is lost in the noise is not explained: torques are not to be left larger.
            if let (Some(before), Some(after)) = (as_recorded, e.torques_left)
                && after > before
            {
                continue;
            }
            if e.after < LEFT && e.after < BETTER * best.1.as_ref().map_or(2.0, |b| b.after) {
                best = (h, Some(e));
            }
        }
    }
    let (positions, Some(e)) = best else { return Vec::new() };
    let before = predicted.map_or(f64::INFINITY, |p| explain(case.record, p).before);
    let why =
        Grounds { measure: "the mean distance of torques and gyro from their prediction", before, after: e.after };
    let mut out: Vec<Finding> = of_positions(case, positions, &why).into_iter().collect();
    // What leaves most of the distance explains nothing.
    if e.after < BETTER || e.after < 0.5 * e.before {
        out.extend(e.outputs.iter().map(|o| of_output(case, o, &why)));
    }
    out
}

/// A hypothesis: positions, then outputs.
struct Hypothesis {
    positions: Positions,
    outputs: Vec<Output>,
    /// Mean distance that it leaves, and what a measure of it is multiplied by for the errors it consists of.
    distance: f64,
    price: f64,
}

/// Mistakes that a hypothesis consists of: the columns of a joint, or all torques, that are wrong in the same way are one.
fn mistakes(positions: Positions, outputs: &[Output], joints: usize) -> i32 {
    let of_torque = |o: &Output| matches!(o, Output::Axis(AxisMismatch::Torque { .. }));
    let same = match (positions, outputs) {
        (Positions::Reversed(j), [Output::Axis(AxisMismatch::Torque { joint, .. })]) => *joint == j,
        (Positions::Swapped(i, j), [Output::Swapped { joints }]) => *joints == (i, j),
        _ => false,
    };
    let of_outputs = match outputs.len() {
        _ if same => 0,
        k if k == joints && k > 0 && outputs.iter().all(of_torque) => 1,
        k => k as i32,
    };
    of_outputs + i32::from(positions != Positions::AsRecorded)
}

/// A gyro whose axes are any but those of the base, in order or sign. What its prediction shares with it may be too little to tell by.
fn turned_gyros() -> impl Iterator<Item = AxisMismatch> {
    let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    orders.into_iter().flat_map(|axes| {
        let signs = move |bits: u8| std::array::from_fn(|i| if bits >> i & 1 == 1 { -1.0 } else { 1.0 });
        // The first of the first is the gyro as it should be.
        (u8::from(axes == [0, 1, 2])..8).map(move |bits| AxisMismatch::Gyro {
            axes,
            signs: signs(bits),
            improvement: 1.0,
        })
    })
}

/// Everything that may be wrong with positions and outputs, cheapest first.
fn ranked(case: &Case<'_>, thin: &Record) -> Vec<Hypothesis> {
    let (turns, n) = (turns(case), thin.joints());
    let mut out = Vec::new();
    let mut all = vec![Positions::AsRecorded];
    all.extend(Positions::all(&turns, true));
    let reversed = |joint| Output::Axis(AxisMismatch::Torque { joint, correlation: -1.0 });
    let swapped = |i, j| Output::Swapped { joints: (i, j) };
    for positions in all {
        let record = positions.put_right(thin, &turns);
        let Some(p) = Prediction::coarse(case, &record) else { continue };
        let Explained { outputs, .. } = explain(&record, &p);
        let mut variants = vec![Vec::new()];
        if !outputs.is_empty() {
            variants.push(outputs);
        }
        match positions {
            Positions::AsRecorded => {
                variants.extend((0..n).map(|j| vec![reversed(j)]));
                variants.push((0..n).map(reversed).collect());
                variants.extend((0..n).flat_map(|i| (i + 1..n).map(move |j| vec![swapped(i, j)])));
                variants.extend(turned_gyros().map(|a| vec![Output::Axis(a)]));
            }
            // The names of a joint, or the sense of its axis, are wrong in all its columns.
            Positions::Reversed(j) => variants.push(vec![reversed(j)]),
            Positions::Swapped(i, j) => variants.push(vec![swapped(i, j)]),
            Positions::Factor(_) | Positions::OneFactor(..) => {}
        }
        for outputs in variants {
            let errors = mistakes(positions, &outputs, n);
            if errors > 0 {
                let distance = distance_with(&record, &p, &outputs);
                out.push(Hypothesis { positions, outputs, distance, price: SIMPLER.powi(errors) });
            }
        }
    }
    out.sort_by(|a, b| (a.distance * a.price).total_cmp(&(b.distance * b.price)));
    out
}

/// Units, axes and signs of a record.
pub(super) fn findings(case: &Case<'_>) -> Hypotheses {
    let mut found = Hypotheses { findings: Vec::new(), scales: Scales::none(case), starts_in_motion: false, fit: None };
    let Some(thin) = thinned(case, case.record) else { return found };
    found.fit = quick_fit(case, &thin, &found.scales, false);
    let before = found.fit.as_ref().map_or(f64::INFINITY, |f| f.misfit);
    let limit = FOLLOWS;
    let good = |text: String| case.finding(Topic::Units, Judgement::Good, text).figures(before, 1.0, "");
    if before <= limit {
        let text = format!(
            "torques and gyro are as predicted in unit, axis and sign: a quick fit follows them, misfit {before:.3}, limit {limit}"
        );
        found.findings.push(good(text));
        return found;
    }
    if case.record.samples() < FEWEST {
        let text =
            format!("{} samples, at least {FEWEST} are needed to tell unit, axis and sign", case.record.samples());
        found.findings.push(good(text));
        return found;
    }
    let explains = |after: f64| after < UNEXPLAINED * before;
    // First what costs one fit.
    let moving = quick_fit(case, &thin, &found.scales, true).map_or(f64::INFINITY, |f| f.misfit);
    if explains(moving) && moving < limit {
        found.starts_in_motion = true;
        found.findings.push(good(format!(
            "a quick fit with base and appendages moving at the first sample leaves the misfit {moving:.3}, one from rest {before:.3}"
        )));
        return found;
    }
    let turns = turns(case);
    let mut best: Option<(f64, Hypothesis)> = None;
    for h in ranked(case, &thin).into_iter().take(FITTED) {
        let record = put_right(&h.positions.put_right(&thin, &turns), &h.outputs);
        let Some(fit) = quick_fit(case, &record, &Scales::of(case, h.positions, &h.outputs), false) else { continue };
        // Of two that explain the record, the one of fewer mistakes.
        if best.as_ref().is_none_or(|b| fit.misfit * h.price < b.0 * b.1.price) {
            best = Some((fit.misfit, h));
        }
    }
    // By the values of the mission, of which a fit may stray into a wrong valley; a single mistake may then be taken from the distance alone.
    let as_it_is = Prediction::coarse(case, &thin).map_or(2.0, |p| distance_with(&thin, &p, &[]));
    let is_taken = |after: f64, h: &Hypothesis| {
        (explains(after) && h.distance < as_it_is)
            || (after < before && h.price <= SIMPLER && h.distance < LEFT && h.distance < BETTER * as_it_is)
    };
    match best {
        Some((after, h)) if is_taken(after, &h) && after < moving => {
            let measure = "the misfit of a quick fit";
            let why = Grounds { measure, before, after };
            found.scales = Scales::of(case, h.positions, &h.outputs);
            found.findings.extend(of_positions(case, h.positions, &why));
            found.findings.extend(h.outputs.iter().map(|o| of_output(case, o, &why)));
        }
        _ => {
            let text =
                format!("no unit, axis or sign explains what a quick fit leaves, misfit {before:.3}, limit {limit}");
            found.findings.push(good(text));
        }
    }
    found
}

impl Scales {
    /// All units are right.
    pub(super) fn none(case: &Case<'_>) -> Self {
        let n = case.record.joints();
        Self { position: vec![1.0; n], torque: vec![1.0; n], gyro: 1.0 }
    }
    fn of(case: &Case<'_>, positions: Positions, outputs: &[Output]) -> Self {
        let mut out = Self::none(case);
        match positions {
            Positions::Factor(f) => {
                turns(case).iter().zip(&mut out.position).filter(|(turns, _)| **turns).for_each(|(_, s)| *s = f);
            }
            Positions::OneFactor(j, f) => out.position[j] = f,
            Positions::AsRecorded | Positions::Reversed(_) | Positions::Swapped(..) => {}
        }
        for o in outputs {
            match o {
                Output::TorqueUnit { factor, .. } => out.torque.iter_mut().for_each(|s| *s *= factor),
                Output::OneTorqueUnit { joint, factor, .. } => out.torque[*joint] *= factor,
                Output::GyroUnit { factor, .. } => out.gyro = *factor,
                Output::Axis(_) | Output::Swapped { .. } => {}
            }
        }
        out
    }
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

fn of_positions(case: &Case<'_>, h: Positions, why: &Grounds) -> Option<Finding> {
    let names = case.record.joint_names();
    let why = why.words();
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

fn of_output(case: &Case<'_>, o: &Output, why: &Grounds) -> Finding {
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
            let mut p = axes::problem(m, case.record);
            let (topic, measured) = match m {
                AxisMismatch::Torque { correlation, .. } => (Topic::Signs, *correlation),
                AxisMismatch::Gyro { improvement, .. } => (Topic::Axes, *improvement),
            };
            // A sign that was tried, and not seen in a correlation.
            if measured == -1.0 {
                p.message = "the sign is reversed".to_owned();
            }
            p.message = format!("{}; {}", p.message, why.words());
            let text = p.message.clone();
            wrong(case, topic, p, text).figures(measured, 1.0, "")
        }
        Output::Swapped { joints: (i, j) } => {
            let text = format!("the torques of {} and {} are swapped; {}", names[*i], names[*j], why.words());
            let p = Problem::error(Area::Data, "Data::AxisMismatch", text.clone())
                .on(format!("tau.{}", names[*i]))
                .hint("exchange the names of the two columns");
            wrong(case, Topic::Axes, p, text)
        }
    }
}
