//! A fit that has ended.

use super::findings::{Minima, ReducedSet};
use super::labelled_record::LabelledRecord;
use super::signals::Signals;
use super::unknowns::Unknowns;
use ff_model::Model;
use ident::Uncertainty;
use ident::belief::Profile;
use ident::compose::{Shared, is_called};
use ident::estimate::Estimate;
use ident::uncertain::ErrorSource;

/// A fit with what led to it.
#[derive(Clone, Debug)]
pub(super) struct Fitted {
    /// The last fit.
    pub(super) estimate: Estimate,
    /// What was estimated in the end, by index among the unknowns' declarations.
    pub(super) selected: Vec<usize>,
    /// What the data can tell of everything that was asked for.
    pub(super) full: Uncertainty,
    /// Minima of several starts.
    pub(super) minima: Option<Minima>,
    /// Covariance about this minimum alone, where that of the estimate covers others as well.
    pub(super) alone: Option<Uncertainty>,
    /// Intervals of parameters along which the valley is no parabola.
    pub(super) bent: Vec<Profile>,
    /// Set of parameters that was estimated in place of all.
    pub(super) reduced: Option<ReducedSet>,
}

impl Fitted {
    /// A fit as it is, with nothing looked for around its end.
    pub(super) fn of(estimate: Estimate, selected: &[usize]) -> Self {
        let (full, selected) = (estimate.data_only.clone(), selected.to_vec());
        Self { estimate, selected, full, minima: None, alone: None, bent: Vec::new(), reduced: None }
    }
}

/// What the fit is, and the estimators of its records with every column.
#[derive(Clone, Copy)]
pub(super) struct Ended<'a> {
    pub(super) model: &'a Model,
    pub(super) shared: &'a Shared,
    pub(super) labels: &'a [String],
    pub(super) unknowns: &'a Unknowns,
    pub(super) fitted: &'a Fitted,
    /// All parameters of the model.
    pub(super) values: &'a [f64],
    pub(super) records: &'a [LabelledRecord],
    pub(super) signals: &'a [Signals],
    /// Whether noise of the encoders is loud in the residuals: then many draws say what it does.
    pub(super) loud: bool,
}

impl Ended<'_> {
    /// Joints that give way by so much (rad/(N m)), where that was estimated, whether each record has its own number or all share it: the first of them.
    pub(super) fn compliances(&self) -> Vec<(usize, f64)> {
        let e = &self.fitted.estimate;
        let of_records = e.nuisance.iter().map(|u| (u.name.as_str(), u.value));
        let shared = self.unknowns.decls.iter().map(|d| d.name.as_str()).zip(e.values.iter().copied());
        let all: Vec<(&str, f64)> = of_records.chain(shared).collect();
        let joints = self.model.joint_names();
        let of = |j: usize| {
            let name = ErrorSource::Compliance(j).name(&joints);
            let found = all.iter().find(|(unknown, _)| is_called(unknown, &name, self.labels))?;
            Some((j, found.1)).filter(|c| c.1 != 0.0)
        };
        (0..joints.len()).filter_map(of).collect()
    }
}
