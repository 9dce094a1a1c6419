//! What is asked of an import, and its limits.

use crate::leniency::Leniency;
use ff_model::{BaseKind, Inertia};
use std::collections::BTreeMap;

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
    /// Only this link and what hangs on it; the whole file unless given.
    pub subtree: Option<String>,
    /// Names or patterns (`*` for any text) of joints that are held at zero, or at the limit next to it.
    pub lock: Vec<String>,
    /// Joints that are held, by name, and where (rad or m).
    pub lock_at: BTreeMap<String, f64>,
    /// Joints that the mission makes hinges of appendages: their limits and drives do not matter.
    pub lifted: Vec<String>,
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
            subtree: None,
            lock: Vec::new(),
            lock_at: BTreeMap::new(),
            lifted: Vec::new(),
            max_links: MAX_LINKS,
            leniency: Leniency::default(),
        }
    }
}
