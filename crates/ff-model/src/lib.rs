//! Descriptions of free-floating robots: spatial algebra, bodies, the kinematic tree, parameters, and the [`Appendage`] trait.
//!
//! SI units throughout. Spatial vectors are linear-first; the base twist is in base coordinates; attitude
//! is a unit quaternion `[w, x, y, z]`; the generalised velocity is `[base 6 | joints n | passive m]`
//! (`docs/notation.md`).
//!
//! | module | contents |
//! |---|---|
//! | [`scalar`] | number types: plain, forward duals, vectors of the machine |
//! | [`spatial`] | twists, wrenches, poses, spatial inertia, rotations |
//! | [`port`] | appendages: the trait of authors, the interface of the dynamics, tree twins |
//! | [`tree`] | the model: bodies, joints, frames, mounted appendages, parameters |
//! | [`keys`], [`registry`] | tables of mission files, and the kinds of appendage they name |
//! | [`payload`] | a rigid body as an appendage without coordinates |
//! | [`diagnostics`] | problems: severity, code, place, value, limit, next step |
//!
//! Files are read by `ff-mission`; motion is computed by `ff-dynamics`.

pub mod diagnostics;
pub mod keys;
pub mod payload;
pub mod port;
pub mod registry;
pub mod scalar;
pub mod spatial;
pub mod tree;

pub use diagnostics::{Area, Problem, Problems, Severity};
pub use port::{
    Appendage, CoordDecl, Decl, DynAppendage, ParamDecl, ParamGroup, PortAccel, PortDynamics, PortMatrix, PortState,
    PortVector, SharedAppendage,
};
pub use registry::Registry;
pub use scalar::{Dual, Scalar};
pub use spatial::{Force, Inertia, Motion, Xform};
pub use tree::{BaseKind, Body, Joint, JointKind, Kinematics, Model, Params};

/// Vectors and matrices of the public signatures, so that an appendage crate needs no second dependency.
pub use nalgebra;
/// Tables of mission files, as a [`registry::Factory`] gets them.
pub use toml;

/// Compiles the example of `README.md`.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
