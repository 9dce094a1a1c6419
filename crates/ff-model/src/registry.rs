//! From the `kind = "..."` of a mission file to an appendage.

use crate::appendage::DynAppendage;
use crate::problem::Problems;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Builds an appendage from its table in the mission file (keys `kind`, `name`, `host`, `mount` removed).
///
/// Errors carry key names in `Problem::object`; the mission loader adds file and line, unless the problem is in another
/// file and says so. A text in a key that ends with `_file` is a path, which the loader has made to start at the folder
/// of the mission file; [`crate::text_file`] reads it.
pub type Factory = fn(&toml::Table) -> Result<Arc<dyn DynAppendage>, Problems>;

/// The kinds of appendage a mission file may name.
///
/// A third-party crate registers its own: `registry.register("tether", tether::from_toml)`.
#[derive(Clone, Debug, Default)]
pub struct Registry {
    kinds: BTreeMap<String, Factory>,
}

impl Registry {
    /// An empty registry.
    pub fn new() -> Self {
        Self::default()
    }
    /// Adds or replaces a kind.
    pub fn register(&mut self, kind: impl Into<String>, factory: Factory) -> &mut Self {
        self.kinds.insert(kind.into(), factory);
        self
    }
    /// The factory of a kind.
    pub fn get(&self, kind: &str) -> Option<Factory> {
        self.kinds.get(kind).copied()
    }
    /// Registered kinds in alphabetical order.
    pub fn kinds(&self) -> impl Iterator<Item = &str> {
        self.kinds.keys().map(String::as_str)
    }
}
