//! TODO-FOLDER ff-model tree

pub(crate) mod model;
pub(crate) mod mount;
pub(crate) mod nominal;
pub(crate) mod parameters;
pub(crate) mod rest;

pub use model::{BaseKind, Body, Frame, Joint, JointKind, JointLimits, Model, Mounted};
pub use parameters::Params;
pub use rest::rest;
