//! The integration tests as one program: as many programs would compile the same generic dynamics again and again.
//! `cargo test -p ff-mission --test all bad_inputs` runs those of `bad_inputs.rs`.
#![allow(clippy::unwrap_used)] // helpers outside #[test] may panic too

mod common;

mod bad_inputs;
mod collision;
mod mjcf;
mod no_panic;
mod paper;
mod sdf;
mod urdf_assumed;
mod urdf_tree;
mod visual;
