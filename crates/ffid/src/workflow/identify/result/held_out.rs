//! Held-out data in a result.

use super::channel::Channel;
use crate::workflow::identify::signals::Signals;
use ff_records::Record;
use serde::{Deserialize, Serialize};

/// The prediction of data that were not used.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeldOut {
    /// The file, or the part of the record.
    pub source: String,
    /// Samples.
    pub samples: usize,
    /// Length (s).
    pub seconds: f64,
    /// As `IdentificationResult::chi2_per_dof`, with the parameters as they are and only biases and initial state fitted.
    pub chi2_per_dof: f64,
    /// Largest value at which the model counts as explaining them.
    pub limit: f64,
    /// Whether it does.
    pub explained: bool,
    /// Every channel.
    pub channels: Vec<Channel>,
    /// In words.
    pub verdict: String,
}

impl HeldOut {
    /// The numbers; the verdict in words is the caller's to add.
    pub(in crate::workflow::identify) fn of(
        source: String,
        record: &Record,
        signals: &Signals,
        chi2_per_dof: f64,
        limit: f64,
    ) -> Self {
        Self {
            source,
            samples: record.samples(),
            seconds: record.seconds(),
            chi2_per_dof,
            limit,
            explained: chi2_per_dof <= limit,
            channels: signals.channels(),
            verdict: String::new(),
        }
    }
}
