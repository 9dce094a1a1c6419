//! Reading descriptions of robots: URDF and mission files. Nothing here moves.
//!
//! [`urdf::from_file`] and [`Mission::load`] collect every problem of a file before they refuse it, each with file, line,
//! object, value, limit and one next step.
//!
//! | module | contents |
//! |---|---|
//! | [`urdf`] | robots: links, joints, limits, collision shapes |
//! | [`mission`] | mission files: robot, appendages, clients, sensors, limits, excitation, parameters to estimate |
//! | [`leniency`] | errors that the user lets through, warnings that refuse |

pub mod leniency;
mod lines;
pub mod mission;
mod mjcf;
mod sdf;
pub mod urdf;
mod xml;

pub use leniency::Leniency;
pub use mission::{LoadOptions, Loaded, Mission};

/// Compiles the example of `README.md`.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
