use super::*;

/// True on a machine with these instructions, in a build with code for them; else the test is printed as skipped on them, or fails where
/// `FF_REQUIRE_ISA` (`v3` or `v4`) requires them. `ff_testkit::isa` does the same for the crates above this one.
#[track_caller]
fn enabled(isa: Isa) -> bool {
    if isa.is_available() {
        return true;
    }
    let required = match std::env::var("FF_REQUIRE_ISA").as_deref() {
        Ok("v3") => Isa::V3,
        Ok("v4") => Isa::V4,
        _ => Isa::Portable,
    };
    assert!(isa > required, "{isa:?}, which FF_REQUIRE_ISA requires, is not available");
    let test = std::thread::current().name().unwrap_or("a test").to_owned();
    eprintln!("SKIPPED {test} on {isa:?}: not available here ({})", core::panic::Location::caller());
    false
}

/// Arguments over many quadrants, both signs, and beyond the limit of the reduction.
fn arguments() -> Vec<f64> {
    let mut x: Vec<f64> = (0..20_000).map(|i| (i as f64 - 9_876.5) * 0.013_7).collect();
    x.extend((0..4_000).map(|i| (f64::from(i) - 1_999.5) * 493.17));
    x.extend((1..400).map(|i| f64::from(i) * core::f64::consts::FRAC_PI_4));
    x.extend([1e-300, -1e-9, 0.0, -0.0, 3.3e6, -8.1e12]);
    x.resize(x.len().next_multiple_of(8), 0.7);
    x
}

struct Trig<'a, L: Lanes>(&'a [f64], fn(L) -> (L, L));
impl<L: Lanes> Kernel for Trig<'_, L> {
    type Output = f64;
    #[inline(always)]
    fn run(self) -> f64 {
        let mut worst = 0.0f64;
        for x in self.0.chunks_exact(L::N) {
            let (s, c) = (self.1)(L::load(x));
            for i in 0..L::N {
                let (es, ec) = x[i].sin_cos();
                worst = worst.max((s.lane(i) - es).abs()).max((c.lane(i) - ec).abs());
            }
        }
        worst
    }
}

#[test]
fn sine_and_cosine_are_those_of_the_library() {
    let x = arguments();
    let scalar = x
        .iter()
        .map(|&x| (sin_cos(x), x.sin_cos()))
        .fold(0.0f64, |w, (a, b)| w.max((a.0 - b.0).abs()).max((a.1 - b.1).abs()));
    assert!(scalar < 2.3e-16, "scalar {scalar:e}");
    assert!(Trig(&x, Portable4::sin_cos).run() < 2.3e-16);
    #[cfg(target_arch = "x86_64")]
    {
        if enabled(Isa::V3) {
            assert!(Avx2x4::enter(Trig(&x, Avx2x4::sin_cos)) < 2.3e-16);
        }
        if enabled(Isa::V4) {
            assert!(Avx512x8::enter(Trig(&x, Avx512x8::sin_cos)) < 2.3e-16);
        }
    }
    assert!(sin_cos(f64::NAN).0.is_nan() && sin_cos(f64::INFINITY).1.is_nan());
}

struct Arithmetic<L>(core::marker::PhantomData<L>);
impl<
    L: Lanes
        + core::ops::Add<Output = L>
        + core::ops::Sub<Output = L>
        + core::ops::Mul<Output = L>
        + core::ops::Div<Output = L>
        + core::ops::Neg<Output = L>,
> Kernel for Arithmetic<L>
{
    type Output = f64;
    #[inline(always)]
    fn run(self) -> f64 {
        let x = [1.3, -0.4, 2.7, 0.9, -3.1, 0.2, 1.7, -0.6];
        let y = [0.3, 1.4, -0.7, 2.9, 1.1, -0.8, 0.5, 3.6];
        let (a, b) = (L::load(&x), L::load(&y));
        let z = -((a + b) * a - b / a).mul_add(b, L::splat(0.1));
        let mut out = [0.0; 8];
        z.store(&mut out);
        (0..L::N).map(|i| (out[i] + ((x[i] + y[i]) * x[i] - y[i] / x[i]) * y[i] + 0.1).abs()).fold(0.0, f64::max)
    }
}

#[test]
fn lanes_compute_what_numbers_do() {
    use core::marker::PhantomData as P;
    assert!(Portable4::enter(Arithmetic::<Portable4>(P)) < 1e-14);
    #[cfg(target_arch = "x86_64")]
    {
        if enabled(Isa::V3) {
            assert!(Avx2x4::enter(Arithmetic::<Avx2x4>(P)) < 1e-14);
        }
        if enabled(Isa::V4) {
            assert!(Avx512x8::enter(Arithmetic::<Avx512x8>(P)) < 1e-14);
        }
    }
}

#[test]
fn lanes_are_set_one_by_one() {
    let mut v = Portable4::splat(0.4);
    v.set_lane(2, -1.7);
    assert_eq!((v.lane(1), v.lane(2)), (0.4, -1.7));
    assert_eq!(Isa::V4.lanes(), 8);
    assert!(Isa::detect() >= Isa::Portable);
}

struct Transpose<L>(core::marker::PhantomData<L>);
impl<L: Lanes> Kernel for Transpose<L> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let x = |i: usize, j: usize| (10 * i + j) as f64 + 0.5;
        for stride in [1, 3] {
            let mut rows = [L::splat(-3.0); 3 * WIDEST];
            for i in 0..L::N {
                (0..L::N).for_each(|j| rows[i * stride].set_lane(j, x(i, j)));
            }
            let columns = L::transpose(&rows, stride);
            for (i, column) in columns[..L::N].iter().enumerate() {
                (0..L::N).for_each(|j| assert_eq!(column.lane(j), x(j, i)));
            }
        }
    }
}

#[test]
fn rows_become_columns() {
    Transpose::<f64>(core::marker::PhantomData).run();
    Transpose::<Portable4>(core::marker::PhantomData).run();
    #[cfg(target_arch = "x86_64")]
    {
        if enabled(Isa::V3) {
            Avx2x4::enter(Transpose::<Avx2x4>(core::marker::PhantomData));
        }
        if enabled(Isa::V4) {
            Avx512x8::enter(Transpose::<Avx512x8>(core::marker::PhantomData));
        }
    }
}
