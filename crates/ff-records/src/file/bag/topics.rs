//! Which topics of a bag make a record.

use super::container::{Channel, Container};
use super::message::{Decoder, Imu, JointState, Kind, Wrench, kind_of};
use crate::file::blocks::unreadable;
use crate::file::naming::LISTED;
use crate::file::{JointColumn, ReadOptions, data};
use ff_model::Problems;
use ff_model::diagnostics::{clip, list};

/// Messages looked at to find the topics once one of joint states is known.
const LOOK: usize = 20_000;

/// A topic that is read.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Topic {
    pub(super) channel: Channel,
    pub(super) kind: Kind,
    pub(super) decoder: Decoder,
}

/// What the beginning of a bag tells.
pub(super) struct Found {
    pub(super) joints: Topic,
    /// The first message of it that has the joints of the robot, or the first of all.
    pub(super) state: JointState,
    pub(super) imu: Option<(Topic, Imu)>,
    pub(super) wrenches: Vec<(Topic, Wrench)>,
}

/// Topics with messages so far.
#[derive(Default)]
struct Seen {
    joints: Vec<(Topic, JointState)>,
    imu: Vec<(Topic, Imu)>,
    wrenches: Vec<(Topic, Wrench)>,
    /// All of them, with their types.
    listed: Vec<String>,
}

/// The topics of a record, by what the bag holds and the user chooses.
///
/// # Errors
/// `Data::Topics` with the list of topics; those of the container.
pub(super) fn look(bag: &mut impl Container, joints: &[JointColumn], options: &ReadOptions) -> Result<Found, Problems> {
    let seen = seen(bag, joints, options)?;
    let whole = |s: &JointState| joints.is_empty() || joints.iter().all(|c| s.names.contains(&c.name));
    let (topic, state) = choose(seen.joints, Kind::Joints, options, &seen.listed, whole)?;
    let imu = match choose(seen.imu, Kind::Imu, options, &seen.listed, |_| true) {
        Ok(found) => Some(found),
        // An arm on the ground has none; where one is needed the missing columns say so.
        Err(p) if p.has("Data::Topics") && !p.has("Data::TopicChoice") => None,
        Err(p) => return Err(p),
    };
    let mut wrenches = seen.wrenches;
    if wrenches.iter().any(|w| options.topics.contains(&w.0.channel.topic)) {
        wrenches.retain(|w| options.topics.contains(&w.0.channel.topic));
    }
    Ok(Found { joints: topic, state, imu, wrenches })
}

/// Reads on until a message of every kind that is wanted has been seen, or the bag ends.
fn seen(bag: &mut impl Container, joints: &[JointColumn], options: &ReadOptions) -> Result<Seen, Problems> {
    let mut found = Seen::default();
    let mut topics: Vec<u32> = Vec::new();
    let lacks = |s: &JointState| joints.iter().any(|c| !s.names.contains(&c.name));
    // Of the publishers of a topic the one that has the joints of the robot; without a robot the one with most joints.
    let fits = |new: &JointState, old: &JointState| {
        if joints.is_empty() { new.names.len() > old.names.len() } else { !lacks(new) }
    };
    for k in 0_usize.. {
        if k > LOOK && !found.joints.is_empty() {
            break;
        }
        // Topics stand before their first message; those without any tell nothing.
        let (id, message) = match bag.next() {
            Ok(Some(m)) => {
                // Another publisher may write the joints of the robot to a topic that began with others.
                let open = |s: &JointState| joints.is_empty() || lacks(s);
                let again = found.joints.iter_mut().find(|j| j.0.channel.id == m.channel && open(&j.1));
                if let Some((topic, state)) = again {
                    if let Some(s) = JointState::read(&topic.decoder, &m.data).filter(|s| fits(s, state)) {
                        *state = s;
                    }
                    continue;
                }
                if topics.contains(&m.channel) {
                    continue;
                }
                (m.channel, m.data.into_owned())
            }
            Ok(None) => break,
            // What can be said of it is said when it is read.
            Err(p) if p.has("Data::MaybeTruncated") => break,
            Err(p) => return Err(p),
        };
        topics.push(id);
        let Some(channel) = bag.channel(id).cloned() else { continue };
        let read = kind_of(&channel);
        if read.is_err() {
            if options.topics.contains(&channel.topic) || options.topics.is_empty() {
                let what = format!("topic '{}' is encoded as '{}'", clip(&channel.topic), clip(&channel.encoding));
                return Err(unreadable(bag.code(), what, "record with ROS 2, which writes cdr, or with ROS 1"));
            }
            continue;
        }
        found.listed.push(format!("{} ({})", clip(&channel.topic), clip(&channel.schema)));
        let Ok(Some((kind, decoder))) = read else { continue };
        let topic = Topic { channel, kind, decoder };
        if found.take(topic, &message).is_none() {
            let name = found.listed.last().map_or("", String::as_str);
            let what = format!("the first message of topic {name} is cut short");
            return Err(unreadable(bag.code(), what, super::container::DAMAGED));
        }
    }
    Ok(found)
}

impl Seen {
    /// Takes a topic with its first message; `None` where that cannot be read.
    fn take(&mut self, topic: Topic, message: &[u8]) -> Option<()> {
        match topic.kind {
            Kind::Joints => {
                let s = JointState::read(&topic.decoder, message)?;
                self.joints.push((topic, s));
            }
            Kind::Imu => {
                let i = Imu::read(&topic.decoder, message)?;
                self.imu.push((topic, i));
            }
            Kind::Wrench => {
                let w = Wrench::read(&topic.decoder, message)?;
                self.wrenches.push((topic, w));
            }
        }
        Some(())
    }
}

/// The topic of a kind: named by the user, or the only one, or the only one that fits.
fn choose<V>(
    mut all: Vec<(Topic, V)>,
    kind: Kind,
    options: &ReadOptions,
    others: &[String],
    fits: impl Fn(&V) -> bool,
) -> Result<(Topic, V), Problems> {
    let topics = || list(others.iter().map(String::as_str), LISTED);
    if let Some(k) = all.iter().position(|(t, _)| options.topics.contains(&t.channel.topic)) {
        return Ok(all.swap_remove(k));
    }
    if all.len() > 1 && all.iter().filter(|(_, v)| fits(v)).count() == 1 {
        all.retain(|(_, v)| fits(v));
    }
    let name = kind.name();
    match all.len() {
        1 => Ok(all.swap_remove(0)),
        0 => {
            let what = format!("no topic of {name} with messages; topics found: {}", topics());
            Err(unreadable("Data::Topics", what, "record the topic, or convert the bag to CSV"))
        }
        n => {
            let names = list(all.iter().map(|(t, _)| t.channel.topic.as_str()), LISTED);
            let mut p = unreadable("Data::Topics", format!("{n} topics of {name}: {names}"), "choose one with --topic");
            p.push(data("Data::TopicChoice", format!("topics found: {}", topics())).hint("choose one with --topic"));
            Err(p)
        }
    }
}
