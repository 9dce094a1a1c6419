//! What a plan may not do, beyond the limits of its joints: named rows with exact Jacobians and margins.
//!
//! Joint position, speed, acceleration and jerk are limited for all time by the control polygon
//! (`crate::plan::limits`). What is here depends on the whole system and is limited *at samples*: torque
//! ([`JointTorque`]), base attitude and rate ([`BaseAttitude`], [`BaseRate`]), pointing ([`Pointing`]), the speed
//! of a frame ([`FrameSpeed`]), panel deflection and slosh angle ([`PassiveRange`]), and collision
#![cfg_attr(feature = "collision", doc = "([`Clearance`]).")]
#![cfg_attr(not(feature = "collision"), doc = "(`Clearance`, with feature `collision`).")]
//!
//! While a plan is being searched, constraints are computed from the system with its appendages held
//! ([`HeldSystem`]) and their linear response ([`Ringing`]), with exact derivatives. The plan that is found is
//! then simulated in full, and every constraint measured on that at ten times as many samples ([`crate::solve::verdict::Verdict`]);
//! only plans that pass are returned. `docs/theory/constraints.md` has the derivations.
pub(crate) mod base;
#[cfg(feature = "collision")]
pub(crate) mod clearance;
pub(crate) mod frame_speed;
pub(crate) mod held;
pub(crate) mod passive;
pub(crate) mod pointing;
pub(crate) mod ringing;
pub(crate) mod signal;
pub(crate) mod torque;

pub use base::{BaseAttitude, BaseRate, History};
#[cfg(feature = "collision")]
pub use clearance::{Clearance, Pairs};
pub use frame_speed::{FrameSpeed, FrameWork};
pub use held::{HeldPartials, HeldSystem, HeldWork};
pub use passive::{PassiveRange, PassiveWork};
pub use pointing::{Cone, Pointing};
pub use ringing::{Ringing, Rung};
pub use signal::Signal;
pub use torque::{JointTorque, TorqueWork};

use crate::plan::spline::SplinePlan;
use crate::system::rigid::RigidError;
use ff_model::spatial::so3::Quat;
use nalgebra::DMatrix;

/// Which side of the limit is allowed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sense {
    /// Values up to the limit.
    AtMost,
    /// Values from the limit on.
    AtLeast,
}

/// One limited quantity of a constraint.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// What is limited, such as `joint torque`.
    pub name: &'static str,
    /// Of what: the joint, body, frame, coordinate or pair.
    pub item: String,
    /// SI unit.
    pub unit: &'static str,
    /// The limit.
    pub limit: f64,
    /// Which side of it is allowed.
    pub sense: Sense,
    /// What an excess is divided by; positive, the limit itself unless that is zero.
    pub scale: f64,
}

impl Channel {
    /// An upper limit, relative to itself.
    pub(crate) fn at_most(name: &'static str, item: impl Into<String>, unit: &'static str, limit: f64) -> Self {
        Self { name, item: item.into(), unit, limit, sense: Sense::AtMost, scale: limit }
    }
    /// How far `value` lies beyond the limit (same unit); negative on the allowed side.
    pub fn excess(&self, value: f64) -> f64 {
        match self.sense {
            Sense::AtMost => value - self.limit,
            Sense::AtLeast => self.limit - value,
        }
    }
}

/// The simulated system at one instant.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot<'a> {
    /// Time (s).
    pub time: f64,
    /// Joint positions.
    pub q: &'a [f64],
    /// Joint rates.
    pub qd: &'a [f64],
    /// Base twist, base axes, linear first.
    pub twist: [f64; 6],
    /// Base attitude `[w, x, y, z]`; identity at the start.
    pub att: Quat<f64>,
    /// Joint torques (N m or N).
    pub tau: &'a [f64],
    /// Passive coordinates.
    pub eta: &'a [f64],
}

/// Rows `g(x) <= 0` over the variables of a plan, with the exact Jacobian.
///
/// Each channel has one row per sample of the trajectory, row `channel * samples + sample`: the excess of the channel
/// there, relative to [`Channel::scale`].
///
/// ```
/// use excitation::Constraint;
/// use excitation::constraint::{HeldSystem, JointTorque};
/// use ff_model::Params;
/// use std::sync::Arc;
/// # use excitation::{Duration, End, JointLimits, PlanSpec, SplinePlan, random_plan};
/// # let limits = vec![JointLimits { lower: -2.5, upper: 2.7, velocity: 0.17, acceleration: 0.15, jerk: None }; 7];
/// # let (start, end, duration) = (vec![0.3, -0.5, 0.2, 0.7, -0.1, 0.4, 0.6], End::Free, Duration::Fixed(30.0));
/// # let plan = SplinePlan::new(PlanSpec { start, end, duration, degree: 5, free: 4, limits, refine: 1 })?;
/// # let x = random_plan(&plan, 1, 0, 0.9)?;
///
/// // At most 12 N m at any joint, appendages included: rows of a trajectory, negative where the limit is kept.
/// let robot = ff_testkit::tree::system();
/// let system = Arc::new(HeldSystem::new(&robot, &Params::nominal(&robot))?);
/// let torque = JointTorque::new(&system, &plan.spec().start, &[12.0; 7])?;
/// let mut rows = vec![0.0; torque.channels().len() * torque.samples(&plan)];
/// torque.evaluate(&plan, &x, &mut rows, None);
/// assert!(rows.iter().all(|g| (-1.0..0.0).contains(g)));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Constraint: Send + Sync {
    /// What is limited.
    fn channels(&self) -> &[Channel];
    /// Equally spaced samples (at least 2) over the trajectory.
    fn samples(&self, plan: &SplinePlan) -> usize;
    /// Rows at `x`, and derivatives of those that are wanted. Not finite where the constraint is not defined.
    /// Allocates.
    ///
    /// # Panics
    /// If a length or shape is wrong.
    fn evaluate(&self, plan: &SplinePlan, x: &[f64], rows: &mut [f64], jacobian: Option<Wanted<'_>>);
    /// The value of every channel, in its unit, in one instant of the full simulation.
    fn measure(&self, at: &Snapshot<'_>, out: &mut [f64]);
}

/// Which rows are to be differentiated, and where the derivatives go.
#[derive(Debug)]
pub struct Wanted<'a> {
    /// One flag per row.
    pub rows: &'a [bool],
    /// `rows x variables`; rows that are not wanted stay as they are.
    pub jacobian: &'a mut DMatrix<f64>,
}

/// Why a constraint cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ConstraintError {
    /// The model.
    #[error(transparent)]
    Rigid(#[from] RigidError),
    /// A limit that is not positive, or not a number.
    #[error("limit of {what} is {value} {unit}; it must be positive and finite")]
    Limit {
        /// What it limits.
        what: String,
        /// Its value.
        value: f64,
        /// Unit.
        unit: &'static str,
    },
    /// A number of limits that does not fit.
    #[error("{got} limits of {what}, expected {want}")]
    Count {
        /// What they limit.
        what: &'static str,
        /// Given.
        got: usize,
        /// Expected.
        want: usize,
    },
    /// A name that the model does not have.
    #[error("{kind} '{name}' does not exist; there are: {known}")]
    Unknown {
        /// Kind of thing.
        kind: &'static str,
        /// The name.
        name: String,
        /// The names there are.
        known: String,
    },
    /// A direction of length zero.
    #[error("{what} has no direction")]
    Direction {
        /// Which vector.
        what: &'static str,
    },
    /// The modes could not be computed.
    #[error(transparent)]
    Modes(#[from] ff_dynamics::analysis::ModesError),
    /// Passive coordinates that no spring holds cannot be predicted by the linear response.
    #[error("the linear response of '{0}' cannot be computed; check its stiffness and damping")]
    Response(String),
}

/// Refuses limits that are not positive and finite.
pub(crate) fn check_limit(what: &str, value: f64, unit: &'static str) -> Result<f64, ConstraintError> {
    let fine = value.is_finite() && value > 0.0;
    if fine { Ok(value) } else { Err(ConstraintError::Limit { what: what.into(), value, unit }) }
}
