//! Robots from MJCF, the model files of MuJoCo, as the links and joints that [`crate::urdf`] makes a model of.
//!
//! Read are bodies, joints, inertials, the masses of primitive shapes where a body has no `<inertial>`, defaults and classes, angles and
//! orientations in every notation, couplings of two joints (`<equality><joint>`), stiffness, damping and friction of joints. A joint with
//! a stiffness is a hinge on a spring: the mission lifts it into an appendage.
//!
//! * A body with several joints becomes links without mass between them, called `body/joint`.
//! * The frame of a body is that of MJCF, moved to the anchor of its last joint.
//! * Skipped: sites, cameras, lights, assets, contacts, sensors, actuators, options. Refused: what only a compiler of MJCF resolves
//!   (`include`, `frame`, `replicate`, `attach`, `composite`, `flexcomp`), loops (`connect`, `weld`), masses of meshes. The compiled model,
//!   written by MuJoCo itself (`mj_saveLastXML`), has none of the first.
pub(crate) mod classes;
pub(crate) mod geometry;
pub(crate) mod orientation;
pub(crate) mod reader;

pub(crate) use reader::read;
