//! Project tasks that need the libraries of the project: `cargo xtask <command>`, started by `xtask-launcher`.
//!
//! A library with a thin binary, so that figures, tables and writers are documented and tested like the
//! rest. One file per command ([`conformance`], [`corpus`], [`pages`], [`reproduce`], [`study`], [`mod@bench`]); what commands share sits
//! beside them: exit codes ([`exit`]),
//! text tables ([`table`]), repeated trials as a number ([`interval`]). Figures and writers come from `ffid` ([`ff_report::plot`], [`ffid::files`]).

pub mod bench;
pub mod cli;
pub mod conformance;
pub mod corpus;
mod delayed;
pub mod exit;
pub mod interval;
pub mod pages;
pub mod process;
pub mod reproduce;
pub mod study;
pub mod table;
pub mod workspace;

/// Compiles the example of `docs/library.md`.
#[cfg(doctest)]
#[doc = include_str!("../../docs/library.md")]
struct Library;
