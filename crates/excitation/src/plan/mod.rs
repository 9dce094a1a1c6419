//! TODO-FOLDER excitation plan

pub(crate) mod limits;
pub(crate) mod manoeuvre;
pub(crate) mod random;
pub(crate) mod spline;

pub use limits::{
    JointLimits, LimitError, LimitReport, Margin, Quantity, ROUNDING, check_for_all_time, check_manoeuvre,
};
pub use manoeuvre::{Extent, JointCommand, Manoeuvre, ManoeuvreError, ManoeuvreSpec, Move, Shape};
pub use random::{feasible_start, random_plan};
pub use spline::{Duration, End, PlanError, PlanSpec, REPEAT, SplinePlan, Which};
