//! The step with which motions of the studies begin and end.

/// Quintic step over unit time with its two derivatives: 0 before, 1 after.
pub(super) fn step(x: f64) -> [f64; 3] {
    let x = x.clamp(0.0, 1.0);
    let y = x * (1.0 - x);
    [x * x * x * (10.0 - 15.0 * x + 6.0 * x * x), 30.0 * y * y, 60.0 * y * (1.0 - 2.0 * x)]
}
