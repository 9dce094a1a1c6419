//! The integration tests as one program: as many programs would compile the same generic dynamics again and again.
//! `cargo test -p xtask --test all architecture` runs those of `architecture.rs`.
#![allow(clippy::unwrap_used)] // helpers outside #[test] may panic too

mod architecture;
mod circles;
mod cli;
mod conformance;
mod corpus;
mod docs;
mod errata;
mod quotes;
mod studies;
