//! What the suite found, one figure per law.

use serde::{Serialize, Serializer};
use std::fmt;

/// One law: its figure, its limit, the verdict.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// Name of the law; see [`crate::conformance::law`].
    pub law: &'static str,
    /// Worst figure found; smaller is better (no unit: relative, or a count). JSON has no NaN and no infinity; they
    /// are written as text.
    #[serde(serialize_with = "number_or_text")]
    pub figure: f64,
    /// Greatest figure that passes.
    pub limit: f64,
    /// `figure <= limit`; false for NaN.
    pub pass: bool,
    /// False for advice: a failure does not fail the report.
    pub required: bool,
    /// Where the worst figure was found, or the faults by name; may be empty.
    #[serde(rename = "where")]
    pub detail: String,
}

fn number_or_text<S: Serializer>(x: &f64, to: S) -> Result<S::Ok, S::Error> {
    if x.is_finite() { to.serialize_f64(*x) } else { to.collect_str(x) }
}

/// A law that was not checked, and why.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Skipped {
    /// Name of the law.
    pub law: &'static str,
    /// What was missing.
    pub why: &'static str,
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
///
/// ```
/// use slosh_pendulum::SloshPendulum;
/// use validate::{ConformanceReport, check_appendage};
///
/// let report: ConformanceReport = check_appendage(&SloshPendulum::new(100.0, 0.8, [20.0, 23.0], [5.0, 4.0])?);
/// assert!(report.passed(), "{report}");
/// assert!(report.checks.len() > 5 && report.kind == "slosh_pendulum");
/// # Ok::<(), ff_model::Problems>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ConformanceReport {
    /// The appendage's kind.
    pub kind: String,
    /// The checks in the order they were made.
    pub checks: Vec<Check>,
    /// Laws that could not be checked.
    pub skipped: Vec<Skipped>,
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
        Self { kind: kind.to_owned(), checks: Vec::new(), skipped: Vec::new() }
    }
    pub(crate) fn skip(&mut self, law: &'static str, why: &'static str) {
        self.skipped.push(Skipped { law, why });
    }
    pub(crate) fn push(&mut self, c: Check) {
        self.checks.push(c);
    }
    /// Takes over the checks of another report: of each law the worse, its place after `prefix` and a colon.
    pub(crate) fn merge(&mut self, other: Self, prefix: &str) {
        for mut c in other.checks {
            c.detail = if c.detail.is_empty() { prefix.to_owned() } else { format!("{prefix}: {}", c.detail) };
            // A figure is as bad as it stands to its limit; limits of counts are zero, and NaN is worst.
            let badness = |c: &Check| if c.pass { c.figure } else { f64::INFINITY };
            match self.checks.iter_mut().find(|have| have.law == c.law) {
                Some(have) if badness(&c) > badness(have) => *have = c,
                Some(_) => {}
                None => self.checks.push(c),
            }
        }
        for s in other.skipped {
            if !self.skipped.contains(&s) {
                self.skipped.push(s);
            }
        }
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
            let sign = if c.pass { "<=" } else { "> " };
            write!(f, "\n  {verdict}  {:<50} {:>9.1e} {sign} {:<8.0e}", c.law, c.figure, c.limit)?;
            if !c.pass && !c.detail.is_empty() {
                write!(f, "  {}", c.detail)?;
            }
        }
        for s in &self.skipped {
            write!(f, "\n  ----  {:<50} not checked: {}", s.law, s.why)?;
        }
        Ok(())
    }
}
