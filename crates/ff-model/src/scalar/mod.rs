//! Number types: the traits, forward duals, and vectors of the machine.

pub(crate) mod dual;
pub mod lanes;
pub(crate) mod traits;

pub use crate::port::erased::{LaneScalar, ModelScalar};
pub use dual::{D1, D2, DIRECTIONS, Dual, Grad};
pub use traits::{PlainScalar, Scalar};
