//! Vectors of `f64` for the fastest instruction set the machine has, chosen at run time.
//!
//! A program built without CPU flags runs on any x86-64, that is with two-wide vectors and without fused
//! multiply-add. The dynamics of this project are written over a number type, so that eight states can go
//! through them at once, one per lane; this crate has the number types and the run-time choice:
//!
//! | type | lanes | instructions |
//! |---|---|---|
//! | `Avx512x8` | 8 | AVX-512 F, DQ, VL, BW |
//! | `Avx2x4` | 4 | AVX2 and FMA (x86-64-v3) |
//! | `Avx2x1` | 1 | the same: one state, fused |
//! | [`Portable4`] | 4 | whatever the program was built for |
//!
//! An instruction set applies to a *function*, and is not inherited by the functions it calls unless they are
//! inlined. Code over lanes therefore runs inside [`Enter::enter`], as a [`Kernel`] whose `run`, and
//! everything it calls, is `#[inline(always)]`. A call that was not inlined is slow, not wrong.
//!
//! The vector types of the two instruction sets are hidden from the documentation on purpose: a value of
//! them must exist only on a machine that has the instructions, and [`Isa::detect`] is how one knows. They
//! are reached through a `match` on [`Isa`] (`ff_model::scalar::lanes::dispatch`). See
//! `docs/decisions/0006-lanes.md` for why this crate, alone, contains unsafe code.

mod portable;
mod trig;
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
mod x86;

pub use portable::Portable4;
pub use trig::sin_cos;
#[cfg(target_arch = "x86_64")]
#[doc(hidden)]
pub use x86::{Avx2x1, Avx2x4, Avx512x8};

/// A computation that can be compiled for several instruction sets.
///
/// `run` must be `#[inline(always)]`, and so must what it calls: see the crate documentation.
///
/// ```
/// struct Energy<'a>(&'a [f64]);
///
/// impl ff_lanes::Kernel for Energy<'_> {
///     type Output = f64;
///     #[inline(always)]
///     fn run(self) -> f64 {
///         self.0.iter().map(|v| 0.5 * v * v).sum()
///     }
/// }
/// assert_eq!(ff_lanes::widest(Energy(&[3.0, 4.0, 2.0])), 14.5);
/// ```
pub trait Kernel {
    /// What it returns.
    type Output;
    /// Does it.
    fn run(self) -> Self::Output;
}

/// A number type that knows which instructions it needs.
///
/// ```
/// use ff_lanes::{Enter, Kernel, Lanes, Portable4};
///
/// struct Norm<L>(L, L);
/// impl<L: Lanes + std::ops::Mul<Output = L>> Kernel for Norm<L> {
///     type Output = L;
///     #[inline(always)]
///     fn run(self) -> L {
///         self.0.mul_add(self.0, self.1 * self.1)
///     }
/// }
/// let (x, y) = (Portable4::load(&[3.0, 5.0, 8.0, 7.0]), Portable4::load(&[4.0, 12.0, 15.0, 24.0]));
/// assert_eq!(Portable4::enter(Norm(x, y)), Portable4::load(&[25.0, 169.0, 289.0, 625.0]));
/// assert_eq!(f64::enter(Norm(3.0, 4.0)), 25.0); // the same code, one lane
/// ```
pub trait Enter {
    /// Runs `kernel` in a function compiled for the instructions of this type.
    ///
    /// # Panics
    /// If the machine does not have them.
    fn enter<K: Kernel>(kernel: K) -> K::Output;
}

impl Enter for f64 {
    #[inline(always)]
    fn enter<K: Kernel>(kernel: K) -> K::Output {
        kernel.run()
    }
}

/// `N` numbers that go through the same arithmetic together.
///
/// ```
/// use ff_lanes::{Lanes, Portable4};
///
/// // Over any number of lanes: the sum of a column whose length is a multiple of it.
/// fn sum<L: Lanes + std::ops::AddAssign>(x: &[f64]) -> f64 {
///     let mut s = L::splat(0.0);
///     x.chunks_exact(L::N).for_each(|part| s += L::load(part));
///     (0..L::N).map(|i| s.lane(i)).sum()
/// }
/// let x = [2.0, -3.0, 5.0, 7.0, 11.0, 13.0, -17.0, 19.0];
/// assert_eq!((sum::<f64>(&x), sum::<Portable4>(&x)), (37.0, 37.0));
/// ```
pub trait Lanes: Copy + Enter {
    /// How many.
    const N: usize;
    /// All lanes the same.
    fn splat(x: f64) -> Self;
    /// From the first `N` numbers.
    ///
    /// # Panics
    /// If there are fewer.
    fn load(x: &[f64]) -> Self;
    /// Into the first `N` places.
    ///
    /// # Panics
    /// If there are fewer.
    fn store(self, to: &mut [f64]);
    /// Lane `i`.
    ///
    /// # Panics
    /// If `i >= N`.
    fn lane(&self, i: usize) -> f64;
    /// Sets lane `i`.
    ///
    /// # Panics
    /// If `i >= N`.
    fn set_lane(&mut self, i: usize, x: f64);
    /// `self * b + c`, in one rounding where the instruction set has it.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// True when every lane is above zero and finite.
    fn all_positive(self) -> bool;
    /// The transposed matrix of rows `rows[0]`, `rows[stride]`, ..: lane `j` of row `i` becomes lane `i` of the `j`-th of
    /// the results, the first `N` of which are meant.
    ///
    /// # Panics
    /// If there are fewer than `N` rows.
    #[inline(always)]
    fn transpose(rows: &[Self], stride: usize) -> [Self; WIDEST] {
        let mut all = [[0.0; WIDEST]; WIDEST];
        for (i, to) in all[..Self::N].iter_mut().enumerate() {
            rows[i * stride].store(to);
        }
        let mut columns = [Self::splat(0.0); WIDEST];
        for (j, column) in columns[..Self::N].iter_mut().enumerate() {
            let mut x = [0.0; WIDEST];
            for i in 0..Self::N {
                x[i] = all[i][j];
            }
            *column = Self::load(&x);
        }
        columns
    }
}

/// Lanes of the widest type.
pub const WIDEST: usize = 8;

/// One lane: so that code over lanes also runs on plain numbers.
impl Lanes for f64 {
    const N: usize = 1;
    #[inline(always)]
    fn splat(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn load(x: &[f64]) -> Self {
        x[0]
    }
    #[inline(always)]
    fn store(self, to: &mut [f64]) {
        to[0] = self;
    }
    #[inline(always)]
    fn lane(&self, i: usize) -> f64 {
        assert!(i == 0);
        *self
    }
    #[inline(always)]
    fn set_lane(&mut self, i: usize, x: f64) {
        assert!(i == 0);
        *self = x;
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        if cfg!(target_feature = "fma") { f64::mul_add(self, b, c) } else { self * b + c }
    }
    #[inline(always)]
    fn all_positive(self) -> bool {
        self > 0.0 && self < f64::INFINITY
    }
}

/// An instruction set of the list in the crate documentation.
///
/// ```
/// use ff_lanes::Isa;
///
/// // Runs of an ensemble go through the dynamics in groups of this size.
/// let isa = Isa::detect();
/// assert_eq!(isa.lanes(), if isa == Isa::V4 { 8 } else { 4 });
/// assert!(isa >= Isa::Portable);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Isa {
    /// What the program was built for.
    Portable,
    /// AVX2 and FMA: x86-64-v3.
    V3,
    /// AVX-512 F, DQ, VL, BW: x86-64-v4.
    V4,
}

impl Isa {
    /// The widest that this machine has and this build has code for. The answer is cached; does not allocate.
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            if cfg!(not(ff_isa = "v3")) && x86::has_v4() {
                return Self::V4;
            }
            if x86::has_v3() {
                return Self::V3;
            }
        }
        Self::Portable
    }
    /// The set of the shortest vectors that hold `count` lanes, or that of the widest that this machine has: half as many lanes take less time
    /// (0.84 of it for the reduced dynamics on a machine with both). Does not allocate.
    pub fn holding(count: usize) -> Self {
        let widest = Self::detect();
        if widest == Self::V4 && count <= Self::V3.lanes() { Self::V3 } else { widest }
    }
    /// Whether this machine has it and this build has code for it. A build with `--cfg ff_isa="v3"` has code for AVX2 alone, which
    /// saves a third of what is compiled and is how the first tier of continuous integration is built.
    pub fn is_available(self) -> bool {
        if cfg!(all(target_arch = "x86_64", ff_isa = "v3")) { self == Self::V3 } else { self <= Self::detect() }
    }
    /// Lanes of the vector type of this set.
    pub fn lanes(self) -> usize {
        if self == Self::V4 { 8 } else { 4 }
    }
}

/// Runs `kernel`, plain `f64` code with loops a compiler can vectorise, in a function compiled for the
/// widest instructions of this machine.
///
/// Results may differ from a plain call in the last bits where the code uses a fused multiply-add; code
/// without gives the same bits everywhere.
#[inline]
pub fn widest<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    {
        match Isa::detect() {
            #[cfg(not(ff_isa = "v3"))]
            Isa::V4 => return Avx512x8::enter(kernel),
            Isa::V3 => return Avx2x4::enter(kernel),
            _ => {}
        }
    }
    kernel.run()
}

/// Operators that every vector type gets from `add`, `sub`, `mul`, `div`, `neg` and `splat`.
macro_rules! operators {
    ($t:ty) => {
        impl core::ops::AddAssign for $t {
            #[inline(always)]
            fn add_assign(&mut self, o: Self) {
                *self = *self + o;
            }
        }
        impl core::ops::SubAssign for $t {
            #[inline(always)]
            fn sub_assign(&mut self, o: Self) {
                *self = *self - o;
            }
        }
        impl core::ops::MulAssign for $t {
            #[inline(always)]
            fn mul_assign(&mut self, o: Self) {
                *self = *self * o;
            }
        }
        impl core::ops::DivAssign for $t {
            #[inline(always)]
            fn div_assign(&mut self, o: Self) {
                *self = *self / o;
            }
        }
        impl num_traits::Zero for $t {
            #[inline(always)]
            fn zero() -> Self {
                <Self as $crate::Lanes>::splat(0.0)
            }
            fn is_zero(&self) -> bool {
                *self == <Self as $crate::Lanes>::splat(0.0)
            }
        }
        impl num_traits::One for $t {
            #[inline(always)]
            fn one() -> Self {
                <Self as $crate::Lanes>::splat(1.0)
            }
        }
        impl PartialEq for $t {
            /// True when every lane is equal.
            fn eq(&self, o: &Self) -> bool {
                (0..<Self as $crate::Lanes>::N).all(|i| $crate::Lanes::lane(self, i) == $crate::Lanes::lane(o, i))
            }
        }
        impl core::fmt::Debug for $t {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                f.debug_list().entries((0..<Self as $crate::Lanes>::N).map(|i| $crate::Lanes::lane(self, i))).finish()
            }
        }
    };
}
pub(crate) use operators;

/// Compiles the example of `README.md`.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

#[cfg(test)]
mod tests;
