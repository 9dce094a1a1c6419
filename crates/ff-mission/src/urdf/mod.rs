//! Robots from URDF files.
//!
//! A URDF passes four doors before it becomes a [`Model`], and every problem behind an open door is
//! collected before the file is refused:
//!
//! 1. `prescan`: size, UTF-8, nesting, DTD, xacro: on the bytes, before any XML parser;
//! 2. `strict`: every element and attribute known, every token a finite number, with line and column;
//! 3. `graph` and `physics`: one tree; inertias that some body could have; axes, limits, units;
//! 4. `second`: urdf-rs reads the same text and must agree.
//!
//! Links on fixed joints are merged into the body they are fixed to; every link stays as a
//! [`ff_model::tree::Frame`]. Body order is joint order in the file, parents before children. What is skipped:
//! `visual`, `collision` (which [`collision`] reads on demand), `material`, `transmission`, `gazebo`, `ros2_control`. What is refused: `mimic`,
//! `planar`, `floating` and `spherical` joints, `quat_xyzw`, xacro.
pub(crate) mod build;
pub mod collision;
pub(crate) mod graph;
pub(crate) mod physics;
pub(crate) mod prescan;
pub(crate) mod raw;
pub(crate) mod schema;
pub(crate) mod second;
pub(crate) mod strict;

use crate::leniency::Leniency;
use ff_model::Inertia;
use ff_model::{Area, Problems, Severity};
use ff_model::{BaseKind, Model};
use std::path::Path;

/// Largest file read (bytes).
pub const MAX_BYTES: usize = 16 << 20;
/// Deepest nesting of XML elements.
pub const MAX_DEPTH: usize = 64;
/// Most links, unless [`UrdfOptions::max_links`] raises it.
pub const MAX_LINKS: usize = 10_000;

/// How to import a URDF.
#[derive(Clone, Debug, PartialEq)]
pub struct UrdfOptions {
    /// The link whose frame is the base frame: the root (default) or a link fixed to it.
    pub base_link: Option<String>,
    /// Whether the base moves.
    pub base_kind: BaseKind,
    /// Replaces the `<inertial>` of the base link; about the base link frame.
    pub base_inertial: Option<Inertia<f64>>,
    /// Most links.
    pub max_links: usize,
    /// Named errors to allow, and whether warnings refuse.
    pub leniency: Leniency,
}

impl Default for UrdfOptions {
    fn default() -> Self {
        Self {
            base_link: None,
            base_kind: BaseKind::Floating,
            base_inertial: None,
            max_links: MAX_LINKS,
            leniency: Leniency::default(),
        }
    }
}

/// Imports a URDF file. Returns the model and the warnings.
///
/// # Errors
/// All problems of the file (area `Model`, or `Io` when it cannot be read), each with file and line.
pub fn from_file(path: &Path, options: &UrdfOptions) -> Result<(Model, Problems), Problems> {
    let name = path.to_string_lossy();
    if name.starts_with("package://") || name.starts_with("model://") || name.ends_with(".xacro") {
        return Err(Problems(vec![prescan::xacro("a path that only ROS resolves").in_file(path)]));
    }
    let bytes = ff_model::diagnostics::read_bytes(path, MAX_BYTES, Area::Model, "Urdf::TooLarge")?;
    let mut result = from_bytes(&bytes, options);
    let problems = match &mut result {
        Ok((_, p)) | Err(p) => p,
    };
    for p in problems.0.iter_mut().filter(|p| p.area == Area::Model) {
        p.file.get_or_insert_with(|| path.to_path_buf());
    }
    result
}

/// Imports a URDF from the bytes of a file. Returns the model and the warnings.
///
/// # Errors
/// All problems, each with its line.
pub fn from_bytes(bytes: &[u8], options: &UrdfOptions) -> Result<(Model, Problems), Problems> {
    match prescan::decode(bytes) {
        Ok(text) => from_str(text, options),
        Err(p) => Err(p),
    }
}

/// Imports a URDF from a string. Returns the model and the warnings.
///
/// # Errors
/// All problems, each with its line.
pub fn from_str(text: &str, options: &UrdfOptions) -> Result<(Model, Problems), Problems> {
    let mut out = Problems::default();
    let model = import(text, options, &mut out);
    options.leniency.settle(&mut out);
    out.finish(model)
}

/// The four doors; `None` when one stayed shut.
fn import(text: &str, options: &UrdfOptions, out: &mut Problems) -> Option<Model> {
    let text = match prescan::decode(text.as_bytes()) {
        Ok(t) => t,
        Err(p) => {
            out.extend(p);
            return None;
        }
    };
    if let Err(p) = prescan::scan(text, options.max_links) {
        out.extend(p);
        return None;
    }
    let mut raw = strict::read(text, &options.leniency, out)?;
    if raw.links.is_empty() {
        return None;
    }
    physics::check(&raw, out);
    let tree = graph::tree(&raw, out);
    let mut found = Problems::default();
    if blocked(out, options) {
        // Bodies without mass can be told from the tree even when other things are wrong, unless the wrong
        // thing is the mass itself.
        if let Some(t) = tree.filter(|_| raw.links.iter().all(|l| !l.unsure)) {
            build::model(&raw, &t, options, &mut found);
            out.extend(found);
        }
        return None;
    }
    second::adopt(text, &mut raw, out);
    if blocked(out, options) {
        return None;
    }
    let model = build::model(&raw, &tree?, options, &mut found);
    out.extend(found);
    model
}

/// True when an error stands that the user has not allowed.
fn blocked(out: &Problems, options: &UrdfOptions) -> bool {
    out.0.iter().any(|p| p.severity == Severity::Error && !options.leniency.allows(p.code))
}
