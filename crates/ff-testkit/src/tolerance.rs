//! Tolerances that one variable scales, and residuals in print.

use std::panic::Location;

/// `FF_TOLERANCE_SCALE`, if it is set.
///
/// # Panics
/// If it is not a number of at least zero.
fn scale() -> Option<f64> {
    let text = std::env::var("FF_TOLERANCE_SCALE").ok()?;
    let scale = text.parse().ok().filter(|s: &f64| s.is_finite() && *s >= 0.0);
    Some(scale.unwrap_or_else(|| panic!("FF_TOLERANCE_SCALE is '{text}', expected a number of at least 0")))
}

/// A tolerance for comparisons that do not go through [`assert_within!`](crate::assert_within), such as those of `approx`:
/// times `FF_TOLERANCE_SCALE`, infinite where that is 0.
pub fn scaled(tolerance: f64) -> f64 {
    match scale() {
        None => tolerance,
        Some(0.0) => f64::INFINITY,
        Some(s) => s * tolerance,
    }
}

/// Implements [`assert_within!`](crate::assert_within).
///
/// # Panics
/// If `residual` is above the scaled `limit`, or not a number.
#[track_caller]
pub fn check(residual: f64, limit: f64, what: &dyn Fn() -> String) {
    let scale = scale();
    if let Some(s) = scale {
        let at = Location::caller();
        let (file, line) = (at.file(), at.line());
        let of = residual / limit;
        eprintln!(
            "residual {residual:9.2e}, limit {limit:9.2e} ({of:8.1e} of it), scale {s}: {file}:{line} {}",
            what()
        );
    }
    if scale == Some(0.0) {
        return;
    }
    let limit = scale.unwrap_or(1.0) * limit;
    assert!(residual <= limit, "residual {residual:e}, limit {limit:e}: {}", what());
}

/// Asserts that a residual is at most its tolerance, `assert_within!(residual, tolerance, "of {what}")`. With
/// `FF_TOLERANCE_SCALE` set, prints both and scales the tolerance; see the root of this crate.
#[macro_export]
macro_rules! assert_within {
    ($residual:expr, $limit:expr $(,)?) => {
        $crate::tolerance::check($residual, $limit, &|| stringify!($residual).to_owned())
    };
    ($residual:expr, $limit:expr, $($what:tt)+) => {
        $crate::tolerance::check($residual, $limit, &|| format!($($what)+))
    };
}

/// Largest magnitude; NaN if one of the numbers is not a number.
pub fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |a, b| if b.is_nan() { f64::NAN } else { nan_max(a, b.abs()) })
}

/// [`f64::max`] forgets what is not a number.
fn nan_max(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

/// Largest difference over the largest magnitude of both; 0 where all are zero, NaN if one of the numbers is not a number.
///
/// # Panics
/// If the lengths differ.
pub fn relative_error(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let d = a.iter().zip(b).fold(0.0, |m, (x, y)| nan_max(m, (x - y).abs()));
    let scale = nan_max(largest(a), largest(b));
    if scale == 0.0 { 0.0 } else { d / scale }
}
