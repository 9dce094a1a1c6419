//! From the `kind = "..."` of a mission file to an appendage.

use crate::diagnostics::problem::Problems;
use crate::diagnostics::text::list;
use crate::keys::error;
use crate::port::DynAppendage;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Builds an appendage from its table in the mission file (keys `kind`, `name`, `host`, `mount` removed).
///
/// Errors carry key names in `Problem::object`; the mission loader adds file and line, unless the problem is in another
/// file and says so. A text in a key that ends with `_file` is a path, which the loader has made to start at the folder
/// of the mission file; [`crate::diagnostics::read::text_file`] reads it.
pub type Factory = fn(&toml::Table) -> Result<Arc<dyn DynAppendage>, Problems>;

/// What a registry knows of one kind.
#[derive(Clone, Debug)]
struct Entry {
    factory: Factory,
    examples: Vec<&'static str>,
}

/// The kinds of appendage a mission file may name.
///
/// A third-party crate registers its own, with at least one table that `validate::check_kind` can build it from:
///
/// ```
/// use ff_model::{DynAppendage, Problems, Registry, toml::Table};
/// # use std::sync::Arc;
/// # fn from_toml(_: &Table) -> Result<Arc<dyn DynAppendage>, Problems> { Err(Problems::default()) }
/// let mut registry = Registry::new();
/// registry.register("tether", from_toml).example("tether", "length_m = 12.0\nmass_kg = 3.5");
/// assert_eq!(registry.kinds().collect::<Vec<_>>(), ["tether"]);
/// assert_eq!(registry.examples("tether").len(), 1);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Registry {
    kinds: BTreeMap<String, Entry>,
}

impl Registry {
    /// An empty registry.
    pub fn new() -> Self {
        Self::default()
    }
    /// Adds or replaces a kind, without examples.
    pub fn register(&mut self, kind: impl Into<String>, factory: Factory) -> &mut Self {
        self.kinds.insert(kind.into(), Entry { factory, examples: Vec::new() });
        self
    }
    /// Adds an example of a registered kind: its keys in a mission file, without `kind`, `name`, `host`, `mount`.
    ///
    /// Give one for every structure that the kind can take (a chain of one and of three segments, each shape of
    /// tank): the conformance suite checks the examples, and tools show them to users. Does nothing for a kind that
    /// is not registered.
    pub fn example(&mut self, kind: &str, table: &'static str) -> &mut Self {
        if let Some(e) = self.kinds.get_mut(kind) {
            e.examples.push(table);
        }
        self
    }
    /// The factory of a kind.
    pub fn get(&self, kind: &str) -> Option<Factory> {
        self.kinds.get(kind).map(|e| e.factory)
    }
    /// The examples of a kind, in the order given; empty for an unknown kind.
    pub fn examples(&self, kind: &str) -> &[&'static str] {
        self.kinds.get(kind).map_or(&[], |e| &e.examples)
    }
    /// Registered kinds in alphabetical order.
    pub fn kinds(&self) -> impl Iterator<Item = &str> {
        self.kinds.keys().map(String::as_str)
    }
    /// Builds an appendage of a kind from the text of its table, as a test or an example needs it.
    ///
    /// # Errors
    /// `Config::UnknownKind`, `Config::Syntax`, or what the factory finds wrong.
    pub fn build(&self, kind: &str, table: &str) -> Result<Arc<dyn DynAppendage>, Problems> {
        let factory = self.get(kind).ok_or_else(|| {
            let known = list(self.kinds(), 20);
            Problems(vec![error("Config::UnknownKind", format!("unknown kind '{kind}'; known: {known}")).on("kind")])
        })?;
        let table = table.parse().map_err(|e: toml::de::Error| {
            Problems(vec![error("Config::Syntax", e.to_string()).hint("correct the TOML of this table")])
        })?;
        factory(&table)
    }
}
