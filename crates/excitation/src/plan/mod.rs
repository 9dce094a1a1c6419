//! Trajectories: the paper's manoeuvre, clamped B-splines, random starts, limits of the joints.

pub(crate) mod error;
pub(crate) mod limits;
pub(crate) mod manoeuvre;
pub(crate) mod random;
pub(crate) mod spline;

pub use error::{PlanError, PlanLimit};
pub use limits::{
    JointLimits, LimitError, LimitReport, Margin, Quantity, ROUNDING, check_for_all_time, check_manoeuvre,
};
pub use manoeuvre::{Extent, JointCommand, Manoeuvre, ManoeuvreError, ManoeuvreSpec, Move, Shape};
pub use random::{feasible_start, random_plan};
pub use spline::{Duration, End, PlanSpec, REPEAT, SplinePlan};
