//! Which failure of a project task ends with which code of [`ffid::exit`], the one table.

use crate::study::trials::TrialsError;
use ff_model::Problems;
use ffid::exit::{Exit, Failure};
use std::io;

/// The table as `--help` prints it.
pub fn help() -> String {
    ffid::exit::help()
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
        if cause.is::<TrialsError>() {
            return Exit::Incompatible.code();
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
    use std::path::Path;

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
