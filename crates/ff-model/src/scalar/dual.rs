//! Forward-mode dual numbers over any [`Scalar`], several directions at once.
//!
//! `Dual<T, N>` holds a value and `N` first derivatives: `f(x + e_i) = f(x) + f'(x) e_i` with
//! `e_i e_j = 0`. Nesting (`Dual<Dual<f64, 1>, 1>`) gives second derivatives. An own type rather than
//! `num-dual`, because the derived appendage bias needs duals over every scalar of the project,
//! lanes included, and that crate's duals end at the primitive floats (`docs/decisions/0001-scalar.md`).

use crate::scalar::traits::Scalar;
use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};
use ff_lanes::{Enter, Kernel};
use num_traits::{One, Zero};

/// A value with `N` directional derivatives.
///
/// ```
/// use ff_model::Dual;
///
/// // d(x^2 y) at x = 3, y = 2.
/// let (x, y) = (Dual::<f64, 2>::variable(3.0, 0), Dual::variable(2.0, 1));
/// let f = x * x * y;
/// assert_eq!((f.re, f.eps), (18.0, [12.0, 9.0]));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<T, const N: usize> {
    /// The value.
    pub re: T,
    /// The derivatives.
    pub eps: [T; N],
}

/// Directions carried at once by [`Grad`], the dual used for parameter sensitivities.
pub const DIRECTIONS: usize = 8;
/// First derivative in one direction.
pub type D1 = Dual<f64, 1>;
/// First derivatives in [`DIRECTIONS`] directions.
pub type Grad = Dual<f64, DIRECTIONS>;
/// Second derivative in one direction.
pub type D2 = Dual<D1, 1>;

impl<T: Scalar, const N: usize> Dual<T, N> {
    /// A constant: all derivatives zero.
    #[inline]
    pub fn constant(re: T) -> Self {
        Self { re, eps: [T::zero(); N] }
    }
    /// The variable of direction `i`: derivative one there, zero elsewhere.
    ///
    /// # Panics
    /// If `i >= N`.
    #[inline]
    pub fn variable(re: T, i: usize) -> Self {
        let mut d = Self::constant(re);
        d.eps[i] = T::one();
        d
    }
    /// `f(self)` from the value `f` and slope `df` at `self.re` (chain rule).
    #[inline]
    fn chain(self, f: T, df: T) -> Self {
        Self { re: f, eps: self.eps.map(|e| e * df) }
    }
}

impl<T: Scalar> Dual<T, 1> {
    /// Value and derivative in the one direction.
    #[inline]
    pub fn new(re: T, eps: T) -> Self {
        Self { re, eps: [eps] }
    }
}

impl<T: Scalar, const N: usize> Add for Dual<T, N> {
    type Output = Self;
    #[inline]
    fn add(mut self, o: Self) -> Self {
        self.re += o.re;
        for i in 0..N {
            self.eps[i] += o.eps[i];
        }
        self
    }
}
impl<T: Scalar, const N: usize> Sub for Dual<T, N> {
    type Output = Self;
    #[inline]
    fn sub(mut self, o: Self) -> Self {
        self.re -= o.re;
        for i in 0..N {
            self.eps[i] -= o.eps[i];
        }
        self
    }
}
impl<T: Scalar, const N: usize> Mul for Dual<T, N> {
    type Output = Self;
    #[inline]
    fn mul(self, o: Self) -> Self {
        let mut eps = [T::zero(); N];
        for i in 0..N {
            eps[i] = self.re * o.eps[i] + self.eps[i] * o.re;
        }
        Self { re: self.re * o.re, eps }
    }
}
impl<T: Scalar, const N: usize> Div for Dual<T, N> {
    type Output = Self;
    #[inline]
    fn div(self, o: Self) -> Self {
        let inv = T::one() / o.re;
        let q = self.re * inv;
        let mut eps = [T::zero(); N];
        for i in 0..N {
            eps[i] = (self.eps[i] - q * o.eps[i]) * inv;
        }
        Self { re: q, eps }
    }
}
impl<T: Scalar, const N: usize> Neg for Dual<T, N> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self { re: -self.re, eps: self.eps.map(|e| -e) }
    }
}
macro_rules! assign {
    ($($tr:ident $f:ident $op:tt),*) => {$(
        impl<T: Scalar, const N: usize> $tr for Dual<T, N> {
            #[inline]
            fn $f(&mut self, o: Self) {
                *self = *self $op o;
            }
        }
    )*};
}
assign!(AddAssign add_assign +, SubAssign sub_assign -, MulAssign mul_assign *, DivAssign div_assign /);

impl<T: Scalar, const N: usize> Zero for Dual<T, N> {
    #[inline]
    fn zero() -> Self {
        Self::constant(T::zero())
    }
    fn is_zero(&self) -> bool {
        self.re.is_zero() && self.eps.iter().all(Zero::is_zero)
    }
}
impl<T: Scalar, const N: usize> One for Dual<T, N> {
    #[inline]
    fn one() -> Self {
        Self::constant(T::one())
    }
}

impl<T: Scalar, const N: usize> Scalar for Dual<T, N> {
    const DERIVATIVES: bool = true;
    #[inline]
    fn from_f64(x: f64) -> Self {
        Self::constant(T::from_f64(x))
    }
    #[inline]
    fn value(&self) -> f64 {
        self.re.value()
    }
    #[inline]
    fn mul_add(self, b: Self, c: Self) -> Self {
        let mut eps = c.eps;
        for i in 0..N {
            eps[i] = self.re.mul_add(b.eps[i], self.eps[i].mul_add(b.re, eps[i]));
        }
        Self { re: self.re.mul_add(b.re, c.re), eps }
    }
    #[inline]
    fn is_positive(&self) -> bool {
        self.re.is_positive()
    }
    #[inline]
    fn scale(self, k: f64) -> Self {
        Self { re: self.re.scale(k), eps: self.eps.map(|e| e.scale(k)) }
    }
    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = self.re.sin_cos();
        (self.chain(s, c), self.chain(c, -s))
    }
    #[inline]
    fn sqrt(self) -> Self {
        let r = self.re.sqrt();
        self.chain(r, T::from_f64(0.5) / r)
    }
    #[inline]
    fn exp(self) -> Self {
        let r = self.re.exp();
        self.chain(r, r)
    }
    fn is_finite(&self) -> bool {
        self.re.is_finite() && self.eps.iter().all(Scalar::is_finite)
    }
}

impl<T: Scalar, const N: usize> Enter for Dual<T, N> {
    #[inline]
    fn enter<K: Kernel>(kernel: K) -> K::Output {
        T::enter(kernel)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// A function with every operation in it, and its derivative by hand.
    fn f<T: Scalar>(x: T) -> T {
        let (s, c) = (x * x).sin_cos();
        (s + T::from_f64(2.0)).sqrt() / (x - c.scale(0.3)) + (-x).exp()
    }

    #[test]
    fn first_derivative_matches_complex_step_free_central_difference() {
        let x = 1.37;
        let h = 1e-5;
        let d: Dual<f64, 2> = f(Dual::variable(x, 1));
        let fd = (f(x + h) - f(x - h)) / (2.0 * h);
        assert_eq!(d.eps[0], 0.0);
        assert_relative_eq!(d.re, f(x), max_relative = 1e-15);
        assert_relative_eq!(d.eps[1], fd, max_relative = 1e-8);
    }

    #[test]
    fn fused_products_differentiate_alike() {
        let v = |x, i| Dual::<f64, 3>::variable(x, i);
        let (a, b, c) = (v(0.7, 0), v(-1.1, 1), v(0.2, 2));
        let (x, y) = (a.mul_add(b, c), a * b + c);
        assert_relative_eq!(x.re, y.re, max_relative = 1e-15);
        (0..3).for_each(|i| assert_relative_eq!(x.eps[i], y.eps[i], max_relative = 1e-15));
    }

    #[test]
    fn nesting_gives_the_second_derivative() {
        let x = 0.73;
        let h = 1e-5;
        let xx = Dual::new(Dual::new(x, 1.0), Dual::new(1.0, 0.0));
        let d1 = |x: f64| f(Dual::<f64, 1>::variable(x, 0)).eps[0];
        assert_relative_eq!(f(xx).eps[0].eps[0], (d1(x + h) - d1(x - h)) / (2.0 * h), max_relative = 1e-8);
    }
}
