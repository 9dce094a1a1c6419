//! What the tests of the workspace share. Not published; every crate has it as a dev-dependency by path alone.
//!
//! | module | what |
//! |---|---|
//! | [`random`] | seeded numbers, vectors, rotations, bodies |
//! | [`tree`] | random trees and states, the robots of the peers, appendages as ports and as tree links |
//! | [`motion`] | joint motions with exact derivatives |
//! | [`appendage`] | random panels, pendulums and port states |
//! | [`ports`] | the port equations that an appendage writes itself, held to the defaults and to differences |
//! | [`fixtures`] | files of `fixtures/`, the missions of the paper |
//! | [`mutate`] | files changed at random |
//! | [`mod@tolerance`] | tolerances that one variable scales, and residuals in print |
//! | [`isa`] | the instruction sets a test runs on; those the machine lacks are named as skipped |
//! | [`problem`] | assertions on the parts of a [`ff_model::Problem`] |
//!
//! # Variables
//!
//! * `FF_TOLERANCE_SCALE=s` multiplies every tolerance of [`assert_within!`] and [`scaled`] by `s` and prints every
//!   residual beside its limit. `0` prints and fails nothing: the way to see how much room a tolerance leaves
//!   (`FF_TOLERANCE_SCALE=0 cargo nextest run -p ff-dynamics --no-capture`).
//! * `FF_REQUIRE_ISA=v4` (or `v3`) makes a test fail where it would skip an instruction set up to that one.
//! * `PROPTEST_CASES` is the number of cases of property tests, as everywhere.
//!
//! Test values have no zeros and no ones: they mask mistakes. Helpers panic where a test would.
#![allow(clippy::unwrap_used, clippy::expect_used)] // helpers of tests may panic like the tests they serve

pub mod appendage;
pub mod fixtures;
pub mod isa;
pub mod motion;
pub mod mutate;
pub mod ports;
pub mod problem;
pub mod random;
pub mod tolerance;
pub mod tree;

pub use tolerance::{largest, relative_error, scaled};
