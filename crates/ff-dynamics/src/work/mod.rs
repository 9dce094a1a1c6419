//! TODO-FOLDER ff-dynamics work

pub(crate) mod buffers;

pub use buffers::Work;
