//! A record and its label.

use ff_records::Record;
use std::borrow::Cow;

/// A record with its label.
#[derive(Clone, Debug)]
pub struct LabelledRecord {
    /// Prefix of its biases and initial state when there are several.
    pub label: String,
    /// The samples.
    pub record: Record,
    /// Torques, gyro: put on another clock by interpolation, which smooths their noise.
    pub resampled: (bool, bool),
    /// The part behind a gap of a longer record: it begins in the middle of a motion, so that its initial state is estimated.
    pub continues: bool,
    /// Identifications ago that it was fitted first: 0 for a record at hand.
    pub ago: usize,
}

/// The name of a channel where there are several records.
pub(super) fn channel_name<'a>(records: &[LabelledRecord], k: usize, name: &'a str) -> Cow<'a, str> {
    if records.len() > 1 { format!("{}.{name}", records[k].label).into() } else { name.into() }
}
