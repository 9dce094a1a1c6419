//! What the laws share: worst figures, relative differences, the port equations at any number type.

use super::report::Check;
use ff_model::scalar::ModelScalar;
use ff_model::{DynAppendage, Motion, PortState};

/// A worst figure and where it occurred. NaN is worse than anything.
#[derive(Default)]
pub(super) struct Worst(pub(super) f64, String);

impl Worst {
    pub(super) fn see(&mut self, figure: f64, place: impl FnOnce() -> String) {
        if figure > self.0 || (figure.is_nan() && !self.0.is_nan()) {
            *self = Self(figure, place());
        }
    }
    pub(super) fn check(self, law: &'static str, limit: f64) -> Check {
        Check::new(law, self.0, limit, self.1)
    }
}

pub(super) fn amax(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |m, v| m.max(v.abs()))
}
/// `|a - b|` over the larger of the two, zero for zero against zero.
pub(super) fn relative(a: f64, b: f64, scale: f64) -> f64 {
    if a == b { 0.0 } else { (a - b).abs() / scale }
}
pub(super) fn bias<T: ModelScalar>(a: &dyn DynAppendage, p: &[T], host: Motion<T>, eta: &[T], nu: &[T]) -> Vec<T> {
    let mut h = vec![T::zero(); 6 + eta.len()];
    T::port(a).bias(p, &PortState { host, eta, nu }, &mut h);
    h
}

/// Step of the differences as a part of a coordinate's range. Truncation falls with its eighth power, rounding grows
/// with its inverse: 1e-3 leaves 1e-13 to 1e-11 for smooth energies.
pub(super) const STEP: f64 = 1e-3;

/// Weights of the eighth-order central difference.
const C1: [f64; 4] = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];
pub(super) fn difference(h: f64, f: impl Fn(f64) -> f64) -> f64 {
    C1.iter().enumerate().map(|(k, c)| c / h * (f(h * (k + 1) as f64) - f(-h * (k + 1) as f64))).sum()
}
