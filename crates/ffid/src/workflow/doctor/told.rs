//! What a record tells of signs and columns, and what it does not.
//!
//! A quick fit that follows a record says nothing of a wrist whose torque is lost in noise. So every sign and every swap of columns is made in
//! the record, and the prediction at the values of the fit asked whether it is worse. With the mean squares of what is left of channel k as
//! recorded, `r_k`, and after the change, `s_k`, both no less than noise and a twentieth of the signal, that is told by `N' sum_k ln(s_k / r_k) / 2`, the logarithm
//! of a likelihood ratio for N' independent samples.

use super::candidates::{turned_gyros, turns};
use super::case::Case;
use super::diagnosis::{Finding, Judgement, Topic};
use super::mismatch::{Output, apply};
use super::motion_error::MotionError;
use super::prediction::Prediction;
use super::quick_fit::QuickFit;
use ff_model::diagnostics::list;
use ff_model::{Area, Problem};
use ff_records::Record;
use ident::checks::AxisMismatch;

/// Samples for each independent one: what a mission lacks leaves residuals that are correlated.
const CORRELATED: f64 = 10.0;
/// Logarithm of the likelihood ratio from which a change is worse, or better.
const TOLD: f64 = 10.0;
/// Part of a signal that is not followed by a quick fit.
const PART: f64 = 0.05;
/// A joint whose sign makes this many times as much difference as is needed is swapped with no other unseen.
const CLEAR: f64 = 20.0;
/// Names in a list.
const SHOWN: usize = 12;

/// What is left of the channels, no less than noise and this part of the signal.
fn left(case: &Case<'_>, p: &Prediction, part: f64) -> Vec<f64> {
    let n = p.measured.nrows() as f64;
    let one = |k: usize| {
        let noise = case.level.of_output(k);
        let signal = p.predicted.column(k).norm_squared() / n;
        let square = (p.measured.column(k) - p.predicted.column(k)).norm_squared() / n;
        square.max(noise * noise).max(part * part * signal).max(f64::MIN_POSITIVE)
    };
    (0..p.measured.ncols()).map(one).collect()
}

/// By how much a record is less likely with an error put right that it may not have.
struct Judge<'c, 'm> {
    case: &'c Case<'m>,
    thin: &'c Record,
    values: &'c [f64],
    turns: Vec<bool>,
    predicted: Prediction,
    as_recorded: Vec<f64>,
    /// Of a signal, that is not followed.
    part: f64,
}

impl<'c, 'm> Judge<'c, 'm> {
    fn new(case: &'c Case<'m>, thin: &'c Record, values: &'c [f64], part: f64) -> Option<Self> {
        let predicted = Prediction::coarse_at(case, thin, values)?;
        let as_recorded = left(case, &predicted, part);
        Some(Self { case, thin, values, turns: turns(case), predicted, as_recorded, part })
    }
    fn against(&self, motion: MotionError, outputs: &[Output]) -> Option<f64> {
        // What is read changes no prediction.
        let mut p = if motion == MotionError::None {
            self.predicted.clone()
        } else {
            Prediction::coarse_at(self.case, &motion.put_right(self.thin, &self.turns), self.values)?
        };
        outputs.iter().for_each(|o| apply(o, &mut p.measured, self.turns.len()));
        let changed = left(self.case, &p, self.part);
        let sum: f64 = changed.iter().zip(&self.as_recorded).map(|(s, r)| 0.5 * (s / r).ln()).sum();
        Some(sum * self.thin.samples() as f64 / CORRELATED)
    }
}

/// What cannot be told from the record, in one finding; and what would be likelier than the record as it is, in another.
pub(super) fn findings(case: &Case<'_>, thin: &Record, fit: &QuickFit) -> Vec<Finding> {
    let Some(judge) = Judge::new(case, thin, &fit.values, PART) else { return Vec::new() };
    let Weighed { mut unknown, likelier } = weighed(&judge);
    let axes: Vec<f64> = turned_gyros().filter_map(|a| judge.against(MotionError::None, &[Output::Axis(a)])).collect();
    let unseen = axes.iter().filter(|found| found.abs() < TOLD).count();
    if unseen > 0 {
        unknown.push(format!("the axes of the gyro ({unseen} of 47 orders and signs are as likely)"));
    }
    let mut out = Vec::new();
    if !unknown.is_empty() {
        let text = format!("not to be told from this record: {}", list(unknown.iter().map(String::as_str), SHOWN));
        out.push(case.finding(Topic::Signs, Judgement::Good, text));
    }
    out.extend(in_doubt(case, likelier));
    out
}

/// What would be likelier than the record as it is at the values of a fit that does not explain it, down to the noise of the sensors: the columns
/// of a light wrist are followed by a quick fit in any order.
pub(super) fn behind_fit(case: &Case<'_>, thin: &Record, values: &[f64]) -> Option<Finding> {
    let judge = Judge::new(case, thin, values, 0.0)?;
    in_doubt(case, weighed(&judge).likelier)
}

/// Signs and swaps by how much likelier a record is with them.
struct Weighed {
    /// Neither likelier nor less likely.
    unknown: Vec<String>,
    /// Logarithms of the likelihood ratios.
    likelier: Vec<(f64, String)>,
}

fn weighed(judge: &Judge<'_, '_>) -> Weighed {
    let record = judge.case.record;
    let n = record.joints();
    let (mut unknown, mut likelier): (Vec<String>, Vec<(f64, String)>) = (Vec::new(), Vec::new());
    let mut weigh = |motion, outputs: &[Output], name: String| -> f64 {
        let found = judge.against(motion, outputs).unwrap_or(f64::INFINITY);
        if found < -TOLD {
            likelier.push((found, name));
        } else if found < TOLD {
            unknown.push(name);
        }
        found
    };
    let torque = |joint| Output::Axis(AxisMismatch::Torque { joint, correlation: -1.0 });
    let names = record.joint_names();
    let mut weak = vec![false; n];
    for j in 0..n {
        let of_torque = weigh(MotionError::None, &[torque(j)], format!("the sign of tau.{}", names[j]));
        let of_position = weigh(MotionError::Reversed(j), &[], format!("the sign of q.{}", names[j]));
        let of_both = weigh(MotionError::Reversed(j), &[torque(j)], format!("the sense of the axis of {}", names[j]));
        weak[j] = of_torque.min(of_position).min(of_both) < CLEAR * TOLD;
    }
    for i in 0..n {
        for j in i + 1..n {
            // Neighbours are confused most often.
            if !(weak[i] && weak[j] || j == i + 1) || judge.turns[i] != judge.turns[j] {
                continue;
            }
            let swapped = [Output::Swapped { joints: (i, j) }];
            weigh(MotionError::None, &swapped, format!("whether tau.{} and tau.{} are swapped", names[i], names[j]));
            weigh(MotionError::Swapped(i, j), &[], format!("whether q.{} and q.{} are swapped", names[i], names[j]));
            weigh(MotionError::Swapped(i, j), &swapped, format!("whether {} and {} are swapped", names[i], names[j]));
        }
    }
    Weighed { unknown, likelier }
}

/// What is likelier than the record as it is: the best, and what is as good.
fn in_doubt(case: &Case<'_>, mut likelier: Vec<(f64, String)>) -> Option<Finding> {
    likelier.sort_by(|a, b| a.0.total_cmp(&b.0));
    let best = likelier.first().map_or(0.0, |l| l.0);
    likelier.retain(|l| l.0 < best + TOLD);
    if likelier.is_empty() {
        return None;
    }
    let text = format!(
        "the record is likelier if these were otherwise, each by itself: {}",
        list(likelier.iter().map(|(_, name)| name.as_str()), SHOWN)
    );
    let p = Problem::warning(Area::Data, "Data::SignInDoubt", text.clone()).on(case.label).hint(
        "compare sign and order of these columns with the URDF; a load that the mission does not have looks alike",
    );
    Some(case.finding(Topic::Signs, Judgement::Suspicious, text).raising(p))
}
