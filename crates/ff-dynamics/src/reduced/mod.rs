//! TODO-FOLDER ff-dynamics reduced

pub mod sensitivity;
pub(crate) mod system;
pub(crate) mod table;
pub(crate) mod torques;

pub use system::{ReducedError, Response, simulate_reduced, simulate_reduced_batch, simulate_reduced_span};
pub use table::{Prescribed, Sampling};
pub use torques::{reduced_torques, reduced_torques_span};
