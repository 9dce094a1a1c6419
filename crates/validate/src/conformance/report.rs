//! What the suite found, one figure per law.

use serde::Serialize;
use std::fmt;

/// One law: its figure, its limit, the verdict.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// Name of the law; see [`crate::conformance::law`].
    pub law: &'static str,
    /// Worst figure found; smaller is better (no unit: relative, or a count).
    pub figure: f64,
    /// Greatest figure that passes.
    pub limit: f64,
    /// `figure <= limit`; false for NaN.
    pub pass: bool,
    /// False for advice: a failure does not fail the report.
    pub required: bool,
    /// Where the worst figure was found, or the faults by name; may be empty.
    pub detail: String,
}

impl Check {
    /// A required check. Allocates for the detail only.
    pub fn new(law: &'static str, figure: f64, limit: f64, detail: impl Into<String>) -> Self {
        Self { law, figure, limit, pass: figure <= limit, required: true, detail: detail.into() }
    }
    /// The same as advice.
    #[must_use]
    pub fn advice(mut self) -> Self {
        self.required = false;
        self
    }
    /// A required check of a count of faults that must be zero; the detail lists up to eight.
    pub fn faults(law: &'static str, faults: &[String]) -> Self {
        let shown = faults.iter().take(8).map(String::as_str).collect::<Vec<_>>().join("; ");
        Self::new(law, faults.len() as f64, 0.0, shown)
    }
}

/// All checks of one appendage.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ConformanceReport {
    /// The appendage's kind.
    pub kind: String,
    /// The checks in the order they were made.
    pub checks: Vec<Check>,
}

/// An appendage broke a law. Prints the whole report.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct NotConforming(
    /// The report with the failures.
    pub ConformanceReport,
);

impl ConformanceReport {
    pub(crate) fn new(kind: &str) -> Self {
        Self { kind: kind.to_owned(), checks: Vec::new() }
    }
    pub(crate) fn push(&mut self, c: Check) {
        self.checks.push(c);
    }
    /// True when every required check passed.
    pub fn passed(&self) -> bool {
        self.checks.iter().all(|c| c.pass || !c.required)
    }
    /// The required checks that failed.
    pub fn failures(&self) -> impl Iterator<Item = &Check> {
        self.checks.iter().filter(|c| !c.pass && c.required)
    }
    /// The check of this law, if it was made.
    pub fn check(&self, law: &str) -> Option<&Check> {
        self.checks.iter().find(|c| c.law == law)
    }
    /// Itself if it passed.
    ///
    /// # Errors
    /// [`NotConforming`] with itself otherwise.
    pub fn require(self) -> Result<Self, NotConforming> {
        if self.passed() { Ok(self) } else { Err(NotConforming(self)) }
    }
}

impl fmt::Display for ConformanceReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let failed = self.failures().count();
        write!(f, "appendage '{}': {} laws checked, {failed} broken", self.kind, self.checks.len())?;
        for c in &self.checks {
            let verdict = match (c.pass, c.required) {
                (true, _) => "pass",
                (false, true) => "FAIL",
                (false, false) => "note",
            };
            write!(f, "\n  {verdict}  {:<42} {:>9.1e} <= {:<8.0e}", c.law, c.figure, c.limit)?;
            if !c.pass && !c.detail.is_empty() {
                write!(f, "  {}", c.detail)?;
            }
        }
        Ok(())
    }
}
