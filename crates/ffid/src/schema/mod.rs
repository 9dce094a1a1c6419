//! JSON schemas: of the files that people write, so that editors complete and check them, and of what programs read.
//!
//! That of mission files is printed from the keys that their reader reads by ([`ff_mission::mission::schema`]); that of results
//! is declared in the same way and held to their reader by a test of `ffid-cli`.
pub(crate) mod result;

use ff_mission::mission::schema;
use ff_model::Registry;
use serde_json::Value;

/// The schema of a mission file whose appendages are of the kinds of a registry. Allocates.
pub fn mission(registry: &Registry) -> Value {
    schema::mission(registry)
}

/// The schema of the `result.json` of an identification ([`crate::workflow::identify::IdentificationResult`]). Allocates.
pub fn result() -> Value {
    schema::of_file("Result of ffid identify", result::ROOT, &Registry::default())
}
