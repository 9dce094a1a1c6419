//! What the report shows that is not in the summary.

use crate::reproduce::errata::Errata;
use crate::reproduce::experiment::Experiment;
use ff_report::plot::Figure;

/// Points of a curve in the page.
pub(super) const POINTS: usize = 2000;

/// What the report shows that is not in the summary.
pub(in crate::reproduce) struct Shown<'a> {
    pub(in crate::reproduce) flex: &'a Experiment,
    pub(in crate::reproduce) slosh: &'a Experiment,
    /// Excitation, response and spectra of each case.
    pub(in crate::reproduce) panels: &'a [Figure; 3],
    pub(in crate::reproduce) fuel: &'a [Figure; 3],
    pub(in crate::reproduce) errata: &'a Errata,
}
