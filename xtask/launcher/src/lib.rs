//! `cargo xtask`, the part that starts at once.
//!
//! `.cargo/config.toml` makes `cargo xtask` compile and run this program, which takes seconds. What needs cargo alone is done here:
//! the tests ([`suite`]), the Python package ([`python`]), continuous integration ([`ci`]), the manifest of the fixtures ([`fixtures`]) and the list of public names
//! ([`api`]). Every other command needs the libraries of the project; [`tasks`] compiles package `xtask` with Cargo's progress in sight
//! and hands the command on.

pub mod api;
pub mod ci;
pub mod cli;
pub mod environment;
pub mod failure;
pub mod fixtures;
pub mod process;
pub mod python;
pub mod suite;
pub mod tasks;
pub mod workspace;
