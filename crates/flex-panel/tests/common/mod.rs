//! What these tests use of `ff-testkit`.

pub(crate) use ff_testkit::appendage::{PortSample, chain, segment};
pub(crate) use ff_testkit::random::{rng, symmetric, vector};
pub(crate) use ff_testkit::{largest, ports, relative_error};
