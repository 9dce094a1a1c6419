//! `[[drive]]`: what lies between the motor of a joint and the torque of its bodies, where the torque channels read on the motor's side.

use super::declared::{Holds, Key, key, must};
use super::reader::{Table, error};
use super::select::fits;
use super::uncertain::named_by;
use ff_model::Model;
use ff_model::diagnostics::{clip, list, nearest};
use serde::Serialize;

/// A term of the torque that a sensor on the motor's side reads beside the torque of the bodies; linear in its coefficient. With rate `qd`,
/// acceleration `qdd` and torque `tau` of the bodies:
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum DriveTerm {
    /// `qd`.
    Viscous,
    /// `sgn(qd)`.
    Coulomb,
    /// 1: a constant torque, which a bias of the sensor cannot be told from.
    Offset,
    /// `qdd`: inertia of rotor and gear, reflected to the joint.
    Inertia,
    /// `|qd|`: viscous friction that differs by direction.
    Asymmetry,
    /// `qd |qd|`.
    Quadratic,
    /// `exp(-|qd| / rate) sgn(qd)`.
    Stribeck,
    /// `|tau| sgn(qd)`.
    Load,
}

/// Words of `terms`, and the key that has the coefficient of each.
const TERMS: [(&str, DriveTerm, &str); 8] = [
    ("viscous", DriveTerm::Viscous, "viscous_nm_s_per_rad"),
    ("coulomb", DriveTerm::Coulomb, "coulomb_nm"),
    ("offset", DriveTerm::Offset, "offset_nm"),
    ("inertia", DriveTerm::Inertia, "inertia_kg_m2"),
    ("asymmetry", DriveTerm::Asymmetry, "asymmetry_nm_s_per_rad"),
    ("quadratic", DriveTerm::Quadratic, "quadratic_nm_s2_per_rad2"),
    ("stribeck", DriveTerm::Stribeck, "stribeck_nm"),
    ("load", DriveTerm::Load, "load_relative"),
];

impl DriveTerm {
    /// Whether it jumps with the direction of the motion.
    pub fn is_dry(self) -> bool {
        matches!(self, Self::Coulomb | Self::Stribeck | Self::Load)
    }
}

/// One `[[drive]]`: what the torque channels of some joints read on the motor's side of the gear. Of a joint that slides, lengths stand for angles
/// (N s/m, N, kg). A later table replaces what an earlier one says of a joint.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Drive {
    /// `joints`: names or patterns, in which `*` stands for any text.
    pub joints: Vec<String>,
    /// `terms`: friction and reflected inertia that is estimated, by name; those that have a value need not be named.
    pub terms: Vec<DriveTerm>,
    /// Values by term: what `ffid simulate` writes, and where a fit begins.
    pub values: Vec<(DriveTerm, f64)>,
    /// `stribeck_rate_rad_per_s`: the rate over which the Stribeck effect falls (rad/s).
    pub stribeck_rate_rad_per_s: Option<f64>,
    /// `relative_std`: standard deviation of each value, relative to it; nothing is known of them unless given.
    pub relative_std: Option<f64>,
    /// `gain_nm_per_a`: torque by the current of the motor (N m/A), which `ffid simulate` then writes; a fit begins there.
    pub gain_nm_per_a: Option<f64>,
    /// `gain_relative_std`: standard deviation of the gain, relative to it; nothing is known of it unless given.
    pub gain_relative_std: Option<f64>,
    /// `near_rest_rad_per_s`: below this rate the torque of a joint with dry friction is not used (rad/s); beyond, the sign is exact.
    pub near_rest_rad_per_s: f64,
    /// `smooth_rad_per_s`: in its place, friction that goes over as `tanh(qd / smooth)`, every sample used (rad/s).
    pub smooth_rad_per_s: Option<f64>,
}

const WORDS: [&str; 8] = ["viscous", "coulomb", "offset", "inertia", "asymmetry", "quadratic", "stribeck", "load"];

/// Keys of `[[drive]]`.
pub(crate) const DRIVE: &[Key] = &[
    must("joints", Holds::Texts, "joints by name or pattern"),
    key("terms", Holds::Texts, "estimated: viscous, coulomb, offset, inertia, asymmetry, quadratic, stribeck, load"),
    key("viscous_nm_s_per_rad", Holds::Number, "viscous friction (N m s/rad)"),
    key("coulomb_nm", Holds::Number, "Coulomb friction (N m)"),
    key("offset_nm", Holds::Number, "constant torque (N m)"),
    key("inertia_kg_m2", Holds::Number, "inertia of rotor and gear, reflected to the joint (kg m^2)"),
    key("asymmetry_nm_s_per_rad", Holds::Number, "viscous friction more forwards, less backwards (N m s/rad)"),
    key("quadratic_nm_s2_per_rad2", Holds::Number, "friction with the square of the rate (N m s^2/rad^2)"),
    key("stribeck_nm", Holds::Number, "friction at rest above that in motion (N m)"),
    key("stribeck_rate_rad_per_s", Holds::Positive, "rate over which that falls (rad/s)"),
    key("load_relative", Holds::Number, "friction in proportion to the torque of the bodies"),
    key("relative_std", Holds::Positive, "relative standard deviation of these values; unknown unless given"),
    key(
        "gain_nm_per_a",
        Holds::Number,
        "torque by current of the motor (N m/A); currents are written by ffid simulate",
    ),
    key("gain_relative_std", Holds::Positive, "relative standard deviation of the gain; unknown unless given"),
    key("near_rest_rad_per_s", Holds::NotNegative, "torques of dry friction are not used below this rate (rad/s)")
        .or(0.01),
    key("smooth_rad_per_s", Holds::Positive, "dry friction goes over as tanh of the rate over this (rad/s)"),
];

impl Drive {
    pub(super) fn read(t: &Table<'_, '_>) -> Self {
        let words = t.strings("terms").unwrap_or_default();
        let mut terms = Vec::new();
        for (k, word) in words.iter().enumerate() {
            match TERMS.iter().find(|(name, ..)| name == word) {
                Some((_, term, _)) => terms.push(*term),
                None => {
                    let what = format!("unknown term '{}'; known: {}", clip(word), WORDS.join(", "));
                    let p = error("Config::BadChoice", what).on(format!("{}[{k}]", t.name_of("terms")));
                    let near = nearest(word, WORDS.iter().copied());
                    let hint = near.map_or_else(
                        || "use terms = [\"viscous\", \"coulomb\"]".into(),
                        |n| format!("did you mean {n}?"),
                    );
                    t.fail_at(t.place(&format!("terms[{k}]")), p.hint(hint));
                }
            }
        }
        let values: Vec<(DriveTerm, f64)> =
            TERMS.iter().filter_map(|&(_, term, key)| Some((term, t.number(key)?))).collect();
        for &(term, _) in &values {
            if !terms.contains(&term) {
                terms.push(term);
            }
        }
        let out = Self {
            joints: t.strings("joints").unwrap_or_default(),
            terms,
            values,
            stribeck_rate_rad_per_s: t.number("stribeck_rate_rad_per_s"),
            relative_std: t.number("relative_std"),
            gain_nm_per_a: t.number("gain_nm_per_a"),
            gain_relative_std: t.number("gain_relative_std"),
            near_rest_rad_per_s: t.number("near_rest_rad_per_s").unwrap_or_default(),
            smooth_rad_per_s: t.number("smooth_rad_per_s"),
        };
        let missing = |key: &str, of: &str, hint: &str| {
            t.fail(key, error("Config::MissingKey", format!("{key} without {of}")).hint(hint));
        };
        let needs_rate = out.terms.contains(&DriveTerm::Stribeck);
        if needs_rate && out.stribeck_rate_rad_per_s.is_none() {
            let key = if t.has("stribeck_nm") { "stribeck_nm" } else { "terms" };
            let p = error("Config::MissingKey", "the Stribeck effect without stribeck_rate_rad_per_s");
            t.fail(key, p.hint("give the rate over which it falls, some hundredths of the fastest rate"));
        }
        if out.gain_relative_std.is_some() && out.gain_nm_per_a.is_none() {
            missing("gain_relative_std", "gain_nm_per_a", "give the gain that it is the deviation of");
        }
        if out.relative_std.is_some() && out.values.iter().all(|v| v.1 == 0.0) {
            missing("relative_std", "a value that is not zero", "give the values that it is the deviation of");
        }
        if out.gain_nm_per_a == Some(0.0) {
            let p = error("Config::OutOfRange", "value 0 N m/A, limit not 0 N m/A: a current without a torque");
            t.fail(
                "gain_nm_per_a",
                p.hint("give the torque of the joint by the current of its motor, or leave it out"),
            );
        }
        if out.smooth_rad_per_s.is_some() && t.has("near_rest_rad_per_s") {
            let what = "near_rest_rad_per_s and smooth_rad_per_s are two ways to treat a joint next to rest";
            t.fail("smooth_rad_per_s", error("Config::Conflict", what).hint("give one of them"));
        }
        if out.terms.is_empty() && out.gain_nm_per_a.is_none() {
            let p = error("Config::MissingKey", "neither terms nor a value nor gain_nm_per_a");
            t.fail("joints", p.hint("say what the channels read beside the torques of the bodies"));
        }
        t.finish();
        out
    }
    /// Reports joints that the model does not have.
    pub(super) fn check(&self, model: &Model, t: &Table<'_, '_>) {
        let names = model.joint_names();
        for (k, pattern) in self.joints.iter().enumerate() {
            if pattern == "*" || names.iter().any(|n| fits(pattern, n)) {
                continue;
            }
            let p = error("Config::UnknownJoint", format!("'{}' fits no joint", clip(pattern)));
            let p = p.on(format!("{}[{k}]", t.name_of("joints")));
            let hint = match nearest(pattern, names.iter().map(String::as_str)) {
                Some(n) => format!("did you mean {n}?"),
                None => format!("joints: {}", list(names.iter().map(String::as_str), 12)),
            };
            t.fail_at(t.place(&format!("joints[{k}]")), p.hint(hint));
        }
    }
    /// The value of a term, none where it has none.
    pub fn value(&self, term: DriveTerm) -> Option<f64> {
        self.values.iter().find(|v| v.0 == term).map(|v| v.1)
    }
    /// What a list of tables says of a joint: the last that names it.
    ///
    /// ```
    /// use ff_mission::mission::Drive;
    ///
    /// let of = |joints: &str, gain| Drive { joints: vec![joints.into()], gain_nm_per_a: Some(gain), ..Drive::default() };
    /// let all = [of("*", 0.11), of("wrist*", 0.04)];
    /// assert_eq!(Drive::of(&all, "wrist2").unwrap().gain_nm_per_a, Some(0.04));
    /// assert_eq!(Drive::of(&all, "elbow").unwrap().gain_nm_per_a, Some(0.11));
    /// ```
    pub fn of<'d>(all: &'d [Self], joint: &str) -> Option<&'d Self> {
        all.iter().rev().find(|d| named_by(&d.joints, joint))
    }
}
