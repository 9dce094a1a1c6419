//! The model: bodies, joints, frames, mounted appendages, and the values of all parameters.

pub(crate) mod coordinates;
pub(crate) mod kinematics;
pub(crate) mod model;
pub(crate) mod mount;
pub(crate) mod names;
pub(crate) mod nominal;
pub(crate) mod parameters;
pub(crate) mod rest;
pub(crate) mod selection;
pub(crate) mod solid;

pub use coordinates::{Coordinates, JointCoordinate};
pub use kinematics::{Displacement, DisplacementKind, KinematicParam, Kinematics, Placed};
pub use model::{BaseKind, Body, Frame, Joint, JointImpedance, JointKind, JointLimits, Model, Mounted};
pub use parameters::Params;
pub use rest::rest;
pub use selection::{SelectionError, matches, select, sift};
pub use solid::{Shape, Solid};
