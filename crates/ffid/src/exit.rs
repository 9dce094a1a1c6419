//! The one table of exit codes, for `ffid` and `xtask`. Libraries return errors; only binaries turn them into
//! codes.
//!
//! 1 (an error nobody mapped), 101 (panic), 134 (abort) and 137 (killed) are not in the table: each is a bug.

use ff_model::Problems;
use std::io;
use std::path::{Path, PathBuf};

/// How a command ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Exit {
    /// All went well; there may be warnings.
    Done = 0,
    /// The command line is wrong.
    Usage = 2,
    /// The robot model is invalid.
    Model = 10,
    /// The mission file or a setting is invalid.
    Config = 11,
    /// Recorded data are invalid.
    Data = 12,
    /// The question is ill-posed: not identifiable from these data.
    IllPosed = 13,
    /// Numerical failure: no convergence, step too small, energy gate.
    Numerical = 14,
    /// A reproduction lies outside its tolerance.
    Tolerance = 15,
    /// The record contradicts the model: values stand, but not their deviations.
    Contradicted = 16,
    /// The record could not be used to test the model.
    NotTested = 17,
    /// Input or output failed: not found, no permission, disk full.
    Io = 20,
    /// Another run holds the lock.
    Locked = 21,
    /// A checkpoint is of another version, model or data.
    Incompatible = 22,
    /// Interrupted; the checkpoint is kept.
    Interrupted = 130,
}

/// Every exit code with its meaning.
pub const TABLE: [(Exit, &str); 14] = [
    (Exit::Done, "done"),
    (Exit::Usage, "wrong command line"),
    (Exit::Model, "model invalid"),
    (Exit::Config, "mission file or setting invalid"),
    (Exit::Data, "data invalid"),
    (Exit::IllPosed, "ill-posed: not identifiable"),
    (Exit::Numerical, "numerical failure"),
    (Exit::Tolerance, "reproduction outside its tolerance"),
    (Exit::Contradicted, "the record contradicts the model"),
    (Exit::NotTested, "the model was not tested by the record"),
    (Exit::Io, "reading or writing failed"),
    (Exit::Locked, "locked by another run"),
    (Exit::Incompatible, "checkpoint of another version, model or data"),
    (Exit::Interrupted, "interrupted, checkpoint kept"),
];

impl Exit {
    /// The number the process ends with.
    pub fn code(self) -> u8 {
        self as u8
    }
    /// The code for a list of problems: that of the first error, or `Done`.
    pub fn of(problems: &Problems) -> Self {
        let code = problems.exit_code();
        TABLE.iter().map(|(e, _)| *e).find(|e| e.code() == code).unwrap_or(Self::Numerical)
    }
}

/// The table as `--help` prints it.
pub fn help() -> String {
    let rows = TABLE.iter().map(|(e, what)| format!("\n  {:>3}  {what}", e.code()));
    rows.fold("Exit codes:".to_owned(), |all, row| all + &row)
}

impl From<Exit> for std::process::ExitCode {
    fn from(e: Exit) -> Self {
        Self::from(e.code())
    }
}

/// A failure while working, after the inputs were accepted. Libraries return it, binaries map it to its code.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// A file could not be read or written.
    #[error("{}: cannot {action}", path.display())]
    Io {
        /// What was tried: `read`, `write`, `create`.
        action: &'static str,
        /// The file or directory.
        path: PathBuf,
        /// Why not.
        #[source]
        source: io::Error,
    },
    /// The output is there already.
    #[error("{}: exists already; give another --out, or --force to replace it", path.display())]
    Exists {
        /// The file or directory.
        path: PathBuf,
    },
    /// Another run is writing the same output.
    #[error("{}: locked by another run ({by}); wait for it, or give another --out", path.display())]
    Locked {
        /// The lock file.
        path: PathBuf,
        /// Who holds it.
        by: String,
    },
    /// A number that must be finite is not.
    #[error("{place} is not finite ({value}); look for the step that produced it")]
    NotFinite {
        /// Where: a JSON path, a column and row, a series and sample.
        place: String,
        /// What was found.
        value: String,
    },
    /// Arrays that belong together differ in length.
    #[error("{place}: {left} values against {right}; both must be sampled alike")]
    Length {
        /// Which arrays.
        place: String,
        /// Length of the first.
        left: usize,
        /// Length of the second.
        right: usize,
    },
    /// Something lies outside its tolerance; the message says what, by how much, and the limit.
    #[error("{0}")]
    Tolerance(String),
    /// A computation gave no usable answer.
    #[error("{0}")]
    Numerical(String),
    /// A program that was started ended badly.
    #[error("`{command}` ended with {status}")]
    Child {
        /// The command as one would type it.
        command: String,
        /// Its end in words.
        status: String,
        /// Its exit code, if it was not killed.
        code: Option<i32>,
    },
}

impl Failure {
    /// A failed operation on a file.
    pub fn io(action: &'static str, path: &Path, source: io::Error) -> Self {
        Self::Io { action, path: path.to_owned(), source }
    }
    /// The code a process ends with that fails so.
    pub fn code(&self) -> u8 {
        match self {
            Self::Io { .. } | Self::Exists { .. } => Exit::Io.code(),
            Self::Locked { .. } => Exit::Locked.code(),
            Self::NotFinite { .. } | Self::Length { .. } | Self::Numerical(_) => Exit::Numerical.code(),
            Self::Tolerance(_) => Exit::Tolerance.code(),
            // A child killed by a signal has no code of its own.
            Self::Child { code, .. } => {
                code.and_then(|c| u8::try_from(c).ok()).filter(|&c| c != 0).unwrap_or(Exit::Io.code())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ff_model::{Area, Problem};

    #[test]
    fn the_table_is_the_documented_one() {
        let codes: Vec<u8> = TABLE.iter().map(|(e, _)| e.code()).collect();
        assert_eq!(codes, [0, 2, 10, 11, 12, 13, 14, 15, 16, 17, 20, 21, 22, 130]);
    }

    #[test]
    fn problems_map_by_their_first_error() {
        let one = |p| Exit::of(&Problems(vec![p]));
        for (area, want) in
            [(Area::Model, Exit::Model), (Area::Config, Exit::Config), (Area::Data, Exit::Data), (Area::Io, Exit::Io)]
        {
            assert_eq!(one(Problem::error(area, "x", "x")), want);
            assert_eq!(one(Problem::warning(area, "x", "x")), Exit::Done);
        }
    }
}
