//! One sloshing mass on its springs and dampers: the part that every slosh model here is made of.
//!
//! A particle of mass `m` at `r(eta)` in the mount frame, moved by two or three coordinates, has `M = m J^T J` with
//! `J = [1, -[r]x, dr/d eta]`. What follows from it is in [`crate::point`], the places in [`crate::swing`] and
//! [`crate::spring`]; here is which of them a particle is, and where its numbers are.

use crate::point;
use crate::point::Wrench;
use crate::slot::Slot;
use crate::spring::Shift;
use crate::swing::{SWING_LIMITS, Swing};
use ff_model::CoordDecl;
use ff_model::spatial::vec3::{PackedInertia, V3};
use ff_model::{ParamDecl, ParamGroup, PortAccel, PortMatrix, PortState, Scalar};
use nalgebra::Vector3;

/// How a particle moves.
#[derive(Clone, Debug)]
pub(crate) enum Path {
    /// On an arm from a fulcrum at this place (m, mount frame), universal joint as in [`crate::pendulum::SloshPendulum`].
    Pendulum(Vector3<f64>),
    /// Along two or three axes of the mount from x on, around a rest position that is a parameter.
    Springs(usize),
}

/// A particle with its place among coordinates and parameters.
#[derive(Clone, Debug)]
pub(crate) struct Particle {
    path: Path,
    slot: Slot,
}

/// Evaluates `$e` with `$x` standing for the [`point::Place`] of a particle.
macro_rules! on_path {
    ($this:expr, $p:expr, $eta:expr, $x:ident => $e:expr) => {{
        let slot = &$this.slot;
        let (own, eta) = (&$p[slot.p0 + 1..], &$eta[slot.eta0..]);
        match &$this.path {
            Path::Pendulum(at) => {
                let at = V3::new(T::from_f64(at.x), T::from_f64(at.y), T::from_f64(at.z));
                let $x = Swing::new(Some(at), own[0], eta);
                $e
            }
            Path::Springs(2) => {
                let $x = Shift::<T, 2>::new(own, eta);
                $e
            }
            Path::Springs(_) => {
                let $x = Shift::<T, 3>::new(own, eta);
                $e
            }
        }
    }};
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
        let k0 = params.len();
        for i in 0..n {
            params.push(ParamDecl::positive(format!("{prefix}k[{i}]"), k_unit, v.k[i]));
        }
        for i in 0..n {
            params.push(ParamDecl::positive(format!("{prefix}d[{i}]"), d_unit, v.d[i]));
            let (name, unit, limit) = match path {
                Path::Pendulum(_) => ("swing", "rad", SWING_LIMITS[i]),
                Path::Springs(_) => ("shift", "m", v.travel),
            };
            coords.push(CoordDecl::new(format!("{prefix}{name}[{i}]"), unit, (-limit, limit)));
        }
        Self { path, slot: Slot { eta0, p0, k0 } }
    }

    /// Number of coordinates.
    #[inline(always)]
    fn n(&self) -> usize {
        match self.path {
            Path::Pendulum(_) => 2,
            Path::Springs(n) => n,
        }
    }

    /// `sum k eta^2 / 2`.
    #[inline]
    pub(crate) fn potential<T: Scalar>(&self, p: &[T], eta: &[T]) -> T {
        (0..self.n()).fold(T::zero(), |u, i| {
            let x = eta[self.slot.eta0 + i];
            u + (p[self.slot.k0 + i] * x * x).scale(0.5)
        })
    }

    /// `sum d nu^2 / 2`.
    #[inline(always)]
    pub(crate) fn rayleigh<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        (0..self.n()).fold(T::zero(), |r, i| {
            let x = nu[self.slot.eta0 + i];
            r + (p[self.slot.k0 + self.n() + i] * x * x).scale(0.5)
        })
    }

    /// Writes own rows and columns of `M` and returns what belongs to the host block.
    #[inline(always)]
    pub(crate) fn inertia<T: Scalar>(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>) -> PackedInertia<T> {
        on_path!(self, p, eta, x => point::inertia(&x, &self.slot, p, m))
    }

    /// Writes the own rows of the residual, or without accelerations of the bias, and returns the wrench.
    #[inline(always)]
    pub(crate) fn residual<T: Scalar>(
        &self,
        p: &[T],
        s: &PortState<'_, T>,
        acc: Option<&PortAccel<'_, T>>,
        r: &mut [T],
    ) -> Wrench<T> {
        on_path!(self, p, s.eta, x => point::residual(&x, &self.slot, p, s, acc, r))
    }

    /// Inertia and bias from one place: see [`Particle::inertia`] and [`Particle::residual`].
    #[inline(always)]
    pub(crate) fn terms<T: Scalar>(
        &self,
        p: &[T],
        s: &PortState<'_, T>,
        m: &mut PortMatrix<'_, T>,
        h: &mut [T],
    ) -> (PackedInertia<T>, Wrench<T>) {
        on_path!(self, p, s.eta, x => {
            (point::inertia(&x, &self.slot, p, m), point::residual(&x, &self.slot, p, s, None, h))
        })
    }

    /// See [`point::jacobian`].
    #[inline(always)]
    pub(crate) fn jacobian<T: Scalar>(
        &self,
        p: &[T],
        s: &PortState<'_, T>,
        acc: &PortAccel<'_, T>,
        j: &mut [T],
    ) -> [Wrench<T>; 3] {
        on_path!(self, p, s.eta, x => point::jacobian(&x, &self.slot, p, s, acc, j))
    }

    /// See [`point::regressor`].
    #[inline(always)]
    pub(crate) fn regressor<T: Scalar>(&self, p: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, y: &mut [T]) {
        on_path!(self, p, s.eta, x => point::regressor(&x, &self.slot, p, s, acc, y));
    }
}
