//! `[robot]`: which URDF, which base, gravity, and rigid mass the URDF does not know of.

use super::reader::{Must, Table, error};
use ff_model::BaseKind;
use ff_model::Inertia;
use ff_model::spatial::InertiaError;
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;
use std::path::PathBuf;

/// Section `[robot]`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Robot {
    /// `urdf`: path of the URDF, relative to the mission file. Required.
    pub urdf: PathBuf,
    /// `base_link`: link whose frame is the base frame; the root of the URDF unless given.
    pub base_link: Option<String>,
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

impl RigidBody {
    /// Inertia about the origin of the link frame.
    pub fn inertia(&self) -> Inertia<f64> {
        Inertia::from_com(self.mass_kg, &Vector3::from(self.com_m), &self.matrix())
    }
    fn matrix(&self) -> Matrix3<f64> {
        ff_model::keys::symmetric(&self.inertia_com_kgm2)
    }
    pub(super) fn read(t: &Table<'_, '_>) -> Option<Self> {
        let mass_kg = t.required("mass_kg", t.number("mass_kg", Must::BePositive));
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
            .hint("an inertia matrix is symmetric"),
        );
        return None;
    }
    Some([a[0], a[1], a[2], b[1], b[2], c[2]])
}

impl Robot {
    /// Reads the section; `None` without a usable `urdf`.
    pub(super) fn read(t: &Table<'_, '_>) -> Option<Self> {
        let urdf = t.required("urdf", t.string("urdf"));
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
            let link = r.required("link", r.string("link"));
            let body = RigidBody::read(&r);
            r.finish();
            Some(Rigid { link: link?, body: body? })
        });
        let out = Self {
            base_link: t.string("base_link"),
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
