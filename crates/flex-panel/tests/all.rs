//! The integration tests as one program: as many programs would compile the same generic dynamics again and again.
//! `cargo test -p flex-panel --test all bias` runs those of `bias.rs`.
#![allow(clippy::unwrap_used)] // helpers outside #[test] may panic too

mod common;

mod bias;
mod config;
mod conformance;
mod coupling;
mod energy;
mod lift;
mod limits;
mod mechanics;
mod modal;
mod modal_files;
mod ports;
