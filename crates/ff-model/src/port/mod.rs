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

pub(crate) mod bias;
pub(crate) mod declaration;
pub(crate) mod derived;
pub(crate) mod dynamics;
pub(crate) mod energies;
pub(crate) mod erased;
pub(crate) mod matrix;
pub(crate) mod set;
pub(crate) mod shared;
pub(crate) mod state;
pub(crate) mod twin;
pub(crate) mod wrapper;

pub use bias::{derived_bias, derived_power};
pub use declaration::{CoordDecl, Decl, MAX_COORDS, MAX_PARAMS, ParamDecl, ParamGroup};
pub use derived::{derived_jacobian, derived_regressor};
pub use dynamics::PortDynamics;
pub use energies::Appendage;
pub use erased::{DynAppendage, PortModel, PortTangent};
pub use matrix::{PortMatrix, PortView, add_inertial, port_len};
pub use set::{AppendageSet, Place};
pub use shared::SharedAppendage;
pub use state::{PortAccel, PortState, PortVector};
pub use twin::{TreeTwin, TwinBody};
pub use wrapper::Derived;
