//! The checks behind `docs/paper-errata.md` that need no model: identities and numbers, by item.
//!
//! What needs one (modes, ranks, Jacobians) is tested where the model is.

use approx::assert_relative_eq;
use nalgebra::{Complex, Matrix3, Vector3};
use std::f64::consts::{PI, SQRT_2};

/// Table I: slosh mass (kg), arm (m), spring (N m/rad), damper (N m s/rad).
const M: f64 = 100.0;
const L: f64 = 0.8;
const K: f64 = 20.0;
const D: f64 = 5.0;

fn hz(omega: f64) -> f64 {
    omega / (2.0 * PI)
}

/// Item 14: accelerations of the mass against differences of its position, and both corrected force
/// balances for a motion that satisfies Lagrange's equation.
#[test]
fn item_14_slosh_equations_follow_from_newton() {
    let a = |t: f64| 0.7 * (1.3 * t).sin() + 0.2;
    let x = |t: f64| (0.4 * (0.9 * t).cos() + L * a(t).sin(), 0.3 * (0.5 * t).sin() - L * a(t).cos());
    let (t, h) = (1.7, 1e-4);
    let second = |f: &dyn Fn(f64) -> f64| (f(t + h) - 2.0 * f(t) + f(t - h)) / (h * h);
    let (al, rate, acc) = (a(t), 0.7 * 1.3 * (1.3 * t).cos(), -0.7 * 1.3 * 1.3 * (1.3 * t).sin());
    let fulcrum = (-0.4 * 0.81 * (0.9 * t).cos(), -0.3 * 0.25 * (0.5 * t).sin());
    let (s, c) = al.sin_cos();
    let lat = fulcrum.0 + L * acc * c - L * rate * rate * s;
    let ax = fulcrum.1 + L * acc * s + L * rate * rate * c;
    assert_relative_eq!(lat, second(&|t| x(t).0), epsilon = 1e-6);
    assert_relative_eq!(ax, second(&|t| x(t).1), epsilon = 1e-6);

    // Left sides of the corrected equations, for any tension: across the arm only Lagrange's remains.
    let tension = 31.7;
    let bracket = M * L * acc + (D * rate + K * al) / L;
    let e_lat = M * fulcrum.0 - M * L * rate * rate * s + bracket * c + tension * s;
    let e_ax = M * fulcrum.1 + M * L * rate * rate * c + bracket * s - tension * c;
    let lagrange = (M * L * L * acc + D * rate + K * al + M * L * (fulcrum.0 * c + fulcrum.1 * s)) / L;
    assert_relative_eq!(e_lat * c + e_ax * s, lagrange, max_relative = 1e-12);

    // As printed the projection keeps (F - m l rate^2) sin 2a.
    let p_bracket = M * L * acc + D * rate / L;
    let p_lat = M * fulcrum.0 - M * L * rate * rate * s + p_bracket * c + tension * s;
    let p_ax = M * fulcrum.1 - M * L * rate * rate * c + p_bracket * s + tension * c;
    let clean = M * (fulcrum.0 * c + fulcrum.1 * s) + p_bracket;
    let kept = (tension - M * L * rate * rate) * (2.0 * al).sin();
    assert_relative_eq!(p_lat * c + p_ax * s - clean, kept, max_relative = 1e-12);
}

/// Item 16: lateral force against that of a frozen mass.
#[test]
fn item_16_lateral_force_drops_below_a_frozen_mass() {
    let (wn, zeta) = ((K / (M * L * L)).sqrt(), D / (2.0 * (K * M * L * L).sqrt()));
    let ratio = |w: f64| {
        let i = Complex::i() * 2.0 * zeta * wn * w;
        ((i + wn * wn) / (i + wn * wn - w * w)).norm()
    };
    assert_relative_eq!(ratio(SQRT_2 * wn), 1.0, max_relative = 1e-12);
    assert_relative_eq!(ratio(wn), 7.22, max_relative = 1e-3);
    assert_relative_eq!(ratio(2.0 * wn), 0.345, max_relative = 2e-3);
}

/// Item 22: what Table I gives, and what 0.06 Hz would take.
#[test]
fn item_22_table_i_is_not_0_06_hz() {
    let inertia = M * L * L;
    assert_relative_eq!(hz((K / inertia).sqrt()), 0.0890, max_relative = 1e-3);
    let wanted = (2.0 * PI * 0.06).powi(2);
    assert_relative_eq!(inertia * wanted, 9.10, max_relative = 1e-3);
    assert_relative_eq!((K / (M * wanted)).sqrt(), 1.186, max_relative = 1e-3);
    // A free base: h_s^T H_b^-1 h_s > 0 makes the inertia smaller and the frequency higher. Here the plane,
    // fulcrum at the centre of mass of a base of 660 kg and 250 kg m^2.
    let h_s = Vector3::new(M * L, 0.0, -M * L * L);
    let h_b = Matrix3::new(660.0 + M, 0.0, -M * L, 0.0, 660.0 + M, 0.0, -M * L, 0.0, 250.0 + inertia);
    let free = inertia - h_s.dot(&h_b.try_inverse().map_or(Vector3::repeat(f64::NAN), |inv| inv * h_s));
    assert_relative_eq!(hz((K / free).sqrt()), 0.1056, max_relative = 1e-3);
}

/// Item 9: joints that start and stop leave no impulse at whole periods.
#[test]
fn item_9_rest_to_rest_is_a_doublet() {
    let (a, ta, w) = (0.15, 1.1, 1.45);
    let spectrum = |gap: f64| {
        // Midpoint rule over the two pulses.
        let n = 20_000;
        let pulse = |from: f64| -> Complex<f64> {
            let dt = ta / f64::from(n);
            (0..n).map(|i| Complex::from_polar(a * dt, -w * (from + (f64::from(i) + 0.5) * dt))).sum()
        };
        (pulse(0.0) - pulse(gap)).norm()
    };
    let formula = |gap: f64| a * 2.0 * (0.5 * w * ta).sin().abs() / w * 2.0 * (0.5 * w * gap).sin().abs();
    assert_relative_eq!(spectrum(4.0), formula(4.0), max_relative = 1e-6);
    let period = 2.0 * PI / w;
    assert!(spectrum(period) < 1e-6 * spectrum(0.5 * period));
}

/// Item 20: the inertia of Table I cannot be about the origin of the base frame.
#[test]
fn item_20_base_inertia_is_about_the_centre_of_mass() {
    let c = Vector3::new(0.9, 0.0, 0.6);
    let steiner = (Matrix3::from_diagonal_element(c.dot(&c)) - c * c.transpose()) * 600.0;
    let expected = Matrix3::new(216.0, 0.0, -324.0, 0.0, 702.0, 0.0, -324.0, 0.0, 486.0);
    assert_relative_eq!(steiner, expected, epsilon = 1e-9);
    let left = (Matrix3::from_diagonal_element(150.0) - steiner).symmetric_eigenvalues();
    assert_relative_eq!(left.min(), -552.0, epsilon = 1e-9);
}
