//! Is the identified model right: end-effector error, and checks of appendages.

pub mod conformance;
pub mod end_effector;

pub use conformance::{ConformanceReport, check_appendage};
pub use end_effector::{FramePath, PathError, PathErrorKind, compare, frame_path};
