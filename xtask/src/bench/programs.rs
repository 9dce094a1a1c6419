//! The programs of a benchmark.

use super::peers::Peers;
use super::run::Pin;
use std::path::Path;

/// What is run.
pub struct Programs<'a> {
    /// The workspace.
    pub root: &'a Path,
    /// `ff-bench` for any x86-64.
    pub portable: &'a Path,
    /// `ff-bench` for this machine.
    pub native: &'a Path,
    /// The peers' programs, if asked for.
    pub peers: Option<&'a Peers>,
    /// Where everything runs.
    pub pin: Pin,
}
