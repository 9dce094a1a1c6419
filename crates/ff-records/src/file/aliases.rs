//! Columns under names of other programs: numbered (`q1`, `tau_0`, `joint_3_pos`, `/joint_states/effort[2]`), with the name of a joint among
//! other words (`/joint_states/shoulder/position`), or with the letter of an axis (`wx`, `imu_gyro_y`). Exact names come first; what is taken
//! is said, and where two readings are possible both are named and nothing is taken.

use super::columns::{GROUPS, Group, known};
use super::heading::starred;
use super::naming::{is_nameless, is_time, split};
use super::units::{Dimension, find, si, symbols};
use super::{JointColumn, ReadOptions, data};
use ff_model::diagnostics::{clip, list};
use ff_model::{Area, Problem, Problems, Severity};

/// Most names listed in an error; a warning lists all that were taken.
const LISTED: usize = 12;

/// What the words of a column mean, without its number, joint, axis and unit.
const PHRASES: [(&str, Group); 50] = [
    ("q", Group::Q),
    ("qpos", Group::Q),
    ("pos", Group::Q),
    ("position", Group::Q),
    ("positions", Group::Q),
    ("angle", Group::Q),
    ("angles", Group::Q),
    ("dq", Group::Dq),
    ("qd", Group::Dq),
    ("qdot", Group::Dq),
    ("qvel", Group::Dq),
    ("vel", Group::Dq),
    ("velocity", Group::Dq),
    ("velocities", Group::Dq),
    ("speed", Group::Dq),
    ("ddq", Group::Ddq),
    ("qdd", Group::Ddq),
    ("qddot", Group::Ddq),
    ("qacc", Group::Ddq),
    ("acceleration", Group::Ddq),
    ("accelerations", Group::Ddq),
    ("tau", Group::Tau),
    ("torque", Group::Tau),
    ("torques", Group::Tau),
    ("trq", Group::Tau),
    ("eff", Group::Tau),
    ("effort", Group::Tau),
    ("efforts", Group::Tau),
    ("current", Group::Current),
    ("currents", Group::Current),
    ("cur", Group::Current),
    ("motor current", Group::Current),
    ("w", Group::Gyro),
    ("omega", Group::Gyro),
    ("gyr", Group::Gyro),
    ("gyro", Group::Gyro),
    ("gyroscope", Group::Gyro),
    ("angvel", Group::Gyro),
    ("ang vel", Group::Gyro),
    ("angular rate", Group::Gyro),
    ("angular velocity", Group::Gyro),
    ("acc", Group::Acc),
    ("accel", Group::Acc),
    ("accelerometer", Group::Acc),
    ("linear acceleration", Group::Acc),
    ("q", Group::Att),
    ("quat", Group::Att),
    ("quaternion", Group::Att),
    ("orientation", Group::Att),
    ("attitude", Group::Att),
];
/// Words beside those that change nothing.
const FILLERS: [&str; 19] = [
    "joint", "joints", "jnt", "j", "axis", "state", "states", "measured", "meas", "msr", "actual", "act", "value",
    "field", "data", "imu", "base", "body", "sensor",
];
/// Words of what was asked for and not measured, wherever they stand.
const DEMANDS: [&str; 12] = [
    "desired",
    "des",
    "command",
    "commanded",
    "cmd",
    "target",
    "reference",
    "ref",
    "setpoint",
    "goal",
    "error",
    "covariance",
];
/// Units at the end of a name.
const UNITS: [(&str, &str); 18] = [
    ("rad", "rad"),
    ("deg", "deg"),
    ("mrad", "mrad"),
    ("nm", "N m"),
    ("mnm", "mN m"),
    ("rads", "rad/s"),
    ("rad s", "rad/s"),
    ("radps", "rad/s"),
    ("rad per s", "rad/s"),
    ("degs", "deg/s"),
    ("deg s", "deg/s"),
    ("mrad s", "mrad/s"),
    ("mradps", "mrad/s"),
    ("dps", "deg/s"),
    ("deg per s", "deg/s"),
    ("m s2", "m/s^2"),
    ("a", "A"),
    ("ma", "mA"),
];

/// Which channel of its group a column is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Which {
    /// This joint or axis, by its name.
    Named(usize),
    /// By a number, whose base is known with the others.
    Number(u32),
}

/// A column that was understood.
#[derive(Clone, Debug)]
struct Member {
    /// Its place in the file.
    column: usize,
    which: Which,
    /// What its header or name says, or the definition of its message.
    unit: Option<String>,
}

/// Columns that belong together: the same words around numbers, joints or axes.
struct Set {
    group: Group,
    words: String,
    numbered: bool,
    /// Units are those of the definition of a message of ROS.
    defined: bool,
    members: Vec<Member>,
}

/// What a name says.
#[derive(Debug, PartialEq)]
struct Reading {
    group: Group,
    which: Which,
    words: String,
    unit: Option<&'static str>,
    defined: bool,
}

/// Names with those of this program in place of what was understood, and the columns to leave out beside; `None` where two readings are
/// possible, with the problems recorded at line 1. `first` are the cells of the first row, if it is at hand; `si_units` gives columns without
/// a unit that of their channel.
pub(super) fn understood(
    names: &[String],
    first: Option<&[Vec<u8>]>,
    joints: &[JointColumn],
    options: &ReadOptions,
    si_units: bool,
    bad: &mut Problems,
) -> Option<(Vec<String>, Vec<String>)> {
    let (mut out, mut ignore) = (names.to_vec(), Vec::new());
    let open = |i: usize| {
        let (cell, name) = (&names[i], split(&names[i]).0);
        !(is_nameless(cell) || ignored(cell, options) || is_time(cell) || known(name, joints, &options.followers))
    };
    let of_message = message_names(names, first, joints);
    let mut sets: Vec<Set> = Vec::new();
    for i in (0..names.len()).filter(|&i| open(i)) {
        if of_message.as_ref().is_some_and(|m| m.columns.contains(&i)) {
            ignore.push(names[i].clone());
            continue;
        }
        let (name, unit) = parts(&names[i], names);
        let Some(mut reading) = read(name, joints) else { continue };
        if let (Some(m), Which::Number(k)) = (&of_message, reading.which)
            && reading.group.axes().is_none()
        {
            match m.joint(k) {
                // Positions, rates and efforts beside names are a message.
                Some(joint) => (reading.which, reading.defined) = (Which::Named(joint), true),
                None => {
                    ignore.push(names[i].clone());
                    continue;
                }
            }
        }
        let slides = matches!(reading.which, Which::Named(k) if reading.group.axes().is_none() && joints[k].slides);
        let dimension = reading.group.dimension(slides);
        let unit = match (unit, reading.unit) {
            // Both, which say the same or nothing that can be relied on.
            (Some(a), Some(b)) if find(a, dimension) != find(b, dimension) => continue,
            (Some(a), _) => Some(a.to_owned()),
            (None, Some(b)) if find(b, dimension).is_none() => continue,
            (None, b) => b.map(str::to_owned),
        };
        let numbered = matches!(reading.which, Which::Number(_));
        let member = Member { column: i, which: reading.which, unit };
        let same = |s: &&mut Set| s.group == reading.group && s.words == reading.words && s.numbered == numbered;
        match sets.iter_mut().find(same) {
            Some(set) => set.members.push(member),
            None => sets.push(Set {
                group: reading.group,
                words: reading.words,
                numbered,
                defined: reading.defined,
                members: vec![member],
            }),
        }
    }
    let before = bad.0.len();
    let show = |m: &Member| format!("'{}'", clip(split(&names[m.column]).0));
    let span = |s: &Set| match &s.members[..] {
        [one] => show(one),
        [a, .., b] => format!("{} .. {}", show(a), show(b)),
        [] => String::new(),
    };
    let mut fail = |p: Problem| bad.push(p.at_line(1));
    let mut taken: Vec<&Set> = Vec::new();
    for group in GROUPS {
        let exact = names.iter().any(|c| {
            let name = split(c).0;
            !ignored(c, options)
                && name.split_once('.').is_some_and(|p| Group::of_prefix(p.0) == Some(group))
                && known(name, joints, &[])
        });
        let of: Vec<&Set> = sets.iter().filter(|s| s.group == group && !exact).collect();
        let channels = group.channels(joints);
        let whole = |s: &&&Set| !s.numbered || base(s, channels.len()).is_some();
        let complete: Vec<&Set> = of.iter().filter(whole).copied().collect();
        match complete[..] {
            [] => {
                if let Some(set) = of.first().filter(|_| group.axes().is_none() && !joints.is_empty()) {
                    fail(not_complete(set, &span(set), joints));
                }
            }
            [one] if one.numbered && group == Group::Att => {
                let what =
                    format!("{} may be a quaternion with its scalar first (w x y z) or last (x y z w)", span(one));
                let hint = format!("say which: --rename '{}=att.w[1]', and so on", clip(&names[one.members[0].column]));
                fail(data("Data::Columns", what).on("att").hint(hint));
            }
            [one] if one.numbered && group == Group::Acc && joints.len() == 3 => {
                let what = format!("{} may be accelerations of the three joints or an accelerometer", span(one));
                let first = clip(&names[one.members[0].column]);
                fail(data("Data::Columns", what).on("acc").hint(format!(
                    "say which: --rename '{first}=acc.x[m/s^2]' or --rename '{first}=ddq.{}[rad/s^2]', and so on",
                    clip(&joints[0].name)
                )));
            }
            [one] => {
                if one.numbered
                    && group.axes().is_none()
                    && let Some(p) = other_order(one, names, joints)
                {
                    fail(p);
                }
                taken.push(one);
            }
            [a, b, ..] => {
                let what = format!("{} and {} may both be {}.*", span(a), span(b), group.prefix());
                let hint = format!(
                    "leave one out: --ignore {}, or name the columns of the other with --rename",
                    rule(b, names, "")
                );
                fail(data("Data::Columns", what).on(group.prefix()).hint(hint));
            }
        }
    }
    let mut named: Vec<String> = Vec::new();
    let mut notes: Vec<Problem> = Vec::new();
    for set in taken {
        let channels = set.group.channels(joints);
        let first = base(set, channels.len()).unwrap_or(0);
        let at = |m: &Member| match m.which {
            Which::Named(k) => k,
            Which::Number(n) => (n - first) as usize,
        };
        let mut said: Vec<(usize, String)> = Vec::new();
        let mut lacking: Option<Dimension> = None;
        for m in &set.members {
            let k = at(m);
            let dimension = set.group.dimension(set.group.axes().is_none() && joints[k].slides);
            let unit = m.unit.clone().or_else(|| (set.defined || si_units).then(|| si(dimension).to_owned()));
            let name = format!("{}.{}", set.group.prefix(), channels[k]);
            said.push((k, format!("{} as {name}", show(m))));
            match unit {
                Some(unit) => out[m.column] = format!("{name}[{unit}]"),
                None => lacking = Some(dimension),
            }
        }
        if let Some(dimension) = lacking {
            let what = format!("{}, which may be {}.*, have no unit", span(set), set.group.prefix());
            let units = symbols(dimension);
            let hint =
                format!("say it: --rename {}; known: {units}", rule(set, names, &format!("[{}]", si(dimension))));
            fail(data("Data::UnitMissing", what).on(set.group.prefix()).hint(hint));
            continue;
        }
        said.sort();
        let said = said.into_iter().map(|s| s.1).collect::<Vec<_>>().join(", ");
        let si = if set.defined { " in the SI units that the messages of ROS define" } else { "" };
        if set.numbered {
            let order = if set.group.axes().is_some() { "x, y, z" } else { "the joints of the mission" };
            let what = format!("columns taken by their numbers, in the order of {order}{si}: {said}");
            let channel = set.members.iter().find(|m| at(m) == 0).map_or(String::new(), show);
            let hint = format!(
                "if their order is another, name every one with --rename, such as --rename {}={}.{}'",
                channel.trim_end_matches('\''),
                set.group.prefix(),
                channels[0]
            );
            notes.push(Problem::warning(Area::Data, "Data::Named", what).on(set.group.prefix()).hint(hint));
        } else {
            named.push(format!("{said}{si}"));
        }
    }
    if bad.0[before..].iter().any(|p| p.severity == Severity::Error) {
        return None;
    }
    if !named.is_empty() {
        let what = format!("columns taken by their names: {}", named.join(", "));
        notes.push(
            Problem::warning(Area::Data, "Data::Named", what)
                .hint("nothing to do, if that is what they are; else --rename"),
        );
    }
    if !ignore.is_empty() {
        let what = format!(
            "names of joints in columns, and joints that the mission does not move, left out: {}",
            list(ignore.iter().map(String::as_str), LISTED)
        );
        notes.push(Problem::warning(Area::Data, "Data::NotUsed", what).hint("nothing to do: they are taken as held"));
    }
    bad.0.extend(notes.into_iter().map(|p| p.at_line(1)));
    Some((out, ignore))
}

/// Whether the user leaves a column out, by its name or by a pattern with one `*`.
pub(super) fn ignored(cell: &str, options: &ReadOptions) -> bool {
    ignores(&options.ignore, cell)
}

/// Whether one of these rules leaves a column out: its name, the whole cell, or either with one `*` for any text.
pub fn ignores(rules: &[String], cell: &str) -> bool {
    let name = split(cell).0;
    rules.iter().any(|rule| starred(rule, name).is_some() || starred(rule, cell).is_some())
}

/// A rule that fits the columns of a set and no other, or the first of them.
fn rule(set: &Set, names: &[String], unit: &str) -> String {
    let of: Vec<&str> = set.members.iter().map(|m| split(&names[m.column]).0).collect();
    let common = |a: &str, b: &str| a.bytes().zip(b.bytes()).take_while(|(x, y)| x == y).count();
    let first = of.first().copied().unwrap_or_default();
    let mut head = of.iter().map(|n| common(first, n)).min().unwrap_or(0);
    while !first.is_char_boundary(head) {
        head -= 1;
    }
    let back = |n: &str| {
        n.chars().rev().zip(first.chars().rev()).take_while(|(x, y)| x == y).map(|c| c.0.len_utf8()).sum::<usize>()
    };
    let shortest = of.iter().map(|n| n.len()).min().unwrap_or(0);
    let tail = of.iter().map(|n| back(n)).min().unwrap_or(0).min(shortest - head.min(shortest));
    let pattern = format!("{}*{}", &first[..head], &first[first.len() - tail..]);
    let fits = names.iter().filter(|n| starred(&pattern, split(n).0).is_some()).count();
    let word = if of.len() > 1 && fits == of.len() { pattern } else { clip(first) };
    let each = if word.contains('*') || of.len() < 2 { "" } else { ", and so for each of them" };
    if unit.is_empty() { format!("'{word}'{each}") } else { format!("'{word}={word}{unit}'{each}") }
}

/// The number that the first of a complete set has: 0 or 1.
fn base(set: &Set, channels: usize) -> Option<u32> {
    let number = |m: &Member| match m.which {
        Which::Number(n) => Some(n),
        Which::Named(_) => None,
    };
    let mut numbers: Vec<u32> = set.members.iter().filter_map(number).collect();
    numbers.sort_unstable();
    let first = *numbers.first().filter(|n| **n <= 1)?;
    let even = numbers.iter().zip(first..).all(|(n, k)| *n == k);
    (even && numbers.len() == channels && set.members.len() == channels).then_some(first)
}

/// What is said of numbers that are not those of the joints.
fn not_complete(set: &Set, span: &str, joints: &[JointColumn]) -> Problem {
    let what = format!(
        "{} columns {span}, which may be {}.*, and {} joints that the mission moves: {}",
        set.members.len(),
        set.group.prefix(),
        joints.len(),
        list(joints.iter().map(|j| j.name.as_str()), LISTED)
    );
    let hint = format!(
        "numbers count where each of these joints has one, from 0 or from 1; say which is which, as --rename 'COLUMN={}.{}'",
        set.group.prefix(),
        clip(&joints[0].name)
    );
    data("Data::Columns", what).on(set.group.prefix()).hint(hint)
}

/// What is said where joints have numbers of their own in another order than that of the mission, or others.
fn other_order(set: &Set, names: &[String], joints: &[JointColumn]) -> Option<Problem> {
    let number = |j: &JointColumn| {
        let digits = j.name.trim_end_matches(|c: char| c.is_ascii_digit()).len();
        j.name[digits..].parse::<u32>().ok()
    };
    let own: Vec<u32> = joints.iter().map(number).collect::<Option<_>>()?;
    let mut sorted = own.clone();
    sorted.sort_unstable();
    sorted.dedup();
    let begins = *sorted.first()?;
    // Numbers of the links of a tree, which say nothing.
    if sorted.len() != own.len() || begins <= 1 && own.iter().zip(begins..).all(|(n, k)| *n == k) {
        return None;
    }
    let first = clip(split(&names[set.members[0].column]).0);
    let what = format!(
        "'{first}' may count the joints in the order of the mission ({}) or mean the numbers in their names",
        list(joints.iter().map(|j| j.name.as_str()), LISTED)
    );
    let hint = format!("say which is which, as --rename '{first}={}.{}'", set.group.prefix(), clip(&joints[0].name));
    Some(data("Data::Columns", what).on(set.group.prefix()).hint(hint))
}

/// Name and unit of a cell, where `[1]` beside `[0]` or `[2]` is the place in an array.
pub(super) fn parts<'c>(cell: &'c str, all: &[String]) -> (&'c str, Option<&'c str>) {
    let (name, unit) = split(cell);
    let beside =
        |k: &str| all.iter().any(|c| c.trim().strip_prefix(name).is_some_and(|rest| rest.trim_start().starts_with(k)));
    if unit == Some("1") && cell.trim().ends_with("[1]") && (beside("[0]") || beside("[2]")) {
        return (cell.trim(), None);
    }
    (name, unit)
}

/// Names of joints in columns of text beside numbered ones, as `rostopic echo -p` writes messages.
struct MessageNames {
    columns: Vec<usize>,
    /// Number and name.
    names: Vec<(u32, Option<usize>)>,
}

impl MessageNames {
    fn joint(&self, number: u32) -> Option<usize> {
        self.names.iter().find(|n| n.0 == number).and_then(|n| n.1)
    }
}

fn message_names(names: &[String], first: Option<&[Vec<u8>]>, joints: &[JointColumn]) -> Option<MessageNames> {
    let first = first?;
    let (mut columns, mut found) = (Vec::new(), Vec::new());
    for (i, cell) in names.iter().enumerate() {
        let name = parts(cell, names).0;
        let (mut words, numbers) = words(name);
        words.retain(|w| !FILLERS.contains(&w.as_str()));
        let ([number], true) =
            (&numbers[..], words.last().is_some_and(|w| w == "name") && cell.contains(['.', '/', '[']))
        else {
            continue;
        };
        let text = String::from_utf8_lossy(first.get(i)?).trim().to_owned();
        columns.push(i);
        found.push((*number, joints.iter().position(|j| j.name == text)));
    }
    let all = (0..joints.len()).all(|k| found.iter().filter(|n| n.1 == Some(k)).count() == 1);
    (all && !joints.is_empty()).then_some(MessageNames { columns, names: found })
}

/// Words of a name in small letters, and the numbers in it: `jointPos_3` is joint, pos, 3.
fn words(name: &str) -> (Vec<String>, Vec<u32>) {
    let (mut out, mut numbers, mut word) = (Vec::new(), Vec::new(), String::new());
    let mut last = ' ';
    let mut end = |word: &mut String| {
        match word.parse::<u32>() {
            Ok(n) => numbers.push(n),
            Err(_) if !word.is_empty() => out.push(word.to_lowercase()),
            Err(_) => {}
        }
        word.clear();
    };
    for c in name.chars() {
        let other = c.is_ascii_digit() != last.is_ascii_digit() || last.is_lowercase() && c.is_uppercase();
        if !c.is_alphanumeric() || other {
            end(&mut word);
        }
        if c.is_alphanumeric() {
            word.push(c);
        }
        last = c;
    }
    end(&mut word);
    (out, numbers)
}

/// What a name says, if it says one thing.
fn read(name: &str, joints: &[JointColumn]) -> Option<Reading> {
    // Names of this program are exact: another joint is another robot.
    if let Some((prefix, channel)) = name.split_once('.')
        && Group::of_prefix(prefix).is_some()
        && channel.chars().count() > 1
        && !channel.bytes().all(|b| b.is_ascii_digit())
    {
        return None;
    }
    let mut by_length: Vec<usize> = (0..joints.len()).filter(|&k| !joints[k].name.is_empty()).collect();
    by_length.sort_by_key(|&k| std::cmp::Reverse(joints[k].name.len()));
    for k in by_length {
        for (at, _) in name.match_indices(joints[k].name.as_str()) {
            let (before, after) = (&name[..at], &name[at + joints[k].name.len()..]);
            if before.ends_with(char::is_alphanumeric) || after.starts_with(char::is_alphanumeric) {
                continue;
            }
            let ((mut all, numbers), (behind, more)) = (words(before), words(after));
            all.extend(behind);
            if numbers.is_empty()
                && more.is_empty()
                && let Some(r) = meaning(name, &all, Which::Named(k), false)
            {
                return Some(r);
            }
        }
    }
    let (all, numbers) = words(name);
    match numbers[..] {
        [n] => meaning(name, &all, Which::Number(n), false).or_else(|| meaning(name, &all, Which::Number(n), true)),
        [] => axis(name, &all),
        _ => None,
    }
}

/// A name with the letter of an axis.
fn axis(name: &str, all: &[String]) -> Option<Reading> {
    let (all, unit) = without_unit(all);
    let mut all = all.to_vec();
    let letter = |w: &str| ["x", "y", "z"].iter().position(|a| *a == w);
    let single = all.iter().rposition(|w| letter(w).is_some()).or_else(|| all.iter().rposition(|w| w == "w"));
    let axis = match single {
        Some(at) => all.remove(at),
        // `wx`, `qw`, `gyroy`.
        None => {
            let last = all.pop()?;
            let (stem, end) = last.split_at_checked(last.len().checked_sub(1)?)?;
            let stems = ["w", "q", "gyro", "gyr", "omega", "acc", "accel", "quat"];
            all.push(stems.contains(&stem).then(|| stem.to_owned())?);
            end.to_owned()
        }
    };
    let of = |group: Group| group.axes().and_then(|axes| axes.iter().position(|a| *a == axis));
    let mut reading = meaning(name, &all, Which::Number(0), true)?;
    reading.unit = reading.unit.or(unit);
    reading.which = Which::Named(of(reading.group)?);
    Some(reading)
}

/// Words without a unit at their end, and that unit.
fn without_unit(words: &[String]) -> (&[String], Option<&'static str>) {
    for n in [3, 2, 1] {
        let Some(at) = words.len().checked_sub(n).filter(|at| *at > 0) else { continue };
        let end = words[at..].join(" ");
        if let Some((_, unit)) = UNITS.iter().find(|u| u.0 == end) {
            return (&words[..at], Some(unit));
        }
    }
    (words, None)
}

/// What words mean: a group of joints, or one with `axes`.
fn meaning(name: &str, all: &[String], which: Which, axes: bool) -> Option<Reading> {
    if all.iter().any(|w| DEMANDS.contains(&w.as_str())) {
        return None;
    }
    let (all, unit) = without_unit(all);
    let mut rest = all;
    // Behind the topic of a message; its units are those of its definition.
    let topic = rest.windows(2).position(|w| w[0] == "joint" && matches!(w[1].as_str(), "states" | "state"));
    let message = match topic {
        Some(at) if !axes => {
            rest = &rest[at + 2..];
            true
        }
        _ => (name.starts_with('/') || name.starts_with("field.")) && axes,
    };
    let mut kept: Vec<&str> = rest.iter().map(String::as_str).filter(|w| !FILLERS.contains(w)).collect();
    if message && axes {
        // Of a path what stands behind the topic.
        kept.drain(..kept.len().saturating_sub(2));
        if kept.len() == 2 && kept[1] == "orientation" {
            kept.remove(0);
        }
    }
    let phrase = kept.join(" ");
    let of_joints = rest.iter().any(|w| matches!(w.as_str(), "joint" | "joints" | "jnt" | "j"));
    let group = match &*phrase {
        // Of joints where it says so; of an accelerometer otherwise.
        "acc" | "accel" if of_joints && !axes => Group::Ddq,
        // Wheels have speeds, and panels angles.
        "speed" | "angle" | "angles" if !of_joints => return None,
        p => PHRASES.iter().find(|f| f.0 == p && f.1.axes().is_some() == axes).map(|f| f.1)?,
    };
    if axes && of_joints {
        return None;
    }
    let of_ros = match group {
        Group::Q | Group::Dq | Group::Tau => topic.is_some(),
        _ => matches!(&*phrase, "angular velocity" | "linear acceleration" | "orientation"),
    };
    Some(Reading { group, which, words: all.join(" "), unit, defined: message && of_ros && unit.is_none() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joints(names: &[&str]) -> Vec<JointColumn> {
        names.iter().map(|n| JointColumn { name: (*n).to_owned(), slides: false }).collect()
    }

    #[test]
    fn names_of_others_say_one_thing_or_nothing() {
        let arm = joints(&["shoulder", "shoulder_lift", "elbow"]);
        let said = |name: &str| {
            let r = read(name, &arm)?;
            let which = match r.which {
                Which::Named(k) => r.group.channels(&arm)[k].to_owned(),
                Which::Number(n) => n.to_string(),
            };
            Some(format!("{}.{which}{}", r.group.prefix(), r.unit.map_or(String::new(), |u| format!("[{u}]"))))
        };
        for (name, want) in [
            ("q1", "q.1"),
            ("q_0", "q.0"),
            ("q.3", "q.3"),
            ("tau7", "tau.7"),
            ("joint_3_pos", "q.3"),
            ("pos_joint3", "q.3"),
            ("joint1_position", "q.1"),
            ("JointPos2", "q.2"),
            ("eff_3", "tau.3"),
            ("tau_Nm_2", "tau.2[N m]"),
            ("q1_deg", "q.1[deg]"),
            ("position[0]", "q.0"),
            ("/joint_states/effort.3", "tau.3"),
            ("/arm/joint_states/velocity[2]", "dq.2"),
            ("joint_2_acc", "ddq.2"),
            ("wx", "gyro.x"),
            ("w_y", "gyro.y"),
            ("gyro_1", "gyro.1"),
            ("gyro_z_dps", "gyro.z[deg/s]"),
            ("/bus/imu/angular_velocity/z", "gyro.z"),
            ("imu_acc_x", "acc.x"),
            ("qw", "att.w"),
            ("/imu/orientation/x", "att.x"),
            ("/joint_states/shoulder_lift/position", "q.shoulder_lift"),
            ("tau_shoulder", "tau.shoulder"),
            ("Gyro.X", "gyro.x"),
        ] {
            assert_eq!(said(name).as_deref(), Some(want), "{name}");
        }
        for name in [
            "q.joint1",
            "q_des_1",
            "tau_cmd_2",
            "quality",
            "temperature_1",
            "/joint_states_desired/position.1",
            "joint_1_2_pos",
            "wrist_pos",
            "x",
            "w",
            "time",
            "base_x",
            "shoulder_pan_pos",
            "/imu/angular_velocity_covariance[0]",
            "motor_1_torque",
            "gyro",
            "cycle_1",
            "speed_1",
        ] {
            assert_eq!(said(name), None, "{name}");
        }
    }
}
