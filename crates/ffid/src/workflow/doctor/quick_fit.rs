//! A fit of few steps over a thinned record, under a prior about the values of the mission: how near those can come to the record.
//!
//! A design office has masses a tenth wrong, inertias and springs a quarter. That hides a reversed sign of a light joint, which the same
//! values, adapted, bring out.

use super::Case;
use crate::workflow::identify::{RecordEstimator, Settings};
use ff_least_squares::Settings as Solver;
use ff_model::Params;
use ff_records::Record;
use ident::{Estimated, Request, estimate};

/// Samples of the thinned record, at least, and its longest interval (s).
const SAMPLES: usize = 600;
const INTERVAL: f64 = 0.1;
/// Relative standard deviation of the prior.
const WIDTH: f64 = 0.3;
/// Linearisations, and promised relative reduction at which it ends before.
const ITERATIONS: usize = 8;
const SHOWN: f64 = 1e-3;

/// What a quick fit comes to.
pub(super) struct QuickFit {
    pub(super) chi2_per_dof: f64,
    /// Full parameter vector.
    pub(super) values: Vec<f64>,
    pub(super) parameters: Vec<Estimated>,
}

/// A record with so few samples that many fits of it take little time.
pub(super) fn thinned(record: &Record) -> Option<Record> {
    let every = (record.samples() / SAMPLES).min((INTERVAL / record.dt()) as usize).max(1);
    record.thinned(every).ok()
}

/// Adapts what is estimated, and biases; with the state at the first sample when `initial_state`. `None` where the record cannot be predicted.
pub(super) fn quick_fit(case: &Case<'_>, record: &Record, initial_state: bool) -> Option<QuickFit> {
    let s = Settings { biases: true, initial_state, ..case.settings.clone() };
    let mut fit = RecordEstimator::new(case.model, record, &s).ok()?;
    let (decls, nominal) = (case.model.param_decls(), Params::nominal(case.model));
    let request = Request {
        prior_width: (!case.estimated.is_empty()).then_some(WIDTH),
        coarse: false,
        settings: Solver { max_iterations: ITERATIONS, decrement_tolerance: SHOWN, ..Solver::default() },
        ..Request::new(&decls, case.estimated, nominal.values())
    };
    let found = estimate(&request, fit.estimator()).ok()?;
    found.chi2_per_dof.is_finite().then_some(QuickFit {
        chi2_per_dof: found.chi2_per_dof,
        values: found.values,
        parameters: found.parameters,
    })
}
