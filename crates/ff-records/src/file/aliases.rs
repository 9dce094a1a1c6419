//! Columns under names of other programs: numbered (`q1`, `tau_0`, `joint_3_pos`, `/joint_states/effort[2]`), with the name of a joint among
//! other words (`/joint_states/shoulder/position`), or with the letter of an axis (`wx`, `imu_gyro_y`). Exact names come first; what is taken
//! is said, and where two readings are possible both are named and nothing is taken.

use super::columns::{GROUPS, Group, Target, known, targets};
use super::naming::{LISTED, ignores, is_nameless, is_time, parts, split, starred};
use super::phrases::{FILLERS, Which, read, words};
use super::units::{Dimension, find, si, symbols};
use super::{JointColumn, ReadOptions, data};
use ff_model::diagnostics::{clip, list};
use ff_model::{Area, Problem, Problems, Severity};

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

/// Names with those of this program in place of what was understood, and where each column goes; `None` where problems are recorded at line 1. `first` are
/// the cells of the first row, if it is at hand; `si_units` gives columns under other names that have no unit that of their channel.
pub(super) fn head(
    names: &[String],
    first: Option<&[Vec<u8>]>,
    joints: &[JointColumn],
    options: &ReadOptions,
    si_units: bool,
    bad: &mut Problems,
) -> Option<(Vec<String>, Option<Vec<Target>>)> {
    let (names, beside) = understood(names, first, joints, options, si_units, bad)?;
    let ignore = [&options.ignore[..], &beside].concat();
    let targets = targets(&names, joints, &ReadOptions { ignore, ..options.clone() }, bad);
    Some((names, targets))
}

/// Names with those of this program in place of what was understood, and the columns to leave out beside; `None` where two readings are
/// possible, with the problems recorded at line 1. `first` are the cells of the first row, if it is at hand; `si_units` gives columns without
/// a unit that of their channel.
fn understood(
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
        !(is_nameless(cell)
            || ignores(&options.ignore, cell)
            || is_time(cell)
            || known(name, joints, &options.followers))
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
            !ignores(&options.ignore, c)
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
