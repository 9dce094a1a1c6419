//! TODO-FOLDER ff-model diagnostics

pub(crate) mod problem;
pub(crate) mod read;
pub(crate) mod text;

pub use problem::{Area, Problem, Problems, Severity};
pub use read::text_file;
pub use text::{clip, list, nearest};
