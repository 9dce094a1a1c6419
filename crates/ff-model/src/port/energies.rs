//! What an author writes of an appendage: a declaration and three energies. Equations: [module](super).

use super::declaration::Decl;
use super::matrix::PortMatrix;
use crate::scalar::traits::Scalar;

/// A passive subsystem on one host body, described by its declaration and three energies.
///
/// `p` holds the parameters in the order of [`Decl::params`], `eta` and `nu` the coordinates and rates in
/// the order of [`Decl::coords`]. All frames are the mount frame. No method may allocate.
///
/// [`Derived`](super::Derived) makes everything else of it; [`derived!`](crate::derived) registers that once for a kind, which then is
/// mounted as it is: `model.mount("mast", 0, pose, boom)`. A kind whose equations of motion are written by hand for speed
/// implements [`PortDynamics`](super::PortDynamics) as well and says [`shared!`](crate::shared).
///
/// ```
/// use ff_model::nalgebra::Vector3;
/// use ff_model::{Appendage, CoordDecl, Decl, ParamDecl, PortMatrix, Scalar};
///
/// /// A tip mass that slides along x on a spring: p = [m, k, d].
/// struct Slider(Decl);
///
/// impl Appendage for Slider {
///     fn decl(&self) -> &Decl {
///         &self.0
///     }
///     fn inertia<T: Scalar>(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>) {
///         let [x, y, z] = [0.7, -0.2, 0.4].map(T::from_f64);
///         m.add_point(p[0], &Vector3::new(x + eta[0], y, z), &[Vector3::x()]);
///     }
///     fn potential<T: Scalar>(&self, p: &[T], eta: &[T]) -> T {
///         p[1].scale(0.5) * eta[0] * eta[0]
///     }
///     fn rayleigh<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
///         p[2].scale(0.5) * nu[0] * nu[0]
///     }
/// }
///
/// let params = [("m", "kg", 2.5), ("k", "N/m", 40.0), ("d", "N s/m", 0.3)].map(|(n, unit, x)| ParamDecl::positive(n, unit, x));
/// let slider = Slider(Decl::new("slider", [CoordDecl::new("x", "m", (-0.3, 0.3))], params));
/// assert!((slider.potential(&[2.5, 40.0, 0.3], &[0.1]) - 0.2_f64).abs() < 1e-15); // J
/// // `ff_model::derived!(Slider);` lets `Model::mount` take it.
/// ```
pub trait Appendage: Send + Sync + 'static {
    /// Coordinates and parameters.
    fn decl(&self) -> &Decl;
    /// Kinetic-energy matrix `M(p, eta)`, `(6+n) x (6+n)`, mount frame; `m` arrives zeroed.
    ///
    /// The host block must be the inertia of the appendage as one rigid body at `eta`, about the mount origin:
    /// `M_bb = [[m 1, -[h]x], [[h]x, I]]` with `m` independent of `eta` and `I` symmetric, ten numbers in all.
    /// That is what rigid motion of host and appendage together costs, so every true kinetic energy has it; one
    /// linearised by hand may not. `ff-dynamics` relies on it: composite inertias are carried through the tree as
    /// ten parameters. [`PortMatrix::set_host`] and [`PortMatrix::add_host`] write it.
    fn inertia<T: Scalar>(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>);
    /// Potential energy `U(p, eta)` (J).
    fn potential<T: Scalar>(&self, p: &[T], eta: &[T]) -> T {
        let _ = (p, eta);
        T::zero()
    }
    /// Rayleigh function `R(p, nu)` (W), convex with its minimum `R(p, 0) = 0`; dampers exert `-dR/d nu`.
    fn rayleigh<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        let _ = (p, nu);
        T::zero()
    }
}
