//! Warnings, files, records and settings behind a result.

use ff_model::Problems;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A problem that was let through.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Warning {
    /// Its code.
    pub code: String,
    /// What it says.
    pub message: String,
}

impl Warning {
    /// Every problem of a list.
    pub fn all(problems: &Problems) -> Vec<Self> {
        problems.0.iter().map(|p| Self { code: p.code.to_owned(), message: p.to_string() }).collect()
    }
}

/// Where a result comes from.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Program and version.
    pub program: String,
    /// Files, as they were named.
    pub inputs: Vec<InputFile>,
    /// The record, its first part when the rest was held out.
    pub record: RecordLine,
    /// Standard deviations that whitened the residuals: torque (N m).
    pub noise_torque_nm: f64,
    /// Gyro (rad/s).
    pub noise_gyro_rad_per_s: f64,
    /// Settings by name.
    pub settings: BTreeMap<String, String>,
}

/// A file that was read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputFile {
    /// Path as given.
    pub file: String,
    /// Size (bytes).
    pub bytes: u64,
    /// SHA-256, hexadecimal.
    pub sha256: String,
    /// Of a record what its readings are known by in any other file ([`ff_records::Content`]).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub content: Option<String>,
}

/// A record at a glance.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordLine {
    /// Samples used.
    pub samples: usize,
    /// Rate (Hz).
    pub rate_hz: f64,
    /// Length (s).
    pub seconds: f64,
    /// First time stamp (s).
    pub t0: f64,
    /// Whether joint rates and accelerations were recorded and used.
    pub rates: bool,
}
