//! What users ask for: judge a record, plan a manoeuvre, judge it, identify a record.

mod amplitude;
mod differences;
pub mod doctor;
pub mod excite;
pub mod identify;
pub mod preflight;
