//! Kinds of appendage beside those of the workspace: the place for your own (`docs/python-appendages.md`).

use ffid::model::Registry;
use pyo3::prelude::*;

/// Adds them.
#[cfg_attr(not(feature = "antenna-boom"), expect(unused_variables, reason = "there is none"))]
pub(crate) fn register(registry: &mut Registry) {
    #[cfg(feature = "antenna-boom")]
    antenna_boom::register(registry);
}

/// All kinds of appendage that a mission may have.
#[pyfunction]
pub(crate) fn appendage_kinds() -> Vec<String> {
    ffid::default_registry().kinds().map(str::to_owned).collect()
}
