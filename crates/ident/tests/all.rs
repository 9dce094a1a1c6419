//! The integration tests as one program: as many programs would compile the same generic dynamics again and again.
//! `cargo test -p ff-ident --test all coarse` runs those of `coarse.rs`.
#![allow(clippy::unwrap_used)] // helpers outside #[test] may panic too

mod common;

mod coarse;
mod complete;
mod ground;
mod joint_motion;
mod modal_paper;
mod motion_fit;
mod nist_strd;
mod output_error;
mod project;
mod record_checks;
mod recovery;
mod row_streams;
mod ties;
mod time_bases;
