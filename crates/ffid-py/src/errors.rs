//! Problems as Python exceptions, and panics as errors.

use ffid::model::{Area, Problem, Problems};
use ffid_cli::session::Refused;
use pyo3::prelude::*;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// The exception of `ffid.errors` for problems with the exit code of a command.
pub(crate) fn refused(r: &Refused) -> PyErr {
    problems(&r.problems, r.exit.code())
}

/// The error of a session.
pub(crate) fn or_refused<T>(x: Result<T, Refused>) -> PyResult<T> {
    x.map_err(|r| refused(&r))
}

/// The exception of `ffid.errors` for problems.
pub(crate) fn problems(p: &Problems, exit: u8) -> PyErr {
    let text = match json(p) {
        Ok(text) => text,
        Err(e) => return e,
    };
    Python::attach(|py| {
        let made = py.import("ffid.errors").and_then(|m| m.getattr("from_json")?.call1((text, exit)));
        match made {
            Ok(e) => PyErr::from_value(e),
            Err(e) => e,
        }
    })
}

/// One problem with an array.
pub(crate) fn array(p: Problem) -> PyErr {
    problems(&Problems(vec![p]), Area::Data.exit_code())
}

/// A value as JSON text; numbers come back exactly.
pub(crate) fn json<T: serde::Serialize + ?Sized>(x: &T) -> PyResult<String> {
    serde_json::to_string(x).map_err(|e| internal(&e.to_string()))
}

/// What should not happen.
pub(crate) fn internal(what: &str) -> PyErr {
    let p = Problem::error(Area::Config, "Internal::Failure", what).hint("please report this");
    problems(&Problems(vec![p]), 1)
}

/// Runs `work`; a panic becomes an error.
pub(crate) fn guarded<R>(work: impl FnOnce() -> R) -> PyResult<R> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|why| panicked(&*why))
}

/// The error of a panic.
pub(crate) fn panicked(why: &(dyn std::any::Any + Send)) -> PyErr {
    let text = why.downcast_ref::<String>().cloned();
    let text = text.or_else(|| why.downcast_ref::<&str>().map(|s| (*s).to_owned()));
    internal(&format!("panic: {}", text.unwrap_or_default()))
}
