//! A first mission file from a URDF: what can be guessed from the tree is written, what cannot is commented out with the
//! unit it needs.
//!
//! ```
//! use crate::init::{Guess, Known, mission};
//! use ff_mission::urdf::{self, UrdfOptions};
//!
//! let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/peers-model/flex.urdf");
//! let (model, _) = urdf::from_file(path.as_ref(), &UrdfOptions::default()).map_err(|p| p.to_string())?;
//! let guess = Guess::of(&model);
//! assert_eq!((guess.arm.len(), guess.end_effector.as_deref()), (7, Some("tool")));
//! assert_eq!(guess.panels.len(), 2);
//! let text = mission(&guess, "flex.urdf", &Known { fixed: false, ..Known::default() });
//! assert!(text.contains("end_effector = \"tool\""));
//! # Ok::<(), String>(())
//! ```
pub(crate) mod guess;
pub(crate) mod text;

pub use guess::{Guess, Panel};
pub use text::{Known, Tank, mission};
