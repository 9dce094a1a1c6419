//! The integration step a system needs, from its modes.
//!
//! One step of the classical Runge-Kutta method multiplies a mode `lambda` by
//! `R(z) = 1 + z + z^2/2 + z^3/6 + z^4/24`, `z = h lambda`, where the truth is `exp(z)` (Hairer, Wanner, *Solving
//! Ordinary Differential Equations II*, IV.2). After `n` steps a mode of amplitude one is off by
//!
//! ```text
//! e(n) = |R^n - exp(n z)| = exp(n Re z) |exp(n d) - 1|,    d = ln R(z) - z,
//! ```
//!
//! for an undamped mode `e(n) = n (w h)^5 / 120`: mostly phase. Both the error and the step for a given error follow
//! without a simulation.

use crate::analysis::modes::Mode;
use std::f64::consts::{PI, TAU};

/// The largest step that keeps every mode within an error, and what decides it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepAdvice {
    /// Step (s).
    pub step_s: f64,
    /// Index of the mode that needs it.
    pub mode: usize,
    /// Error of that mode at this step, relative to its amplitude at the start.
    pub error: f64,
}

/// Largest error of one mode under classical RK4 at any time up to `duration_s`, relative to its amplitude at the
/// start. Above one, the mode is lost; beyond the limit of stability, the number grows without bound.
///
/// `damping_ratio` as in [`Mode`]: from 1 on a real root. Does not allocate.
pub fn rk4_error(frequency_hz: f64, damping_ratio: f64, step_s: f64, duration_s: f64) -> f64 {
    let w = TAU * frequency_hz * step_s;
    let zeta = damping_ratio.clamp(0.0, 1.0);
    let (x, y) = (-zeta * w, w * (1.0 - zeta * zeta).sqrt());
    // R exp(-z) - 1 = -exp(-z) (z^5/5! + z^6/6! + ..), so that nothing cancels for small steps. By Horner.
    let mul = |(a, b): (f64, f64), (c, d): (f64, f64)| (a * c - b * d, a * d + b * c);
    let mut tail = (1.0, 0.0);
    for k in (6..60).rev() {
        let (re, im) = mul(tail, (x / f64::from(k), y / f64::from(k)));
        tail = (1.0 + re, im);
    }
    for k in 1..=5 {
        tail = mul(tail, (x / f64::from(k), y / f64::from(k)));
    }
    let back = ((-x).exp() * y.cos(), -(-x).exp() * y.sin());
    let (re, im) = mul((-tail.0, -tail.1), back);
    let grow = 0.5 * (2.0 * re + re * re + im * im).ln_1p();
    // The argument is known up to a turn; the method is never off by half a one where it is any use.
    let turn = im.atan2(1.0 + re);
    let at = |n: f64| {
        let (g, t) = (n * grow, n * turn);
        // |exp(g + i t) - 1| without cancellation; once in opposite phase, it has been there.
        let half = (0.5 * t.abs().min(PI)).sin();
        ((n * x).exp()) * (g.exp_m1().powi(2) + 4.0 * g.exp() * half * half).sqrt()
    };
    let n = duration_s / step_s;
    // Where a damped mode errs most: it has grown out of phase and not yet died away.
    if x < 0.0 { at(n).max(at(n.min(-1.0 / x))) } else { at(n) }
}

/// The largest step at which no mode errs by more than `error` (relative to its amplitude at the start) within
/// `duration_s`; `None` without modes or for numbers that make no sense.
///
/// Modes are those of [`crate::analysis::modes::modes()`] in the configuration that stiffens the system most. The joint motion has to be
/// resolved as well: it counts like an undamped mode of its highest frequency. Does not allocate.
pub fn advise_step(modes: &[Mode], duration_s: f64, error: f64) -> Option<StepAdvice> {
    if !(duration_s > 0.0 && duration_s.is_finite() && error > 0.0 && error.is_finite()) {
        return None;
    }
    let of = |(mode, m): (usize, &Mode)| {
        let w = TAU * m.frequency_hz;
        if !(w > 0.0 && w.is_finite()) {
            return None;
        }
        let err = |h: f64| rk4_error(m.frequency_hz, m.damping_ratio, h, duration_s);
        // From far below what rounding leaves to use, to the limit of stability; the error rises with the step.
        let (mut lo, mut hi) = (1e-6 / w, (2.5 / w).min(duration_s));
        if err(hi) > error {
            for _ in 0..200 {
                let mid = (lo * hi).sqrt();
                if err(mid) > error { hi = mid } else { lo = mid }
            }
            hi = lo;
        }
        Some(StepAdvice { step_s: hi, mode, error: err(hi) })
    };
    modes.iter().enumerate().filter_map(of).min_by(|a, b| a.step_s.total_cmp(&b.step_s))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector6;

    fn mode(frequency_hz: f64, damping_ratio: f64) -> Mode {
        let damped_hz = frequency_hz * (1.0 - damping_ratio.powi(2)).max(0.0).sqrt();
        Mode { frequency_hz, damping_ratio, damped_hz, passive: Vec::new(), base: Vector6::zeros() }
    }

    /// RK4 on `x'' + 2 zeta w x' + w^2 x = 0` itself, as a complex first-order equation.
    fn measured(f: f64, zeta: f64, h: f64, t: f64) -> f64 {
        let w = TAU * f;
        let (lx, ly) = (-zeta * w, w * (1.0 - zeta * zeta).sqrt());
        let mul = |(a, b): (f64, f64)| (lx * a - ly * b, lx * b + ly * a);
        let along = |z: (f64, f64), k: (f64, f64), c: f64| (z.0 + c * k.0, z.1 + c * k.1);
        let (mut z, mut worst) = ((1.0, 0.0), 0.0f64);
        for n in 1..=(t / h).round() as usize {
            let k1 = mul(z);
            let k2 = mul(along(z, k1, h / 2.0));
            let k3 = mul(along(z, k2, h / 2.0));
            let k4 = mul(along(z, k3, h));
            z = along(along(along(along(z, k1, h / 6.0), k2, h / 3.0), k3, h / 3.0), k4, h / 6.0);
            let (s, e) = (n as f64 * h, (lx * n as f64 * h).exp());
            let truth = (e * (ly * s).cos(), e * (ly * s).sin());
            worst = worst.max((z.0 - truth.0).hypot(z.1 - truth.1));
        }
        worst
    }

    #[test]
    fn the_error_is_that_of_the_method() {
        for (f, zeta, h, t) in
            [(0.7, 0.0, 0.02, 31.0), (0.7, 0.03, 0.05, 47.0), (0.2, 0.4, 0.11, 20.0), (1.3, 1.0, 0.07, 9.0)]
        {
            let (want, got) = (measured(f, zeta, h, t), rk4_error(f, zeta, h, t));
            assert!((got / want - 1.0).abs() < 0.05, "{f} Hz, {zeta}: {got:e} instead of {want:e}");
        }
        // Small errors are not lost in rounding: the leading term n (w h)^5 / 120.
        let (w, h, t) = (TAU * 0.3, 1e-3, 60.0);
        let want = t / h * (w * h).powi(5) / 120.0;
        assert!((rk4_error(0.3, 0.0, h, t) / want - 1.0).abs() < 1e-3);
    }

    #[test]
    fn the_advised_step_makes_the_error_asked_for() {
        let modes = [mode(0.23, 0.004), mode(0.68, 0.012), mode(0.11, 0.2)];
        for wanted in [1e-9, 1e-6, 1e-3] {
            let a = advise_step(&modes, 60.0, wanted).unwrap();
            assert_eq!(a.mode, 1);
            assert!((a.error / wanted - 1.0).abs() < 1e-6, "{a:?}");
            let seen = measured(0.68, 0.012, a.step_s, 60.0);
            assert!(wanted < 1e-8 || (seen / wanted - 1.0).abs() < 0.05, "{seen:e} instead of {wanted:e}");
        }
    }

    #[test]
    fn stability_bounds_the_step_of_a_mode_that_dies_at_once() {
        // Any error will do: the step still may not blow up.
        let a = advise_step(&[mode(40.0, 1.0)], 100.0, 10.0).unwrap();
        assert!(TAU * 40.0 * a.step_s <= 2.5 + 1e-12, "{a:?}");
        assert!(rk4_error(0.5, 0.0, 1.2, 600.0) > 1e3, "unstable");
        assert!(advise_step(&[], 60.0, 1e-6).is_none());
        assert!(advise_step(&[mode(0.3, 0.0)], f64::NAN, 1e-6).is_none());
        assert!(advise_step(&[mode(0.0, 0.0)], 60.0, 1e-6).is_none());
    }
}
