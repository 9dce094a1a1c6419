//! Seeded numbers, vectors, rotations and bodies.

use ff_model::Inertia;
use ff_model::spatial::so3::{exp_so3, quat_to_rot};
use nalgebra::{Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
pub use rand_chacha::ChaCha8Rng as Random;

/// The generator of a seed.
pub fn rng(seed: u64) -> Random {
    Random::seed_from_u64(seed)
}

/// Uniform in `[a, b)`.
pub fn uniform(r: &mut Random, a: f64, b: f64) -> f64 {
    r.random_range(a..b)
}

/// Uniform in `[-a, a)`.
pub fn symmetric(r: &mut Random, a: f64) -> f64 {
    r.random_range(-a..a)
}

/// `n` numbers, uniform in `[-a, a)`, of a seed of their own.
pub fn numbers(n: usize, a: f64, seed: u64) -> Vec<f64> {
    let mut r = rng(seed);
    (0..n).map(|_| a * (2.0 * r.random::<f64>() - 1.0)).collect()
}

/// Components uniform in `[-a, a)`.
pub fn vector(r: &mut Random, a: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| symmetric(r, a))
}

/// A direction off the coordinate axes.
pub fn unit_vector(r: &mut Random) -> Vector3<f64> {
    loop {
        let v = vector(r, 1.0);
        if v.norm() > 0.2 {
            return v.normalize();
        }
    }
}

/// A rotation by up to three radians about a skewed axis.
pub fn rotation(r: &mut Random) -> Matrix3<f64> {
    quat_to_rot(&exp_so3(&vector(r, 1.7)))
}

/// A physically consistent body of six random point masses, so that no symmetry is built in: `0.2 scale` to `scale` (kg)
/// each, within `reach` (m) along every axis.
pub fn body_within(r: &mut Random, scale: f64, reach: f64) -> Inertia<f64> {
    let mut b = Inertia::zero();
    for _ in 0..6 {
        b += Inertia::point(scale * uniform(r, 0.2, 1.0), &vector(r, reach));
    }
    b
}

/// [`body_within`] 0.8 m.
pub fn body(r: &mut Random, scale: f64) -> Inertia<f64> {
    body_within(r, scale, 0.8)
}
