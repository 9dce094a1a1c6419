//! What may be wrong with the columns of the records: found in seconds, where errors of a model that would make up for it take minutes.

use ff_mission::Leniency;
use ff_model::Problems;
use ff_model::diagnostics::Severity;
use ffid::open::Opened;
use ffid::workflow::doctor::{columns, likelier_columns};
use ffid::workflow::identify::{Identified, IdentifyError, LabelledRecord, Settings};
use std::cell::RefCell;
use std::path::{Path, PathBuf};

/// What the doctor says of the columns of the records, asked once.
pub(super) struct Columns<'a> {
    opened: &'a Opened,
    sources: &'a [PathBuf],
    leniency: Leniency,
    /// What was found, once it was asked: a fit from a start in motion, or on other clocks, is of the same columns.
    known: RefCell<Option<Problems>>,
}

impl<'a> Columns<'a> {
    pub(super) fn new(opened: &'a Opened, sources: &'a [PathBuf], leniency: Leniency) -> Self {
        Self { opened, sources, leniency, known: RefCell::new(None) }
    }

    /// Records that this identification judges, with their places and files.
    fn judged<'r>(
        &'r self,
        records: &'r [LabelledRecord],
    ) -> impl Iterator<Item = (usize, &'r LabelledRecord, &'r Path)> {
        let all = records.iter().zip(self.sources).enumerate();
        all.filter(|(_, (r, _))| r.ago == 0).map(|(k, (r, path))| (k, r, path.as_path()))
    }
    fn found(&self, records: &[LabelledRecord], s: &Settings) -> Result<Problems, IdentifyError> {
        let mut all = Problems::default();
        for (_, labelled, path) in self.judged(records) {
            all.extend(columns(self.opened, labelled, s)?.in_file(path));
        }
        Ok(all)
    }
    /// Refuses records whose columns are wrong, for a fit that leads nowhere.
    pub(super) fn refuse(&self, records: &[LabelledRecord], s: &Settings) -> Result<(), IdentifyError> {
        if self.known.borrow().is_some() {
            return Ok(());
        }
        let mut found = self.found(records, s)?;
        self.leniency.settle(&mut found);
        if found.has_errors() {
            return Err(IdentifyError::Refused(found));
        }
        self.known.replace(Some(found));
        Ok(())
    }
    /// What speaks against columns behind a fit that does not explain its records, as warnings.
    pub(super) fn behind(
        &self,
        records: &[LabelledRecord],
        s: &Settings,
        fit: &Identified,
    ) -> Result<Problems, IdentifyError> {
        let mut all = match self.known.take() {
            Some(known) => known,
            None => self.found(records, s)?,
        };
        for (k, labelled, path) in self.judged(records) {
            let at = fit.values_in(records, k);
            all.extend(likelier_columns(self.opened, labelled, s, &at)?.in_file(path));
        }
        all.0.iter_mut().for_each(|p| p.severity = Severity::Warning);
        all.0.dedup_by(|a, b| a.message == b.message);
        Ok(all)
    }
}
