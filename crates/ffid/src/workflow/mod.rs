//! What users ask for: plan a manoeuvre, judge it, identify a record.

pub mod excite;
pub mod identify;
pub mod preflight;
