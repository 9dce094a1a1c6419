//! Numbers that carry one state or several: what the batched variants are written over.

use ff_model::scalar::LaneScalar;
use std::any::TypeId;

/// Appended to the names of functions measured over `T`, such as `.x8`; `.x1` is one state in code for AVX2 and FMA.
pub(crate) fn suffix<T: LaneScalar>() -> &'static str {
    match T::N {
        1 if TypeId::of::<T>() == TypeId::of::<f64>() => "",
        1 => ".x1",
        4 => ".x4",
        _ => ".x8",
    }
}

/// One number per lane; `x` gives that of lane `i`.
pub(crate) fn pack<T: LaneScalar>(x: impl Fn(usize) -> f64) -> T {
    let mut all = [0.0; 8];
    all[..T::N].iter_mut().enumerate().for_each(|(i, a)| *a = x(i));
    T::load(&all)
}
