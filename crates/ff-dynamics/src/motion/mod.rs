//! Joint motions as functions of time.

pub mod bspline;
pub(crate) mod function;
pub(crate) mod joint;

pub use function::FnMotion;
pub use joint::{HermiteTable, Hold, JOIN_TOLERANCE, JointMotion, MotionError, Sequence};
