//! `[limits]`: what planned motion must keep to.

use super::appendage;
use super::reader::{Must, Table, error};
use serde::Serialize;

/// Section `[limits]`: what planned motion must keep to. Absent keys are no limit.
///
/// Joint limits hold for all time (they are limits of control polygons); the others are limits of the simulated
/// system, appendages swinging.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Limits {
    /// `velocity_rad_per_s`: greatest joint speed, beside the limits of the URDF.
    pub velocity_rad_per_s: Option<f64>,
    /// `acceleration_rad_per_s2`: greatest joint acceleration.
    pub acceleration_rad_per_s2: Option<f64>,
    /// `jerk_rad_per_s3`: greatest joint jerk.
    pub jerk_rad_per_s3: Option<f64>,
    /// `torque_nm`: greatest joint torque, one number for all joints.
    pub torque_nm: Option<f64>,
    /// `base_attitude_rad`: greatest angle that the base turns away from its attitude at the start, 0 to pi.
    pub base_attitude_rad: Option<f64>,
    /// `base_rate_rad_per_s`: greatest angular speed of the base.
    pub base_rate_rad_per_s: Option<f64>,
    /// `end_effector_speed_m_per_s`: greatest speed of the origin of `robot.end_effector`.
    pub end_effector_speed_m_per_s: Option<f64>,
    /// `passive_rad`: greatest deflection from rest of every passive angle (panel hinges, slosh).
    pub passive_rad: Option<f64>,
    /// `passive_m`: greatest deflection from rest of every passive length.
    pub passive_m: Option<f64>,
    /// `[[limits.pointing]]`: cones for axes of the base.
    pub pointing: Vec<PointingLimit>,
    /// `clearance_m`: least distance between `<collision>` shapes of the URDF on bodies that no joint connects, and
    /// between these and keep-out capsules (m).
    pub clearance_m: Option<f64>,
    /// `[[limits.keep_out]]`: capsules that the collision shapes of other bodies must stay out of; need `clearance_m`.
    pub keep_out: Vec<KeepOut>,
}

/// One `[[limits.keep_out]]`: a capsule fixed to a link, such as the sweep of a panel on the base.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KeepOut {
    /// `name`.
    pub name: String,
    /// `host`: the link that carries it.
    pub host: String,
    /// `from_m`: centre of one end, in the frame of the link (m).
    pub from_m: [f64; 3],
    /// `to_m`: centre of the other end (m).
    pub to_m: [f64; 3],
    /// `radius_m` (m).
    pub radius_m: f64,
}

/// One `[[limits.pointing]]`: where an axis of the base may point. Exactly one of the two angles.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PointingLimit {
    /// `name`: what points, such as `antenna`.
    pub name: String,
    /// `axis`: the axis in base axes, of any length.
    pub axis: [f64; 3],
    /// `target`: the direction in world axes, which are those of the base at the start; of any length.
    pub target: [f64; 3],
    /// `within_rad`: greatest angle between the two, 0 to pi.
    pub within_rad: Option<f64>,
    /// `outside_rad`: least angle between the two, 0 to pi.
    pub outside_rad: Option<f64>,
}

impl Limits {
    pub(super) fn read(t: &Table<'_, '_>) -> Self {
        let out = Self {
            velocity_rad_per_s: t.number("velocity_rad_per_s", Must::BePositive),
            acceleration_rad_per_s2: t.number("acceleration_rad_per_s2", Must::BePositive),
            jerk_rad_per_s3: t.number("jerk_rad_per_s3", Must::BePositive),
            torque_nm: t.number("torque_nm", Must::BePositive),
            base_attitude_rad: angle(t, "base_attitude_rad"),
            base_rate_rad_per_s: t.number("base_rate_rad_per_s", Must::BePositive),
            end_effector_speed_m_per_s: t.number("end_effector_speed_m_per_s", Must::BePositive),
            passive_rad: t.number("passive_rad", Must::BePositive),
            passive_m: t.number("passive_m", Must::BePositive),
            pointing: t.tables("pointing").iter().filter_map(PointingLimit::read).collect(),
            clearance_m: t.number("clearance_m", Must::BePositive),
            keep_out: t.tables("keep_out").iter().filter_map(KeepOut::read).collect(),
        };
        if !out.keep_out.is_empty() && !t.has("clearance_m") {
            t.fail(
                "keep_out",
                error("Config::MissingKey", "'clearance_m' is missing")
                    .hint("add clearance_m = ..., the least distance"),
            );
        }
        t.finish();
        out
    }
}

impl KeepOut {
    fn read(t: &Table<'_, '_>) -> Option<Self> {
        let name = appendage::name(t);
        let host = t.required("host", t.string("host"));
        let [from_m, to_m] = ["from_m", "to_m"].map(|key| t.required(key, t.vector::<3>(key)));
        let radius_m = t.required("radius_m", t.number("radius_m", Must::BePositive));
        t.finish();
        Some(Self { name: name?, host: host?, from_m: from_m?, to_m: to_m?, radius_m: radius_m? })
    }
}

impl PointingLimit {
    fn read(t: &Table<'_, '_>) -> Option<Self> {
        let name = appendage::name(t);
        let [axis, target] = ["axis", "target"].map(|key| direction(t, key));
        let (within_rad, outside_rad) = (angle(t, "within_rad"), angle(t, "outside_rad"));
        match (t.has("within_rad"), t.has("outside_rad")) {
            (true, true) => {
                let p = error("Config::Conflict", "within_rad and outside_rad are both given");
                t.fail("outside_rad", p.hint("make two limits of them"));
            }
            (false, false) => _ = t.required::<f64>("within_rad", None),
            _ => {}
        }
        t.finish();
        Some(Self { name: name?, axis: axis?, target: target?, within_rad, outside_rad })
    }
}

/// A vector that must be given, and not be zero.
pub(super) fn direction(t: &Table<'_, '_>, key: &'static str) -> Option<[f64; 3]> {
    let v = t.required(key, t.vector::<3>(key))?;
    let zero = v.iter().all(|x| *x == 0.0);
    if zero {
        t.fail(key, error("Config::ZeroAxis", "is the zero vector").hint("give a direction, such as [0, 0, 1]"));
    }
    (!zero).then_some(v)
}

/// An angle above 0 and below pi.
fn angle(t: &Table<'_, '_>, key: &'static str) -> Option<f64> {
    let x = t.number(key, Must::BePositive)?;
    if x >= std::f64::consts::PI {
        let what = format!("value {x} rad, limit < pi rad");
        t.fail(key, error("Config::OutOfRange", what).hint("give the angle in radians; leave it out for no limit"));
        return None;
    }
    Some(x)
}
