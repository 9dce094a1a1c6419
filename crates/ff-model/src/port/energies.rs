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
