//! Method and end of a fit in a result.

use ff_least_squares::{Criterion, Status};
use serde::{Deserialize, Serialize};

/// How a record is predicted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Rigid system, base acceleration eliminated ([`ident::Rda`]).
    Rda,
    /// Base and passive states simulated ([`ident::OutputError`]).
    OutputError,
    /// Fixed base with gravity and joint friction, linear least squares ([`ident::Ground`]).
    Ground,
}

/// How the solver ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "status", rename_all = "snake_case")]
pub enum Ended {
    /// At a minimum.
    Converged,
    /// At a minimum that is flat: going on along the named combination gains nothing that the noise would not. The other parameters are
    /// estimates.
    Flat {
        /// The combination that the data know least, in the names of the parameters.
        along: String,
    },
    /// At a minimum of a bounded problem; the named parameters want to leave their bounds.
    AtBound {
        /// Their names; empty when a body is at the boundary of what is physical.
        at: Vec<String>,
    },
    /// No step helps although the linearisation promises one: not a solution.
    Stalled {
        /// Relative reduction still promised.
        promised: f64,
    },
    /// Out of iterations: not a solution.
    IterationLimit,
    /// Ended from outside: not a solution.
    Interrupted {
        /// Linearisations until then, those over less data included.
        after: usize,
    },
}

/// A linearisation on the way to the estimates.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DescentStep {
    /// What was minimised there, per residual: losses of residuals and squares of priors; about 1 where model and noise figures are right.
    pub cost: f64,
    /// Residuals of this pass: fewer than all of them over a thinned record, or a part of it, on the way.
    pub residuals: usize,
}

impl DescentStep {
    pub(in crate::workflow::identify) fn all(of: &[ident::estimate::Linearisation]) -> Vec<Self> {
        of.iter().map(|l| Self { cost: l.objective / l.residuals.max(1) as f64, residuals: l.residuals }).collect()
    }
}

impl Ended {
    /// `flattest` is the combination that the data know least.
    pub(in crate::workflow::identify) fn of(s: &Status, names: &[String], flattest: Option<String>) -> Self {
        match s {
            Status::Converged { by: Criterion::Flat } => Self::Flat { along: flattest.unwrap_or_default() },
            Status::Converged { .. } => Self::Converged,
            Status::AtBound { at, .. } => {
                Self::AtBound { at: at.iter().filter_map(|&i| names.get(i).cloned()).collect() }
            }
            Status::Stalled { promised } => Self::Stalled { promised: *promised },
            Status::IterationLimit => Self::IterationLimit,
        }
    }
    /// True for a fit that was ended from outside.
    pub fn is_interrupted(&self) -> bool {
        matches!(self, Self::Interrupted { .. })
    }
    /// True for a minimum, bounded or not.
    pub fn is_solution(&self) -> bool {
        matches!(self, Self::Converged | Self::Flat { .. } | Self::AtBound { .. })
    }
}

impl std::fmt::Display for Ended {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Converged => f.write_str("converged"),
            Self::Flat { along } => write!(f, "converged, with a flat direction: {along}"),
            Self::AtBound { at } if at.is_empty() => f.write_str("a body reached the boundary of what is physical"),
            Self::AtBound { at } => write!(f, "converged with {} at a bound", at.join(", ")),
            Self::Stalled { promised } => write!(f, "stalled (a reduction of {promised:.1e} still promised)"),
            Self::IterationLimit => f.write_str("ran out of iterations"),
            Self::Interrupted { after: 1 } => f.write_str("was interrupted after 1 linearisation"),
            Self::Interrupted { after } => write!(f, "was interrupted after {after} linearisations"),
        }
    }
}
