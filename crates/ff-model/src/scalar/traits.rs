//! The number type the dynamics are written over.
//!
//! One source serves plain numbers, forward duals (exact derivatives) and SIMD lanes (`ff-lanes`). The set of
//! number types that reach an appendage behind a trait object is closed ([`ModelScalar`]), because a
//! `dyn` object cannot carry a generic method; adding a type is one line in this file and one in
//! [`DynAppendage`].

use crate::port::{DynAppendage, PortModel, PortTangent};
use crate::scalar::dual::Dual;
use core::ops::{Add, Div, Mul, Neg, Sub};
use ff_lanes::{Enter, Lanes, Portable4};
use nalgebra::{ClosedAddAssign, ClosedDivAssign, ClosedMulAssign, ClosedSubAssign};
use num_traits::{One, Zero};

/// A real number as the dynamics need it: ring operations, division, square root, sine and cosine.
///
/// Every operation is branch-free in the value, so that a dual number or a vector of lanes may stand in
/// for an `f64`. No method allocates.
pub trait Scalar:
    nalgebra::Scalar
    + Copy
    + Send
    + Sync
    + Zero
    + One
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + ClosedAddAssign
    + ClosedSubAssign
    + ClosedMulAssign
    + ClosedDivAssign
    + Enter
{
    /// Whether values carry derivatives. Such numbers go through the plainest code path of an algorithm: they
    /// serve as a check or a fallback, and every path over them costs compile time.
    const DERIVATIVES: bool = false;
    /// The constant `x`, with zero derivative in every direction.
    fn from_f64(x: f64) -> Self;
    /// The value without derivatives; for lanes, of the first lane. For pivots and reports only.
    fn value(&self) -> f64;
    /// `self * b + c`. For lanes in one rounding, which is also one instruction; for `f64` only in a program
    /// built for machines that have it, because without the instruction it is a library call.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// True when the value, of every lane, is above zero and finite.
    fn is_positive(&self) -> bool;
    /// `self * k` for a constant `k`; cheaper than lifting `k` for derivative-carrying types.
    fn scale(self, k: f64) -> Self;
    /// Sine and cosine (argument in rad).
    fn sin_cos(self) -> (Self, Self);
    /// Square root. The derivative at zero is infinite.
    fn sqrt(self) -> Self;
    /// Natural exponential.
    fn exp(self) -> Self;
    /// True when the value and every derivative are finite.
    fn is_finite(&self) -> bool;
}

impl Scalar for f64 {
    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn value(&self) -> f64 {
        *self
    }
    #[inline(always)]
    fn scale(self, k: f64) -> Self {
        self * k
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        if cfg!(target_feature = "fma") { f64::mul_add(self, b, c) } else { self * b + c }
    }
    #[inline(always)]
    fn is_positive(&self) -> bool {
        *self > 0.0 && *self < f64::INFINITY
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        ff_lanes::sin_cos(self)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn exp(self) -> Self {
        f64::exp(self)
    }
    #[inline(always)]
    fn is_finite(&self) -> bool {
        f64::is_finite(*self)
    }
}

/// Vectors of lanes are scalars: several states, or several parameter sets, at once.
macro_rules! lane_scalars {
    ($($t:ty),*) => {$(
        impl Scalar for $t {
            #[inline(always)]
            fn from_f64(x: f64) -> Self {
                <$t as Lanes>::splat(x)
            }
            #[inline(always)]
            fn value(&self) -> f64 {
                self.lane(0)
            }
            #[inline(always)]
            fn mul_add(self, b: Self, c: Self) -> Self {
                Lanes::mul_add(self, b, c)
            }
            #[inline(always)]
            fn is_positive(&self) -> bool {
                self.all_positive()
            }
            #[inline(always)]
            fn scale(self, k: f64) -> Self {
                self * <$t as Lanes>::splat(k)
            }
            #[inline(always)]
            fn sin_cos(self) -> (Self, Self) {
                <$t>::sin_cos(self)
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                <$t>::sqrt(self)
            }
            fn exp(self) -> Self {
                let mut e = self;
                (0..<$t as Lanes>::N).for_each(|i| e.set_lane(i, self.lane(i).exp()));
                e
            }
            #[inline(always)]
            fn is_finite(&self) -> bool {
                // `x - x` is zero for a finite number, NaN for all others.
                (*self - *self + <$t as Lanes>::splat(1.0)).all_positive()
            }
        }
    )*};
}
lane_scalars!(Portable4);
#[cfg(target_arch = "x86_64")]
lane_scalars!(ff_lanes::Avx2x1, ff_lanes::Avx2x4, ff_lanes::Avx512x8);

/// A scalar that can pass through a boxed appendage.
///
/// Implemented for `f64`, for lanes, for duals with 1 and with [`DIRECTIONS`] directions, and for the nested
/// dual that second derivatives need.
pub trait ModelScalar: Scalar {
    /// The face of a boxed appendage at this number type.
    fn port(appendage: &dyn DynAppendage) -> &dyn PortModel<Self>;
}

/// Directions carried at once by [`Grad`], the dual used for parameter sensitivities.
pub const DIRECTIONS: usize = 8;
/// First derivative in one direction.
pub type D1 = Dual<f64, 1>;
/// First derivatives in [`DIRECTIONS`] directions.
pub type Grad = Dual<f64, DIRECTIONS>;
/// Second derivative in one direction.
pub type D2 = Dual<D1, 1>;

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
model_scalars!(f64, D1, Grad, D2, Portable4);
#[cfg(target_arch = "x86_64")]
model_scalars!(ff_lanes::Avx2x1, ff_lanes::Avx2x4, ff_lanes::Avx512x8);

/// A number, or a vector of lanes, that can pass through a boxed appendage and have the port equations
/// differentiated at it.
pub trait LaneScalar: ModelScalar + Lanes {
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
lane_models!(f64: f64, Portable4: f64);
#[cfg(target_arch = "x86_64")]
lane_models!(
    ff_lanes::Avx2x1: ff_lanes::Avx2x1,
    ff_lanes::Avx2x4: ff_lanes::Avx2x1,
    ff_lanes::Avx512x8: ff_lanes::Avx2x1,
);
