//! Which failure of a project task ends with which code of [`ffid::exit`], the one table.

use ff_model::Problems;
pub use ffid::exit::Exit;
use std::io;
use std::path::{Path, PathBuf};

/// The table as `--help` prints it, and what it does not hold.
pub fn help() -> String {
    format!("{}\n`test` and `ci` pass on the code of the program that failed.", ffid::exit::help())
}

/// A failure of a project task. Wrap in `anyhow` and add context freely: [`code_of`] looks through it.
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
    fn code(&self) -> u8 {
        match self {
            Self::Io { .. } => Exit::Io.code(),
            Self::NotFinite { .. } | Self::Length { .. } | Self::Numerical(_) => Exit::Numerical.code(),
            Self::Tolerance(_) => Exit::Tolerance.code(),
            // A child killed by a signal has no code of its own.
            Self::Child { code, .. } => {
                code.and_then(|c| u8::try_from(c).ok()).filter(|&c| c != 0).unwrap_or(Exit::Io.code())
            }
        }
    }
}

/// The exit code of an error: that of the first cause in its chain that has one.
///
/// Errors of the libraries that carry no code are failed computations (14).
pub fn code_of(e: &anyhow::Error) -> u8 {
    for cause in e.chain() {
        if let Some(f) = cause.downcast_ref::<Failure>() {
            return f.code();
        }
        if let Some(p) = cause.downcast_ref::<Problems>() {
            return Exit::of(p).code();
        }
        if cause.is::<io::Error>() {
            return Exit::Io.code();
        }
    }
    Exit::Numerical.code()
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::Context;
    use ff_model::{Area, Problem};

    #[test]
    fn every_failure_has_its_code_through_any_context() {
        let io = || io::Error::from(io::ErrorKind::PermissionDenied);
        let problems = |area| {
            let mut p = Problems::default();
            p.push(Problem::error(area, "Test::Code", "refused"));
            p
        };
        let child = |code| Failure::Child { command: "cargo test".into(), status: "status".into(), code };
        let cases: Vec<(anyhow::Error, u8)> = vec![
            (Failure::io("read", Path::new("x"), io()).into(), 20),
            (Failure::NotFinite { place: "x".into(), value: "NaN".into() }.into(), 14),
            (Failure::Tolerance("table II off".into()).into(), 15),
            (child(Some(101)).into(), 101),
            (child(None).into(), 20),
            (problems(Area::Model).into(), 10),
            (problems(Area::Config).into(), 11),
            (problems(Area::Data).into(), 12),
            (io().into(), 20),
            (anyhow::anyhow!("solver stopped"), 14),
        ];
        for (e, code) in cases {
            let e = Err::<(), _>(e).context("while reproducing").context("table II").unwrap_err();
            assert_eq!(code_of(&e), code, "{e:#}");
        }
    }
}
