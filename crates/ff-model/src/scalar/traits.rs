//! The number type the dynamics are written over.
//!
//! One source serves plain numbers, forward duals (exact derivatives) and SIMD lanes (`ff-lanes`).

use core::ops::{Add, Div, Mul, Neg, Sub};
use ff_lanes::{Enter, Lanes};
use nalgebra::{ClosedAddAssign, ClosedDivAssign, ClosedMulAssign, ClosedSubAssign};
use num_traits::{One, Zero};

/// A real number as the dynamics need it: ring operations, division, square root, sine and cosine.
///
/// Every operation is branch-free in the value, so that a dual number or a vector of lanes may stand in
/// for an `f64`. No method allocates.
///
/// ```
/// use ff_model::{Dual, Scalar};
///
/// /// Potential energy of a pendulum (J): mass 3 kg, length `l` (m), angle (rad).
/// fn energy<T: Scalar>(l: T, angle: T) -> T {
///     l.scale(3.0 * 9.81) * (T::one() - angle.sin_cos().1)
/// }
/// // The same code gives the torque: the derivative with respect to the angle.
/// let torque = energy(Dual::constant(0.7), Dual::<f64, 1>::variable(0.4, 0)).eps[0];
/// assert!((torque - 3.0 * 9.81 * 0.7 * 0.4_f64.sin()).abs() < 1e-14);
/// ```
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
lane_scalars!(ff_lanes::Portable4);
#[cfg(target_arch = "x86_64")]
lane_scalars!(ff_lanes::Avx2x1, ff_lanes::Avx2x4, ff_lanes::Avx512x8);

/// A scalar without derivatives: `f64`, or a vector of lanes of them. Its lanes are read and written by the methods of
/// [`Lanes`], the supertrait.
///
/// Derivatives of the port equations are computed over such numbers. An appendage that writes them itself
/// ([`PortDynamics`](crate::PortDynamics)) uses the operations of [`Scalar`]; lanes matter to it only where it must treat
/// them one by one.
pub trait PlainScalar: Scalar + Lanes {}
impl<T: Scalar + Lanes> PlainScalar for T {}
