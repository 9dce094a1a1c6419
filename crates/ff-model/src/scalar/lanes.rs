//! Running one computation with eight states, or eight parameter sets, at a time.

pub use crate::port::erased::LaneScalar;
use ff_lanes::Kernel;
pub use ff_lanes::{Isa, Lanes};

/// The narrowest lanes that this build has code for: portable ones, or those of AVX2 in a build for AVX2 alone
/// ([`Isa::is_available`]).
#[cfg(not(all(target_arch = "x86_64", ff_isa = "v3")))]
pub type Four = ff_lanes::Portable4;
/// The narrowest lanes that this build has code for: those of AVX2.
#[cfg(all(target_arch = "x86_64", ff_isa = "v3"))]
pub type Four = ff_lanes::Avx2x4;

/// A computation over lanes of a width that is chosen at run time.
///
/// Mark `run` `#[inline(always)]`: it is compiled once for each instruction set.
pub trait LaneTask {
    /// What it returns.
    type Output;
    /// Does it with `L::N` lanes.
    fn run<L: LaneScalar>(self) -> Self::Output;
}

struct With<K, L>(K, core::marker::PhantomData<L>);

impl<K: LaneTask, L: LaneScalar> Kernel for With<K, L> {
    type Output = K::Output;
    #[inline(always)]
    fn run(self) -> K::Output {
        self.0.run::<L>()
    }
}

/// Runs `task` with the lanes of `isa`; [`Isa::detect`] names the widest the machine has.
///
/// # Panics
/// If `isa` is not [available](Isa::is_available).
pub fn dispatch<K: LaneTask>(isa: Isa, task: K) -> K::Output {
    assert!(isa.is_available(), "{isa:?}: this machine does not have it, or this build has no code for it");
    #[cfg(all(target_arch = "x86_64", not(ff_isa = "v3")))]
    match isa {
        Isa::V4 => return enter::<K, ff_lanes::Avx512x8>(task),
        Isa::V3 => return enter::<K, ff_lanes::Avx2x4>(task),
        Isa::Portable => {}
    }
    enter::<K, Four>(task)
}

/// Runs `task` with one lane, in code for AVX2 and FMA where the machine has them: what a single state gains from
/// instructions that the program was not built for.
pub fn dispatch_one<K: LaneTask>(task: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    if Isa::detect() >= Isa::V3 {
        return enter::<K, ff_lanes::Avx2x1>(task);
    }
    enter::<K, f64>(task)
}

/// The same numbers in every lane.
pub fn splat<L: LaneScalar>(x: &[f64]) -> Vec<L> {
    x.iter().map(|&x| L::splat(x)).collect()
}

fn enter<K: LaneTask, L: LaneScalar>(task: K) -> K::Output {
    L::enter(With::<K, L>(task, core::marker::PhantomData))
}

/// Packs `L::N` numbers, one per lane, from slices given one per lane: element `i` of each.
///
/// # Panics
/// If a slice is shorter than `i + 1` or there are fewer slices than lanes.
#[inline(always)]
pub fn gather<L: LaneScalar>(from: &[&[f64]], i: usize) -> L {
    let mut a = [0.0; 8];
    for (a, s) in a.iter_mut().zip(&from[..L::N]) {
        *a = s[i];
    }
    L::load(&a)
}
