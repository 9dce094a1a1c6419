//! `[[uncertain]]`: what the mission gives values for and does not know exactly.

use super::declared::{Holds, Key, key};
use super::reader::{Table, error};
use super::select::fits;
use ff_model::Model;
use ff_model::diagnostics::{clip, list, nearest};
use serde::Serialize;

/// One `[[uncertain]]`: standard deviations of what some bodies, parameters or placements are in truth about the values of the mission.
/// Names may be patterns, in which `*` stands for any text.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Uncertain {
    /// `bodies`: links of the arm and segments of appendages, such as `l*` and `wing.seg[*]`.
    pub bodies: Vec<String>,
    /// `mass_relative_std`: of the mass; first moments and inertia change with it.
    pub mass_relative_std: Option<f64>,
    /// `com_std_m`: of every coordinate of the centre of mass (m).
    pub com_std_m: Option<f64>,
    /// `inertia_relative_std`: of the inertia about the centre of mass; a product of inertia `I_jk` is measured by
    /// `sqrt(I_jj I_kk)`.
    pub inertia_relative_std: Option<f64>,
    /// `common`: one relative error of the mass for all of the bodies, as when one scale weighed them.
    pub common: bool,
    /// `parameters`: of appendages, such as `tank.length`.
    pub parameters: Vec<String>,
    /// `relative_std`: of these, relative to their values.
    pub relative_std: Option<f64>,
    /// `std`: of these, in the unit of each.
    pub std: Option<f64>,
    /// `mounts`: appendages and joints by name: where they are mounted.
    pub mounts: Vec<String>,
    /// `position_std_m`: of every coordinate of their place (m).
    pub position_std_m: Option<f64>,
    /// `angle_std_rad`: of the rotation about every axis (rad); that of a joint about its own axis is its encoder's offset, and
    /// belongs to `[sensors.encoder]`.
    pub angle_std_rad: Option<f64>,
}

/// Keys of `[[uncertain]]`.
pub(crate) const UNCERTAIN: &[Key] = &[
    key("bodies", Holds::Texts, "links of the arm and segments of appendages, by name or pattern"),
    key("mass_relative_std", Holds::Positive, "relative standard deviation of their masses"),
    key("com_std_m", Holds::Positive, "standard deviation of every coordinate of their centres of mass (m)"),
    key("inertia_relative_std", Holds::Positive, "relative standard deviation of their inertia about these"),
    key("common", Holds::Flag, "true: one relative error of the mass for all of them, as of one scale"),
    key("parameters", Holds::Texts, "parameters of appendages, by name or pattern"),
    key("relative_std", Holds::Positive, "their relative standard deviation"),
    key("std", Holds::Positive, "their standard deviation, in the unit of each"),
    key("mounts", Holds::Texts, "appendages and joints, by name or pattern: where they are mounted"),
    key("position_std_m", Holds::Positive, "standard deviation of every coordinate of their place (m)"),
    key("angle_std_rad", Holds::Positive, "standard deviation of their rotation about every axis (rad)"),
];

/// What a table is about, the keys that say how uncertain it is, and those that need it.
const SUBJECTS: [(&str, &[&str]); 3] = [
    ("bodies", &["mass_relative_std", "com_std_m", "inertia_relative_std"]),
    ("parameters", &["relative_std", "std"]),
    ("mounts", &["position_std_m", "angle_std_rad"]),
];

impl Uncertain {
    pub(super) fn read(t: &Table<'_, '_>) -> Self {
        let out = Self {
            bodies: t.strings("bodies").unwrap_or_default(),
            mass_relative_std: t.number("mass_relative_std"),
            com_std_m: t.number("com_std_m"),
            inertia_relative_std: t.number("inertia_relative_std"),
            common: t.flag("common").unwrap_or(false),
            parameters: t.strings("parameters").unwrap_or_default(),
            relative_std: t.number("relative_std"),
            std: t.number("std"),
            mounts: t.strings("mounts").unwrap_or_default(),
            position_std_m: t.number("position_std_m"),
            angle_std_rad: t.number("angle_std_rad"),
        };
        for (subject, how) in SUBJECTS {
            let given: Vec<&str> = how.iter().copied().filter(|k| t.has(k)).collect();
            if t.has(subject) && given.is_empty() {
                let p = error("Config::MissingKey", format!("{subject} without {}", list(how.iter().copied(), 3)));
                t.fail(subject, p.hint("say how uncertain they are, as one standard deviation"));
            }
            if let (false, Some(first)) = (t.has(subject), given.first()) {
                let p = error("Config::MissingKey", format!("{first} without {subject}"));
                t.fail(first, p.hint(format!("name the {subject}")));
            }
        }
        if t.has("relative_std") && t.has("std") {
            let p = error("Config::Conflict", "relative_std and std are two deviations of the same parameters");
            t.fail("std", p.hint("give one of them"));
        }
        if SUBJECTS.iter().all(|(subject, _)| !t.has(subject)) {
            let p = error("Config::MissingKey", "neither bodies, nor parameters, nor mounts");
            t.fail("bodies", p.hint("name what is uncertain"));
        }
        t.finish();
        out
    }
    /// Reports names that the model does not have.
    pub(super) fn check(&self, model: &Model, t: &Table<'_, '_>) {
        let decls = model.param_decls();
        let bodies: Vec<String> = decls
            .iter()
            .filter_map(|d| d.name.strip_suffix(".mass"))
            .map(str::to_owned)
            .filter(|n| is_body(&decls, n))
            .collect();
        let parameters: Vec<String> = decls.into_iter().map(|d| d.name).collect();
        let mounts: Vec<String> =
            model.appendages().iter().map(|a| a.name.clone()).chain(model.joint_names()).collect();
        for (key, patterns, names, what) in [
            ("bodies", &self.bodies, bodies, "body"),
            ("parameters", &self.parameters, parameters, "parameter"),
            ("mounts", &self.mounts, mounts, "appendage or joint"),
        ] {
            for (k, pattern) in patterns.iter().enumerate() {
                // All of them may be none.
                if pattern == "*" || names.iter().any(|n| fits(pattern, n)) {
                    continue;
                }
                let p = error("Config::NoSuchParameter", format!("'{}' fits no {what}", clip(pattern)));
                let p = p.on(format!("{}[{k}]", t.name_of(key)));
                let hint = match nearest(pattern, names.iter().map(String::as_str)) {
                    Some(n) => format!("did you mean {n}?"),
                    None => format!("there are {}", list(names.iter().map(String::as_str), 8)),
                };
                t.fail_at(t.place(&format!("{key}[{k}]")), p.hint(hint));
            }
        }
    }
}

/// Whether `<name>.mass` is the first of the ten numbers of a body, and not the mass of an appendage such as a slosh pendulum.
fn is_body(decls: &[ff_model::ParamDecl], name: &str) -> bool {
    let first = format!("{name}.h_x");
    decls.iter().any(|d| d.name == first)
}

/// Whether a name fits one of the patterns, in which `*` stands for any text and all else for itself.
///
/// ```
/// use ff_mission::mission::named_by;
///
/// assert!(named_by(&["l*".to_owned(), "wing.seg[*]".to_owned()], "wing.seg[1]"));
/// ```
pub fn named_by(patterns: &[String], name: &str) -> bool {
    patterns.iter().any(|p| fits(p, name))
}
