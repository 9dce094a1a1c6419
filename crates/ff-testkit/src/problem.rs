//! Assertions on the parts of a [`Problem`]: code, place, value, limit, unit and next step, never its sentences.

use ff_model::diagnostics::Limit;
use ff_model::{Problem, Problems};

/// The only problem of this code.
///
/// # Panics
/// If there is none, or more than one.
#[track_caller]
pub fn problem_of<'p>(found: &'p Problems, code: &str) -> &'p Problem {
    let mut of_code = found.0.iter().filter(|p| p.code == code);
    let first = of_code.next().unwrap_or_else(|| panic!("no {code} in {found}"));
    assert!(of_code.next().is_none(), "more than one {code} in {found}");
    first
}

/// Asserts that one mistake gave one problem: of this code, on this object, with a next step. Returns it.
///
/// # Panics
/// If not.
#[track_caller]
pub fn refused<'p>(found: &'p Problems, code: &str, object: &str) -> &'p Problem {
    let p = problem_of(found, code);
    assert_eq!(p.object.as_deref(), Some(object), "{p}");
    assert!(p.hint.is_some(), "no next step: {p}");
    assert_eq!(found.0.len(), 1, "one mistake, one problem: {found}");
    p
}

/// Reads a good table with the first `from` replaced by `to`: it must be refused as in [`refused`], with exit code 11.
///
/// # Panics
/// If not.
#[track_caller]
pub fn refused_table<A>(
    read: impl Fn(&toml::Table) -> Result<A, Problems>,
    good: &str,
    (from, to): (&str, &str),
    code: &str,
    object: &str,
) -> Problem {
    assert!(good.contains(from), "{from}");
    let Err(e) = read(&good.replacen(from, to, 1).parse().unwrap()) else { panic!("accepted") };
    assert_eq!(e.exit_code(), 11);
    refused(&e, code, object).clone()
}

/// Asserts which number broke which limit, in which unit, and that the message says the number.
///
/// # Panics
/// If not.
#[track_caller]
pub fn assert_violation(p: &Problem, value: f64, limit: Limit, unit: &str) {
    let v = p.violation.as_ref().unwrap_or_else(|| panic!("no violation in {p}"));
    assert_eq!((v.value, v.limit, v.unit.as_ref()), (value, limit, unit), "{p}");
    assert!(!v.limit.admits(v.value), "the number keeps its limit: {p}");
    assert!(p.message.contains(&value.to_string()), "the message leaves the number {value} out: {p}");
}
