//! The integration tests as one program: as many programs would compile the same generic dynamics again and again.
//! `cargo test -p ff-model --test all sets` runs those of `sets.rs`.
#![allow(clippy::unwrap_used)] // helpers outside #[test] may panic too

mod names;
mod sets;
