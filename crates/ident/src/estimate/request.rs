//! What a fit is asked for.

use crate::belief::prior::Priors;
use crate::solve::loss::Loss;
use ff_least_squares::Settings;
use ff_model::ParamDecl;

/// What is kept of a linearisation while a fit works with it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Jacobian {
    /// All rows where they take up to [`KEPT_BYTES`]; else its triangle, on one thread.
    #[default]
    Auto,
    /// All rows: two matrices of rows times unknowns. The fastest on one core.
    Kept,
    /// Its triangle alone. Rows are handed out block by block ([`crate::Estimator::streams`]), folded and forgotten, streams on so many
    /// threads (0 counts as 1); the result has the same bits for any number of them. Products with the rows go through them once
    /// more, so that a fit on one thread takes about twice the time.
    Folded {
        /// Most threads.
        threads: usize,
    },
}

/// Bytes of a Jacobian up to which [`Jacobian::Auto`] keeps it; a fit holds two.
pub const KEPT_BYTES: usize = 1 << 30;

impl Jacobian {
    /// Threads to fold `rows` of so many `columns` with; `None` where they are kept.
    pub(crate) fn threads(self, rows: usize, columns: usize) -> Option<usize> {
        match self {
            Self::Kept => None,
            Self::Auto => (rows.saturating_mul(columns).saturating_mul(8) > KEPT_BYTES).then_some(1),
            Self::Folded { threads } => Some(threads.max(1)),
        }
    }
}

/// What to estimate, from where, with what prior knowledge.
#[derive(Clone, Debug)]
pub struct Request<'a> {
    /// Declarations of all parameters of the model.
    pub decls: &'a [ParamDecl],
    /// Indices of the parameters to estimate, ascending.
    pub selected: &'a [usize],
    /// Full parameter vector to start from; those not selected stay as they are here.
    pub start: &'a [f64],
    /// What [`Request::prior_width`] is measured from, when it is not the start (a fit that goes on from another's end).
    pub centre: Option<&'a [f64]>,
    /// Prior knowledge of selected parameters.
    pub priors: Priors,
    /// Prior knowledge of everything selected at once: relative standard deviation around the start (0.3 is
    /// 30 %), bodies measured in the affine-invariant metric. `None` for none.
    pub prior_width: Option<f64>,
    /// Holds directions that neither data nor priors determine near where they are, without biasing the
    /// others: a pull of this relative width that is re-centred at each estimate until it moves nothing
    /// (proximal point method). `None` leaves such directions to drift.
    pub anchor: Option<f64>,
    /// What a residual costs. Priors and anchors are squares whatever is asked for here.
    pub loss: Loss,
    /// Take the way to the answer over less data, where the estimator offers that ([`Estimator::coarse`]). The answer and its
    /// deviations are those of all data either way.
    pub coarse: bool,
    /// What is kept of a linearisation.
    pub jacobian: Jacobian,
    /// When to stop.
    pub settings: Settings,
}

impl<'a> Request<'a> {
    /// These parameters from this start, with the data alone: no priors, no anchor, default settings.
    pub fn new(decls: &'a [ParamDecl], selected: &'a [usize], start: &'a [f64]) -> Self {
        Self {
            decls,
            selected,
            start,
            centre: None,
            priors: Priors::default(),
            prior_width: None,
            anchor: None,
            loss: Loss::Squares,
            coarse: true,
            jacobian: Jacobian::default(),
            settings: Settings::default(),
        }
    }
}
