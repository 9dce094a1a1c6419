//! An identification with what figures and files need.

use super::course::CoursePoint;
use super::evidence::NamedError;
use super::fitted::Fitted;
use super::labelled_record::LabelledRecord;
use super::result::identification::IdentificationResult;
use super::signals::Signals;
use ident::sample::Draws;

/// A result with what figures and files need beside it.
#[derive(Clone, Debug)]
pub struct Identified {
    /// The result; its held-out part and its warnings are the caller's to add.
    pub result: IdentificationResult,
    /// Signals of every record.
    pub signals: Vec<Signals>,
    /// All parameters with the estimates in place.
    pub values: Vec<f64>,
    /// Indices of the parameters that were estimated, for themselves or by a tie.
    pub selected: Vec<usize>,
    /// Every error that was tested, each by itself, whether the record speaks for it or not.
    pub tried: Vec<NamedError>,
    /// Draws from the posterior ([`super::sample_posterior`]).
    pub draws: Option<Draws>,
    /// Where the fit has ended; none on the ground.
    pub(super) fitted: Option<Fitted>,
}

impl Identified {
    /// Parameters of the model as they were in record `k`: those of the last record ([`Identified::values`]), but for what changes from record to
    /// record. A part behind a gap has those of its record. Allocates.
    ///
    /// # Panics
    /// If there is no such record.
    pub fn values_in(&self, records: &[LabelledRecord], k: usize) -> Vec<f64> {
        let mut values = self.values.clone();
        let first = (0..=k).rev().find(|&i| !records[i].continues).unwrap_or(k);
        for course in self.result.over_time.iter().filter(|c| c.record.is_none()) {
            let at = self.result.model.iter().position(|v| v.name == course.name);
            let of = |p: &&CoursePoint| p.record.as_ref().is_some_and(|r| *r == records[first].label);
            if let (Some(at), Some(point)) = (at, course.points.iter().find(of)) {
                values[at] = point.value;
            }
        }
        values
    }
}
