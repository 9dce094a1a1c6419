//! What the dynamics consume of an appendage.

use super::bias::{derived_bias, derived_power};
use super::derived::{derived_jacobian, derived_regressor};
use super::energies::Appendage;
use super::matrix::{PortMatrix, add_inertial};
use super::state::{PortAccel, PortState, PortVector};
use super::twin::TreeTwin;
use crate::scalar::traits::{PlainScalar, Scalar};

/// The equations of motion of an appendage at its port, with their derivatives: what the dynamics consume.
///
/// Every default follows from the energies of [`Appendage`], and [`Derived`](super::Derived) consists of the defaults. A
/// kind that many systems carry implements this trait itself. A method written by hand is for speed alone: it must equal
/// its default over every number type, and `validate::check_appendage` holds it to that. Do not branch on
/// [`Scalar::value`]: in lanes, which are several states at once, it is that of the first.
///
/// Arguments: `p` the parameters, `s` the motion, `acc` the accelerations, in the order of the declaration and in mount
/// axes; wrench rows come first, about the mount origin. SI units. No method may allocate.
///
/// ```
/// use ff_model::nalgebra::Vector3;
/// use ff_model::port::Derived;
/// use ff_model::{Appendage, CoordDecl, Decl, Motion, ParamDecl, PortDynamics, PortMatrix, PortState, Scalar};
/// # struct Slider(Decl);
/// # impl Appendage for Slider {
/// #     fn decl(&self) -> &Decl { &self.0 }
/// #     fn inertia<T: Scalar>(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>) {
/// #         let [x, y, z] = [0.7, -0.2, 0.4].map(T::from_f64);
/// #         m.add_point(p[0], &Vector3::new(x + eta[0], y, z), &[Vector3::x()]);
/// #     }
/// # }
///
/// // A mass that slides along x; the equations of motion follow from its energies.
/// let decl = Decl::new("slider", [CoordDecl::new("x", "m", (-0.3, 0.3))], [ParamDecl::positive("m", "kg", 2.5)]);
/// let slider = Derived::new(Slider(decl));
/// let host = Motion::new(Vector3::new(0.2, 0.3, -0.1), Vector3::new(0.0, 0.0, 0.8)); // the host turns about z
/// let mut bias = [0.0; 7];
/// slider.bias(&[2.5], &PortState { host, eta: &[0.1], nu: &[0.0] }, &mut bias);
/// // Along the slide: centrifugal -m w^2 (0.7 + 0.1), and -m w v_y of the body-fixed twist.
/// assert!((bias[6] + 2.5 * (0.8 * 0.8 * 0.8 + 0.8 * 0.3)).abs() < 1e-12);
/// ```
pub trait PortDynamics: Appendage {
    /// Whether [`Appendage::inertia`] writes every number of `m`, which need not arrive zeroed then. For speed alone.
    const WRITES_ALL: bool = false;
    /// Power that the dampers take out, `nu . dR/d nu >= 0` (W): `2 R` where `R` is quadratic. A simulation calls it at
    /// every stage.
    ///
    /// The default differentiates [`Appendage::rayleigh`] along `nu`.
    fn dissipated_power<T: Scalar>(&self, p: &[T], nu: &[T]) -> T {
        derived_power(self, p, nu)
    }
    /// Bias `h(p, s)`, length `6+n`: everything in the equations of motion but `M [A; nu']`.
    ///
    /// The default differentiates the energies.
    fn bias<T: Scalar>(&self, p: &[T], s: &PortState<'_, T>, h: &mut PortVector<T>) {
        derived_bias(self, p, s, h);
    }
    /// `M` and `h` of one state together, where the two share work. `m` arrives with anything in it; an override sets
    /// every number or clears it first.
    fn terms<T: Scalar>(&self, p: &[T], s: &PortState<'_, T>, m: &mut PortMatrix<'_, T>, h: &mut PortVector<T>) {
        if !Self::WRITES_ALL {
            m.clear();
        }
        self.inertia(p, s.eta, m);
        self.bias(p, s, h);
    }
    /// Port equations `r = M [A; nu'] + h`, length `6+n`. `scratch` may be used for `M` and arrives with anything in it.
    ///
    /// The default multiplies the matrix of [`PortDynamics::terms`].
    fn residual<T: Scalar>(
        &self,
        p: &[T],
        s: &PortState<'_, T>,
        acc: &PortAccel<'_, T>,
        scratch: &mut PortMatrix<'_, T>,
        r: &mut PortVector<T>,
    ) {
        self.terms(p, s, scratch, r);
        add_inertial(scratch, acc, r);
    }
    /// Derivatives of [`PortDynamics::residual`] at fixed accelerations, columns of length `6+n`: three for the
    /// angular velocity of the host, `n` for the coordinates, `n` for the rates.
    ///
    /// There is none for the host's linear velocity: the equations of a Galilean-invariant appendage depend on it only
    /// through the acceleration `A + [w x v; 0]` of the mount in an inertial frame; for one that is not (`Decl::galilean`)
    /// `ff-dynamics` forms these columns from [`PortDynamics::bias`]. The default differentiates by forward duals
    /// ([`derived_jacobian`]).
    fn jacobian<T: PlainScalar>(&self, p: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, j: &mut [T]) {
        derived_jacobian(self, p, s, acc, j);
    }
    /// Derivatives of [`PortDynamics::residual`] with respect to the parameters, one column of length `6+n` each.
    ///
    /// The default evaluates inertial parameters, in which the equations are linear, at unit vectors, and
    /// differentiates with respect to the others ([`derived_regressor`]).
    fn regressor<T: PlainScalar>(&self, p: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, y: &mut [T]) {
        derived_regressor(self, p, s, acc, y);
    }
    /// The same system as ordinary tree links, where there is one.
    fn twin(&self) -> Option<&dyn TreeTwin> {
        None
    }
}
