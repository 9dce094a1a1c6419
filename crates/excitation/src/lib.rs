//! Excitation trajectories: B-splines, limits that hold for all time, costs and an optimiser
//!
//! [`manoeuvre`] is the paper's simplified excitation; [`spline_plan`], [`cost`] and [`sqp`] its trajectory
//! optimisation (eqs. 9-10, corrected); [`random`] gives seeded feasible trajectories; [`limits`] proves that
//! any of them keeps the joint limits for all time.
//!
//! [`plan_information`] and [`plan_quiet`] put these together for a model: [`rigid`] is what the costs need of
//! it, [`modal_response`] what drives its modes, [`prediction`] what the plan will tell. [`trajectory_file`] writes
//! and reads trajectories.

pub mod conflict;
pub mod constraint;
pub mod cost;
pub mod demand;
pub mod flexible;
pub mod limits;
pub mod manoeuvre;
pub mod modal_response;
pub mod plan_error;
pub mod planning;
pub mod prediction;
pub mod problem;
mod qp;
pub mod random;
pub mod rigid;
pub mod search;
pub mod spline_plan;
pub mod sqp;
pub mod trajectory_file;
pub mod verdict;
pub mod watch;

pub use constraint::{
    BaseAttitude, BaseRate, Channel, Cone, Constraint, ConstraintError, FrameSpeed, HeldSystem, JointTorque,
    PassiveRange, Pointing, Sense, Signal, Snapshot, Wanted,
};
#[cfg(feature = "collision")]
pub use constraint::{Clearance, Pairs};
pub use cost::base::{BaseMotion, BasePartials, BaseResponse};
pub use cost::criterion::{Criterion, RelativeQuantity, relative_deviations};
pub use cost::disturbance::{Disturbance, DrivenMode};
pub use cost::fisher::{FisherCost, Optimality};
pub use cost::information::{Information, SampleInformation};
pub use cost::response::{ModalResponse, ResponseTarget, Robust};
pub use cost::spectrum::{Modal, Quiet, Target};
pub use cost::{Cost, CostSum, Form};
pub use demand::{Conflict, Demand};
pub use flexible::{Estimated, FlexibleError, FlexibleInformation, FlexibleRequest, Nuisance};
pub use limits::{JointLimits, LimitError, LimitReport, Margin, Quantity, check_for_all_time, check_manoeuvre};
pub use manoeuvre::{Extent, JointCommand, Manoeuvre, ManoeuvreError, ManoeuvreSpec, Move, Shape};
pub use modal_response::{driven_modes, flexible_band, modal_targets};
pub use plan_error::{PlanError, PlanLimit};
pub use planning::fisher::{FisherPlanned, FisherRequest, base_quantities, named_quantities, plan_fisher};
pub use planning::{
    InformationRequest, Planned, PlanningError, QuietBand, Quieted, Quietness, plan_information, plan_quiet,
};
pub use prediction::Prediction;
pub use problem::Problem;
pub use random::{feasible_start, random_plan};
pub use rigid::{RigidBase, RigidError, RigidInformation, SensorNoise};
pub use search::{Found, MultiStart, SearchOptions, multi_start, search, search_from};
pub use spline_plan::{Duration, End, PlanSpec, SplinePlan};
pub use sqp::{Outcome, SqpOptions, Status, minimise, minimise_under};
pub use trajectory_file::{NamedJoint, Origin, Samples, Trajectory, TrajectoryFile, named_joints, write_csv};
pub use verdict::{Basis, ConstraintMargin, Verdict, verify};
pub use watch::{Observer, Progress};
