//! Problems found in files and data, and the text that reports them.

pub(crate) mod problem;
pub(crate) mod read;
pub(crate) mod text;

pub use problem::{Area, Limit, Problem, Problems, Severity, Violation};
pub use read::{read_bytes, text_file};
pub use text::{clip, list, misspelling, nearest};
