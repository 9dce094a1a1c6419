//! Writing results: whole or not at all, and only what reads back to the same numbers.
pub mod atomic;
pub mod complete;
pub mod csv_out;
pub mod folder;
pub mod format;
pub mod json;
