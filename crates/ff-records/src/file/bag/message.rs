//! The messages that a record is made of: joint states, base sensors, wrenches; by type in CDR, by the names of their fields in bags
//! of ROS 1.

use super::container::Channel;
use super::definition::{Layout, Value};

/// `sensor_msgs/JointState`; empty lists where it has none.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct JointState {
    /// ns; 0 for a message without a stamp of its own.
    pub(super) stamp: i64,
    pub(super) names: Vec<String>,
    pub(super) position: Vec<f64>,
    pub(super) velocity: Vec<f64>,
    pub(super) effort: Vec<f64>,
    /// Another one whenever the names may have changed.
    pub(super) version: u64,
    /// The names as they were in the message, whose bytes the next one mostly repeats.
    pub(super) image: Vec<u8>,
    /// What their bytes mean depends on: where in a word they begin, and the order of bytes.
    pub(super) image_of: (usize, bool),
}

/// `sensor_msgs/Imu`; `None` for what the sensor says it does not measure (first covariance -1).
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Imu {
    /// ns; 0 for a message without a stamp of its own.
    pub(super) stamp: i64,
    /// Body to world, scalar first.
    pub(super) att: Option<[f64; 4]>,
    pub(super) gyro: Option<[f64; 3]>,
    pub(super) acc: Option<[f64; 3]>,
}

/// `geometry_msgs/WrenchStamped`: force and torque (N, N m) in a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Wrench {
    /// ns; 0 for a message without a stamp of its own.
    pub(super) stamp: i64,
    pub(super) frame: String,
    pub(super) numbers: [f64; 6],
}

/// What a topic is to a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Joints,
    Imu,
    Wrench,
}

impl Kind {
    /// Type of ROS that it is called by.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Joints => "sensor_msgs/JointState",
            Self::Imu => "sensor_msgs/Imu",
            Self::Wrench => "geometry_msgs/WrenchStamped",
        }
    }
}

/// How the messages of a topic are read.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Decoder {
    /// Types of ROS 2 with a fixed definition.
    Cdr,
    /// By the definition in the bag.
    Ros1(Layout),
}

/// What a topic is, and how it is read; `None` for what no record is made of, `Err` for one in an encoding that is not read.
pub(super) fn kind_of(c: &Channel) -> Result<Option<(Kind, Decoder)>, ()> {
    if c.encoding == "ros1" {
        let Some(layout) = Layout::new(&c.definition) else { return Ok(None) };
        let has = |all: &[&str]| all.iter().all(|p| layout.has(p));
        let kind = if has(&["name", "position"]) {
            Kind::Joints
        } else if has(&["angular_velocity.x", "linear_acceleration.x"]) {
            Kind::Imu
        } else if has(&["wrench.force.x", "wrench.torque.x"]) {
            Kind::Wrench
        } else {
            return Ok(None);
        };
        return Ok(Some((kind, Decoder::Ros1(layout))));
    }
    let is = |pkg: &str, name: &str| c.schema == format!("{pkg}/msg/{name}") || c.schema == format!("{pkg}/{name}");
    let kind = if is("sensor_msgs", "JointState") {
        Kind::Joints
    } else if is("sensor_msgs", "Imu") {
        Kind::Imu
    } else if is("geometry_msgs", "WrenchStamped") {
        Kind::Wrench
    } else {
        return Ok(None);
    };
    if c.encoding == "cdr" { Ok(Some((kind, Decoder::Cdr))) } else { Err(()) }
}

impl JointState {
    pub(super) fn read(by: &Decoder, message: &[u8]) -> Option<Self> {
        let mut out = Self::default();
        out.read_again(by, message)?;
        Some(out)
    }
    /// Reads into the buffers of a message before. What is left after `None` is of no use.
    pub(super) fn read_again(&mut self, by: &Decoder, message: &[u8]) -> Option<()> {
        match by {
            Decoder::Cdr => self.read_cdr(message)?,
            Decoder::Ros1(layout) => self.read_by(layout, message)?,
        }
        let n = self.names.len();
        [&self.position, &self.velocity, &self.effort].into_iter().all(|v| v.is_empty() || v.len() == n).then_some(())
    }
    fn read_by(&mut self, layout: &Layout, message: &[u8]) -> Option<()> {
        (self.stamp, self.velocity, self.effort) = (0, Vec::new(), Vec::new());
        let mut whole = true;
        layout.read(message, &mut |path, value| match (path, value) {
            ("header.stamp", Value::Time(ns)) => self.stamp = ns,
            ("name", Value::Texts(bytes)) if self.version == 0 || self.image != bytes => {
                self.image = bytes.to_vec();
                self.version += 1;
                match value.texts() {
                    Some(names) => self.names = names,
                    None => whole = false,
                }
            }
            ("position", v) => whole &= v.numbers(&mut self.position).is_some(),
            ("velocity", v) => whole &= v.numbers(&mut self.velocity).is_some(),
            ("effort", v) => whole &= v.numbers(&mut self.effort).is_some(),
            _ => {}
        })?;
        whole.then_some(())
    }
}

impl Imu {
    pub(super) fn read(by: &Decoder, message: &[u8]) -> Option<Self> {
        let layout = match by {
            Decoder::Cdr => return Self::read_cdr(message),
            Decoder::Ros1(layout) => layout,
        };
        let mut stamp = 0;
        // Quaternion with the scalar first, rates, specific force; and whether they are measured.
        let (mut att, mut gyro, mut acc, mut known) = ([0.0; 4], [0.0; 3], [0.0; 3], [false, true, true]);
        let mut first = Vec::new();
        layout.read(message, &mut |path, value| match value {
            Value::Time(ns) if path == "header.stamp" => stamp = ns,
            Value::Number(x) => {
                if let Some(of) = path.strip_prefix("orientation.") {
                    known[0] = true;
                    "wxyz".find(of).into_iter().for_each(|k| att[k] = x);
                } else if let Some(of) = path.strip_prefix("angular_velocity.") {
                    "xyz".find(of).into_iter().for_each(|k| gyro[k] = x);
                } else if let Some(of) = path.strip_prefix("linear_acceleration.") {
                    "xyz".find(of).into_iter().for_each(|k| acc[k] = x);
                }
            }
            v => {
                let part = ["orientation", "angular_velocity", "linear_acceleration"];
                let of = part.iter().position(|p| path.strip_suffix("_covariance") == Some(*p));
                if let (Some(k), Some(())) = (of, v.numbers(&mut first)) {
                    known[k] &= first.first() != Some(&-1.0);
                }
            }
        })?;
        known[0] &= att != [0.0; 4];
        Some(Self { stamp, att: known[0].then_some(att), gyro: known[1].then_some(gyro), acc: known[2].then_some(acc) })
    }
}

impl Wrench {
    pub(super) fn read(by: &Decoder, message: &[u8]) -> Option<Self> {
        let layout = match by {
            Decoder::Cdr => return Self::read_cdr(message),
            Decoder::Ros1(layout) => layout,
        };
        let mut out = Self::default();
        layout.read(message, &mut |path, value| match value {
            Value::Time(ns) if path == "header.stamp" => out.stamp = ns,
            Value::Text(t) if path == "header.frame_id" => out.frame = String::from_utf8_lossy(t).into_owned(),
            Value::Number(x) => {
                for (part, first) in [("wrench.force.", 0), ("wrench.torque.", 3)] {
                    let axis = path.strip_prefix(part).and_then(|a| "xyz".find(a));
                    axis.into_iter().for_each(|k| out.numbers[first + k] = x);
                }
            }
            _ => {}
        })?;
        Some(out)
    }
}
