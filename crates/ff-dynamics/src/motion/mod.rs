//! TODO-FOLDER ff-dynamics motion

pub mod bspline;
pub(crate) mod joint;

pub use joint::{HermiteTable, Hold, JOIN_TOLERANCE, JointMotion, MotionError, Sequence};
