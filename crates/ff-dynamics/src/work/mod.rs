//! Buffers of the algorithms: everything that is allocated, once.

pub(crate) mod buffers;

pub use buffers::Work;
