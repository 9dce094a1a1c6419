//! What exists: spatial algebra, bodies, the kinematic tree, URDF and mission files, parameters, and the
//! [`Appendage`] trait.
//!
//! SI units throughout. Spatial vectors are linear-first; the base twist is in base coordinates; attitude
//! is a unit quaternion `[w, x, y, z]`; the generalised velocity is `[base 6 | joints n | passive m]`
//! (`docs/notation.md`).

pub mod appendage;
pub mod axis;
pub mod dual;
pub mod inertia;
pub mod keys;
pub mod kinematics;
pub mod lanes;
pub mod leniency;
pub mod mission;
pub mod model;
pub mod params;
pub mod payload;
pub mod problem;
mod read;
pub mod registry;
pub mod rest;
pub mod scalar;
pub mod small;
pub mod so3;
pub mod spatial;
mod text;
pub mod twin;
pub mod urdf;
pub mod vec3;

pub use appendage::{
    Appendage, AppendageSet, CoordDecl, Decl, DynAppendage, MAX_COORDS, ParamDecl, ParamGroup, Place, PortAccel,
    PortMatrix, PortModel, PortState, PortTangent, PortVector, PortView, derived_bias, derived_jacobian, derived_power,
    derived_regressor, port_len,
};
pub use dual::Dual;
pub use inertia::Inertia;
pub use kinematics::{Displacement, DisplacementKind, KinematicParam, Kinematics, Placed};
pub use leniency::Leniency;
pub use model::{BaseKind, Body, Frame, Joint, JointKind, JointLimits, Model, Mounted};
pub use params::Params;
pub use problem::{Area, Problem, Problems, Severity};
pub use read::text_file;
pub use registry::Registry;
pub use scalar::{D1, D2, Grad, LaneScalar, ModelScalar, Scalar};
pub use spatial::{Force, Motion, Xform};
pub use text::{clip, list, nearest};
pub use twin::TwinBody;

/// Vectors and matrices of the public signatures, so that an appendage crate needs no second dependency.
pub use nalgebra;
/// Tables of mission files, as a [`registry::Factory`] gets them.
pub use toml;
