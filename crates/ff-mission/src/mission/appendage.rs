//! `[[appendage]]`: what hangs where. The keys of each kind are read by the crate that registered it.

use super::declared::{Holds, Key, key, must};
use super::lift;
use super::reader::{Table, error};
use ff_model::Model;
use ff_model::Registry;
use ff_model::SharedAppendage;
use ff_model::Xform;
use ff_model::diagnostics::{list, nearest};
use ff_model::spatial::so3::{quat_to_rot, rot_of_rpy};
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;
use std::path::Path;

/// How far a quaternion or rotation matrix may be from exact before it is refused.
const UNIT_TOLERANCE: f64 = 1e-6;

/// One `[[appendage]]`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AppendageSpec {
    /// `kind`: a registered kind, such as `flex_panel` or `slosh_pendulum`. Required.
    pub kind: String,
    /// `name`: prefix of its parameters and coordinates. Required; no dots, brackets, stars or blanks.
    pub name: String,
    /// `host`: any link of the URDF, or a client. Required, but for an appendage that is lifted: it hangs where its
    /// first joint does.
    pub host: String,
    /// `mount`: pose of the mount frame in the host link frame; the link frame itself unless given.
    pub mount: Mount,
    /// `lift`: joints of the URDF, from the host outwards, that are the hinges of this appendage; they leave the tree.
    /// Their links become its `segments`; `stiffness_nm_per_rad`, `damping_nms_per_rad` and `rest_rad` are then lists with
    /// one number per joint (or matrices, where the kind has these). What is not given is what the description of the robot says
    /// (`<dynamics damping>` of a URDF), where every lifted joint has one. Empty unless given.
    pub lift: Vec<String>,
    /// All other keys of the table, read by the kind.
    pub settings: toml::Table,
}

/// Table `mount` of an appendage: `xyz_m` and one of `rpy_rad`, `quat_wxyz`, `rotation`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Mount {
    /// `xyz_m`: origin of the mount frame in the link frame.
    pub xyz_m: [f64; 3],
    /// Rotation from mount to link coordinates, in rows. From `rpy_rad` (roll, pitch, yaw as in URDF),
    /// `quat_wxyz` (unit quaternion, w first) or `rotation` (the matrix itself, in rows).
    pub rotation: [[f64; 3]; 3],
}

/// Keys of a mount.
pub(crate) const MOUNT: &[Key] = &[
    key("xyz_m", Holds::Vector(3), "origin of the mount frame in the link frame (m)"),
    key("rpy_rad", Holds::Vector(3), "roll, pitch, yaw as in URDF (rad)"),
    key("quat_wxyz", Holds::Vector(4), "unit quaternion, scalar first"),
    key("rotation", Holds::Rows, "rotation from mount to link coordinates, in rows"),
];

/// Keys of every `[[appendage]]`; the others belong to its kind.
pub(crate) const APPENDAGE: &[Key] = &[
    must("kind", Holds::Text, "what hangs there"),
    must("name", Holds::Text, "prefix of its parameters and coordinates"),
    key("host", Holds::Text, "link that carries it"),
    key("mount", Holds::Table(MOUNT), "pose of the mount frame in the link frame"),
    key("lift", Holds::Texts, "joints of the URDF that become its hinges, from the host outwards"),
];

impl Mount {
    /// As a pose.
    pub fn to_xform(&self) -> Xform<f64> {
        Xform::new(Matrix3::from_fn(|i, j| self.rotation[i][j]), Vector3::from(self.xyz_m))
    }
    fn of(xyz_m: [f64; 3], r: &Matrix3<f64>) -> Self {
        Self { xyz_m, rotation: [0, 1, 2].map(|i| [r[(i, 0)], r[(i, 1)], r[(i, 2)]]) }
    }
    /// Sub-table `mount` of a table; the frame itself when absent.
    pub(super) fn of_table(t: &Table<'_, '_>) -> Option<Self> {
        match t.table("mount") {
            Some(m) => Self::read(&m),
            None => Some(Self::of([0.0; 3], &Matrix3::identity())),
        }
    }
    pub(super) fn of_xform(x: &Xform<f64>) -> Self {
        Self::of(x.pos.into(), &x.rot)
    }
    fn read(t: &Table<'_, '_>) -> Option<Self> {
        let xyz = t.vector("xyz_m");
        let (rpy, quat) = (t.vector::<3>("rpy_rad"), t.vector::<4>("quat_wxyz"));
        let rows = t.rows("rotation");
        t.finish();
        if usize::from(rpy.is_some()) + usize::from(quat.is_some()) + usize::from(rows.is_some()) > 1 {
            let p = error("Config::Conflict", "more than one of rpy_rad, quat_wxyz, rotation");
            t.fail("quat_wxyz", p.hint("keep one of them"));
            return None;
        }
        let rotation = match (quat, rows) {
            (Some(q), _) => {
                // In f64 the square of a huge component overflows; the norm is then infinite and refused.
                let norm = q.iter().map(|x| x * x).sum::<f64>().sqrt();
                if !norm.is_finite() || (norm - 1.0).abs() > UNIT_TOLERANCE {
                    let what = format!("quaternion norm {norm}, expected 1 within {UNIT_TOLERANCE:e}");
                    let hint = "give a unit quaternion in the order w, x, y, z";
                    t.fail("quat_wxyz", error("Config::NotUnit", what).hint(hint));
                    return None;
                }
                quat_to_rot(&q.map(|x| x / norm).into())
            }
            (None, Some(rows)) => rotation(t, &rows)?,
            (None, None) => rot_of_rpy(&Vector3::from(rpy.unwrap_or_default())),
        };
        Some(Self::of(xyz.unwrap_or_default(), &rotation))
    }
}

/// A given matrix, if it is a rotation.
fn rotation(t: &Table<'_, '_>, rows: &[[f64; 3]; 3]) -> Option<Matrix3<f64>> {
    let r = Matrix3::from_fn(|i, j| rows[i][j]);
    let det = r.determinant();
    let off = (r * r.transpose() - Matrix3::identity()).abs().max();
    if !(off <= UNIT_TOLERANCE && (det - 1.0).abs() <= 2.0 * UNIT_TOLERANCE) {
        let what = format!(
            "determinant {det:.6}, expected 1; rows are off orthonormal by {off:.3e}, limit {UNIT_TOLERANCE:e}"
        );
        let hint = if det < 0.0 { "this is a reflection: negate one axis" } else { "give orthonormal rows" };
        t.fail("rotation", error("Config::NotRotation", what).hint(hint));
        return None;
    }
    Some(r)
}

/// The kinds a mission may name, and the folder that relative paths start from (none for a mission from a text).
pub(super) struct Kinds<'a> {
    pub(super) registry: &'a Registry,
    pub(super) folder: Option<&'a Path>,
}

/// An appendage as far as it could be read, with the table it came from; `None` where a problem is recorded.
pub(super) struct Draft<'d, 't> {
    pub(super) kind: Option<String>,
    pub(super) name: Option<String>,
    pub(super) host: Option<String>,
    pub(super) mount: Option<Mount>,
    pub(super) lift: Option<Vec<String>>,
    pub(super) settings: toml::Table,
    pub(super) appendage: Option<SharedAppendage>,
    pub(super) table: Table<'d, 't>,
}

impl<'d, 't> Draft<'d, 't> {
    /// Reads one table and runs the factory of its kind; problems are recorded at their keys.
    pub(super) fn read(t: Table<'d, 't>, kinds: &Kinds<'_>) -> Self {
        let kind = t.string("kind");
        let name = name(&t);
        let lift = t.strings("lift");
        let (host, mount) = match &lift {
            None => (t.required("host", t.string("host")), Mount::of_table(&t)),
            Some(_) => {
                for key in ["host", "mount"].into_iter().filter(|k| t.has(k)) {
                    let p = error("Config::Conflict", "a lifted appendage hangs where its first joint does");
                    t.fail(key, p.hint(format!("remove {key}")));
                }
                (None, None)
            }
        };
        let settings = t.undeclared();
        let mut draft = Self { kind, name, host, mount, lift, settings, appendage: None, table: t };
        if draft.lift.is_none() {
            draft.appendage = draft.make(&draft.settings, kinds);
        }
        draft
    }
    /// Runs the factory of the kind on a table; problems are recorded.
    fn make(&self, settings: &toml::Table, kinds: &Kinds<'_>) -> Option<SharedAppendage> {
        let kind = self.kind.as_deref()?;
        make(&self.table, kind, self.name.as_deref().unwrap_or(kind), settings, kinds)
    }
    /// Makes an appendage of the lifted bodies of the whole tree; the bodies, or `None` where a problem is recorded.
    pub(super) fn lift(&mut self, tree: &Model, kinds: &Kinds<'_>) -> Option<Vec<usize>> {
        let bodies = lift::chain(tree, self.lift.as_deref()?, &self.table)?;
        let (host, mount) = lift::seat(tree, bodies[0]);
        self.host = Some(tree.body_name(host).to_owned());
        self.mount = Some(Mount::of_xform(&mount));
        let table = lift::table(tree, &bodies, &self.settings, &self.table)?;
        self.appendage = self.make(&table, kinds);
        Some(bodies)
    }
    /// What is kept of it; `None` unless everything was there.
    pub(super) fn spec(&self) -> Option<AppendageSpec> {
        Some(AppendageSpec {
            kind: self.kind.clone()?,
            name: self.name.clone()?,
            host: self.host.clone()?,
            mount: self.mount.clone()?,
            lift: self.lift.clone().unwrap_or_default(),
            settings: self.settings.clone(),
        })
    }
}

/// Key `name` of an appendage or client, fit to be the prefix of parameters.
pub(super) fn name(t: &Table<'_, '_>) -> Option<String> {
    t.string("name").filter(|n| {
        let good = !n.is_empty() && !n.contains(|c: char| c.is_whitespace() || ".[]*".contains(c));
        if !good {
            let what = format!("'{}' is blank or holds a dot, bracket, star or blank", ff_model::diagnostics::clip(n));
            t.fail("name", error("Config::BadName", what).hint("use letters, digits and _"));
        }
        good
    })
}

/// Runs the factory of a kind; its problems get their place in the file.
fn make(
    t: &Table<'_, '_>,
    kind: &str,
    label: &str,
    settings: &toml::Table,
    kinds: &Kinds<'_>,
) -> Option<SharedAppendage> {
    let registry = kinds.registry;
    let Some(factory) = registry.get(kind) else {
        let known = list(registry.kinds(), 20);
        let p = error(
            "Config::UnknownKind",
            format!("unknown kind '{}'; known: {known}", ff_model::diagnostics::clip(kind)),
        );
        t.fail(
            "kind",
            match nearest(kind, registry.kinds()) {
                Some(n) => p.hint(format!("did you mean {n}?")),
                None => p.hint("use a known kind, or register this one"),
            },
        );
        return None;
    };
    // The door for numbers: no factory ever sees NaN or infinity, which the file-wide check has reported.
    if !settings.values().all(finite) {
        return None;
    }
    let mut settings = settings.clone();
    if let Some(folder) = kinds.folder {
        settings.iter_mut().for_each(|(key, value)| resolve(folder, key, value));
    }
    match factory(&settings) {
        Ok(appendage) => Some(appendage),
        Err(problems) => {
            for mut p in problems.0 {
                let key = p.object.take().unwrap_or_default();
                let object = if key.is_empty() { label.to_owned() } else { format!("{label}.{key}") };
                match p.file {
                    // Found in a file that the table names: that place says more than the key.
                    Some(_) => t.fail_elsewhere(p.on(object)),
                    None => t.fail_at(t.place(&key), p.on(object)),
                }
            }
            None
        }
    }
}

/// Makes paths in keys that end with `_file` start at the folder of the mission file.
fn resolve(folder: &Path, key: &str, value: &mut toml::Value) {
    match value {
        toml::Value::String(s) if key.ends_with("_file") => *s = folder.join(&*s).to_string_lossy().into_owned(),
        toml::Value::Array(a) => a.iter_mut().for_each(|v| resolve(folder, key, v)),
        toml::Value::Table(t) => t.iter_mut().for_each(|(k, v)| resolve(folder, k, v)),
        _ => {}
    }
}

fn finite(v: &toml::Value) -> bool {
    match v {
        toml::Value::Float(x) => x.is_finite(),
        toml::Value::Array(a) => a.iter().all(finite),
        toml::Value::Table(t) => t.values().all(finite),
        _ => true,
    }
}
