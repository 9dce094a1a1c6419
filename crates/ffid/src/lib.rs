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

mod base_parameters;
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

pub use base_parameters::{BaseParameters, base_parameters};
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

use std::sync::{PoisonError, RwLock};

/// The kinds of appendage this workspace brings: `flex_panel`, `modal`, `payload`, `reaction_wheel`, `slosh_pendulum`,
/// `slosh_spring_mass` and `slosh_tank`.
///
/// Add your own with [`model::Registry::register`], or for a whole program with [`add_kinds`].
pub fn default_registry() -> model::Registry {
    let mut r = model::Registry::new();
    model::payload::register(&mut r);
    flex_panel::register(&mut r);
    reaction_wheel::register(&mut r);
    slosh_pendulum::register(&mut r);
    let more = MORE.read().unwrap_or_else(PoisonError::into_inner).clone();
    more.iter().for_each(|register| register(&mut r));
    r
}

/// What registers kinds of appendage.
pub type Register = fn(&mut model::Registry);

static MORE: RwLock<Vec<Register>> = RwLock::new(Vec::new());

/// Adds kinds of appendage to every [`default_registry`] of this process from now on: for a program that is built of this library and
/// appendages of its own, such as a Python package.
pub fn add_kinds(register: Register) {
    MORE.write().unwrap_or_else(PoisonError::into_inner).push(register);
}

/// Compiles the example of `README.md`.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
