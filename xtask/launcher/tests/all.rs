//! The program as a user meets it: exit codes and messages.
#![allow(clippy::unwrap_used)] // helpers outside #[test] may panic too

mod cli;
