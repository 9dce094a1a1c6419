//! Options of an identification beside its settings: reduction, profiles, other starts, earlier knowledge, ties.

use super::ties::TieSpec;
use ident::Posterior;

/// A payload that was not mounted in a record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Absent {
    /// Name of the payload (`[[client]]`, or an appendage of kind `payload`).
    pub payload: String,
    /// Label of the record; those of its parts begin with it.
    pub record: String,
}

impl Absent {
    /// Whether it is said of a record with this label, or of the record that it is a part of.
    pub fn says(&self, label: &str) -> bool {
        label
            .strip_prefix(&*self.record)
            .is_some_and(|rest| rest.is_empty() || rest.starts_with(['-', ' ', '#', '.', '/']))
    }
}

/// Options of a fit; the default is one fit of all parameters.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FitOptions {
    /// Where the data are silent, estimate the parameters that they can tell and hold the others.
    pub reduce: bool,
    /// Patterns of parameters whose likelihood is to be profiled.
    pub profile: Vec<String>,
    /// Fits from random starts, beside the one from the start.
    pub more_starts: usize,
    /// What an earlier identification has learnt, as prior: for one whose records are not at hand.
    pub posterior: Option<Posterior>,
    /// Begin at the means of `posterior`, not at the values of the mission.
    pub start_at_posterior: bool,
    /// What an earlier identification has learnt whose records are among those that are fitted: listed beside the estimates.
    pub learnt: Option<Posterior>,
    /// Hold what the mission is not sure of at its values, and widen the deviations by it, instead of estimating it beside.
    pub consider: bool,
    /// Parameters that are functions of fewer unknowns.
    pub ties: Vec<TieSpec>,
    /// Payloads that were not mounted in a record of an arm on the ground.
    pub absent: Vec<Absent>,
}
