//! TODO-FOLDER ff-model spatial

pub(crate) mod axis;
pub(crate) mod inertia;
pub(crate) mod motion;
pub mod small;
pub mod so3;
pub mod vec3;

pub use axis::Axis;
pub use inertia::{INERTIAL_NAMES, INERTIAL_UNITS, Inertia, InertiaError};
pub use motion::{Force, Motion, Xform};
