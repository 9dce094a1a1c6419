//! What these tests use of `ff-testkit`.

use ff_testkit::appendage::PortSample;
pub(crate) use ff_testkit::appendage::pendulum;
pub(crate) use ff_testkit::ports;
pub(crate) use ff_testkit::random::{Random, rng, symmetric, vector};
pub(crate) use ff_testkit::relative_error;

/// A random motion of host and pendulum, within the range of the coordinates.
pub(crate) fn sample(r: &mut Random) -> PortSample {
    PortSample::new(r, &[3.1, 1.4])
}
