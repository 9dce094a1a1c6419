//! Appendages behind trait objects, and the closed set of number types that pass through them.
//!
//! A `dyn` object cannot have a generic method, so [`DynAppendage`] has one supertrait per number type and
//! [`ModelScalar`] selects it (`docs/decisions/0001-scalar.md`). To add a number type, add it to the supertraits of
//! [`DynAppendage`] and to the list of [`ModelScalar`].

use super::declaration::Decl;
use super::dynamics::PortDynamics;
use super::energies::Appendage;
use super::matrix::{PortMatrix, add_inertial, port_len};
use super::state::{PortAccel, PortState, PortVector};
use super::twin::TreeTwin;
use crate::scalar::dual::{D1, D2, Grad};
use crate::scalar::lanes::Four;
use crate::scalar::traits::{PlainScalar, Scalar};
use ff_lanes::Kernel;
use nalgebra::DMatrix;

/// An appendage at one number type: [`Appendage`] and [`PortDynamics`] as an object-safe trait.
pub trait PortModel<T: Scalar> {
    /// See [`Appendage::inertia`]; `m` may hold anything.
    fn inertia(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>);
    /// See [`Appendage::potential`].
    fn potential(&self, p: &[T], eta: &[T]) -> T;
    /// See [`Appendage::rayleigh`].
    fn rayleigh(&self, p: &[T], nu: &[T]) -> T;
    /// See [`PortDynamics::bias`].
    fn bias(&self, p: &[T], s: &PortState<'_, T>, h: &mut PortVector<T>);
    /// See [`PortDynamics::terms`].
    fn terms(&self, p: &[T], s: &PortState<'_, T>, m: &mut PortMatrix<'_, T>, h: &mut PortVector<T>);
    /// See [`PortDynamics::residual`].
    fn residual(
        &self,
        p: &[T],
        s: &PortState<'_, T>,
        acc: &PortAccel<'_, T>,
        scratch: &mut PortMatrix<'_, T>,
        r: &mut PortVector<T>,
    );
    /// See [`PortDynamics::dissipated_power`].
    fn dissipated_power(&self, p: &[T], nu: &[T]) -> T;
    /// Dense copy of `M(p, eta)`, `(6+n) x (6+n)`, for inspection. Allocates.
    fn dense_inertia(&self, p: &[T], eta: &[T]) -> DMatrix<T> {
        let mut buffer = vec![T::zero(); port_len(eta.len())];
        let mut m = PortMatrix::over(eta.len(), &mut buffer);
        self.inertia(p, eta, &mut m);
        m.view().dense()
    }
}

/// Derivatives of the port equations of an appendage at numbers and lanes.
pub trait PortTangent<T: PlainScalar> {
    /// See [`PortDynamics::jacobian`].
    fn jacobian(&self, p: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, j: &mut [T]);
    /// See [`PortDynamics::regressor`].
    fn regressor(&self, p: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, y: &mut [T]);
}

/// Calls a method of an appendage in a function compiled for the instructions of the scalar: a trait object's methods
/// are functions of their own, so whatever instructions the caller was compiled for end at the call.
macro_rules! entered {
    ($bound:ident, $owner:ident, $this:ident . $method:ident($($arg:ident: $ty:ty),*) $(-> $out:ty)?) => {{
        struct Call<'x, 'y, 'z, A, T: $bound> {
            this: &'x A,
            $($arg: $ty,)*
            borrowed: core::marker::PhantomData<(&'x &'y &'z (), T)>,
        }
        impl<'x, 'y, 'z, A: PortDynamics, T: $bound> Kernel for Call<'x, 'y, 'z, A, T> {
            type Output = entered!(@ $($out)?);
            #[inline(always)]
            fn run(self) -> Self::Output {
                $owner::$method(self.this, $(self.$arg),*)
            }
        }
        T::enter(Call::<A, T> { this: $this, $($arg,)* borrowed: core::marker::PhantomData })
    }};
    (@) => { () };
    (@ $out:ty) => { $out };
}

impl<A: PortDynamics, T: Scalar> PortModel<T> for A {
    fn inertia(&self, p: &[T], eta: &[T], m: &mut PortMatrix<'_, T>) {
        if !A::WRITES_ALL {
            m.clear();
        }
        entered!(Scalar, Appendage, self.inertia(p: &'x [T], eta: &'x [T], m: &'x mut PortMatrix<'z, T>));
    }
    fn potential(&self, p: &[T], eta: &[T]) -> T {
        Appendage::potential(self, p, eta)
    }
    fn rayleigh(&self, p: &[T], nu: &[T]) -> T {
        Appendage::rayleigh(self, p, nu)
    }
    fn bias(&self, p: &[T], s: &PortState<'_, T>, h: &mut PortVector<T>) {
        entered!(Scalar, PortDynamics, self.bias(p: &'x [T], s: &'x PortState<'y, T>, h: &'x mut PortVector<T>));
    }
    fn terms(&self, p: &[T], s: &PortState<'_, T>, m: &mut PortMatrix<'_, T>, h: &mut PortVector<T>) {
        if T::DERIVATIVES {
            // The functions of this trait, not those of the appendage, which the compiler would copy into this one.
            PortModel::inertia(self, p, s.eta, m);
            PortModel::bias(self, p, s, h);
            return;
        }
        entered!(Scalar, PortDynamics, self.terms(p: &'x [T], s: &'x PortState<'y, T>, m: &'x mut PortMatrix<'z, T>, h: &'x mut [T]));
    }
    fn residual(
        &self,
        p: &[T],
        s: &PortState<'_, T>,
        acc: &PortAccel<'_, T>,
        scratch: &mut PortMatrix<'_, T>,
        r: &mut PortVector<T>,
    ) {
        if T::DERIVATIVES {
            PortModel::inertia(self, p, s.eta, scratch);
            PortModel::bias(self, p, s, r);
            add_inertial(scratch, acc, r);
            return;
        }
        entered!(Scalar, PortDynamics, self.residual(p: &'x [T], s: &'x PortState<'y, T>, acc: &'x PortAccel<'y, T>,
            scratch: &'x mut PortMatrix<'z, T>, r: &'x mut [T]));
    }
    fn dissipated_power(&self, p: &[T], nu: &[T]) -> T {
        entered!(Scalar, PortDynamics, self.dissipated_power(p: &'x [T], nu: &'x [T]) -> T)
    }
}

impl<A: PortDynamics, T: PlainScalar> PortTangent<T> for A {
    fn jacobian(&self, p: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, j: &mut [T]) {
        entered!(PlainScalar, PortDynamics, self.jacobian(p: &'x [T], s: &'x PortState<'y, T>, acc: &'x PortAccel<'y, T>, j: &'x mut [T]));
    }
    fn regressor(&self, p: &[T], s: &PortState<'_, T>, acc: &PortAccel<'_, T>, y: &mut [T]) {
        entered!(PlainScalar, PortDynamics, self.regressor(p: &'x [T], s: &'x PortState<'y, T>, acc: &'x PortAccel<'y, T>, y: &'x mut [T]));
    }
}

/// Appendages at the widest number types of the machine's architecture.
#[cfg(all(target_arch = "x86_64", ff_isa = "v3"))]
pub trait WidePorts: PortModel<ff_lanes::Avx2x1> + PortTangent<ff_lanes::Avx2x1> {}
/// Appendages at the widest number types of the machine's architecture.
#[cfg(all(target_arch = "x86_64", not(ff_isa = "v3")))]
pub trait WidePorts:
    PortModel<ff_lanes::Avx2x1>
    + PortTangent<ff_lanes::Avx2x1>
    + PortModel<ff_lanes::Avx2x4>
    + PortModel<ff_lanes::Avx512x8>
    + PortTangent<ff_lanes::Avx2x4>
    + PortTangent<ff_lanes::Avx512x8>
{
}
/// Appendages at the widest number types of the machine's architecture: none beyond the portable ones here.
#[cfg(not(target_arch = "x86_64"))]
pub trait WidePorts {}
impl<A: PortDynamics> WidePorts for A {}

/// An appendage behind a trait object, at every number type of the project.
///
/// Implemented for every [`PortDynamics`], so for `Derived<A>` of every [`Appendage`]; nobody implements it by hand.
///
/// ```
/// use ff_model::nalgebra::{Matrix3, Vector3};
/// use ff_model::payload::Payload;
/// use ff_model::{DynAppendage, Inertia, SharedAppendage};
///
/// /// Nominal mass of whatever hangs there (kg), if it is a parameter.
/// fn mass(appendage: &dyn DynAppendage) -> Option<f64> {
///     appendage.declaration().params.iter().find(|p| p.name.ends_with("mass")).map(|p| p.nominal)
/// }
/// let block = Inertia::from_com(3.2, &Vector3::new(0.4, -0.1, 0.2), &Matrix3::from_diagonal_element(0.3));
/// let payload: SharedAppendage = Payload::new(&block)?.into();
/// assert_eq!(mass(&*payload), Some(3.2));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait DynAppendage:
    PortModel<f64>
    + PortModel<D1>
    + PortModel<Grad>
    + PortModel<D2>
    + PortModel<Four>
    + PortTangent<f64>
    + PortTangent<Four>
    + WidePorts
    + Send
    + Sync
{
    /// Coordinates and parameters.
    fn declaration(&self) -> &Decl;
    /// See [`PortDynamics::twin`].
    fn tree_twin(&self) -> Option<&dyn TreeTwin>;
}

impl<A: PortDynamics> DynAppendage for A {
    fn declaration(&self) -> &Decl {
        Appendage::decl(self)
    }
    fn tree_twin(&self) -> Option<&dyn TreeTwin> {
        PortDynamics::twin(self)
    }
}

/// A scalar that can pass through a boxed appendage.
///
/// Implemented for `f64`, for lanes, for duals with 1 and with [`DIRECTIONS`](crate::scalar::dual::DIRECTIONS) directions, and for the nested
/// dual that second derivatives need.
pub trait ModelScalar: Scalar {
    /// The face of a boxed appendage at this number type.
    fn port(appendage: &dyn DynAppendage) -> &dyn PortModel<Self>;
}

macro_rules! model_scalars {
    ($($t:ty),* $(,)?) => {$(
        impl ModelScalar for $t {
            #[inline(always)]
            fn port(appendage: &dyn DynAppendage) -> &dyn PortModel<Self> {
                appendage
            }
        }
    )*};
}
model_scalars!(f64, D1, Grad, D2, Four);
#[cfg(target_arch = "x86_64")]
model_scalars!(ff_lanes::Avx2x1);
#[cfg(all(target_arch = "x86_64", not(ff_isa = "v3")))]
model_scalars!(ff_lanes::Avx2x4, ff_lanes::Avx512x8);

/// A number, or a vector of lanes, that can pass through a boxed appendage and have the port equations
/// differentiated at it.
pub trait LaneScalar: ModelScalar + PlainScalar {
    /// One number in code for the same instructions, or for fewer: what a single state is computed over beside lanes.
    type One: LaneScalar;
    /// The derivatives of a boxed appendage at this number type.
    fn tangent(appendage: &dyn DynAppendage) -> &dyn PortTangent<Self>;
}
macro_rules! lane_models {
    ($($t:ty: $one:ty),* $(,)?) => {$(
        impl LaneScalar for $t {
            type One = $one;
            #[inline(always)]
            fn tangent(appendage: &dyn DynAppendage) -> &dyn PortTangent<Self> {
                appendage
            }
        }
    )*};
}
#[cfg(not(all(target_arch = "x86_64", ff_isa = "v3")))]
lane_models!(f64: f64, Four: f64);
#[cfg(all(target_arch = "x86_64", ff_isa = "v3"))]
lane_models!(f64: f64, Four: ff_lanes::Avx2x1);
#[cfg(target_arch = "x86_64")]
lane_models!(ff_lanes::Avx2x1: ff_lanes::Avx2x1);
#[cfg(all(target_arch = "x86_64", not(ff_isa = "v3")))]
lane_models!(ff_lanes::Avx2x4: ff_lanes::Avx2x1, ff_lanes::Avx512x8: ff_lanes::Avx2x1);
