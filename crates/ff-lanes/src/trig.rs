//! Sine and cosine together, without a branch on the quadrant.
//!
//! Reduction to `|r| <= pi/4` by `k = round(2 x / pi)` with `pi/2` in three parts of 33 bits, so that `k` times
//! a part is exact for `|k| < 2^20` (W. J. Cody, W. Waite, *Software Manual for the Elementary Functions*,
//! 1980, ch. 8); then the minimax polynomials of fdlibm (`k_sin.c`, `k_cos.c`, Sun Microsystems 1993), whose
//! error is below one unit in the last place. Beyond [`LIMIT`] the standard library takes over.

/// Arguments above this (rad) go to the standard library.
pub(crate) const LIMIT: f64 = 1.0e6;

/// `1.5 * 2^52`: adding it leaves the rounded integer in the low bits.
pub(crate) const MAGIC: f64 = 6_755_399_441_055_744.0;
pub(crate) const TWO_OVER_PI: f64 = core::f64::consts::FRAC_2_PI;
/// `pi/2` in three parts.
pub(crate) const PIO2: [f64; 3] = [1.570_796_326_734_125_6, 6.077_100_506_303_966e-11, 2.022_266_248_795_950_6e-21];
/// Odd Taylor-like coefficients of the sine, from the highest.
pub(crate) const SIN: [f64; 6] = [
    1.589_690_995_211_55e-10,
    -2.505_076_025_340_686_3e-8,
    2.755_731_370_707_006_8e-6,
    -1.984_126_982_985_795e-4,
    8.333_333_333_322_49e-3,
    -1.666_666_666_666_663_2e-1,
];
/// Even coefficients of the cosine, from the highest.
pub(crate) const COS: [f64; 6] = [
    -1.135_964_755_778_819_5e-11,
    2.087_572_321_298_175e-9,
    -2.755_731_435_139_066_3e-7,
    2.480_158_728_947_673e-5,
    -1.388_888_888_887_411e-3,
    4.166_666_666_666_66e-2,
];

/// Reduced argument's sine and cosine, and the quadrant, from the vector operations of `$t`.
macro_rules! reduced {
    ($x:expr, $splat:expr) => {{
        let (x, c) = ($x, $splat);
        let t = x.mul_add(c($crate::trig::TWO_OVER_PI), c($crate::trig::MAGIC));
        let k = t - c($crate::trig::MAGIC);
        let r = (-k).mul_add(c($crate::trig::PIO2[0]), x);
        let r = (-k).mul_add(c($crate::trig::PIO2[1]), r);
        let r = (-k).mul_add(c($crate::trig::PIO2[2]), r);
        let z = r * r;
        let s = &$crate::trig::SIN;
        let q = &$crate::trig::COS;
        let ps =
            c(s[0]).mul_add(z, c(s[1])).mul_add(z, c(s[2])).mul_add(z, c(s[3])).mul_add(z, c(s[4])).mul_add(z, c(s[5]));
        let pc =
            c(q[0]).mul_add(z, c(q[1])).mul_add(z, c(q[2])).mul_add(z, c(q[3])).mul_add(z, c(q[4])).mul_add(z, c(q[5]));
        let sin = (r * z).mul_add(ps, r);
        let cos = (z * z).mul_add(pc, z.mul_add(c(-0.5), c(1.0)));
        (t, sin, cos)
    }};
}
pub(crate) use reduced;

/// `a * b + c`, fused where the program was built for it.
#[derive(Clone, Copy)]
struct Plain(f64);

impl Plain {
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        if cfg!(target_feature = "fma") { Self(self.0.mul_add(b.0, c.0)) } else { Self(self.0 * b.0 + c.0) }
    }
}
impl core::ops::Neg for Plain {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}
impl core::ops::Sub for Plain {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Self(self.0 - o.0)
    }
}
impl core::ops::Mul for Plain {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        Self(self.0 * o.0)
    }
}

/// Sine and cosine of `x` (rad), both within one unit in the last place; a third of the time of two library
/// calls. NaN and infinities give NaN.
#[inline(always)]
pub fn sin_cos(x: f64) -> (f64, f64) {
    // Also for NaN, which compares with nothing.
    if x.abs() >= LIMIT || x.is_nan() {
        return far(x);
    }
    let (t, s, c) = reduced!(Plain(x), Plain);
    quadrant(t.0, s.0, c.0)
}

/// Sine and cosine from those of the reduced argument, and the shifted multiple of `pi/2` with the quadrant in its low
/// bits.
#[inline(always)]
pub(crate) fn quadrant(t: f64, s: f64, c: f64) -> (f64, f64) {
    let n = t.to_bits();
    let (s, c) = (s.to_bits(), c.to_bits());
    let swap = (n & 1).wrapping_neg();
    let a = (s & !swap) | (c & swap);
    let b = (c & !swap) | (s & swap);
    (f64::from_bits(a ^ ((n & 2) << 62)), f64::from_bits(b ^ ((n.wrapping_add(1) & 2) << 62)))
}

#[cold]
#[inline(never)]
pub(crate) fn far(x: f64) -> (f64, f64) {
    x.sin_cos()
}
