//! Is the identified model right: end-effector error and checks of appendages

pub mod conformance;

pub use conformance::{ConformanceReport, check_appendage};
