//! Is the identified model right: end-effector error, and checks of appendages.

pub mod conformance;
pub mod end_effector;
pub mod extrapolation;
pub mod known_wrong;
pub mod nist;
pub mod systems;

pub use conformance::{ConformanceReport, check_appendage, check_appendage_counting, check_kind};
pub use end_effector::{FramePath, PathError, PathErrorKind, compare, frame_path};

/// Compiles the example of `README.md`.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
