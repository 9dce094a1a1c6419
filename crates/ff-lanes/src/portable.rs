//! Four lanes for whatever the program was built for, on the crate `wide`.

use crate::{Enter, Kernel, Lanes, operators};
use core::ops::{Add, Div, Mul, Neg, Sub};
use wide::f64x4;

/// Four numbers, with the instructions the program was built for.
///
/// ```
/// use ff_lanes::{Lanes, Portable4};
///
/// // Four springs at once: 2.5 N m/rad, at four angles.
/// let angle = Portable4::load(&[0.1, -0.2, 0.3, 0.4]);
/// let torque = angle * Portable4::splat(-2.5);
/// assert_eq!((torque.lane(1), torque.lane(3)), (0.5, -1.0));
/// ```
#[derive(Clone, Copy)]
pub struct Portable4(f64x4);

impl Enter for Portable4 {
    #[inline(always)]
    fn enter<K: Kernel>(kernel: K) -> K::Output {
        kernel.run()
    }
}

impl Lanes for Portable4 {
    const N: usize = 4;
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self(f64x4::splat(x))
    }
    #[inline(always)]
    fn load(x: &[f64]) -> Self {
        Self(f64x4::from([x[0], x[1], x[2], x[3]]))
    }
    #[inline(always)]
    fn store(self, to: &mut [f64]) {
        to[..4].copy_from_slice(&self.0.to_array());
    }
    #[inline(always)]
    fn lane(&self, i: usize) -> f64 {
        self.0.to_array()[i]
    }
    #[inline(always)]
    fn set_lane(&mut self, i: usize, x: f64) {
        let mut a = self.0.to_array();
        a[i] = x;
        self.0 = f64x4::from(a);
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Self(self.0.mul_add(b.0, c.0))
    }
    #[inline(always)]
    fn all_positive(self) -> bool {
        self.0.to_array().iter().all(|&x| x > 0.0 && x < f64::INFINITY)
    }
}

impl Portable4 {
    /// Square root of every lane.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }
    /// Sine and cosine of every lane (rad).
    #[inline(always)]
    pub fn sin_cos(self) -> (Self, Self) {
        let x = self.0.to_array();
        let y = [crate::sin_cos(x[0]), crate::sin_cos(x[1]), crate::sin_cos(x[2]), crate::sin_cos(x[3])];
        (Self(f64x4::from(y.map(|p| p.0))), Self(f64x4::from(y.map(|p| p.1))))
    }
}

macro_rules! op {
    ($tr:ident, $f:ident) => {
        impl $tr for Portable4 {
            type Output = Self;
            #[inline(always)]
            fn $f(self, o: Self) -> Self {
                Self(self.0.$f(o.0))
            }
        }
    };
}
op!(Add, add);
op!(Sub, sub);
op!(Mul, mul);
op!(Div, div);
impl Neg for Portable4 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}
operators!(Portable4);
