//! The integration tests as one program: as many programs would compile the same generic dynamics again and again.
//! `cargo test -p ff-validate --test all conformance` runs those of `conformance.rs`.
#![allow(clippy::unwrap_used)] // helpers outside #[test] may panic too

mod conformance;
mod systems;
