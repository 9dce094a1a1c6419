//! Robots from URDF files.
//!
//! A URDF passes four doors before it becomes a [`Model`], and every problem behind an open door is
//! collected before the file is refused:
//!
//! 1. `prescan`: size, UTF-8, nesting, DTD, xacro: on the bytes, before any XML parser;
//! 2. `strict`: no name misspelt, every token a finite number, with line and column;
//! 3. `part`, `graph`, `hold`, `follow`, `physics`: which links, one tree, which joints move and which follow another; inertias that some body could have; axes, limits,
//!    units;
//! 4. `second`: urdf-rs reads the same text and must agree.
//!
//! What is wrong is an error where the answer would follow from it, and a warning with what was assumed elsewhere; warnings of one kind
//! are one warning (`docs/urdf.md`).
//!
//! Links on fixed joints, and on joints that are held, are merged into the body they are fixed to; every link stays as a
//! [`ff_model::tree::Frame`]. Body order is joint order in the file, parents before children. What is skipped:
//! `visual`, `collision` (which [`visual`] and [`collision`] read on demand), `material`, `transmission`, `gazebo`, `ros2_control`, and elements
//! and attributes that are not part of URDF. What is refused: `planar`, `floating` and `spherical` joints that carry mass,
//! `quat_xyzw`, xacro.
pub(crate) mod build;
pub mod collision;
mod convert;
pub(crate) mod follow;
pub(crate) mod graph;
pub(crate) mod hold;
mod options;
pub(crate) mod part;
pub(crate) mod physics;
pub(crate) mod prescan;
pub(crate) mod raw;
pub(crate) mod schema;
pub(crate) mod second;
pub(crate) mod strict;
pub(crate) mod summary;
pub mod visual;

pub use options::{MAX_BYTES, MAX_DEPTH, MAX_LINKS, UrdfOptions};

use crate::leniency::Leniency;
use ff_model::Model;
use ff_model::diagnostics::Limit;
use ff_model::{Area, Problem, Problems, Severity};
use hold::Held;
use std::path::Path;

/// Imports a URDF file. Returns the model and the warnings, one for each kind.
///
/// # Errors
/// All problems of the file (area `Model`, or `Io` when it cannot be read), each with file and line; of area `Config` when a link or
/// joint that the options name does not exist.
pub fn from_file(path: &Path, options: &UrdfOptions) -> Result<(Model, Problems), Problems> {
    summary::summarised(read_file(path, options))
}

/// Imports a URDF from the bytes of a file. Returns the model and the warnings, one for each kind.
///
/// # Errors
/// All problems, each with its line.
pub fn from_bytes(bytes: &[u8], options: &UrdfOptions) -> Result<(Model, Problems), Problems> {
    summary::summarised(read_bytes(bytes, options))
}

/// Imports a URDF from a string. Returns the model and the warnings, one for each kind.
///
/// # Errors
/// All problems, each with its line.
pub fn from_str(text: &str, options: &UrdfOptions) -> Result<(Model, Problems), Problems> {
    summary::summarised(read_str(text, options))
}

/// Names of the joints of a URDF that turn or slide about one axis, in the order of the file; empty for a text that is no URDF. Those that a
/// [`Model`] does not have are held. Allocates.
pub fn moving_joints(text: &str) -> Vec<String> {
    let whole = prescan::decode(text.as_bytes()).ok().filter(|t| prescan::scan(t, MAX_LINKS).is_ok());
    let raw = whole.and_then(|t| strict::read(t, &Leniency::default(), &mut Problems::default()));
    raw.into_iter()
        .flat_map(|r| r.joints)
        .filter(|j| j.moves() && !matches!(&*j.kind, "planar" | "floating"))
        .map(|j| j.name)
        .collect()
}

/// [`from_file`] with every warning by itself.
pub(crate) fn read_file(path: &Path, options: &UrdfOptions) -> Result<(Model, Problems), Problems> {
    let name = path.to_string_lossy();
    if name.starts_with("package://") || name.starts_with("model://") || name.ends_with(".xacro") {
        return Err(Problems(vec![prescan::xacro("a path that only ROS resolves").in_file(path)]));
    }
    let bytes = ff_model::diagnostics::read_bytes(path, MAX_BYTES, Area::Model, "Urdf::TooLarge")?;
    let mut result = read_bytes(&bytes, options);
    let problems = match &mut result {
        Ok((_, p)) | Err(p) => p,
    };
    for p in problems.0.iter_mut().filter(|p| p.area == Area::Model) {
        p.file.get_or_insert_with(|| path.to_path_buf());
    }
    result
}

fn read_bytes(bytes: &[u8], options: &UrdfOptions) -> Result<(Model, Problems), Problems> {
    match prescan::decode(bytes) {
        Ok(text) => read_str(text, options),
        Err(p) => Err(p),
    }
}

/// [`from_str`] with every warning by itself.
pub(crate) fn read_str(text: &str, options: &UrdfOptions) -> Result<(Model, Problems), Problems> {
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
    let (whole, foreign) = match strict::foreign(text, out) {
        Some(robot) => (robot, true),
        None => (strict::read(text, &options.leniency, out)?, false),
    };
    if whole.links.is_empty() {
        return None;
    }
    // Formats that call their links otherwise pass the count of the bytes.
    if whole.links.len() > options.max_links {
        let (n, limit) = (whole.links.len(), options.max_links);
        let p = Problem::error(Area::Model, "Urdf::TooLarge", format!("{n} links, limit {limit} links"));
        let p = p.violating(n as f64, Limit::AtMost(limit as f64), "links");
        out.push(p.hint("raise the limit if the robot is really that large"));
        return None;
    }
    let raw = part::used(&whole, options, out)?;
    let doubts = physics::links(&raw, out);
    let tree = graph::tree(&raw, out);
    let held = tree.as_ref().map_or_else(|| Held::none(&raw), |t| hold::settle(&raw, t, options, out));
    let lifted = |name: &str| options.lifted.iter().any(|l| l == name);
    physics::joints(&raw, |k| held.moves(&raw, k), |k| held.follows[k].is_some(), lifted, out);
    let mut found = Problems::default();
    if blocked(out, options) {
        // Bodies without mass can be told from the tree even when other things are wrong, unless the wrong
        // thing is the mass itself.
        match tree.filter(|_| raw.links.iter().all(|l| !l.unsure)) {
            Some(t) => _ = build::model(&raw, &t, &held, doubts, options, &mut found),
            None => found.0.extend(doubts.into_iter().map(|d| d.problem)),
        }
        out.extend(found);
        return None;
    }
    if !foreign {
        second::agree(text, &raw, out);
    }
    if blocked(out, options) {
        return None;
    }
    let model = build::model(&raw, &tree?, &held, doubts, options, &mut found);
    out.extend(found);
    model
}

/// True when an error stands that the user has not allowed.
fn blocked(out: &Problems, options: &UrdfOptions) -> bool {
    out.0.iter().any(|p| p.severity == Severity::Error && !options.leniency.allows(p.code))
}
