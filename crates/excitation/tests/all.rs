//! The integration tests as one program: as many programs would compile the same generic dynamics again and again.
//! `cargo test -p excitation --test all constraints` runs those of `constraints.rs`.
#![allow(clippy::unwrap_used)] // helpers outside #[test] may panic too

mod common;

#[cfg(feature = "collision")]
mod constraints;
mod cost;
mod flexible;
mod limits;
mod manoeuvre;
mod modal_response;
mod planning;
mod planning_fisher;
mod quiet;
mod rigid;
#[cfg(feature = "collision")]
mod search;
mod sqp;
mod trajectory_file;
