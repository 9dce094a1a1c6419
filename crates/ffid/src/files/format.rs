//! The head of a JSON file that says what it is: `"format": "ffid-result", "version": 1`.

use ff_model::diagnostics::{Limit, clip};
use ff_model::{Area, Problem, Problems};
use serde_json::Value;

/// Refuses a text that names another format, or a version above `newest`, before anything else in it is judged: keys of a newer
/// version would be unknown ones. A text that is not JSON, or names no format, is left to its reader. Allocates.
///
/// # Errors
/// `Data::Format`, `Data::Version`; exit code 12.
pub fn check(text: &[u8], format: &str, newest: u32) -> Result<(), Problems> {
    let Ok(head) = serde_json::from_slice::<Value>(text) else { return Ok(()) };
    let refused = |p: Problem| Err(Problems(vec![p]));
    match &head["format"] {
        Value::String(found) if found != format => {
            let what = format!("format is '{}', must be '{format}'", clip(found));
            let p = Problem::error(Area::Data, "Data::Format", what).on("format");
            return refused(p.hint("give a file that was written as this format"));
        }
        _ => {}
    }
    match head["version"].as_u64() {
        Some(version) if version > u64::from(newest) => {
            refused(Problem::newer_format(Area::Data, "Data::Version", version, newest.into()).on("version"))
        }
        Some(0) => {
            let p = Problem::out_of_range(Area::Data, "Data::Version", 0.0, Limit::AtLeast(1.0), "").on("version");
            refused(p.hint("write the file again"))
        }
        _ => Ok(()),
    }
}
