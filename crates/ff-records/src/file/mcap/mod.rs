//! ROS 2 bags in MCAP: `sensor_msgs/JointState` and `sensor_msgs/Imu` as one record on the clock of the joints.
//!
//! The container is read by own code ([`container`]): a chunk at a time, every length checked against the file and against
//! limits before memory is taken, so that nothing a file says can exhaust memory or panic. Messages are decoded from CDR by
//! [`cdr`], and brought to one clock by [`merge`].
pub(crate) mod cdr;
pub(crate) mod container;
pub(crate) mod lz4;
pub(crate) mod merge;

use super::blocks::{BLOCK, Block, Blocks, Stamps, unreadable};
use super::{JointColumn, ReadOptions, data};
use cdr::{Imu, JointState};
use container::{Channel, Container, Message};
use ff_model::diagnostics::{clip, list};
use ff_model::{Area, Problem, Problems};
use merge::Merge;
use std::fs::File;

/// Most topics named in one message.
const LISTED: usize = 12;
/// Messages looked at to find the topics once one of joint states is known.
const LOOK: usize = 20_000;

const JOINTS: [&str; 2] = ["sensor_msgs/msg/JointState", "sensor_msgs/JointState"];
const IMU: [&str; 2] = ["sensor_msgs/msg/Imu", "sensor_msgs/Imu"];

/// A bag as rows.
pub(crate) struct McapBlocks {
    bag: Container,
    names: Vec<String>,
    messages: Messages,
    ended: bool,
    truncated: Option<Problem>,
}

/// The messages that belong to the record.
struct Messages {
    /// Channels that are read.
    joints: u16,
    imu: Option<u16>,
    merge: Merge,
    /// Buffers of the message at hand.
    state: JointState,
    /// Topics, for what is said at the end.
    topics: (String, Option<String>),
    /// True when messages carry no stamp of their own and the time of recording is taken.
    unstamped: bool,
}

/// What the beginning of a bag tells.
struct Found {
    joints: Vec<(Channel, JointState)>,
    imu: Vec<(Channel, Imu)>,
    others: Vec<String>,
}

impl McapBlocks {
    pub(crate) fn new(file: File, joints: &[JointColumn], options: &ReadOptions) -> Result<Self, Problems> {
        let mut bag = Container::new(file)?;
        let found = look(&mut bag, options)?;
        let (channel, first) = choose(found.joints, "sensor_msgs/JointState", options, &found.others, |j| {
            joints.is_empty() || joints.iter().all(|c| j.names.contains(&c.name))
        })?;
        let imu = match choose(found.imu, "sensor_msgs/Imu", options, &found.others, |_| true) {
            Ok((c, i)) => Some((c, i)),
            // An arm on the ground has none; where one is needed the missing columns say so.
            Err(p) if p.has("Data::Topics") && !p.has("Data::TopicChoice") => None,
            Err(p) => return Err(p),
        };
        let merge = Merge::new(&first, imu.as_ref().map(|(_, i)| i));
        let slides = |n: &String| joints.iter().any(|j| j.name == *n && j.slides) || options.slides.contains(n);
        let mut names = vec!["time[ns]".to_owned()];
        let groups = [
            ("q", first.position.len(), ["rad", "m"]),
            ("dq", first.velocity.len(), ["rad/s", "m/s"]),
            ("tau", first.effort.len(), ["N m", "N"]),
        ];
        for (prefix, n, units) in groups {
            if n > 0 {
                let unit = |name| units[usize::from(slides(name))];
                names.extend(first.names.iter().map(|n| format!("{prefix}.{n}[{}]", unit(n))));
            }
        }
        if let Some((_, i)) = &imu {
            let mut axes = |prefix: &str, unit: &str, axes: &[&str]| {
                names.extend(axes.iter().map(|a| format!("{prefix}.{a}[{unit}]")));
            };
            if i.gyro.is_some() {
                axes("gyro", "rad/s", &["x", "y", "z"]);
            }
            if i.acc.is_some() {
                axes("acc", "m/s^2", &["x", "y", "z"]);
            }
            if i.att.is_some() {
                axes("att", "1", &["w", "x", "y", "z"]);
            }
        }
        bag.rewind()?;
        let unstamped = first.stamp == 0;
        let topics = (channel.topic.clone(), imu.as_ref().map(|(c, _)| c.topic.clone()));
        let messages =
            Messages { joints: channel.id, imu: imu.map(|(c, _)| c.id), merge, state: first, topics, unstamped };
        Ok(Self { bag, names, messages, ended: false, truncated: None })
    }
}

impl Messages {
    /// Takes a message that belongs to the record.
    fn take(&mut self, m: &Message<'_>) -> Result<(), Problems> {
        let wrong = |what: &str, topic: &str| {
            let what = format!("{what} on topic '{}' at byte {}", clip(topic), m.offset);
            unreadable("Data::Mcap", what, "record the bag again; it may be damaged")
        };
        if m.channel == self.joints {
            let joints = &self.topics.0;
            let s = &mut self.state;
            s.read_again(m.data).ok_or_else(|| wrong("a JointState that is cut short", joints))?;
            let stamp = if self.unstamped { m.log_time } else { s.stamp };
            self.merge.joints(stamp, s).map_err(|what| wrong(&what, joints))
        } else if Some(m.channel) == self.imu {
            let topic = self.topics.1.as_deref().unwrap_or_default();
            let i = Imu::read(m.data).ok_or_else(|| wrong("an Imu that is cut short", topic))?;
            let stamp = if self.unstamped { m.log_time } else { i.stamp };
            self.merge.imu(stamp, &i).map_err(|what| wrong(&what, topic))
        } else {
            Ok(())
        }
    }
}

/// Reads on until a message of every kind that is wanted has been seen, or the bag ends.
fn look(bag: &mut Container, options: &ReadOptions) -> Result<Found, Problems> {
    let mut found = Found { joints: Vec::new(), imu: Vec::new(), others: Vec::new() };
    let mut seen = Vec::new();
    for k in 0_usize.. {
        if k > LOOK && !found.joints.is_empty() {
            break;
        }
        // Channels stand before their first message; those without any tell nothing.
        let (id, states) = match bag.next() {
            Ok(Some(m)) => {
                if seen.contains(&m.channel) {
                    continue;
                }
                (m.channel, (JointState::read(m.data), Imu::read(m.data)))
            }
            Ok(None) => break,
            // What can be said of it is said when it is read.
            Err(p) if p.has("Data::MaybeTruncated") => break,
            Err(p) => return Err(p),
        };
        seen.push(id);
        let Some(c) = bag.channel(id).cloned() else { continue };
        let schema = c.schema.clone();
        let kind = |all: [&str; 2]| all.contains(&schema.as_str());
        let named = || options.topics.contains(&c.topic);
        if (kind(JOINTS) || kind(IMU)) && c.encoding != "cdr" {
            if named() || options.topics.is_empty() {
                let what = format!("topic '{}' is encoded as '{}'", clip(&c.topic), clip(&c.encoding));
                return Err(unreadable("Data::Mcap", what, "record with ROS 2, which writes cdr"));
            }
            continue;
        }
        found.others.push(format!("{} ({})", clip(&c.topic), clip(&c.schema)));
        match states {
            (Some(j), _) if kind(JOINTS) => found.joints.push((c, j)),
            (_, Some(i)) if kind(IMU) => found.imu.push((c, i)),
            _ if kind(JOINTS) || kind(IMU) => {
                let what = format!("the first message of topic '{}' is cut short", clip(&c.topic));
                return Err(unreadable("Data::Mcap", what, "record the bag again; it may be damaged"));
            }
            _ => {}
        }
    }
    Ok(found)
}

/// The topic of a kind: named by the user, or the only one, or the only one that fits.
fn choose<V>(
    mut all: Vec<(Channel, V)>,
    kind: &str,
    options: &ReadOptions,
    others: &[String],
    fits: impl Fn(&V) -> bool,
) -> Result<(Channel, V), Problems> {
    let topics = || list(others.iter().map(String::as_str), LISTED);
    if let Some(k) = all.iter().position(|(c, _)| options.topics.contains(&c.topic)) {
        return Ok(all.swap_remove(k));
    }
    if all.len() > 1 && all.iter().filter(|(_, v)| fits(v)).count() == 1 {
        all.retain(|(_, v)| fits(v));
    }
    match all.len() {
        1 => Ok(all.swap_remove(0)),
        0 => {
            let what = format!("no topic of {kind} with messages; topics found: {}", topics());
            Err(unreadable("Data::Topics", what, "record the topic, or convert the bag to CSV"))
        }
        n => {
            let names = list(all.iter().map(|(c, _)| c.topic.as_str()), LISTED);
            let mut p = unreadable("Data::Topics", format!("{n} topics of {kind}: {names}"), "choose one with --topic");
            p.push(data("Data::TopicChoice", format!("topics found: {}", topics())).hint("choose one with --topic"));
            Err(p)
        }
    }
}

impl Blocks for McapBlocks {
    fn names(&self) -> &[String] {
        &self.names
    }
    fn want(&mut self, _: &[bool]) {}
    fn next(&mut self, out: &mut Block) -> Result<bool, Problems> {
        out.clear();
        let mut stamps = out.stamps.take_whole();
        // What waited for room.
        self.messages.merge.advance();
        while !self.ended && self.messages.merge.ready() < BLOCK {
            match self.bag.next() {
                Ok(Some(m)) => self.messages.take(&m)?,
                Ok(None) => self.ended = true,
                Err(p) if p.has("Data::MaybeTruncated") => {
                    self.truncated = p.0.into_iter().next();
                    self.ended = true;
                }
                Err(p) => return Err(p),
            }
        }
        if self.ended && self.messages.merge.ready() < BLOCK {
            self.messages.merge.end();
        }
        self.messages.merge.take(&mut stamps, &mut out.columns);
        let some = !stamps.is_empty();
        out.stamps = Stamps::Whole(stamps);
        match self.truncated.take_if(|_| !some) {
            Some(p) => Err(Problems(vec![p])),
            None => Ok(some),
        }
    }
    fn bytes(&self) -> u64 {
        self.bag.bytes()
    }
    fn notes(&self) -> Problems {
        let mut out = Problems::default();
        let mut note = |what: String, hint: &str| {
            out.push(Problem::warning(Area::Data, "Data::Merged", what).hint(hint));
        };
        let m = &self.messages;
        if m.unstamped {
            note("messages carry no stamps; the times of recording are taken".to_owned(), "stamp at the sensor");
        }
        if let (Some(topic), Some(r)) = (&m.topics.1, m.merge.report()) {
            let what = format!(
                "base sensors of '{}' interpolated to {} stamps of '{}': {} at stamps of their own, the others between neighbours up \
                 to {:.6} s apart (median interval {:.6} s); {} joint states outside left out",
                clip(topic),
                r.rows,
                clip(&m.topics.0),
                r.exact,
                r.widest,
                r.interval,
                r.outside
            );
            note(
                what,
                "between samples white noise shrinks to 2/3 of its variance on average; frames are taken as the base's",
            );
        }
        out
    }
}
