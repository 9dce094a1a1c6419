//! One sloshing mass on its springs and dampers: the part that every slosh model here is made of.
//!
//! A particle of mass `m` at `r(eta)` in the mount frame, moved by two or three coordinates, has
//!
//! ```text
//! M = m J^T J,  J = [1, -[r]x, dr/d eta]          f = m (w x (v + w x r + 2 r') + r''_own)
//! h_b = [f; r x f]                                h_e = (dr/d eta)^T f + k eta + d nu
//! ```
//!
//! with `r' = sum dr/d eta_k nu_k` and `r''_own = sum d^2r/(d eta_k d eta_l) nu_k nu_l`: Newton's law at zero `A`, `nu'`.

use crate::pendulum::{Arm, SWING_LIMITS};
use ff_model::appendage::CoordDecl;
use ff_model::small::{cross, dot};
use ff_model::{Inertia, ParamDecl, ParamGroup, PortMatrix, PortState, Scalar};
use nalgebra::Vector3;

/// How a particle moves.
#[derive(Clone, Debug)]
pub(crate) enum Path {
    /// On an arm from a fulcrum at this place (m, mount frame), universal joint as in [`crate::SloshPendulum`].
    Pendulum(Vector3<f64>),
    /// Along this many axes of the mount from x on, around a rest position that is a parameter.
    Springs(usize),
}

/// A particle with its place among coordinates and parameters.
#[derive(Clone, Debug)]
pub(crate) struct Particle {
    path: Path,
    /// First own coordinate.
    eta0: usize,
    /// First own parameter.
    p0: usize,
}

/// Nominal values of a particle.
#[derive(Clone, Debug)]
pub(crate) struct Values {
    pub(crate) mass: f64,
    /// Arm length (m); unused by springs.
    pub(crate) length: f64,
    /// Rest position (m); unused by the pendulum.
    pub(crate) rest: Vector3<f64>,
    pub(crate) k: Vec<f64>,
    pub(crate) d: Vec<f64>,
    /// Greatest displacement (m); unused by the pendulum.
    pub(crate) travel: f64,
}

/// Position, partial derivatives by each coordinate, and velocity products.
struct Place<T: Scalar> {
    r: Vector3<T>,
    columns: [Vector3<T>; 3],
    own: Vector3<T>,
}

impl Particle {
    /// Declares a particle: its coordinates and parameters are pushed, names starting with `prefix`. Allocates.
    pub(crate) fn declare(
        path: Path,
        v: &Values,
        prefix: &str,
        coords: &mut Vec<CoordDecl>,
        params: &mut Vec<ParamDecl>,
    ) -> Self {
        let (eta0, p0) = (coords.len(), params.len());
        params.push(ParamDecl::positive(format!("{prefix}mass"), "kg", v.mass));
        let (n, k_unit, d_unit) = match path {
            Path::Pendulum(_) => {
                params.push(ParamDecl::positive(format!("{prefix}length"), "m", v.length));
                (2, "N m/rad", "N m s/rad")
            }
            Path::Springs(n) => {
                for (name, x) in ["x", "y", "z"].iter().zip(v.rest.iter()) {
                    params.push(ParamDecl {
                        name: format!("{prefix}rest_{name}"),
                        unit: "m",
                        nominal: *x,
                        bounds: (f64::NEG_INFINITY, f64::INFINITY),
                        group: ParamGroup::Free,
                    });
                }
                (n, "N/m", "N s/m")
            }
        };
        for i in 0..n {
            params.push(ParamDecl::positive(format!("{prefix}k[{i}]"), k_unit, v.k[i]));
        }
        for i in 0..n {
            params.push(ParamDecl::positive(format!("{prefix}d[{i}]"), d_unit, v.d[i]));
            let (name, unit, limit) = match path {
                Path::Pendulum(_) => ("swing", "rad", SWING_LIMITS[i]),
                Path::Springs(_) => ("shift", "m", v.travel),
            };
            coords.push(CoordDecl { name: format!("{prefix}{name}[{i}]"), unit, range: (-limit, limit) });
        }
        Self { path, eta0, p0 }
    }

    /// Number of coordinates.
    #[inline(always)]
    fn n(&self) -> usize {
        match self.path {
            Path::Pendulum(_) => 2,
            Path::Springs(n) => n,
        }
    }
    /// Index of `k[0]`; the dampers follow the springs.
    #[inline(always)]
    fn k0(&self) -> usize {
        self.p0 + if matches!(self.path, Path::Pendulum(_)) { 2 } else { 4 }
    }

    #[inline(always)]
    fn place<T: Scalar>(&self, p: &[T], eta: &[T], nu: Option<&[T]>) -> Place<T> {
        let (p, eta) = (&p[self.p0..], &eta[self.eta0..]);
        match &self.path {
            Path::Pendulum(at) => {
                let (arm, l) = (Arm::new(eta), p[1]);
                let own = nu.map_or(Vector3::zeros(), |nu| {
                    let (a, b) = (nu[self.eta0], nu[self.eta0 + 1]);
                    (arm.r_aa * (a * a) + arm.r_ab * (a * b).scale(2.0) - arm.r * (b * b)) * l
                });
                let r = arm.r * l + at.map(T::from_f64);
                Place { r, columns: [arm.r_a * l, arm.r_b * l, Vector3::zeros()], own }
            }
            Path::Springs(n) => {
                let mut r = Vector3::new(p[1], p[2], p[3]);
                for (i, &x) in eta.iter().enumerate().take(*n) {
                    r[i] += x;
                }
                let columns = [0, 1, 2].map(|i| Vector3::from_fn(|j, _| if i == j { T::one() } else { T::zero() }));
                Place { r, columns, own: Vector3::zeros() }
            }
        }
    }

    /// Adds `m J^T J`.
    #[inline]
    pub(crate) fn inertia<T: Scalar>(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>) {
        let at = self.place(p, eta, None);
        let mass = p[self.p0];
        m.add_host(&Inertia::point(mass, &at.r));
        for k in 0..self.n() {
            let q = at.columns[k] * mass;
            let n = cross(&at.r, &q);
            for i in 0..3 {
                m.add_sym(i, 6 + self.eta0 + k, q[i]);
                m.add_sym(3 + i, 6 + self.eta0 + k, n[i]);
            }
            for l in 0..=k {
                m.add_sym(6 + self.eta0 + k, 6 + self.eta0 + l, dot(&q, &at.columns[l]));
            }
        }
    }

    /// `sum k eta^2 / 2`.
    #[inline]
    pub(crate) fn potential<T: Scalar>(&self, p: &[T], eta: &[T]) -> T {
        (0..self.n()).fold(T::zero(), |u, i| {
            let x = eta[self.eta0 + i];
            u + (p[self.k0() + i] * x * x).scale(0.5)
        })
    }

    /// `sum d nu^2 / 2`.
    #[inline]
    pub(crate) fn rayleigh<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        (0..self.n()).fold(T::zero(), |r, i| {
            let x = nu[self.eta0 + i];
            r + (p[self.k0() + self.n() + i] * x * x).scale(0.5)
        })
    }

    /// Adds the wrench to the first six of `h` and writes the own rows.
    #[inline]
    pub(crate) fn bias<T: Scalar>(&self, p: &[T], s: &PortState<'_, T>, h: &mut [T]) {
        let at = self.place(p, s.eta, Some(s.nu));
        let w = &s.host.ang;
        let mut carried = s.host.lin + cross(w, &at.r);
        for k in 0..self.n() {
            carried += at.columns[k] * s.nu[self.eta0 + k].scale(2.0);
        }
        let f = (cross(w, &carried) + at.own) * p[self.p0];
        let n = cross(&at.r, &f);
        for i in 0..3 {
            h[i] += f[i];
            h[3 + i] += n[i];
        }
        for k in 0..self.n() {
            let (i, j) = (self.eta0 + k, self.k0() + k);
            h[6 + i] = dot(&at.columns[k], &f) + p[j] * s.eta[i] + p[j + self.n()] * s.nu[i];
        }
    }
}
