//! How a task fails. The codes are those of `ffid::exit`, which this program cannot depend on; a test of `xtask` compares them.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// Why a task stopped.
#[derive(Debug)]
pub enum Failure {
    /// The command line is wrong.
    Usage(String),
    /// Something differs from what is recorded; the message says what.
    Differs(String),
    /// A file could not be read or written, or a program not be started.
    Io {
        /// What was tried: `read`, `start`.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// A program that was started ended badly.
    Child {
        /// The command as one would type it.
        command: String,
        /// Its end in words.
        status: String,
        /// Its exit code, if it was not killed.
        code: Option<i32>,
    },
}

/// Exit codes: wrong command line, outside a tolerance, input or output.
pub const CODES: [u8; 3] = [2, 15, 20];

impl Failure {
    /// A failed operation on a file.
    pub fn io(action: &'static str, path: &Path, source: io::Error) -> Self {
        Self::Io { action, path: path.to_owned(), source }
    }
    /// The code the process ends with.
    pub fn code(&self) -> u8 {
        let [usage, differs, io] = CODES;
        match self {
            Self::Usage(_) => usage,
            Self::Differs(_) => differs,
            Self::Io { .. } => io,
            // A child killed by a signal has no code of its own.
            Self::Child { code, .. } => code.and_then(|c| u8::try_from(c).ok()).filter(|c| *c != 0).unwrap_or(io),
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Usage(text) => write!(f, "{text}\nlook at `cargo xtask --help`"),
            Self::Differs(text) => f.write_str(text),
            Self::Io { action, path, source } => write!(f, "{}: cannot {action}: {source}", path.display()),
            Self::Child { command, status, .. } => write!(f, "`{command}` ended with {status}"),
        }
    }
}

impl std::error::Error for Failure {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_child_passes_its_code_on() {
        let child = |code| Failure::Child { command: "cargo test".into(), status: "status".into(), code }.code();
        assert_eq!([child(Some(101)), child(Some(0)), child(None), child(Some(400))], [101, 20, 20, 20]);
    }
}
