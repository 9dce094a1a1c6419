//! In-orbit identification of free-floating robots: measured joint motion, joint torques and base gyro in;
//! base, panel, fuel and payload parameters out, each with its uncertainty.
//!
//! This crate is the facade: one name for each crate of the workspace, a [`default_registry`] with every kind of
//! appendage they bring, and [`open()`](open::open), the way from a file to a model that can be computed with. The
//! command `ffid` is built on it.
//!
//! ```
//! use ff_dynamics::Boundary;
//! use ff_mission::Leniency;
//!
//! let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/paper/flex.toml");
//! let system = ffid::open::open(path.as_ref(), Leniency::default())?;
//! assert_eq!(system.model.nv(), 6 + 7 + 4);
//! let modes = ffid::modes::ModeTable::new(&system.model, &system.pose(), Boundary::JointsHeld)?;
//! assert_eq!(modes.modes[1].base, "rotates");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod exit;
pub mod files;
pub mod init;
pub mod inputs;
pub mod modes;
pub mod open;
#[cfg(feature = "batch")]
mod regressor_triangle;
pub mod schema;
pub mod selfcheck;
pub mod sense;
pub mod summary;
pub mod workflow;

pub use excitation;
pub use ff_dynamics as dynamics;
pub use ff_least_squares as least_squares;
pub use ff_mission as mission;
pub use ff_model as model;
pub use ff_records as records;
pub use ff_spectral as spectral;
pub use flex_panel;
pub use ident;
pub use reaction_wheel;
#[cfg(feature = "batch")]
pub use regressor_triangle::regressor_triangle;
pub use slosh_pendulum;
pub use validate;

/// The kinds of appendage this workspace brings: `flex_panel`, `modal`, `payload`, `reaction_wheel`, `slosh_pendulum`,
/// `slosh_spring_mass` and `slosh_tank`.
///
/// Add your own with [`model::Registry::register`].
pub fn default_registry() -> model::Registry {
    let mut r = model::Registry::new();
    model::payload::register(&mut r);
    flex_panel::register(&mut r);
    reaction_wheel::register(&mut r);
    slosh_pendulum::register(&mut r);
    r
}

/// Compiles the example of `README.md`.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
