//! What a name of another program says by itself: which group, joint, number or axis it is of, and in which unit.

use super::JointColumn;
use super::columns::Group;

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
pub(super) const FILLERS: [&str; 19] = [
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
pub(super) enum Which {
    /// This joint or axis, by its name.
    Named(usize),
    /// By a number, whose base is known with the others.
    Number(u32),
}

/// What a name says.
#[derive(Debug, PartialEq)]
pub(super) struct Reading {
    pub(super) group: Group,
    pub(super) which: Which,
    pub(super) words: String,
    pub(super) unit: Option<&'static str>,
    pub(super) defined: bool,
}

/// Words of a name in small letters, and the numbers in it: `jointPos_3` is joint, pos, 3.
pub(super) fn words(name: &str) -> (Vec<String>, Vec<u32>) {
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
pub(super) fn read(name: &str, joints: &[JointColumn]) -> Option<Reading> {
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
