//! Errors of units, axes and signs in words: findings, each with its problem and what to do.

use super::case::Case;
use super::diagnosis::{Finding, Judgement, Topic};
use super::mismatch::Output;
use super::motion_error::MotionError;
use super::sensor_errors::{LEAST_GAIN, LEAST_TURN};
use super::units::{ANGLE, RATE, TIME, TORQUE, of_factor};
use crate::workflow::identify::axes;
use ff_model::diagnostics::Limit;
use ff_model::{Area, Problem};
use ident::checks::AxisMismatch;
use nalgebra::Vector3;

/// By how much a measure falls with an error put right.
pub(super) struct Grounds {
    pub(super) measure: &'static str,
    pub(super) before: f64,
    pub(super) after: f64,
    /// What of it follows a record.
    pub(super) limit: f64,
    /// Other errors that explain as much.
    pub(super) rivals: Vec<String>,
}

impl Grounds {
    fn words(&self) -> String {
        let Self { measure, before, after, limit, .. } = self;
        let mut out = if before.is_finite() {
            format!("with that put right {measure} falls from {before:.4} to {after:.4}")
        } else {
            format!("with that put right {measure} is {after:.4}; as it is, the record cannot be predicted")
        };
        if after > limit {
            out += &format!(
                "; that does not follow the record either (limit {limit}), so that another error of this kind may be the right one"
            );
        }
        out + &self.doubts()
    }
    /// What else explains as much, behind a semicolon.
    fn doubts(&self) -> String {
        if self.rivals.is_empty() {
            String::new()
        } else {
            format!("; not to be told from: {}", self.rivals.join("; "))
        }
    }
}

/// Gains of torques that are units, and how near they have to be.
const GAINS: [(f64, &str); 2] = [(0.737_56, "lbf ft, labelled as N m"), (1.355_82, "N m, labelled as lbf ft")];
const NEAR_GAIN: f64 = 0.04;

/// What to do with torques of motors.
const MOTORS: &str = "torques are those on the joint, after the gear: multiply by the ratio, or declare a [[drive]] (docs/motor-side.md)";

/// Findings on a hypothesis: errors of the motion, then of outputs.
pub(super) fn findings_of(case: &Case<'_>, motion: MotionError, outputs: &[Output], why: &Grounds) -> Vec<Finding> {
    let mut out: Vec<Finding> = of_motion(case, motion, why).into_iter().collect();
    out.extend(outputs.iter().map(|o| of_output(case, o, why)));
    out
}

/// A hypothesis in a few words.
pub(super) fn named(case: &Case<'_>, motion: MotionError, outputs: &[Output]) -> String {
    let why = Grounds { measure: "", before: 0.0, after: 0.0, limit: 1.0, rivals: Vec::new() };
    let one = |f: Finding| {
        let text = f.text.split([';', '(']).next().unwrap_or("").trim().to_owned();
        f.channel.map_or(text.clone(), |c| format!("{c}: {text}"))
    };
    findings_of(case, motion, outputs, &why).into_iter().map(one).collect::<Vec<_>>().join(" and ")
}

fn wrong(case: &Case<'_>, topic: Topic, p: Problem, text: String) -> Finding {
    let channel = p.object.clone();
    let f = case.finding(topic, Judgement::Wrong, text).raising(p);
    Finding { channel, ..f }
}

/// The code of a factor between units of an angle, or of its rate.
fn code(factor: f64) -> &'static str {
    let thousands = factor.log10() / 3.0;
    if (thousands - thousands.round()).abs() < 1e-6 { "Data::UnitMismatch" } else { "Data::LooksLikeDegrees" }
}

/// `f` as a reader would say it.
fn times(f: f64) -> String {
    if f >= 1.0 { format!("{f:.4} times too large") } else { format!("{:.4} times too small", 1.0 / f) }
}

fn of_motion(case: &Case<'_>, h: MotionError, why: &Grounds) -> Option<Finding> {
    let names = case.record.joint_names();
    let why = why.words();
    let angle = |f: f64, on: String, what: &str| {
        let of = of_factor(f, &ANGLE);
        let (is, write) = of.map_or(("in another unit", ""), |u| (u.is, u.write));
        let text = format!("{what} {is} (factor {f:.4}); {why}");
        let p = Problem::error(Area::Data, code(f), text.clone())
            .on(&on)
            .violating(f, Limit::Within(0.5, 2.0), "")
            .hint(format!("write the unit {write} in the header of the column"));
        wrong(case, Topic::Units, p, text).figures(f, 1.0, "")
    };
    Some(match h {
        MotionError::None => return None,
        MotionError::Factor(f) => angle(f, "q".to_owned(), "joint positions are"),
        MotionError::OneFactor(j, f) => angle(f, format!("q.{}", names[j]), "the position is"),
        MotionError::Time(f) => {
            let (is, write) = of_factor(f, &TIME).map_or(("in another unit", "time"), |u| (u.is, u.write));
            let text = format!("times are {is}; {why}");
            let p = Problem::error(Area::Data, "Data::TimeScale", text.clone())
                .on("time")
                .violating(f, Limit::Within(0.5, 2.0), "")
                .hint(format!("write {write} in the header"));
            wrong(case, Topic::Units, p, text).figures(f, 1.0, "")
        }
        MotionError::Reversed(j) => {
            let text = format!("the sign of the position is reversed; {why}");
            let p = Problem::error(Area::Data, "Data::AxisMismatch", text.clone())
                .on(format!("q.{}", names[j]))
                .violating(-1.0, Limit::Above(0.0), "")
                .hint("positions are positive along the axis of the joint in the URDF; change the sign");
            wrong(case, Topic::Signs, p, text).figures(-1.0, 1.0, "")
        }
        MotionError::Swapped(i, j) => {
            let text = format!("the positions of {} and {} are swapped; {why}", names[i], names[j]);
            let p = Problem::error(Area::Data, "Data::AxisMismatch", text.clone())
                .on(format!("q.{}", names[i]))
                .hint("exchange the names of the two columns");
            wrong(case, Topic::Axes, p, text)
        }
    })
}

/// A gain that all channels of a group have, which may be in the mission as well: a warning.
fn off_by(case: &Case<'_>, (channel, gain): (&str, f64), text: String, error: &str) -> Finding {
    let p = Problem::warning(Area::Data, "Data::GainInDoubt", text.clone())
        .on(channel)
        .violating(gain, Limit::Within((-LEAST_GAIN).exp(), LEAST_GAIN.exp()), "")
        .hint(format!("multiply the columns by {:.4} if that is why, or estimate it: --adopt {error}; masses and inertias that the mission takes as exact may look alike", 1.0 / gain));
    let f = case.finding(Topic::Units, Judgement::Suspicious, text).figures(gain, 1.0, "").raising(p);
    f.on(channel)
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
    let torque = |on: String, factor: f64, measured: f64| {
        let of = of_factor(factor, &TORQUE);
        let is = of.map_or("that of the motor, before a gear of this ratio?", |u| u.is);
        let off = times(measured);
        let what = format!(
            "amplitudes are {off} (measured over predicted {measured:.4e}): {is} (factor {factor:.4}){}",
            why.doubts()
        );
        let hint = match of {
            None => MOTORS.to_owned(),
            Some(u) if u.write.is_empty() => format!("multiply by {:.5}, and write [N m] in the header", 1.0 / factor),
            Some(u) => format!("write the unit {} in the header, or multiply by {}", u.write, 1.0 / factor),
        };
        unit("Data::UnitMismatch", on, factor, measured, what, hint)
    };
    match o {
        Output::TorqueUnit { factor, measured } => torque("tau".to_owned(), *factor, *measured),
        Output::OneTorqueUnit { joint, factor, measured } => {
            torque(format!("tau.{}", names[*joint]), *factor, *measured)
        }
        Output::MotorSide { factors } => {
            let mut all = factors.clone();
            all.sort_unstable_by(f64::total_cmp);
            let (low, high) = (1.0 / all[all.len() - 1], 1.0 / all[0]);
            let what = format!(
                "amplitudes are {low:.1} to {high:.1} times too small: those of the motors, before gears of such ratios?; {}",
                why.words()
            );
            unit(
                "Data::UnitMismatch",
                "tau".to_owned(),
                all[all.len() / 2],
                all[all.len() / 2],
                what,
                MOTORS.to_owned(),
            )
        }
        Output::GyroUnit { factor, measured } => {
            let (is, write) = of_factor(*factor, &RATE).map_or(("in another unit", ""), |u| (u.is, u.write));
            let what = format!(
                "rates are {} (measured over predicted {measured:.4}): {is} (factor {factor:.4}){}",
                times(*measured),
                why.doubts()
            );
            let hint = format!("write the unit {write} in the header of the columns");
            unit(code(*factor), "gyro".to_owned(), *factor, *measured, what, hint)
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
        Output::Turned(rotation) => {
            let (axis, angle) = rotation.axis_angle().unwrap_or((Vector3::x_axis(), 0.0));
            let degrees = angle.to_degrees();
            let text = format!(
                "the gyro is turned by {degrees:.1} deg about ({:.2}, {:.2}, {:.2}) of the base; {}",
                axis.x,
                axis.y,
                axis.z,
                why.words()
            );
            let p = Problem::error(Area::Data, "Data::AxisMismatch", text.clone())
                .on("gyro")
                .violating(degrees, Limit::AtMost(LEAST_TURN.to_degrees()), "deg")
                .hint("turn its readings into the axes of the base; what is left of the angle can be estimated: --adopt gyro-misalignment");
            wrong(case, Topic::Axes, p, text).figures(degrees, 0.0, "deg")
        }
        Output::GyroGain(gain) => {
            let text = format!("rates are {}; {}", times(*gain), why.words());
            off_by(case, ("gyro", *gain), text, "gyro-scale")
        }
        Output::TorqueGain(gain) => {
            let known = GAINS.iter().find(|(factor, _)| (gain / factor).ln().abs() < NEAR_GAIN);
            let known = known.map_or_else(String::new, |(factor, is)| format!(" ({is}: factor {factor:.4})"));
            let text = format!("torques are {}{known}; {}", times(*gain), why.words());
            off_by(case, ("tau", *gain), text, "torque-gain")
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
