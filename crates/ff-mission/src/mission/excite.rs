//! `[excite]`: the manoeuvre that is to be planned, for `ffid excite`.

use super::declared::{Holds, Key, key, words};
use super::reader;
use super::reader::{Table, error};
use super::select;
use ff_model::Model;
use ff_model::diagnostics::Limit;
use ff_model::diagnostics::{clip, list, nearest};
use ff_model::keys::out_of_range;
use serde::Serialize;

/// What a plan is for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Goal {
    /// `information`: the smallest standard deviations of the parameters.
    #[default]
    Information,
    /// `modal`: the largest response of the modes.
    Modal,
    /// `quiet`: information about the base that flexible appendages spoil least, for rigid identification.
    Quiet,
    /// `paper`: the paper's simplified manoeuvre, fast moves timed at half a period of a mode, then a hold.
    Paper,
    /// `condition`: the smallest condition number of the regressor of the base parameters.
    Condition,
}

/// What of the covariance an information plan makes small.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Optimality {
    /// `d`: its determinant.
    #[default]
    D,
    /// `a`: its trace.
    A,
    /// `e`: its largest eigenvalue.
    E,
    /// `largest`: the largest relative standard deviation of any of the parameters.
    Largest,
}

/// How long a plan takes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum ExciteDuration {
    /// `duration_s`: given (s).
    Fixed(f64),
    /// `duration_bounds_s`: free between two bounds (s).
    Free([f64; 2]),
}

/// Where a plan ends.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(untagged)]
pub enum ExciteEnd {
    /// `end = "free"`: anywhere.
    #[default]
    Free,
    /// `end = "start"`: where it began.
    Start,
    /// `end_rad`: at these positions.
    At(Vec<f64>),
}

/// Section `[excite]`; every key has a default.
///
/// To add a key: one field here, one line in `EXCITE`, one in `read`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Excite {
    /// `goal`: `information` (default), `modal`, `quiet`, `paper` or `condition`.
    pub goal: Goal,
    /// `optimality` of an information plan: `d` (default), `a`, `e` or `largest`.
    pub optimality: Optimality,
    /// `parameters`: names or patterns to plan for; those of `[estimate]` unless given.
    pub parameters: Vec<String>,
    /// `duration_s` (60 unless given), or `duration_bounds_s = [shortest, longest]`.
    pub duration: ExciteDuration,
    /// `control_points`: free control points per joint, 10 unless given.
    pub control_points: u64,
    /// `degree` of the splines, 3 to 7; 5 unless given.
    pub degree: u64,
    /// `start_rad`: joint positions at the start (rad or m); `reproduce.hold_rad` unless given, else zero.
    pub start_rad: Vec<f64>,
    /// `end_rad`, or `end = "free"` (default) or `"start"`.
    pub end: ExciteEnd,
    /// `seed` of all randomness, 1 unless given.
    pub seed: u64,
    /// `starts`: local searches from different random plans, 4 unless given.
    pub starts: u64,
    /// `iterations` of each search at most, 200 unless given.
    pub iterations: u64,
    /// `modes_hz`: natural frequencies that a modal plan drives, the nearest modes of the model; the two lowest unless given.
    pub modes_hz: Vec<f64>,
    /// `frequency_error`: relative error of the natural frequencies that a modal plan allows for; 0.1 unless given.
    pub frequency_error: f64,
    /// `emphasis` of quietness against information in a quiet plan, 3 unless given.
    pub emphasis: f64,
    /// `joints` that move in the paper's manoeuvre; `reproduce.manoeuvre_joints` unless given.
    pub joints: Vec<String>,
    /// `hold_s`: time that the joints hold after the paper's manoeuvre (s), 60 unless given.
    pub hold_s: f64,
    /// `weak_relative_std`: relative standard deviation above which a parameter counts as weakly identifiable; 0.1
    /// unless given.
    pub weak_relative_std: f64,
}

impl Default for Excite {
    fn default() -> Self {
        reader::absent(EXCITE, Self::read)
    }
}

/// Names of the goals, in the order of their help.
pub const GOALS: [(&str, Goal); 5] = [
    ("information", Goal::Information),
    ("modal", Goal::Modal),
    ("quiet", Goal::Quiet),
    ("paper", Goal::Paper),
    ("condition", Goal::Condition),
];

const OPTIMALITIES: [(&str, Optimality); 4] =
    [("d", Optimality::D), ("a", Optimality::A), ("e", Optimality::E), ("largest", Optimality::Largest)];

/// What `end` can say, and whether the plan ends at the start then.
const ENDS: [(&str, bool); 2] = [("free", false), ("start", true)];

const GOAL_WORDS: [&str; 5] = words(&GOALS);
const OPTIMALITY_WORDS: [&str; 4] = words(&OPTIMALITIES);
const END_WORDS: [&str; 2] = words(&ENDS);

const fn within(from: u64, to: u64) -> Holds {
    Holds::WholeWithin { from, to, unit: "" }
}

/// Keys of `[excite]`.
pub(crate) const EXCITE: &[Key] = &[
    key("goal", Holds::OneOf(&GOAL_WORDS), "what the plan is for").or_word(GOALS[0].0),
    key("optimality", Holds::OneOf(&OPTIMALITY_WORDS), "of an information plan").or_word(OPTIMALITIES[0].0),
    key("parameters", Holds::Texts, "names or patterns to plan for; those of [estimate] unless given"),
    key("duration_s", Holds::Positive, "given duration (s)").or(60.0),
    key("duration_bounds_s", Holds::Vector(2), "free duration between two bounds (s)"),
    key("control_points", within(1, 1000), "free control points per joint").or_whole(10),
    key("degree", within(3, 7), "of the splines, 3 to 7").or_whole(5),
    key("start_rad", Holds::Numbers, "joint positions at the start (rad or m)"),
    key("end", Holds::OneOf(&END_WORDS), "where the plan ends").or_word(ENDS[0].0),
    key("end_rad", Holds::Numbers, "joint positions at the end (rad or m)"),
    key("seed", Holds::Whole, "of all randomness").or_whole(1),
    key("starts", within(1, 10_000), "local searches").or_whole(4),
    key("iterations", within(1, 1_000_000), "of each search at most").or_whole(200),
    key("modes_hz", Holds::Numbers, "natural frequencies that a modal plan drives (Hz)"),
    key("frequency_error", Holds::Fraction, "relative error of the frequencies that is allowed for; below 1").or(0.1),
    key("emphasis", Holds::NotNegative, "of quietness against information").or(3.0),
    key("joints", Holds::Texts, "joints that move in the paper's manoeuvre"),
    key("hold_s", Holds::NotNegative, "time that the joints hold after it (s)").or(60.0),
    key("weak_relative_std", Holds::Positive, "from which a parameter counts as weakly identifiable").or(0.1),
];

impl Goal {
    /// Its name in a mission file.
    pub fn name(self) -> &'static str {
        GOALS.iter().find(|(_, g)| *g == self).map_or("", |(n, _)| n)
    }
}

impl Excite {
    pub(super) fn read(t: &Table<'_, '_>) -> Self {
        let out = Self {
            goal: choice(t, "goal", &GOALS).unwrap_or_default(),
            optimality: choice(t, "optimality", &OPTIMALITIES).unwrap_or_default(),
            parameters: t.strings("parameters").unwrap_or_default(),
            duration: duration(t),
            control_points: t.whole("control_points").unwrap_or_default(),
            degree: t.whole("degree").unwrap_or_default(),
            start_rad: t.numbers("start_rad").unwrap_or_default(),
            end: end(t),
            seed: t.whole("seed").unwrap_or_default(),
            starts: t.whole("starts").unwrap_or_default(),
            iterations: t.whole("iterations").unwrap_or_default(),
            modes_hz: t.numbers("modes_hz").unwrap_or_default(),
            frequency_error: t.number("frequency_error").unwrap_or_default(),
            emphasis: t.number("emphasis").unwrap_or_default(),
            joints: t.strings("joints").unwrap_or_default(),
            hold_s: t.number("hold_s").unwrap_or_default(),
            weak_relative_std: t.number("weak_relative_std").unwrap_or_default(),
        };
        if let Some(f) = out.modes_hz.iter().find(|f| **f <= 0.0) {
            let p = out_of_range(*f, Limit::Above(0.0), "Hz");
            t.fail("modes_hz", p.hint("give natural frequencies in Hz; `ffid modes` prints them"));
        }
        t.finish();
        out
    }

    /// What can be checked against the robot; returns the parameters, none when the section names none.
    pub(super) fn check(&self, model: &Model, complete: bool, t: &Table<'_, '_>) -> Vec<usize> {
        positions(&self.start_rad, "start_rad", model, t);
        if let ExciteEnd::At(q) = &self.end {
            positions(q, "end_rad", model, t);
        }
        let names = model.joint_names();
        let all = || names.iter().map(String::as_str);
        for j in self.joints.iter().filter(|j| !names.contains(j)) {
            let p = error("Config::UnknownJoint", format!("the robot has no moving joint '{}'", clip(j)));
            t.fail(
                "joints",
                match nearest(j, all()) {
                    Some(n) => p.hint(format!("did you mean {n}?")),
                    None => p.hint(format!("joints: {}", list(all(), 12))),
                },
            );
        }
        if complete { select::indices(&self.parameters, model, t) } else { Vec::new() }
    }
}

/// One of several words.
pub(super) fn choice<V: Copy>(t: &Table<'_, '_>, key: &'static str, known: &[(&'static str, V)]) -> Option<V> {
    let word = t.string(key)?;
    let found = known.iter().find(|(n, _)| *n == word).map(|(_, v)| *v);
    if found.is_none() {
        let names = || known.iter().map(|(n, _)| *n);
        let p = error("Config::UnknownChoice", format!("'{}' is none of {}", clip(&word), list(names(), 12)));
        let near = nearest(&word, names()).unwrap_or(known[0].0);
        t.fail(key, p.hint(format!("did you mean {near}?")));
    }
    found
}

fn duration(t: &Table<'_, '_>) -> ExciteDuration {
    let fixed = ExciteDuration::Fixed(t.number("duration_s").unwrap_or_default());
    let Some([a, b]) = t.vector::<2>("duration_bounds_s") else { return fixed };
    if t.has("duration_s") {
        let p = error("Config::Conflict", "duration_s and duration_bounds_s are both given");
        t.fail("duration_bounds_s", p.hint("keep duration_s for a given duration, duration_bounds_s for a free one"));
        return fixed;
    }
    if !(a > 0.0 && a < b) {
        let what = format!("{a} .. {b} s, limit 0 < shortest < longest");
        t.fail("duration_bounds_s", error("Config::OutOfRange", what).hint("give [shortest, longest] in seconds"));
        return fixed;
    }
    ExciteDuration::Free([a, b])
}

fn end(t: &Table<'_, '_>) -> ExciteEnd {
    let word = choice(t, "end", &ENDS);
    let at = t.numbers("end_rad");
    if t.has("end") && t.has("end_rad") {
        let p = error("Config::Conflict", "end and end_rad are both given");
        t.fail("end", p.hint("keep end_rad for a given end"));
    }
    match (at, word) {
        (Some(q), _) if q.is_empty() => {
            t.fail("end_rad", error("Config::WrongLength", "no positions").hint("give one position per joint"));
            ExciteEnd::Free
        }
        (Some(q), _) => ExciteEnd::At(q),
        (None, Some(true)) => ExciteEnd::Start,
        _ => ExciteEnd::Free,
    }
}

/// One position per joint, each within its limits; an empty list stands for the default.
fn positions(q: &[f64], key: &'static str, model: &Model, t: &Table<'_, '_>) {
    // A list with a wrong entry comes as an empty one, and has been reported.
    if q.is_empty() {
        return;
    }
    if q.len() != model.nj() {
        let what = format!("{} positions for {} joints", q.len(), model.nj());
        t.fail(key, error("Config::WrongLength", what).hint("give one position per joint"));
        return;
    }
    for (b, &q) in model.own_bodies().zip(q) {
        let l = &b.joint.limits;
        if !(l.lower..=l.upper).contains(&q) {
            let what = format!("joint {}: {q} rad, limit {} .. {} rad", b.joint.name, l.lower, l.upper);
            let p = error("Config::OutOfRange", what).violating(q, Limit::Within(l.lower, l.upper), "rad");
            t.fail(key, p.hint("give a position within the joint limits"));
        }
    }
}
