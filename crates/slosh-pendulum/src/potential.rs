//! Linear lateral sloshing in an axisymmetric tank, by Ritz's method on harmonic functions.
//!
//! Small irrotational motion of a liquid under axial gravity `g` with the surface at height `h`: `phi` is harmonic,
//! `d phi/dn = 0` on the wall, `d phi/dz = lambda phi` on the surface, `lambda = omega^2 / g` (H. Lamb, *Hydrodynamics*,
//! 6th ed., 1932, sections 227-231). Its weak form is `int grad phi . grad psi dV = lambda int_S phi psi dS` for all
//! `psi`. Both are evaluated on the solid harmonics `r^l P_l^1(cos t) cos(a)`, which are complete in these tanks, so that
//! Green's formula turns the volume integral into one over the boundary:
//!
//! ```text
//! A_ij = pi oint H_i (dH_j/dn) rho ds,   B_ij = pi int_S H_i H_j rho d rho,   A c = lambda B c
//! ```
//!
//! A mode moves the tank like a mass `m` at height `z` above the bottom: with `f = lambda phi` the shape of the surface,
//! `X = int_S x phi dS`,
//!
//! ```text
//! m = density lambda X^2 / int_S phi^2 dS,      z = oint phi (e_y x r).n dS / oint phi n_x dS,   oint phi n_x dS = lambda X
//! ```
//!
//! (linear and angular momentum of the mode; `docs/theory/slosh.md` section 5).

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use std::f64::consts::PI;

/// A point of the meridian of the wall with its outward normal times the length it stands for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WallPoint {
    pub(crate) rho: f64,
    pub(crate) z: f64,
    pub(crate) n_rho: f64,
    pub(crate) n_z: f64,
}

/// A mode in units of density 1.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PotentialMode {
    /// `omega^2 / g` (1/m).
    pub(crate) lambda: f64,
    /// Slosh mass per density (m^3).
    pub(crate) volume: f64,
    /// Height of the mass above the bottom (m).
    pub(crate) height: f64,
}

/// Functions used. The error of a tank with smooth modes falls exponentially; beyond 24 rounding takes over.
const FUNCTIONS: usize = 18;
/// Directions of the energy matrix below this part of the largest are rounding and are left out.
const RANK: f64 = 1e-13;

/// Nodes and weights of Gauss's rule with `n` points on (0, 1), by Newton on Legendre polynomials. Allocates.
pub(crate) fn gauss(n: usize) -> Vec<(f64, f64)> {
    (0..n)
        .map(|i| {
            let mut x = (PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..100 {
                let (mut p, mut before) = (1.0, 0.0);
                for l in 0..n {
                    let l = l as f64;
                    (p, before) = (((2.0 * l + 1.0) * x * p - l * before) / (l + 1.0), p);
                }
                slope = n as f64 * (x * p - before) / (x * x - 1.0);
                let step = p / slope;
                x -= step;
                if step.abs() < 1e-15 {
                    break;
                }
            }
            (0.5 * (1.0 + x), 1.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

/// Solid harmonics of azimuthal order one at `(rho, z)`: values and derivatives by `rho` and `z`, `l = 1, 2, ...`.
/// `l H_{l+1} = (2l + 1) z H_l - (l + 1) r^2 H_{l-1}`, `H_1 = rho`, `H_0 = 0`.
fn harmonics(rho: f64, z: f64) -> [[f64; 3]; FUNCTIONS] {
    let mut out = [[0.0; 3]; FUNCTIONS];
    let (mut before, mut now) = ([0.0; 3], [rho, 1.0, 0.0]);
    for (k, slot) in out.iter_mut().enumerate() {
        *slot = now;
        let l = (k + 1) as f64;
        let square = rho * rho + z * z;
        let (a, b) = ((2.0 * l + 1.0) / l, (l + 1.0) / l);
        let next = [
            a * z * now[0] - b * square * before[0],
            a * z * now[1] - b * (square * before[1] + 2.0 * rho * before[0]),
            a * (z * now[2] + now[0]) - b * (square * before[2] + 2.0 * z * before[0]),
        ];
        (before, now) = (now, next);
    }
    out
}

/// The first `count` lateral modes, in ascending frequency, of the liquid bounded by `wall` and by the surface of
/// radius `radius` at height `fill`; `None` if the eigenvalues fail. Allocates.
pub(crate) fn modes(wall: &[WallPoint], radius: f64, fill: f64, count: usize) -> Option<Vec<PotentialMode>> {
    // About the middle of the liquid, in units of its size: powers of up to 18 stay in range.
    let size = wall.iter().fold(radius.max(0.5 * fill), |s, w| s.max(w.rho));
    let middle = 0.5 * fill;
    let at = |rho: f64, z: f64| harmonics(rho / size, (z - middle) / size);
    let mut a = DMatrix::zeros(FUNCTIONS, FUNCTIONS);
    let mut b = DMatrix::zeros(FUNCTIONS, FUNCTIONS);
    let (mut lateral, mut moment) = (DVector::zeros(FUNCTIONS), DVector::zeros(FUNCTIONS));
    let surface = gauss(64).into_iter().map(|(x, w)| (radius * x, radius * w));
    for (w, on_surface) in wall
        .iter()
        .map(|w| (*w, false))
        .chain(surface.map(|(rho, w)| (WallPoint { rho, z: fill, n_rho: 0.0, n_z: w }, true)))
    {
        let h = at(w.rho, w.z);
        let ring = PI * w.rho;
        for j in 0..FUNCTIONS {
            let normal = (h[j][1] * w.n_rho + h[j][2] * w.n_z) / size;
            for i in 0..FUNCTIONS {
                a[(i, j)] += ring * h[i][0] * normal;
                if on_surface {
                    b[(i, j)] += ring * h[i][0] * h[j][0] * w.n_z;
                }
            }
            moment[j] += ring * h[j][0] * (w.z * w.n_rho - w.rho * w.n_z);
            if on_surface {
                lateral[j] += ring * w.rho * h[j][0] * w.n_z;
            }
        }
    }
    let a = (&a + a.transpose()) * 0.5;
    if !a.iter().chain(b.iter()).all(|x| x.is_finite()) {
        return None;
    }
    // Scaled to unit energy first: what is left of the condition number is that of the directions.
    let s: Vec<f64> = (0..FUNCTIONS).map(|i| 1.0 / a[(i, i)].max(f64::MIN_POSITIVE).sqrt()).collect();
    let scaled = DMatrix::from_fn(FUNCTIONS, FUNCTIONS, |i, j| s[i] * a[(i, j)] * s[j]);
    let energy = SymmetricEigen::try_new(scaled, 1e-15, 10_000)?;
    let largest = energy.eigenvalues.max();
    let kept: Vec<usize> = (0..FUNCTIONS).filter(|&i| energy.eigenvalues[i] > RANK * largest).collect();
    let columns: Vec<DVector<f64>> = kept
        .iter()
        .map(|&k| {
            let root = energy.eigenvalues[k].sqrt();
            DVector::from_fn(FUNCTIONS, |i, _| s[i] * energy.eigenvectors[(i, k)] / root)
        })
        .collect();
    let basis = DMatrix::from_columns(&columns);
    let reduced = basis.transpose() * &b * &basis;
    let eigen = SymmetricEigen::try_new((&reduced + reduced.transpose()) * 0.5, 1e-15, 10_000)?;
    let mut order: Vec<usize> = (0..kept.len()).collect();
    order.sort_by(|&i, &j| eigen.eigenvalues[j].total_cmp(&eigen.eigenvalues[i]));
    let found = order.into_iter().take(count).map(|k| {
        // Unit energy: int_S phi^2 dS is the eigenvalue 1 / lambda.
        let c = &basis * eigen.eigenvectors.column(k);
        let square = eigen.eigenvalues[k];
        let lambda = 1.0 / square;
        let x = lateral.dot(&c);
        PotentialMode { lambda, volume: lambda * x * x / square, height: moment.dot(&c) / (lambda * x) }
    });
    Some(found.collect::<Vec<_>>())
        .filter(|f| f.len() == count && f.iter().all(|m| m.lambda.is_finite() && m.lambda > 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ff_testkit::assert_within;

    #[test]
    fn gauss_is_exact_for_polynomials() {
        let rule = gauss(7);
        for p in 0..14 {
            let sum: f64 = rule.iter().map(|(x, w)| w * x.powi(p)).sum();
            assert_within!((sum - 1.0 / f64::from(p + 1)).abs(), 1e-15, "degree {p}: {sum}");
        }
    }

    #[test]
    fn harmonics_are_harmonic_and_their_derivatives_theirs() {
        // Laplace for cos(a) f(rho, z): f_rr + f_r / rho - f / rho^2 + f_zz = 0.
        let (r, z, h) = (0.7, -0.4, 1e-4);
        let f = |r: f64, z: f64| harmonics(r, z);
        for l in 0..FUNCTIONS {
            let d = |x: f64, y: f64| f(r + x, z + y)[l];
            let here = d(0.0, 0.0);
            let (rr, zz) = (d(h, 0.0)[1] - d(-h, 0.0)[1], d(0.0, h)[2] - d(0.0, -h)[2]);
            let scale = here[0].abs() + here[1].abs() + here[2].abs();
            let laplace = (rr + zz) / (2.0 * h) + here[1] / r - here[0] / (r * r);
            assert_within!(laplace.abs(), 1e-5 * (1 + l * l) as f64 * scale, "{l}: {laplace}");
            assert_within!(
                ((d(h, 0.0)[0] - d(-h, 0.0)[0]) / (2.0 * h) - here[1]).abs(),
                1e-6 * (1 + l * l * l) as f64 * scale
            );
            assert_within!(
                ((d(0.0, h)[0] - d(0.0, -h)[0]) / (2.0 * h) - here[2]).abs(),
                1e-6 * (1 + l * l * l) as f64 * scale
            );
        }
    }
}
