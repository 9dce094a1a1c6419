//! In-orbit identification of free-floating robots: measured joint motion, joint torques and base gyro in;
//! base, panel, fuel and payload parameters out, each with its uncertainty.
//!
//! This crate is the facade: one name for each crate of the workspace, and a [`default_registry`] with every
//! kind of appendage they bring. The command `ffid` is built on it.
//!
//! ```
//! use ffid::model::mission::{LoadOptions, Mission};
//!
//! let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/paper/flex.toml");
//! let loaded = Mission::load(path.as_ref(), &ffid::default_registry(), &LoadOptions::default())?;
//! assert_eq!(loaded.model.nv(), 6 + 7 + 4);
//! # Ok::<(), ffid::model::Problems>(())
//! ```

pub mod exit;
pub mod summary;

pub use excitation;
pub use ff_dynamics as dynamics;
pub use ff_model as model;
pub use flex_panel;
pub use ident;
pub use slosh_pendulum;
pub use validate;

/// The kinds of appendage this workspace brings: `flex_panel` and `slosh_pendulum`.
///
/// Add your own with [`model::Registry::register`].
pub fn default_registry() -> model::Registry {
    let mut r = model::Registry::new();
    flex_panel::register(&mut r);
    slosh_pendulum::register(&mut r);
    r
}
