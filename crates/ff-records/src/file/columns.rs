//! The line of names: which column goes where, in which unit, and all that is wrong with it.

use super::naming::{LISTED, ignores, is_nameless, is_time, parts, split};
use super::units;
use super::units::{Dimension, Unit};
use super::{FollowerColumn, JointColumn, ReadOptions, data};
use crate::carried::WRENCH;
use crate::time_base::ChannelGroup;
use ff_model::diagnostics::{clip, list, nearest};
use ff_model::{Area, Problem, Problems};

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
    Current,
}

/// All groups, in the order of the channels.
pub(super) const GROUPS: [Group; 8] =
    [Group::Q, Group::Dq, Group::Ddq, Group::Tau, Group::Gyro, Group::Acc, Group::Att, Group::Current];

impl Group {
    /// Prefix in names that are written.
    pub(super) fn prefix(self) -> &'static str {
        ["q", "dq", "ddq", "tau", "gyro", "acc", "att", "current"][self as usize]
    }
    /// Every prefix that is read.
    pub(super) fn of_prefix(prefix: &str) -> Option<Self> {
        match prefix {
            "qd" => Some(Self::Dq),
            "qdd" => Some(Self::Ddq),
            _ => GROUPS.into_iter().find(|g| g.prefix() == prefix),
        }
    }
    pub(super) fn axes(self) -> Option<&'static [&'static str]> {
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
            Self::Tau | Self::Current => ChannelGroup::Torque,
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
            (Self::Current, _) => Dimension::Current,
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
    /// A channel that is carried beside, by its number among them.
    Carried(usize, &'static Unit),
    /// Positions of a joint that follows another, by its index among such: compared, and left out.
    Follower(usize, &'static Unit),
    /// Named by the user as of no interest, or known from others.
    Ignored,
}

impl Target {
    /// Unit of a channel; `None` for the time and what is ignored.
    pub(super) fn unit(&self) -> Option<&'static Unit> {
        match self {
            Self::Channel(_, _, u) | Self::Carried(_, u) | Self::Follower(_, u) => Some(u),
            Self::Time(_) | Self::Ignored => None,
        }
    }
    /// Channels that are sampled together with this one.
    pub(super) fn sampled_with(&self) -> Option<ChannelGroup> {
        match self {
            Self::Channel(g, ..) => Some(g.sampled_with()),
            Self::Carried(..) => Some(ChannelGroup::Carried),
            Self::Follower(..) => Some(ChannelGroup::Motion),
            Self::Time(_) | Self::Ignored => None,
        }
    }
    /// Whether it is a position of a joint.
    pub(super) fn is_position(&self) -> bool {
        matches!(self, Self::Channel(Group::Q, ..) | Self::Follower(..))
    }
    /// Prefix of the column's name.
    pub(super) fn group(&self) -> &'static str {
        match self {
            Self::Time(_) => "time",
            Self::Channel(g, _, _) => g.prefix(),
            Self::Carried(..) => "carried",
            Self::Follower(..) => "q",
            Self::Ignored => "ignored",
        }
    }
}

/// The warning that says which columns are left out for want of a name; `None` where all have one.
pub fn without_name(head: &[String]) -> Option<Problem> {
    let at: Vec<usize> = (0..head.len()).filter(|&i| is_nameless(&head[i])).collect();
    let what = match at[..] {
        [] => return None,
        [0] => "the first column has no name: taken as row numbers".to_owned(),
        _ => {
            let numbers: Vec<String> = at.iter().map(|i| (i + 1).to_string()).collect();
            format!("columns without a name are left out: {}", list(numbers.iter().map(String::as_str), 8))
        }
    };
    let p = Problem::warning(Area::Data, "Data::NotUsed", what);
    Some(p.hint("with pandas, to_csv(..., index=False); name the column if it is a signal"))
}

/// Whether a name means something here by itself: the time, a channel, what is carried, or a channel of a joint that follows another.
pub(super) fn known(name: &str, joints: &[JointColumn], followers: &[FollowerColumn]) -> bool {
    place(name, joints).is_some() || carried(name).is_some() || follower(name, followers).is_some()
}

/// The group and the joint of a column of a joint that follows another.
fn follower(name: &str, followers: &[FollowerColumn]) -> Option<(Group, usize)> {
    let (prefix, joint) = name.split_once('.')?;
    let group = Group::of_prefix(prefix).filter(|g| g.axes().is_none())?;
    Some((group, followers.iter().position(|f| f.name == joint)?))
}

/// What every column is (a base that is bolted down needs no gyro); `None` when something is wrong, with the problems recorded at line 1.
pub(super) fn targets(
    head: &[String],
    joints: &[JointColumn],
    options: &ReadOptions,
    bad: &mut Problems,
) -> Option<Vec<Target>> {
    let (ignore, followers, fixed_base) = (&options.ignore, &options.followers, options.fixed_base);
    let mut out: Vec<Option<Target>> = Vec::with_capacity(head.len());
    let (mut extra, mut strangers): (Vec<&str>, Vec<&str>) = (Vec::new(), Vec::new());
    let mut good = true;
    if let Some(p) = without_name(head) {
        bad.push(p.at_line(1));
    }
    let ignored = |cell: &String| ignores(ignore, cell) || is_nameless(cell);
    let passed = head.iter().filter(|c| !ignored(c)).map(|c| split(c).0);
    let passed: Vec<&str> = passed.filter(|n| follower(n, followers).is_some()).collect();
    if !passed.is_empty() {
        let what = format!("columns of joints that follow others, left out: {}", list(passed.iter().copied(), LISTED));
        let p = Problem::warning(Area::Data, "Data::NotUsed", what).at_line(1);
        bad.push(p.hint("nothing to do: they are known from the joints that they follow"));
    }
    let mut fail = |p: Problem| {
        good = false;
        bad.push(p.at_line(1));
    };
    for cell in head {
        let (name, symbol) = split(cell);
        if ignored(cell) {
            out.push(Some(Target::Ignored));
            continue;
        }
        if let Some((group, k)) = follower(name, followers) {
            let unit = symbol.filter(|_| group == Group::Q);
            let unit = unit.and_then(|u| units::find(u, group.dimension(followers[k].slides)));
            out.push(Some(unit.map_or(Target::Ignored, |u| Target::Follower(k, u))));
            continue;
        }
        let known = match place(name, joints) {
            Some((place, d)) => Some((Some(place), d)),
            None => carried(name).map(|d| (None, d)),
        };
        let Some((place, dimension)) = known else {
            match name.split_once('.').map(|(p, j)| (Group::of_prefix(p), j)) {
                Some((Some(g), joint)) if g.axes().is_none() => strangers.push(joint),
                // What may be the time is asked after by itself.
                _ if is_time(cell) && time_column(head).is_err() => {}
                _ => extra.push(parts(cell, head).0),
            }
            out.push(None);
            continue;
        };
        let Some(symbol) = symbol else {
            let what = format!("column '{}' has no unit", clip(cell));
            let (si, known) = (units::si(dimension), units::symbols(dimension));
            let all = name.split_once('.').map_or_else(|| name.to_owned(), |(group, _)| format!("{group}.*"));
            let hint = format!(
                "write {}[{si}], or give --rename '{all}={all}[{si}]'; known: {known}",
                clip(name),
                all = clip(&all)
            );
            fail(data("Data::UnitMissing", what).on(clip(name)).hint(hint));
            out.push(None);
            continue;
        };
        match units::find(symbol, dimension) {
            Some(u) => out.push(Some(match place {
                Some(None) => Target::Time(u),
                Some(Some((g, k))) => Target::Channel(g, k, u),
                None => Target::Carried(out.iter().filter(|t| matches!(t, Some(Target::Carried(..)))).count(), u),
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
        let again = |c: &String| {
            let other = split(c).0;
            place(other, joints).is_some_and(|p| place(name, joints) == Some(p))
                || other == name && carried(name).is_some()
        };
        if head[..i].iter().any(again) {
            let p = data("Data::Columns", format!("column '{}' is there twice", clip(name))).on(clip(name));
            fail(p.hint("keep one of the two"));
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
            None if absent.is_empty() => {
                let prefixed =
                    |s: &&&str| head.iter().map(|c| split(c).0).find(|n| n.split_once('.').is_some_and(|p| p.1 == **s));
                let column = strangers.iter().find_map(|s| prefixed(&s)).unwrap_or_default();
                format!("leave them out with --ignore, such as --ignore '{}', if they stood still", clip(column))
            }
            None => format!("use the record of this robot; its joints: {}", list(all(), LISTED)),
        };
        fail(data("Data::NameMismatch", what).hint(hint));
    }
    let mut missing: Vec<String> = Vec::new();
    for g in GROUPS {
        let names = g.channels(joints);
        // The torque of a joint, or the current of its motor.
        let stands = |k: usize| match g {
            Group::Tau => named(Group::Tau, k) || named(Group::Current, k),
            Group::Current => true,
            _ => named(g, k),
        };
        let lost: Vec<&str> = (0..names.len()).filter(|&k| !stands(k)).map(|k| names[k]).collect();
        let some = lost.len() < names.len();
        // Joints that are there under a name of another robot have been reported.
        if !lost.is_empty()
            && (some || g.required() && !(fixed_base && g == Group::Gyro))
            && (strangers.is_empty() || g.axes().is_some())
        {
            missing.extend(lost.iter().map(|n| format!("{}.{n}", g.prefix())));
        }
    }
    // A wrench has six components.
    for cell in head {
        let Some((frame, _)) = split(cell).0.strip_prefix("wrench.").and_then(|n| n.rsplit_once('.')) else { continue };
        for c in WRENCH {
            let name = format!("wrench.{frame}.{c}");
            if !head.iter().any(|h| split(h).0 == name) && !missing.contains(&name) {
                missing.push(name);
            }
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
            (None, Some(e)) if !missing.is_empty() => format!(
                "give names with --rename, such as --rename '{}={}[UNIT]' (* for any text), or leave columns out with --ignore",
                clip(e),
                missing[0]
            ),
            (None, Some(e)) => format!("drop them, or name each with --ignore, such as --ignore '{}'", clip(e)),
            (None, None) => "give every channel of a group, or none of dq, ddq, acc and att".to_owned(),
        };
        fail(data("Data::Columns", what).hint(hint));
    }
    if good { out.into_iter().collect() } else { None }
}

/// Place of the column of the time, or what to say where there is none.
pub(super) fn time_column(names: &[String]) -> Result<usize, Box<Problem>> {
    let missing = || {
        let p = data("Data::Columns", "there is no column time[s]").on("time");
        match names.iter().find(|n| is_time(n)) {
            Some(n) => p.hint(format!(
                "is '{n}' the time? give --rename '{n}=time[s]', or time[ms], time[us], time[ns]",
                n = clip(split(n).0)
            )),
            None => {
                p.hint("name the time of every sample time[s], or say which column it is: --rename 'COLUMN=time[s]'")
            }
        }
    };
    names.iter().position(|n| split(n).0 == "time").ok_or_else(|| Box::new(missing()))
}

/// What a channel measures that is carried beside; `None` for a name that is none.
fn carried(name: &str) -> Option<Dimension> {
    let (kind, rest) = name.split_once('.')?;
    match kind {
        "wheel" => Some(Dimension::AngularRate),
        "thruster" => Some(Dimension::Force),
        "wrench" => {
            let (_, component) = rest.rsplit_once('.')?;
            let k = WRENCH.iter().position(|c| *c == component)?;
            Some(if k < 3 { Dimension::Force } else { Dimension::Torque })
        }
        _ => None,
    }
}

/// Names and SI units of the channels that are carried beside, in the order of their columns. Allocates.
pub(super) fn carried_channels(head: &[String], targets: &[Target]) -> (Vec<String>, Vec<&'static str>) {
    let all = head.iter().zip(targets).filter(|(_, t)| matches!(t, Target::Carried(..)));
    all.map(|(c, t)| (split(c).0.to_owned(), t.unit().map_or("1", |u| units::si(u.dimension)))).unzip()
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
