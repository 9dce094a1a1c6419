//! Links of the robot by name, for the keys of a mission that name one.

use super::reader::{Table, error};
use ff_model::Model;
use ff_model::diagnostics::{clip, list, nearest};

/// Frames of the robot without appendages, looked up by name.
pub(super) struct Frames<'m>(pub(super) &'m Model);

impl Frames<'_> {
    /// Index of a frame; an unknown name is reported at `key` of `t`.
    pub(super) fn find(&self, name: &str, key: &str, t: &Table<'_, '_>) -> Option<usize> {
        let found = self.0.frames().iter().position(|f| f.name == name);
        if found.is_none() {
            let names = || self.0.frames().iter().map(|f| f.name.as_str());
            let p = error("Config::UnknownFrame", format!("the robot has no link '{}'", clip(name)));
            t.fail(
                key,
                match nearest(name, names()) {
                    Some(n) => p.hint(format!("did you mean {n}?")),
                    None => p.hint(format!("links: {}", list(names(), 12))),
                },
            );
        }
        found
    }
}
