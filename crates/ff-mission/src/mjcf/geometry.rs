//! Masses of primitive shapes, for bodies without `<inertial>`.

use ff_model::Inertia;
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::PI;

/// Numbers of `size` that a shape needs; `None` for one whose mass is not computed here.
pub(super) fn sizes(shape: &str) -> Option<usize> {
    match shape {
        "sphere" => Some(1),
        "capsule" | "cylinder" => Some(2),
        "box" | "ellipsoid" => Some(3),
        _ => None,
    }
}

/// Volume (m^3) and inertia per mass about the centre (m^2) of a shape along z; lengths are half lengths.
pub(super) fn solid(shape: &str, size: &[f64]) -> (f64, Matrix3<f64>) {
    let diagonal = |x: f64, y: f64, z: f64| Matrix3::from_diagonal(&Vector3::new(x, y, z));
    match (shape, size) {
        ("sphere", &[r, ..]) => (4.0 / 3.0 * PI * r.powi(3), Matrix3::from_diagonal_element(0.4 * r * r)),
        ("cylinder", &[r, h, ..]) => {
            let across = r * r / 4.0 + h * h / 3.0;
            (2.0 * PI * r * r * h, diagonal(across, across, r * r / 2.0))
        }
        ("capsule", &[r, h, ..]) => {
            let (tube, caps) = (2.0 * PI * r * r * h, 4.0 / 3.0 * PI * r.powi(3));
            let volume = tube + caps;
            let of_caps = 0.4 * r * r + h * h + 0.75 * h * r;
            let across = (tube * (r * r / 4.0 + h * h / 3.0) + caps * of_caps) / volume;
            (volume, diagonal(across, across, (tube * r * r / 2.0 + caps * 0.4 * r * r) / volume))
        }
        ("ellipsoid", &[a, b, c, ..]) => {
            let i = diagonal(b * b + c * c, a * a + c * c, a * a + b * b) / 5.0;
            (4.0 / 3.0 * PI * a * b * c, i)
        }
        ("box", &[a, b, c, ..]) => (8.0 * a * b * c, diagonal(b * b + c * c, a * a + c * c, a * a + b * b) / 3.0),
        _ => (0.0, Matrix3::zeros()),
    }
}

/// Inertia of a shape of this mass about its own centre.
pub(super) fn inertia(mass: f64, per_mass: &Matrix3<f64>) -> Inertia<f64> {
    Inertia::from_com(mass, &Vector3::zeros(), &(per_mass * mass))
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Sums over a fine grid, which knows no formula.
    #[test]
    fn volumes_and_moments_are_those_of_the_shapes() {
        let size = [0.3, 0.5, 0.4];
        let inside = |shape: &str, p: &Vector3<f64>| {
            let across = p.xy().norm();
            match shape {
                "sphere" => p.norm() <= size[0],
                "cylinder" => across <= size[0] && p.z.abs() <= size[1],
                "capsule" => across.hypot((p.z.abs() - size[1]).max(0.0)) <= size[0],
                "ellipsoid" => p.component_div(&Vector3::from(size)).norm() <= 1.0,
                _ => p.iter().zip(size).all(|(x, s)| x.abs() <= s),
            }
        };
        for shape in ["sphere", "cylinder", "capsule", "ellipsoid", "box"] {
            // Faces lie between cells.
            let (n, reach) = (72, 0.9);
            let at = |k: usize| reach * (2.0 * (k as f64 + 0.5) / n as f64 - 1.0);
            let (mut count, mut second) = (0.0, Matrix3::<f64>::zeros());
            for (x, y, z) in (0..n * n * n).map(|k| (at(k % n), at(k / n % n), at(k / n / n))) {
                let p = Vector3::new(x, y, z);
                if inside(shape, &p) {
                    count += 1.0;
                    second += Matrix3::from_diagonal_element(p.norm_squared()) - p * p.transpose();
                }
            }
            let (volume, i) = solid(shape, &size);
            let cell = (2.0 * reach / n as f64).powi(3);
            assert_relative_eq!(volume, count * cell, max_relative = 0.01);
            assert_relative_eq!(i, second / count, epsilon = 0.002);
        }
    }
}
