//! The line of names: which column goes where, in which unit, and all that is wrong with it.

use super::units;
use super::units::{Dimension, Unit};
use super::{JointColumn, data};
use crate::time_base::ChannelGroup;
use ff_model::diagnostics::{clip, list, nearest};
use ff_model::{Problem, Problems};

/// Most names listed in one message.
const LISTED: usize = 12;
const XYZ: [&str; 3] = ["x", "y", "z"];
const WXYZ: [&str; 4] = ["w", "x", "y", "z"];

/// A group of channels that belong together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Group {
    Q,
    Dq,
    Ddq,
    Tau,
    Gyro,
    Acc,
    Att,
}

/// All groups, in the order of the channels.
pub(super) const GROUPS: [Group; 7] =
    [Group::Q, Group::Dq, Group::Ddq, Group::Tau, Group::Gyro, Group::Acc, Group::Att];

impl Group {
    /// Prefix in names that are written.
    pub(super) fn prefix(self) -> &'static str {
        ["q", "dq", "ddq", "tau", "gyro", "acc", "att"][self as usize]
    }
    /// Every prefix that is read.
    fn of_prefix(prefix: &str) -> Option<Self> {
        match prefix {
            "qd" => Some(Self::Dq),
            "qdd" => Some(Self::Ddq),
            _ => GROUPS.into_iter().find(|g| g.prefix() == prefix),
        }
    }
    fn axes(self) -> Option<&'static [&'static str]> {
        match self {
            Self::Gyro | Self::Acc => Some(&XYZ),
            Self::Att => Some(&WXYZ),
            _ => None,
        }
    }
    fn required(self) -> bool {
        matches!(self, Self::Q | Self::Tau | Self::Gyro)
    }
    /// Channels that are sampled together.
    pub(super) fn sampled_with(self) -> ChannelGroup {
        match self {
            Self::Q | Self::Dq | Self::Ddq => ChannelGroup::Motion,
            Self::Tau => ChannelGroup::Torque,
            Self::Gyro => ChannelGroup::Gyro,
            Self::Acc => ChannelGroup::Accelerometer,
            Self::Att => ChannelGroup::Attitude,
        }
    }
    /// What a channel of this group measures; joints that slide measure lengths.
    pub(super) fn dimension(self, slides: bool) -> Dimension {
        match (self, slides) {
            (Self::Q, false) => Dimension::Angle,
            (Self::Q, true) => Dimension::Length,
            (Self::Dq, false) | (Self::Gyro, _) => Dimension::AngularRate,
            (Self::Dq, true) => Dimension::Speed,
            (Self::Ddq, false) => Dimension::AngularAcceleration,
            (Self::Ddq, true) | (Self::Acc, _) => Dimension::Acceleration,
            (Self::Tau, false) => Dimension::Torque,
            (Self::Tau, true) => Dimension::Force,
            (Self::Att, _) => Dimension::One,
        }
    }
    /// Names of its channels behind the prefix.
    pub(super) fn channels(self, joints: &[JointColumn]) -> Vec<&str> {
        match self.axes() {
            Some(axes) => axes.to_vec(),
            None => joints.iter().map(|j| j.name.as_str()).collect(),
        }
    }
}

/// Where a cell goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Target {
    Time(&'static Unit),
    /// Group, channel in it, unit.
    Channel(Group, usize, &'static Unit),
    /// Named by the user as of no interest.
    Ignored,
}

impl Target {
    /// Prefix of the column's name.
    pub(super) fn group(&self) -> &'static str {
        match self {
            Self::Time(_) => "time",
            Self::Channel(g, _, _) => g.prefix(),
            Self::Ignored => "ignored",
        }
    }
}

/// What every column is (a base that is bolted down needs no gyro); `None` when something is wrong, with the problems recorded at line 1.
pub(super) fn targets(
    head: &[String],
    joints: &[JointColumn],
    ignore: &[String],
    fixed_base: bool,
    bad: &mut Problems,
) -> Option<Vec<Target>> {
    let mut out: Vec<Option<Target>> = Vec::with_capacity(head.len());
    let (mut extra, mut strangers): (Vec<&str>, Vec<&str>) = (Vec::new(), Vec::new());
    let mut good = true;
    let mut fail = |p: Problem| {
        good = false;
        bad.push(p.at_line(1));
    };
    for cell in head {
        let (name, symbol) = split(cell);
        if ignore.iter().any(|i| i == name || i == cell) {
            out.push(Some(Target::Ignored));
            continue;
        }
        let Some((place, dimension)) = place(name, joints) else {
            match name.split_once('.').map(|(p, j)| (Group::of_prefix(p), j)) {
                Some((Some(g), joint)) if g.axes().is_none() => strangers.push(joint),
                _ => extra.push(name),
            }
            out.push(None);
            continue;
        };
        let Some(symbol) = symbol else {
            let what = format!("column '{}' has no unit", clip(cell));
            let hint = format!("write {}[{}]; known: {}", clip(name), units::si(dimension), units::symbols(dimension));
            fail(data("Data::UnitMissing", what).on(clip(name)).hint(hint));
            out.push(None);
            continue;
        };
        match units::find(symbol, dimension) {
            Some(u) => out.push(Some(match place {
                None => Target::Time(u),
                Some((g, k)) => Target::Channel(g, k, u),
            })),
            None => {
                let what = format!("unit [{}] of column '{}' is not known here", clip(symbol), clip(name));
                let hint = format!("known: {}", units::symbols(dimension));
                fail(data("Data::UnknownUnit", what).on(clip(name)).hint(hint));
                out.push(None);
            }
        }
    }
    for (i, cell) in head.iter().enumerate() {
        let name = split(cell).0;
        let again = |c: &String| place(split(c).0, joints).is_some_and(|p| place(name, joints) == Some(p));
        if head[..i].iter().any(again) {
            fail(data("Data::Columns", format!("column '{}' is there twice", clip(name))).hint("keep one of the two"));
        }
    }
    let named = |g: Group, k: usize| {
        head.iter().any(|c| matches!(place(split(c).0, joints), Some((Some(p), _)) if p == (g, k)))
    };
    if let Err(p) = time_column(head) {
        fail(*p);
    }
    let absent: Vec<&str> =
        joints.iter().enumerate().filter(|(k, _)| !named(Group::Q, *k)).map(|(_, j)| j.name.as_str()).collect();
    strangers.sort_unstable();
    strangers.dedup();
    if !strangers.is_empty() {
        let missing = if absent.is_empty() {
            String::new()
        } else {
            format!("; missing: {}", list(absent.iter().copied(), LISTED))
        };
        let what = format!("joints that the robot does not have: {}{missing}", list(strangers.iter().copied(), LISTED));
        let all = || joints.iter().map(|j| j.name.as_str());
        let near = strangers.iter().find_map(|s| Some((s, nearest(s, absent.iter().copied().chain(all()))?)));
        let hint = match near {
            Some((s, n)) => format!("is {} meant to be {n}?", clip(s)),
            None => format!("use the record of this robot; its joints: {}", list(all(), LISTED)),
        };
        fail(data("Data::NameMismatch", what).hint(hint));
    }
    let mut missing: Vec<String> = Vec::new();
    for g in GROUPS {
        let names = g.channels(joints);
        let lost: Vec<&str> = (0..names.len()).filter(|&k| !named(g, k)).map(|k| names[k]).collect();
        let some = lost.len() < names.len();
        // Joints that are there under a name of another robot have been reported.
        if !lost.is_empty()
            && (some || g.required() && !(fixed_base && g == Group::Gyro))
            && (strangers.is_empty() || g.axes().is_some())
        {
            missing.extend(lost.iter().map(|n| format!("{}.{n}", g.prefix())));
        }
    }
    if !missing.is_empty() || !extra.is_empty() {
        let say = |what: &str, names: Vec<&str>| {
            if names.is_empty() { None } else { Some(format!("{what}: {}", list(names, LISTED))) }
        };
        let parts = [say("missing", missing.iter().map(String::as_str).collect()), say("not known", extra.clone())];
        let what = parts.into_iter().flatten().collect::<Vec<_>>().join("; ");
        let near = extra.iter().find_map(|e| Some((e, nearest(e, missing.iter().map(String::as_str))?)));
        let hint = match (near, extra.first()) {
            (Some((e, n)), _) => format!("is {} meant to be {n}?", clip(e)),
            (None, Some(e)) => format!("drop them, or name each with --ignore, such as --ignore '{}'", clip(e)),
            (None, None) => "give every channel of a group, or none of dq, ddq, acc and att".to_owned(),
        };
        fail(data("Data::Columns", what).hint(hint));
    }
    if good { out.into_iter().collect() } else { None }
}

/// Place of the column of the time, or what to say where there is none.
pub(super) fn time_column(names: &[String]) -> Result<usize, Box<Problem>> {
    let missing = || data("Data::Columns", "there is no column time[s]").hint("give the time of every sample");
    names.iter().position(|n| split(n).0 == "time").ok_or_else(|| Box::new(missing()))
}

/// Name and unit of a header cell.
pub(super) fn split(cell: &str) -> (&str, Option<&str>) {
    match cell.trim().strip_suffix(']').and_then(|c| c.rsplit_once('[')) {
        Some((name, unit)) => (name.trim(), Some(unit)),
        None => (cell.trim(), None),
    }
}

/// The SI unit of a column by its name; `None` for a name that means nothing here.
pub(super) fn si_unit(name: &str, joints: &[JointColumn]) -> Option<&'static str> {
    place(name.trim(), joints).map(|(_, dimension)| units::si(dimension))
}

/// Group and channel of a name (`None` for the time), with its dimension; `None` for a name that means nothing here.
type Place = (Option<(Group, usize)>, Dimension);

fn place(name: &str, joints: &[JointColumn]) -> Option<Place> {
    if name == "time" {
        return Some((None, Dimension::Time));
    }
    let (prefix, channel) = name.split_once('.')?;
    let group = Group::of_prefix(prefix)?;
    let k = group.channels(joints).iter().position(|c| *c == channel)?;
    let slides = group.axes().is_none() && joints[k].slides;
    Some((Some((group, k)), group.dimension(slides)))
}
