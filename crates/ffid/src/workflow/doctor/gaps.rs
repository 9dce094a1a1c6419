//! Samples that are missing or late, as reading the file found them (rows D13 and D14).

use super::case::Case;
use super::diagnosis::{Finding, Judgement, Topic};
use ff_model::Problems;

/// Codes of what reading says about sample times.
const CODES: [&str; 6] =
    ["Data::Dropped", "Data::Gap", "Data::Jitter", "Data::Merged", "Data::Resampled", "Data::Segments"];

pub(super) fn finding(case: &Case<'_>, warnings: Option<&Problems>) -> Finding {
    let r = case.record;
    let of_time: Vec<&str> =
        warnings.iter().flat_map(|w| &w.0).filter(|p| CODES.contains(&p.code)).map(|p| p.message.as_str()).collect();
    let rate = r.rate_hz();
    let head = format!("{} samples at {:.4} Hz, {:.3} s", r.samples(), rate, r.seconds());
    if of_time.is_empty() {
        return case.finding(Topic::Gaps, Judgement::Good, format!("{head}, without gaps"));
    }
    // The problem itself is among those of reading.
    case.finding(Topic::Gaps, Judgement::Suspicious, format!("{head}; {}", of_time.join("; ")))
}
