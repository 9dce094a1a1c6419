//! Buffers of the algorithms: everything that is allocated, once.

pub(crate) mod buffers;
pub(crate) mod coupled;
pub(crate) mod derivative_matrices;
pub(crate) mod link;
pub(crate) mod node;
pub(crate) mod port_work;

pub use buffers::Work;
