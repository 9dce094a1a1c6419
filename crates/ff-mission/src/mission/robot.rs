//! `[robot]`: which URDF, which base, gravity, and rigid mass the URDF does not know of.

use super::declared::{Holds, Key, key, must};
use super::reader::{Table, error};
use ff_model::BaseKind;
use ff_model::Inertia;
use ff_model::Problem;
use ff_model::diagnostics::Limit;
use ff_model::spatial::InertiaError;
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Section `[robot]`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Robot {
    /// `urdf`: path of the URDF, relative to the mission file. Required.
    pub urdf: PathBuf,
    /// `base_link`: link whose frame is the base frame; the root of the URDF unless given.
    pub base_link: Option<String>,
    /// `subtree`: only this link of the URDF and what hangs on it; the whole file unless given.
    pub subtree: Option<String>,
    /// `lock`: names or patterns (`*` for any text) of joints that are held at zero, or at the limit next to it; they leave the
    /// model, and what they carry becomes part of the body that they hang on.
    pub lock: Vec<String>,
    /// `[robot.lock_at]`: joints that are held elsewhere, by name (rad or m).
    pub lock_at: BTreeMap<String, f64>,
    /// `end_effector`: frame (any link of the URDF) whose motion is reported.
    pub end_effector: Option<String>,
    /// `base`: `"floating"` (default) or `"fixed"`.
    #[serde(serialize_with = "base_name")]
    pub base: BaseKind,
    /// `gravity_m_per_s2`: gravity acceleration in world axes; zero unless given.
    pub gravity_m_per_s2: [f64; 3],
    /// `[robot.base_inertial]`: replaces the `<inertial>` of the base link.
    pub base_inertial: Option<RigidBody>,
    /// `[[robot.rigid]]`: rigid mass on a link, such as fuel that does not move (paper eq. (18)).
    pub rigid: Vec<Rigid>,
}

/// Mass, centre of mass and inertia: `[robot.base_inertial]` and part of `[[robot.rigid]]`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RigidBody {
    /// `mass_kg`: mass. Required, positive.
    pub mass_kg: f64,
    /// `com_m`: centre of mass in the link frame; the origin unless given.
    pub com_m: [f64; 3],
    /// `inertia_com_kgm2`: inertia about the centre of mass in link axes, as `[xx, xy, xz, yy, yz, zz]` or
    /// three rows of three; a point mass unless given.
    pub inertia_com_kgm2: [f64; 6],
}

/// One `[[robot.rigid]]`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rigid {
    /// `link`: the link that carries the mass. Required.
    pub link: String,
    /// What it carries.
    #[serde(flatten)]
    pub body: RigidBody,
}

fn base_name<S: serde::Serializer>(b: &BaseKind, s: S) -> Result<S::Ok, S::Error> {
    s.serialize_str(if *b == BaseKind::Fixed { "fixed" } else { "floating" })
}

/// Keys of a [`RigidBody`].
pub(crate) const BODY: [Key; 3] = [
    must("mass_kg", Holds::Positive, "mass (kg)"),
    key("com_m", Holds::Vector(3), "centre of mass in the frame of the link or client (m)"),
    key(
        "inertia_com_kgm2",
        Holds::Symmetric,
        "inertia about the centre of mass (kg m^2): xx, xy, xz, yy, yz, zz or rows",
    ),
];

/// Keys of `[robot]`.
pub(crate) const ROBOT: &[Key] = &[
    must("urdf", Holds::Text, "path of the URDF, relative to the mission file"),
    key("base_link", Holds::Text, "link whose frame is the base frame; the root unless given"),
    key("subtree", Holds::Text, "only this link and what hangs on it; the whole file unless given"),
    key("lock", Holds::Texts, "joints that are held at zero, or at the limit next to it: names or patterns"),
    key("lock_at", Holds::Named, "joints that are held elsewhere, by name (rad or m)"),
    key("end_effector", Holds::Text, "link whose motion is reported"),
    key("base", Holds::OneOf(&["floating", "fixed"]), "").or_word("floating"),
    key("gravity_m_per_s2", Holds::Vector(3), "gravity in world axes (m/s^2); zero unless given"),
    key("base_inertial", Holds::Table(&BODY), "replaces the inertial of the base link"),
    key("rigid", Holds::Tables(RIGID), "rigid mass on a link"),
];

const RIGID: &[Key] = &[must("link", Holds::Text, "the link that carries the mass"), BODY[0], BODY[1], BODY[2]];

impl RigidBody {
    /// Inertia about the origin of the link frame.
    pub fn inertia(&self) -> Inertia<f64> {
        Inertia::from_com(self.mass_kg, &Vector3::from(self.com_m), &self.matrix())
    }
    fn matrix(&self) -> Matrix3<f64> {
        ff_model::keys::symmetric(&self.inertia_com_kgm2)
    }
    pub(super) fn read(t: &Table<'_, '_>) -> Option<Self> {
        let mass_kg = t.number("mass_kg");
        let com_m = t.vector("com_m").unwrap_or_default();
        let inertia_com_kgm2 = six(t, "inertia_com_kgm2").unwrap_or_default();
        let body = Self { mass_kg: mass_kg?, com_m, inertia_com_kgm2 };
        let about_com = Inertia::from_com(body.mass_kg, &Vector3::zeros(), &body.matrix());
        match about_com.check() {
            Ok(()) => Some(body),
            Err(e) => {
                let (code, hint) = match &e {
                    InertiaError::Triangle { .. } => ("Config::Triangle", "check units and axes of the inertia"),
                    InertiaError::NotPsd { .. } => (
                        "Config::InertiaNotPsd",
                        "give the inertia about the centre of mass, not about the link origin",
                    ),
                    InertiaError::NonPositiveMass { .. } => ("Config::NonPositiveMass", "give the mass in kg"),
                    InertiaError::NotFinite { .. } => ("Config::NotFinite", "give finite numbers"),
                };
                t.fail("inertia_com_kgm2", error(code, e.to_string()).hint(hint));
                None
            }
        }
    }
}

/// Six numbers, or a symmetric matrix in rows.
fn six(t: &Table<'_, '_>, key: &'static str) -> Option<[f64; 6]> {
    if !t.is_nested(key) {
        return t.vector(key);
    }
    let [a, b, c] = t.rows(key)?;
    let skew = (a[1] - b[0]).abs().max((a[2] - c[0]).abs()).max((b[2] - c[1]).abs());
    let scale = a[0].abs().max(b[1].abs()).max(c[2].abs());
    if skew > 1e-9 * scale {
        t.fail(
            key,
            error(
                "Config::NotSymmetric",
                format!("opposite elements differ by {skew} kg m^2, limit {} kg m^2", 1e-9 * scale),
            )
            .violating(skew, Limit::AtMost(1e-9 * scale), "kg m^2")
            .hint("an inertia matrix is symmetric"),
        );
        return None;
    }
    Some([a[0], a[1], a[2], b[1], b[2], c[2]])
}

impl Robot {
    /// The key that a problem of the import is about.
    pub(super) fn key_of(&self, p: &Problem) -> &'static str {
        match p.code {
            "Config::UnknownLink" if self.subtree.is_some() && p.object == self.subtree => "subtree",
            "Config::UnknownJoint" | "Config::OutOfRange" => {
                if self.lock_at.keys().any(|k| p.object.as_ref() == Some(k)) { "lock_at" } else { "lock" }
            }
            _ => "base_link",
        }
    }
    /// Reads the section; `None` without a usable `urdf`.
    pub(super) fn read(t: &Table<'_, '_>) -> Option<Self> {
        let urdf = t.string("urdf");
        let base = match t.string("base").as_deref() {
            None | Some("floating") => BaseKind::Floating,
            Some("fixed") => BaseKind::Fixed,
            Some(other) => {
                let what = format!("'{}' is neither \"floating\" nor \"fixed\"", ff_model::diagnostics::clip(other));
                t.fail("base", error("Config::BadChoice", what).hint("use base = \"floating\""));
                BaseKind::Floating
            }
        };
        let base_inertial = t.table("base_inertial").and_then(|b| {
            let body = RigidBody::read(&b);
            b.finish();
            body
        });
        let rigid = t.tables("rigid").into_iter().filter_map(|r| {
            let link = r.string("link");
            let body = RigidBody::read(&r);
            r.finish();
            Some(Rigid { link: link?, body: body? })
        });
        let out = Self {
            base_link: t.string("base_link"),
            subtree: t.string("subtree"),
            lock: t.strings("lock").unwrap_or_default(),
            lock_at: t.table("lock_at").as_ref().map(super::values::read).unwrap_or_default(),
            end_effector: t.string("end_effector"),
            base,
            gravity_m_per_s2: t.vector("gravity_m_per_s2").unwrap_or_default(),
            base_inertial,
            rigid: rigid.collect(),
            urdf: PathBuf::from(urdf.clone().unwrap_or_default()),
        };
        t.finish();
        urdf.map(|_| out)
    }
}
