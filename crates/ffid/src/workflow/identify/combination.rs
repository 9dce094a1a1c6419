//! A direction in the space of the unknowns, in the names of the parameters.

use ident::belief::Direction;
use serde::{Deserialize, Serialize};

/// A combination of parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Combination {
    /// Singular value of the scaled sensitivities along it.
    pub singular_value: f64,
    /// Change of each parameter along it, in its own unit, largest relative part first.
    pub terms: Vec<(String, f64)>,
    /// Smaller parts left out.
    pub omitted: usize,
    /// In words.
    pub text: String,
}

impl Combination {
    pub(crate) fn of(d: &Direction) -> Self {
        Self { singular_value: d.singular_value, terms: d.terms.clone(), omitted: d.omitted, text: d.to_string() }
    }
}
