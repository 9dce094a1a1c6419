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

/// Integration steps per sample at most, and what [`Request::finer`] is without being asked.
pub const FINEST: usize = 1000;

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

/// Where else a fit may begin, asked for when it is lost: full parameter vectors.
#[derive(Clone, Copy)]
pub struct OtherStarts<'a>(pub &'a (dyn Fn() -> Vec<Vec<f64>> + Sync));

impl core::fmt::Debug for OtherStarts<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("OtherStarts")
    }
}

/// What to estimate, from where, with what prior knowledge.
///
/// ```
/// # use ff_dynamics::{Drive, SimOptions, State, motion::FnMotion, simulate};
/// # use ff_model::nalgebra::{Matrix3, Vector3};
/// # use ff_model::{BaseKind, Inertia, Joint, JointKind, Model, Params, Xform, tree::JointLimits};
/// # let hull = Inertia::from_com(60.0, &Vector3::new(0.2, 0.1, 0.3), &Matrix3::from_diagonal(&Vector3::new(15.0, 14.0, 13.0)));
/// # let mut robot = Model::new("probe", "hull", hull, BaseKind::Floating);
/// # let (kind, placement) = (JointKind::Revolute, Xform::new(Matrix3::identity(), Vector3::new(0.5, 0.1, 0.4)));
/// # let (axis, limits) = (Vector3::new(0.1, -0.2, 0.9), JointLimits::default());
/// # let link = Inertia::from_com(8.6, &Vector3::new(0.1, 0.21, -0.1), &Matrix3::from_diagonal(&Vector3::new(0.4, 0.05, 0.37)));
/// # robot.add_body(0, "arm", Joint { name: "shoulder".into(), kind, axis, placement, limits }, link);
/// # let truth = Params::<f64>::nominal(&robot);
/// # let motion = FnMotion::new(1, 10.0, |t, q, qd, qdd| {
/// #     let (sin, cos) = (0.9 * t).sin_cos();
/// #     (q[0], qd[0], qdd[0]) = (0.7 * (1.0 - cos), 0.63 * sin, 0.567 * cos);
/// # })?;
/// # let options = SimOptions { duration_s: 10.0, step_s: 0.01, sample_s: 0.01 };
/// # let trace = simulate(&robot, &truth, &State::zero(&robot), &Drive::Prescribed(&motion), &options)?;
/// # let record = ff_records::RecordBuilder::new(["shoulder"]).uniform(0.0, 100.0).q(trace.q.clone()).tau(trace.tau.clone());
/// # let (record, _) = record.gyro(trace.gyro()).build()?;
/// # let (decls, mass) = (robot.param_decls(), robot.parameter_indices("base.mass")?);
/// # let mut start = truth.values().to_vec();
/// # start[mass[0]] = 72.0;
/// use ident::{Loss, Noise, Rda, Request, estimate};
///
/// // Mass and arm inertia, 30 % prior width, outliers weighted down.
/// let selected = robot.parameter_indices("base.mass")?;
/// let request = Request { prior_width: Some(0.3), loss: Loss::HUBER, ..Request::new(&decls, &selected, &start) };
/// let mut rda = Rda::new(&robot, &record, &Noise { torque: 0.01, gyro: 1e-5 })?;
/// assert!((estimate(&request, &mut rda)?.values[0] - 60.0).abs() < 0.05);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
    /// Where nuisance unknowns begin, in the order of the estimator; at zero unless given.
    pub nuisance: Option<&'a [f64]>,
    /// Prior knowledge of selected parameters.
    pub priors: Priors,
    /// Which of the selected parameters are not asked for, by index, with what is known of each without any record, as a standard
    /// deviation. That counts as a measurement when it is decided what the data can tell, and takes a degree of freedom the less. It is
    /// no prior: that is among [`Request::priors`], alone or with what earlier records have told.
    pub marginal: Vec<(usize, f64)>,
    /// Prior knowledge of everything selected at once: relative standard deviation around the start (0.3 is
    /// 30 %), bodies measured in the affine-invariant metric. `None` for none.
    pub prior_width: Option<f64>,
    /// Holds directions that neither data nor priors determine near where they are, without biasing the
    /// others: a pull of this relative width that is re-centred at each estimate until it moves nothing
    /// (proximal point method). `None` leaves such directions to drift.
    pub anchor: Option<f64>,
    /// What a residual costs. Priors and anchors are squares whatever is asked for here.
    pub loss: Loss,
    /// Take the way to the answer over less data, where the estimator offers that ([`Estimator::coarse`](crate::Estimator::coarse)). The answer and its
    /// deviations are those of all data either way.
    pub coarse: bool,
    /// Where that is not taken, and less data have led to the start: fewer rows with the cost of all of them go on from there ([`Request::near_end`]), so that
    /// all data begin next to their end.
    pub led: bool,
    /// Mean squared residual above which the end of the way over less data is taken to lead nowhere: all data are then linearised ten times only,
    /// since other starts find more in that time; for the same reason, a fit that creeps where its data are not explained is ended. None: data
    /// are linearised as often as the settings say.
    pub give_up: Option<f64>,
    /// Mean squared residual that noise alone leaves: one where it is what the estimator was told, more where it has been measured to be larger. What
    /// is judged by noise on the way to the end ([`Request::give_up`] among it) is measured by it; the answer is not touched.
    pub noise: f64,
    /// Objective of another fit to the same data that this one must get below to be of use. Where the linearisations that it is allowed will not lead
    /// there, at five times the gain of the last four, it ends as one that has run out of them. None: it is of use anywhere.
    pub to_beat: Option<f64>,
    /// Other places to begin from where the way over less data is lost from the start ([`Request::coarse`]): the best of them, if it is better.
    pub other_starts: Option<OtherStarts<'a>>,
    /// Take the last steps to the answer over fewer rows that have the cost of all of them nearby ([`crate::estimate::Around`]), where the
    /// estimator offers that and the loss is that of squares. Whether the fit is at its end is told by all data.
    pub near_end: bool,
    /// Where predictions turn out not to be exact enough, they are made so ([`Estimator::refine`](crate::Estimator::refine)) for all that follows, if that takes up to so many
    /// times the work; a fit that would take more has failed. Zero: they stay as they are.
    pub finer: usize,
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
            nuisance: None,
            priors: Priors::default(),
            marginal: Vec::new(),
            prior_width: None,
            anchor: None,
            loss: Loss::Squares,
            coarse: true,
            led: false,
            give_up: None,
            noise: 1.0,
            to_beat: None,
            other_starts: None,
            near_end: true,
            finer: FINEST,
            jacobian: Jacobian::default(),
            settings: Settings::default(),
        }
    }
    /// Sum of squared residuals that noise leaves of so many rows.
    pub(crate) fn noise_of(&self, rows: usize) -> f64 {
        self.noise * rows as f64
    }
}
