//! The extension point: a passive subsystem hanging from one body, described by its energies.
//!
//! With host twist `V` (mount frame, linear first), own rates `nu` and `y = [V; nu]`, an appendage states
//!
//! * `M(p, eta)`: its kinetic-energy matrix, `T = y^T M y / 2`, symmetric positive semidefinite;
//! * `U(p, eta)`: its potential energy (springs);
//! * `R(p, nu)`: its Rayleigh dissipation function (dampers), convex with its minimum `R(0) = 0` at rest. Convex
//!   with `R(0) = 0` alone is not enough: `R = d nu^2 / 2 + c nu` is both, and its constant torque `-c` feeds energy
//!   into slow motion. With the minimum at rest `nu . dR/d nu >= R(nu) >= 0`: dampers dissipate.
//!
//! `validate::check_appendage` checks all of this, and what else the trait promises.
//!
//! Lagrange's equations in the quasi-velocities `V` (Boltzmann-Hamel form, K and D restoring and
//! dissipating; the paper's eq. (1) with the signs of `docs/paper-errata.md`) then give, with `pi = M y`,
//!
//! ```text
//! w = M_bb A + M_be nu' + h_b,     h_b = (dM/dt)_b y + V x* pi_b
//! 0 = M_eb A + M_ee nu' + h_e,     h_e = (dM/dt)_e y - 1/2 d(y^T M y)/d eta + dU/d eta + dR/d nu
//! ```
//!
//! where `w` is the wrench the host exerts on the appendage, about the mount origin. [`derived_bias`]
//! obtains `h` from the three energies by forward differentiation, so that momentum conservation, energy
//! balance and "damping dissipates" hold by construction.
//!
//! [`PortDynamics`] is what the dynamics consume; [`Derived`] implements it for every appendage from its energies.

mod bias;
mod declaration;
mod derived;
mod dynamics;
mod erased;
mod port_matrix;
mod set;
mod shared;
mod state;
mod wrapper;

pub use bias::{derived_bias, derived_power};
pub use declaration::{CoordDecl, Decl, MAX_COORDS, MAX_PARAMS, ParamDecl, ParamGroup};
pub use derived::{derived_jacobian, derived_regressor};
pub use dynamics::PortDynamics;
pub use erased::{DynAppendage, LaneScalar, ModelScalar, PortModel, PortTangent};
pub use port_matrix::{PortMatrix, PortView, add_inertial, port_len};
pub use set::{AppendageSet, Place};
pub use shared::SharedAppendage;
pub use state::{PortAccel, PortState, PortVector};
pub use wrapper::Derived;

use crate::scalar::Scalar;

/// A passive subsystem on one host body, described by its declaration and three energies.
///
/// `p` holds the parameters in the order of [`Decl::params`], `eta` and `nu` the coordinates and rates in
/// the order of [`Decl::coords`]. All frames are the mount frame. No method may allocate.
///
/// [`Derived`] makes everything else of it; [`derived!`](crate::derived) registers that once for a kind, which then is
/// mounted as it is: `model.mount("mast", 0, pose, boom)`. A kind whose equations of motion are written by hand for speed
/// implements [`PortDynamics`] as well and says [`shared!`](crate::shared).
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
