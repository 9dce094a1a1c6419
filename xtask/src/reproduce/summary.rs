//! What a reproduction found: `summary.json`.

use super::beyond::Beyond;
use super::open::{Conclusion, Sweep};
use super::score::Columns;
use super::{errata, identify, spectra};
use serde::Serialize;

/// The report of the study.
pub(super) const REPORT: &str = "report.html";

/// Both runs of one case.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct Runs {
    /// Perfect sensors, as in the paper.
    pub(super) noise_free: Columns,
    /// The sensors of the mission file.
    pub(super) noisy: Columns,
}

/// `summary.json`.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Summary {
    pub(super) quick: bool,
    pub(super) table2: Runs,
    pub(super) table3: Runs,
    pub(super) fig5: spectra::Frequencies,
    pub(super) fig7: spectra::Frequencies,
    pub(super) identified: Vec<identify::Report>,
    pub(super) errata: Vec<errata::Effect>,
    pub(super) sweep: Sweep,
    pub(super) conclusions: Vec<Conclusion>,
    pub(super) beyond: Beyond,
    pub(super) wall_s: f64,
}
