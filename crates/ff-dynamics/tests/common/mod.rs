//! What these tests use of `ff-testkit`.
#![allow(unused_imports)] // one list for all files

pub(crate) use ff_testkit::isa::instruction_sets;
pub(crate) use ff_testkit::motion::Wave;
pub(crate) use ff_testkit::random::{body, rng, rotation, uniform, unit_vector, vector};
pub(crate) use ff_testkit::tree::*;
pub(crate) use ff_testkit::{assert_within, relative_error};
