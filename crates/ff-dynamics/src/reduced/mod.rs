//! The prescribed arm condensed into a table; simulation of base twist and passive states only.

pub(crate) mod batch;
pub(crate) mod coupled;
pub(crate) mod follow;
pub(crate) mod over;
pub mod sensitivity;
pub(crate) mod single;
pub(crate) mod stages;
pub(crate) mod system;
pub(crate) mod table;
pub(crate) mod torques;

pub use batch::{OwnTable, simulate_reduced_batch, simulate_reduced_own_tables};
pub use over::simulate_reduced_over;
pub use single::{simulate_reduced, simulate_reduced_span};
pub use stages::Stages;
pub use system::{ReducedError, Response, STAGE, WEIGHT};
pub use table::{
    Arm, ArmModel, ArmTable, BaseWrench, Disturbance, Disturbances, Frame, JointRow, Prescribed, Sampling, TableKey,
    TorqueForm,
};
pub use torques::{reduced_torques, reduced_torques_span};
