//! Bags of ROS: joint states, base sensors and wrenches as one record on the clock of the joints; ROS 2 in MCAP, ROS 1 in its own format.
//!
//! A [`container`] gives messages, a chunk at a time: every length is checked against the file or against a limit before memory is
//! taken, so that nothing a file says can exhaust memory or panic. Messages are decoded from [`cdr`], or by the [`definition`] that
//! stands in the bag, and brought to one clock by [`merge`].
pub(crate) mod cdr;
pub(crate) mod container;
pub(crate) mod definition;
#[cfg(feature = "mcap")]
pub(crate) mod mcap;
pub(crate) mod merge;
pub(crate) mod message;
#[cfg(feature = "rosbag")]
pub(crate) mod rosbag;
pub(crate) mod topics;

use super::blocks::{BLOCK, Block, Blocks, Stamps, unreadable};
use super::dates::SECOND;
use super::naming::LISTED;
use super::options::StampSource;
use super::{JointColumn, ReadOptions};
use container::{Container, DAMAGED, Message};
use ff_model::diagnostics::{clip, list};
use ff_model::{Area, Problem, Problems};
use merge::{Counts, Merge, Side};
use message::{Imu, JointState, Kind, Wrench};
use topics::{Topic, look};

/// A bag as rows.
pub(crate) struct BagBlocks<C> {
    bag: C,
    names: Vec<String>,
    messages: Messages,
    ended: bool,
    /// What is said of a file that ends too early.
    truncated: Option<Problem>,
    /// Stamp of the last row so far (ns).
    until: Option<i64>,
}

/// The messages that belong to the record.
struct Messages {
    joints: Topic,
    /// Those beside, in the order of the [`Side`]s.
    sides: Vec<Topic>,
    merge: Merge,
    /// Buffers of the message at hand.
    state: JointState,
    /// True when the time of recording is taken, and why.
    received: Option<&'static str>,
    /// Joints of the bag that the robot does not have.
    strangers: Vec<String>,
    code: &'static str,
}

impl<C: Container> BagBlocks<C> {
    pub(crate) fn new(mut bag: C, joints: &[JointColumn], options: &ReadOptions) -> Result<Self, Problems> {
        let found = look(&mut bag, joints, options)?;
        let first = found.state;
        let own = |n: &String| joints.iter().any(|j| j.name == *n);
        // Fingers and wheels that the mission holds; where a joint of the robot is missing, all names are of use.
        let complete = !joints.is_empty() && joints.iter().all(|j| first.names.contains(&j.name));
        let (kept, strangers) =
            if complete { first.names.iter().cloned().partition(own) } else { (first.names.clone(), Vec::new()) };
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
                names.extend(kept.iter().map(|n| format!("{prefix}.{n}[{}]", unit(n))));
            }
        }
        let (mut sides, mut topics) = (Vec::new(), Vec::new());
        if let Some((topic, i)) = found.imu {
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
            sides.push(Side::imu(&i));
            topics.push(topic);
        }
        for (topic, w) in found.wrenches {
            for (part, unit) in [("f", "N"), ("t", "N m")] {
                names.extend(["x", "y", "z"].map(|a| format!("wrench.{}.{part}{a}[{unit}]", w.frame)));
            }
            sides.push(Side::wrench());
            topics.push(topic);
        }
        bag.rewind()?;
        let received = match options.stamps {
            StampSource::Receive => Some("asked for"),
            StampSource::Header if first.stamp == 0 => Some("messages carry no stamps"),
            StampSource::Header => None,
        };
        let merge = Merge::new(kept, &first, sides);
        let code = bag.code();
        let messages = Messages { joints: found.joints, sides: topics, merge, state: first, received, strangers, code };
        Ok(Self { bag, names, messages, ended: false, truncated: None, until: None })
    }
}

impl Messages {
    /// Takes a message that belongs to the record.
    fn take(&mut self, m: &Message<'_>) -> Result<(), Problems> {
        let code = self.code;
        let wrong = |what: &str, hint: &str, topic: &Topic| {
            let what = format!("{what} on topic '{}' before byte {}", clip(&topic.channel.topic), m.before);
            unreadable(code, what, hint)
        };
        let received = self.received.is_some();
        let at = |stamp: i64| if received { m.log_time } else { stamp };
        if m.channel == self.joints.channel.id {
            let (joints, s) = (&self.joints, &mut self.state);
            s.read_again(&joints.decoder, &m.data)
                .ok_or_else(|| wrong("a JointState that is cut short", DAMAGED, joints))?;
            return self.merge.joints(at(s.stamp), s).map_err(|r| wrong(&r.what, r.hint, joints));
        }
        let Some(k) = self.sides.iter().position(|t| t.channel.id == m.channel) else { return Ok(()) };
        let topic = &self.sides[k];
        let short = || wrong("a message that is cut short", DAMAGED, topic);
        match topic.kind {
            Kind::Imu => {
                let i = Imu::read(&topic.decoder, &m.data).ok_or_else(short)?;
                self.merge.imu(k, at(i.stamp), &i).map_err(|r| wrong(&r.what, r.hint, topic))
            }
            Kind::Wrench => {
                let w = Wrench::read(&topic.decoder, &m.data).ok_or_else(short)?;
                self.merge.wrench(k, at(w.stamp), &w).map_err(|r| wrong(&r.what, r.hint, topic))
            }
            Kind::Joints => Ok(()),
        }
    }
}

impl<C: Container> Blocks for BagBlocks<C> {
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
        if let Stamps::Whole(all) = &out.stamps {
            self.until = all.last().copied().or(self.until);
        }
        match self.truncated.take_if(|_| self.until.is_none()) {
            Some(p) => Err(Problems(vec![p])),
            None => Ok(some),
        }
    }
    fn bytes(&self) -> u64 {
        self.bag.bytes()
    }
    fn notes(&self) -> Problems {
        let mut out = Problems::default();
        let m = &self.messages;
        if let (Some(p), Some(until)) = (&self.truncated, self.until) {
            let what = format!(
                "{}: the messages before it are read, up to {}.{:09} s",
                p.message,
                until.div_euclid(SECOND),
                until.rem_euclid(SECOND)
            );
            let hint = "nothing to do, if the recorder was killed; else copy the bag again";
            out.push(Problem::warning(Area::Data, "Data::MaybeTruncated", what).hint(hint));
        }
        let mut note = |what: String, hint: &str| {
            out.push(Problem::warning(Area::Data, "Data::Merged", what).hint(hint));
        };
        if let Some(why) = m.received {
            let hint = "stamp at the sensor: times of recording are late by what the network takes";
            note(format!("the times of recording are taken ({why})"), hint);
        }
        let Counts { rows, outside, others, repeated } = m.merge.counts();
        let joints = clip(&m.joints.channel.topic);
        for (k, topic) in m.sides.iter().enumerate() {
            let r = m.merge.report(k);
            let name = if topic.kind == Kind::Imu { "base sensors" } else { "wrenches" };
            let what = format!(
                "{name} of '{}' interpolated to {rows} stamps of '{joints}': {} at stamps of their own, the others between neighbours up \
                 to {:.6} s apart (median interval {:.6} s); {outside} joint states outside left out",
                clip(&topic.channel.topic),
                r.exact,
                r.widest,
                r.interval,
            );
            note(
                what,
                "between samples white noise shrinks to 2/3 of its variance on average; frames are taken as the base's",
            );
        }
        if others > 0 {
            let what = format!("{others} messages of '{joints}' are of other joints and were left out");
            note(what, "nothing to do, if another controller writes to the same topic");
        }
        if repeated > 0 {
            let what = format!("{repeated} messages of '{joints}' have the stamp of the one before and were left out");
            note(what, "see why the driver wrote them twice; --stamps receive takes the times of recording");
        }
        if !m.strangers.is_empty() {
            let names = list(m.strangers.iter().map(String::as_str), LISTED);
            note(
                format!("joints of '{joints}' that the robot of the mission does not have were left out: {names}"),
                "they are taken as held",
            );
        }
        out
    }
}
