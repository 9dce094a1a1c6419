//! What a calibration is asked for.

use super::joint_terms::{Friction, JointTerm, NearRest};
use crate::estimate::setup::SetupError;
use crate::solve::linear::{LinearError, Weights};
use ff_model::{BaseKind, Model};

const NAME: &str = "the ground calibration";

/// The estimator.
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
/// use ident::{Friction, Ground};
///
/// // In orbit the base moves: refused, with the estimators for that.
/// assert!(Ground::new(&robot, Friction::ALL).is_err());
/// let bench = robot.clone().with_base_kind(BaseKind::Fixed);
/// assert!(Ground::new(&bench, Friction::ALL).is_ok());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Ground<'a> {
    pub(super) model: &'a Model,
    pub(super) friction: Friction,
    pub(super) weights: Weights,
    pub(super) trim_s: f64,
    pub(super) low_pass_hz: Option<f64>,
    /// Terms of every joint beside those of `friction`.
    pub(super) terms: Vec<Vec<JointTerm>>,
    /// Parameters that are zero in each record.
    pub(super) absent: Vec<Vec<usize>>,
    /// Priors of unknowns, by number: mean and standard deviation.
    pub(super) priors: Vec<(usize, f64, f64)>,
}

impl<'a> Ground<'a> {
    /// For a rigid model with a fixed base, weights from the residuals, nothing cut off the ends of a record.
    ///
    /// # Errors
    /// [`LinearError::Base`], [`LinearError::Setup`], [`LinearError::Option`].
    pub fn new(model: &'a Model, friction: Friction) -> Result<Self, LinearError> {
        if model.base_kind() != BaseKind::Fixed {
            let hint = "give base = \"fixed\" in the mission file; in orbit use the RDA or the complete form";
            return Err(LinearError::Base { estimator: NAME, needed: "fixed", hint });
        }
        if model.np() > 0 {
            return Err(SetupError::NotRigid(model.np()).into());
        }
        let (NearRest::LeaveOut(value) | NearRest::Smooth(value)) = friction.near_rest;
        let smooth = matches!(friction.near_rest, NearRest::Smooth(_));
        if !(value.is_finite() && value >= 0.0 && !(smooth && value == 0.0)) {
            let needed = if smooth { "positive and finite" } else { "zero or positive" };
            return Err(LinearError::Option { what: "rate near rest (rad/s)".into(), value, needed });
        }
        let weights = Weights::FromResiduals(3);
        let (terms, absent, priors) = (Vec::new(), Vec::new(), Vec::new());
        Ok(Self { model, friction, weights, trim_s: 0.0, low_pass_hz: None, terms, absent, priors })
    }
    /// With other weights: one standard deviation per joint (N m).
    #[must_use]
    pub fn weights(mut self, weights: Weights) -> Self {
        self.weights = weights;
        self
    }
    /// Leaves out this many seconds at both ends, where a spline knows least of the acceleration.
    #[must_use]
    pub fn trim(mut self, seconds: f64) -> Self {
        self.trim_s = seconds;
        self
    }
    /// Takes away what is above this frequency (Hz) by a filter that shifts nothing ([`ZeroPhase`](crate::motion::ZeroPhase)): measured torques and every
    /// column of the equations pass it alike, friction included, which leaves their solution as it is. Rows at the ends of a record,
    /// where the filter lets more noise through, do not count.
    /// A tenth of the sampling rate at most. Positions are taken as they are: see [`smoothed`](super::smoothed()).
    #[must_use]
    pub fn low_pass(mut self, hz: f64) -> Self {
        self.low_pass_hz = Some(hz);
        self
    }
    /// With terms beside the friction, for every joint: those that [`Ground::choose_terms`] finds, or others.
    #[must_use]
    pub fn terms(mut self, terms: Vec<Vec<JointTerm>>) -> Self {
        self.terms = terms;
        self
    }
    /// Parameters that are zero in each record of [`Ground::estimate`], by their indices: those of a payload that is not mounted there.
    #[must_use]
    pub fn absent(mut self, of: Vec<Vec<usize>>) -> Self {
        self.absent = of;
        self
    }
    /// With Gaussian priors of selected parameters: place among the selected, mean, standard deviation.
    #[must_use]
    pub fn priors(mut self, priors: Vec<(usize, f64, f64)>) -> Self {
        self.priors = priors;
        self
    }
    /// The terms of all joints: friction, and those beside.
    pub(super) fn all_terms(&self) -> Vec<(usize, JointTerm)> {
        let f = self.friction;
        let own: Vec<JointTerm> = [f.viscous, f.coulomb, f.offset]
            .into_iter()
            .zip(JointTerm::ALWAYS)
            .filter_map(|(on, term)| on.then_some(term))
            .collect();
        let of = |j: usize| own.iter().chain(self.terms.get(j).into_iter().flatten()).map(move |t| (j, *t));
        (0..self.model.nj()).flat_map(of).collect()
    }
}
