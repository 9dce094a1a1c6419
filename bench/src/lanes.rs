//! Numbers that carry one state or several: what the batched variants are written over.

use ff_model::LaneScalar;

/// Appended to the names of functions measured over `T`, such as `.x8`.
pub(crate) fn suffix<T: LaneScalar>() -> &'static str {
    match T::N {
        1 => "",
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
