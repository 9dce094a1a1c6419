//! AVX-512 and AVX2 vectors.
//!
//! # Safety of this module
//! Every operator calls intrinsics that need an instruction set. The types are reached only behind
//! [`crate::Isa`], and [`Enter::enter`] checks the machine before it runs anything, so a value of a type here
//! exists only where its instructions do. The functions are `#[inline(always)]`, so that they end up in the
//! function `enter` compiled for those instructions; if one is not inlined it still executes the same
//! instructions, only slower.

use crate::trig::{LIMIT, far, quadrant, reduced};
use crate::{Enter, Kernel, Lanes, WIDEST, operators};
use core::arch::x86_64::*;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// AVX2 and FMA present.
#[inline]
pub(crate) fn has_v3() -> bool {
    is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")
}

/// AVX-512 F, DQ, VL and BW present, beside AVX2 and FMA.
#[inline]
pub(crate) fn has_v4() -> bool {
    has_v3()
        && is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512bw")
}

/// Eight numbers in one AVX-512 register.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub struct Avx512x8(__m512d);

/// Four numbers in one AVX register.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub struct Avx2x4(__m256d);

/// One number in code for AVX2 and FMA: multiplications and additions that are fused, and instructions of three
/// operands, in a program built for any x86-64. Its arithmetic is that of `f64`; outside [`Enter::enter`] a fused
/// operation is a library call.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub struct Avx2x1(f64);

impl Enter for Avx2x1 {
    #[inline]
    fn enter<K: Kernel>(kernel: K) -> K::Output {
        <Avx2x4 as Enter>::enter(kernel)
    }
}

impl Lanes for Avx2x1 {
    const N: usize = 1;
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self(x)
    }
    #[inline(always)]
    fn load(x: &[f64]) -> Self {
        Self(x[0])
    }
    #[inline(always)]
    fn store(self, to: &mut [f64]) {
        to[0] = self.0;
    }
    #[inline(always)]
    fn lane(&self, i: usize) -> f64 {
        assert!(i == 0);
        self.0
    }
    #[inline(always)]
    fn set_lane(&mut self, i: usize, x: f64) {
        assert!(i == 0);
        self.0 = x;
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Self(self.0.mul_add(b.0, c.0))
    }
    #[inline(always)]
    fn all_positive(self) -> bool {
        self.0 > 0.0 && self.0 < f64::INFINITY
    }
}

/// Operators of one number.
macro_rules! plain_operator {
    ($($trait:ident, $method:ident, $op:tt);*) => {$(
        impl $trait for Avx2x1 {
            type Output = Self;
            #[inline(always)]
            fn $method(self, o: Self) -> Self {
                Self(self.0 $op o.0)
            }
        }
    )*};
}
plain_operator!(Add, add, +; Sub, sub, -; Mul, mul, *; Div, div, /);
impl Neg for Avx2x1 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}
operators!(Avx2x1);

impl Avx2x1 {
    /// Square root.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }
    /// Sine and cosine (rad).
    #[inline(always)]
    pub fn sin_cos(self) -> (Self, Self) {
        // Also for NaN, which compares with nothing.
        if self.0.abs() >= LIMIT || self.0.is_nan() {
            let (s, c) = far(self.0);
            return (Self(s), Self(c));
        }
        let (t, s, c) = reduced!(self, Self);
        let (s, c) = quadrant(t.0, s.0, c.0);
        (Self(s), Self(c))
    }
}

impl Enter for Avx512x8 {
    #[inline]
    fn enter<K: Kernel>(kernel: K) -> K::Output {
        #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw,avx2,fma,bmi1,bmi2")]
        fn go<K: Kernel>(kernel: K) -> K::Output {
            kernel.run()
        }
        assert!(has_v4(), "this machine has no AVX-512");
        // SAFETY: the instruction sets of `go` are present, as just checked.
        unsafe { go(kernel) }
    }
}

impl Enter for Avx2x4 {
    #[inline]
    fn enter<K: Kernel>(kernel: K) -> K::Output {
        #[target_feature(enable = "avx2,fma,bmi1,bmi2")]
        fn go<K: Kernel>(kernel: K) -> K::Output {
            kernel.run()
        }
        assert!(has_v3(), "this machine has no AVX2");
        // SAFETY: the instruction sets of `go` are present, as just checked.
        unsafe { go(kernel) }
    }
}

#[inline]
#[target_feature(enable = "avx512f")]
fn positive8(x: __m512d) -> bool {
    let above = _mm512_cmp_pd_mask::<_CMP_GT_OQ>(x, _mm512_setzero_pd());
    above & _mm512_cmp_pd_mask::<_CMP_LT_OQ>(x, _mm512_set1_pd(f64::INFINITY)) == 0xff
}

#[inline]
#[target_feature(enable = "avx")]
fn positive4(x: __m256d) -> bool {
    let above = _mm256_cmp_pd::<_CMP_GT_OQ>(x, _mm256_setzero_pd());
    let below = _mm256_cmp_pd::<_CMP_LT_OQ>(x, _mm256_set1_pd(f64::INFINITY));
    _mm256_movemask_pd(_mm256_and_pd(above, below)) == 0xf
}

/// `x` with the other sign where the second bit of `n` is set: the third and fourth quadrant. Functions, because a closure is not
/// always inlined, and is not compiled for the instruction set of its surroundings then.
#[inline]
#[target_feature(enable = "avx512f")]
fn flipped8(n: __m512i, x: __m512d) -> __m512d {
    let sign = _mm512_slli_epi64::<62>(_mm512_and_si512(n, _mm512_set1_epi64(2)));
    _mm512_castsi512_pd(_mm512_xor_si512(_mm512_castpd_si512(x), sign))
}

/// As [`flipped8`].
#[inline]
#[target_feature(enable = "avx2")]
fn flipped4(n: __m256i, x: __m256d) -> __m256d {
    let sign = _mm256_slli_epi64::<62>(_mm256_and_si256(n, _mm256_set1_epi64x(2)));
    _mm256_castsi256_pd(_mm256_xor_si256(_mm256_castpd_si256(x), sign))
}

/// Columns of a 4 x 4 matrix given by rows. Straight-line code: the compiler makes calls of `memcpy` of loops over vectors.
#[inline]
#[target_feature(enable = "avx")]
fn transpose4(r: &[Avx2x4], stride: usize) -> [Avx2x4; WIDEST] {
    let (w, x, y, z) = (r[0].0, r[stride].0, r[2 * stride].0, r[3 * stride].0);
    // Even and odd columns of each pair of rows, then halves.
    let (a, b) = (_mm256_unpacklo_pd(w, x), _mm256_unpackhi_pd(w, x));
    let (c, d) = (_mm256_unpacklo_pd(y, z), _mm256_unpackhi_pd(y, z));
    let zero = Avx2x4(_mm256_setzero_pd());
    [
        Avx2x4(_mm256_permute2f128_pd::<0x20>(a, c)),
        Avx2x4(_mm256_permute2f128_pd::<0x20>(b, d)),
        Avx2x4(_mm256_permute2f128_pd::<0x31>(a, c)),
        Avx2x4(_mm256_permute2f128_pd::<0x31>(b, d)),
        zero,
        zero,
        zero,
        zero,
    ]
}

/// Columns of an 8 x 8 matrix given by rows, as [`transpose4`].
#[inline]
#[target_feature(enable = "avx512f")]
fn transpose8(r: &[Avx512x8], stride: usize) -> [Avx512x8; WIDEST] {
    let (s, t, u, v) = (r[0].0, r[stride].0, r[2 * stride].0, r[3 * stride].0);
    let (w, x, y, z) = (r[4 * stride].0, r[5 * stride].0, r[6 * stride].0, r[7 * stride].0);
    let (a, b) = (_mm512_unpacklo_pd(s, t), _mm512_unpackhi_pd(s, t));
    let (c, d) = (_mm512_unpacklo_pd(u, v), _mm512_unpackhi_pd(u, v));
    let (e, f) = (_mm512_unpacklo_pd(w, x), _mm512_unpackhi_pd(w, x));
    let (g, h) = (_mm512_unpacklo_pd(y, z), _mm512_unpackhi_pd(y, z));
    let (even, odd) = (transpose_pairs(a, c, e, g), transpose_pairs(b, d, f, h));
    [even[0], odd[0], even[1], odd[1], even[2], odd[2], even[3], odd[3]]
}

/// Rows of pairs for columns of pairs: the first vector has the pairs of rows 0 and 1, the second those of 2 and 3, and so on.
#[inline]
#[target_feature(enable = "avx512f")]
fn transpose_pairs(a: __m512d, b: __m512d, c: __m512d, d: __m512d) -> [Avx512x8; 4] {
    const EVEN: i32 = 0b10_00_10_00;
    const ODD: i32 = 0b11_01_11_01;
    let (e, f) = (_mm512_shuffle_f64x2::<EVEN>(a, b), _mm512_shuffle_f64x2::<EVEN>(c, d));
    let (g, h) = (_mm512_shuffle_f64x2::<ODD>(a, b), _mm512_shuffle_f64x2::<ODD>(c, d));
    [
        Avx512x8(_mm512_shuffle_f64x2::<EVEN>(e, f)),
        Avx512x8(_mm512_shuffle_f64x2::<EVEN>(g, h)),
        Avx512x8(_mm512_shuffle_f64x2::<ODD>(e, f)),
        Avx512x8(_mm512_shuffle_f64x2::<ODD>(g, h)),
    ]
}

macro_rules! vector {
    ($t:ident, $n:literal, $raw:ty, $add:ident, $sub:ident, $mul:ident, $div:ident, $fma:ident, $sqrt:ident, $set1:ident,
     $loadu:ident, $storeu:ident, $positive:ident, {$($more:item)*}) => {
        impl Lanes for $t {
            const N: usize = $n;
            #[inline(always)]
            fn splat(x: f64) -> Self {
                // SAFETY: module documentation.
                Self(unsafe { $set1(x) })
            }
            #[inline(always)]
            fn load(x: &[f64]) -> Self {
                assert!(x.len() >= $n);
                // SAFETY: `x` has at least N elements; unaligned load. Module documentation.
                Self(unsafe { $loadu(x.as_ptr()) })
            }
            #[inline(always)]
            fn store(self, to: &mut [f64]) {
                assert!(to.len() >= $n);
                // SAFETY: `to` has at least N elements; unaligned store. Module documentation.
                unsafe { $storeu(to.as_mut_ptr(), self.0) }
            }
            #[inline(always)]
            fn lane(&self, i: usize) -> f64 {
                let mut a = [0.0; $n];
                self.store(&mut a);
                a[i]
            }
            #[inline(always)]
            fn set_lane(&mut self, i: usize, x: f64) {
                let mut a = [0.0; $n];
                self.store(&mut a);
                a[i] = x;
                *self = Self::load(&a);
            }
            #[inline(always)]
            fn mul_add(self, b: Self, c: Self) -> Self {
                // SAFETY: module documentation.
                Self(unsafe { $fma(self.0, b.0, c.0) })
            }
            #[inline(always)]
            fn all_positive(self) -> bool {
                // SAFETY: module documentation.
                unsafe { $positive(self.0) }
            }
            $($more)*
        }
        impl Add for $t {
            type Output = Self;
            #[inline(always)]
            fn add(self, o: Self) -> Self {
                // SAFETY: module documentation.
                Self(unsafe { $add(self.0, o.0) })
            }
        }
        impl Sub for $t {
            type Output = Self;
            #[inline(always)]
            fn sub(self, o: Self) -> Self {
                // SAFETY: module documentation.
                Self(unsafe { $sub(self.0, o.0) })
            }
        }
        impl Mul for $t {
            type Output = Self;
            #[inline(always)]
            fn mul(self, o: Self) -> Self {
                // SAFETY: module documentation.
                Self(unsafe { $mul(self.0, o.0) })
            }
        }
        impl Div for $t {
            type Output = Self;
            #[inline(always)]
            fn div(self, o: Self) -> Self {
                // SAFETY: module documentation.
                Self(unsafe { $div(self.0, o.0) })
            }
        }
        impl Neg for $t {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self::splat(-0.0) - self
            }
        }
        impl $t {
            /// Square root of every lane.
            #[inline(always)]
            pub fn sqrt(self) -> Self {
                // SAFETY: module documentation.
                Self(unsafe { $sqrt(self.0) })
            }
            #[cold]
            #[inline(never)]
            fn far(self) -> (Self, Self) {
                let (mut s, mut c) = (self, self);
                for i in 0..$n {
                    let (x, y) = far(self.lane(i));
                    s.set_lane(i, x);
                    c.set_lane(i, y);
                }
                (s, c)
            }
        }
        operators!($t);
    };
}
vector!(
    Avx512x8,
    8,
    __m512d,
    _mm512_add_pd,
    _mm512_sub_pd,
    _mm512_mul_pd,
    _mm512_div_pd,
    _mm512_fmadd_pd,
    _mm512_sqrt_pd,
    _mm512_set1_pd,
    _mm512_loadu_pd,
    _mm512_storeu_pd,
    positive8,
    {
        #[inline(always)]
        fn transpose(rows: &[Self], stride: usize) -> [Self; WIDEST] {
            // SAFETY: module documentation.
            unsafe { transpose8(rows, stride) }
        }
    }
);
vector!(
    Avx2x4,
    4,
    __m256d,
    _mm256_add_pd,
    _mm256_sub_pd,
    _mm256_mul_pd,
    _mm256_div_pd,
    _mm256_fmadd_pd,
    _mm256_sqrt_pd,
    _mm256_set1_pd,
    _mm256_loadu_pd,
    _mm256_storeu_pd,
    positive4,
    {
        #[inline(always)]
        fn transpose(rows: &[Self], stride: usize) -> [Self; WIDEST] {
            // SAFETY: module documentation.
            unsafe { transpose4(rows, stride) }
        }
    }
);

impl Avx512x8 {
    /// Sine and cosine of every lane (rad).
    #[inline(always)]
    pub fn sin_cos(self) -> (Self, Self) {
        // SAFETY: module documentation.
        unsafe {
            let near = _mm512_cmp_pd_mask::<_CMP_LT_OQ>(_mm512_abs_pd(self.0), _mm512_set1_pd(LIMIT));
            if near != 0xff {
                return self.far();
            }
            let (t, s, c) = reduced!(self, Self::splat);
            let n = _mm512_castpd_si512(t.0);
            let swap = _mm512_test_epi64_mask(n, _mm512_set1_epi64(1));
            let a = _mm512_mask_blend_pd(swap, s.0, c.0);
            let b = _mm512_mask_blend_pd(swap, c.0, s.0);
            (Self(flipped8(n, a)), Self(flipped8(_mm512_add_epi64(n, _mm512_set1_epi64(1)), b)))
        }
    }
}

impl Avx2x4 {
    /// Sine and cosine of every lane (rad).
    #[inline(always)]
    pub fn sin_cos(self) -> (Self, Self) {
        // SAFETY: module documentation.
        unsafe {
            let abs = _mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0);
            let near = _mm256_cmp_pd::<_CMP_LT_OQ>(abs, _mm256_set1_pd(LIMIT));
            if _mm256_movemask_pd(near) != 0xf {
                return self.far();
            }
            let (t, s, c) = reduced!(self, Self::splat);
            let n = _mm256_castpd_si256(t.0);
            let swap = _mm256_castsi256_pd(_mm256_slli_epi64::<63>(n));
            let a = _mm256_blendv_pd(s.0, c.0, swap);
            let b = _mm256_blendv_pd(c.0, s.0, swap);
            (Self(flipped4(n, a)), Self(flipped4(_mm256_add_epi64(n, _mm256_set1_epi64x(1)), b)))
        }
    }
}
