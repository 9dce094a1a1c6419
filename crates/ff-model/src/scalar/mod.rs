//! TODO-FOLDER ff-model scalar

pub(crate) mod dual;
pub mod lanes;
pub(crate) mod traits;

pub use dual::Dual;
pub use traits::{D1, D2, DIRECTIONS, Grad, LaneScalar, ModelScalar, Scalar};
