//! Approximation of the Hessian of the Lagrangian.

use nalgebra::{DMatrix, DVector};

/// Powell's damped BFGS update; the first one also sets the scale (Nocedal and Wright eq. 6.20).
pub(crate) fn update(h: &mut DMatrix<f64>, s: &DVector<f64>, y: &DVector<f64>, fresh: bool) {
    let sy = s.dot(y);
    if fresh && sy > 0.0 {
        let n = s.len();
        *h = DMatrix::identity(n, n) * (y.norm_squared() / sy);
    }
    let hs = &*h * s;
    let shs = s.dot(&hs);
    if shs <= 0.0 {
        return;
    }
    let theta = if sy >= 0.2 * shs { 1.0 } else { 0.8 * shs / (shs - sy) };
    let r = y * theta + &hs * (1.0 - theta);
    let sr = s.dot(&r);
    h.ger(-1.0 / shs, &hs, &hs, 1.0);
    h.ger(1.0 / sr, &r, &r, 1.0);
}
