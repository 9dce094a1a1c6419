//! Excitation trajectories: joint motions that make a system tell its parameters, within limits that hold for all time.
//!
//! | module | contents |
//! |---|---|
//! | [`plan`] | trajectories: the paper's manoeuvre, clamped B-splines, random starts, joint limits |
//! | [`objective`] | what is optimised: information, modal response, quiet spectra |
//! | [`constraint`] | what must hold besides: torque, base attitude and rate, pointing, deflection, clearance |
//! | [`system`] | what costs and constraints need of the rigid and of the flexible system, with adjoints |
//! | [`solve`] | the optimiser: quadratic programs, SQP, search over starts, conflicts, verification |
//! | [`planning`] | costs and limits put together for a model |
//! | [`trajectory`] | trajectory files |

pub mod constraint;
pub mod objective;
pub mod plan;
pub mod planning;
pub mod solve;
pub mod system;
pub mod trajectory;

pub use constraint::Constraint;
pub use objective::{Cost, CostSum, Criterion};
pub use plan::{
    Duration, End, JointCommand, JointLimits, Manoeuvre, ManoeuvreSpec, PlanSpec, SplinePlan, check_for_all_time,
    check_manoeuvre, random_plan,
};
pub use planning::{plan_fisher, plan_information, plan_quiet};
pub use solve::{Found, Observer, Outcome, Progress, SearchOptions, SqpOptions, search};
pub use system::flexible::FlexibleInformation;
pub use system::rigid::{RigidInformation, SensorNoise};
pub use trajectory::{Trajectory, TrajectoryFile};

/// Compiles the example of `README.md`.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
