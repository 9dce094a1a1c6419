//! Project tasks: `cargo xtask <command>`.
//!
//! A library with a thin binary, so that figures, tables and writers are documented and tested like the
//! rest. One file per command ([`suite`], [`conformance`], [`fixtures`], [`ci`], [`reproduce`], [`study`], [`mod@bench`]); what commands share sits
//! beside them: exit codes ([`exit`]),
//! text tables ([`table`]). Figures and writers come from `ffid` ([`ff_report::plot`], [`ffid::files`]).

pub mod bench;
pub mod ci;
pub mod cli;
pub mod conformance;
pub mod exit;
pub mod fixtures;
pub mod process;
pub mod reproduce;
pub mod study;
pub mod suite;
pub mod table;
pub mod workspace;
