//! Held-out data in a result.

use super::channel::Channel;
use crate::workflow::identify::evidence::{Evidence, State};
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
    /// As `IdentificationResult::chi2_per_dof`, with the parameters as they are and only biases and initial state fitted; on the ground, where
    /// nothing is fitted, with the deviations of the calibration and what its low pass takes of the motion allowed for.
    pub chi2_per_dof: f64,
    /// Largest value at which the model counts as explaining them.
    pub limit: f64,
    /// Whether it does: chi-squared is within the limit, and no test speaks against the model.
    pub explained: bool,
    /// What the tests of a fit say of these data, what was known before them being the prior of the parameters; absent on the
    /// ground, in results of older versions, and where nothing was identified before.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub evidence: Option<Evidence>,
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
            evidence: None,
            channels: signals.channels(),
            verdict: String::new(),
        }
    }
    /// With what the tests of a fit to these data say. The one place that decides whether data that were not fitted are explained.
    pub(in crate::workflow::identify) fn judged_by(mut self, evidence: Evidence) -> Self {
        self.explained = self.chi2_per_dof <= self.limit && evidence.state != State::Contradicted;
        self.evidence = Some(evidence);
        self
    }
}
