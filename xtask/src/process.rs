//! Other programs that tasks start.

use std::ffi::OsString;

/// The cargo that started this process, else the one on the path.
pub fn cargo() -> OsString {
    std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into())
}
