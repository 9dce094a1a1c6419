//! Numbers that carry one state or several: what the batched variants are written over.

use ff_model::ModelScalar;

/// A scalar that holds one number per state.
pub(crate) trait Lanes: ModelScalar {
    /// States carried at once.
    const LANES: usize;
    /// Appended to the names of functions measured over this type.
    const SUFFIX: &'static str;
    /// One number per lane; `x` gives that of lane `i`.
    fn pack(x: impl Fn(usize) -> f64) -> Self;
    /// The number of lane `i`.
    fn lane(&self, i: usize) -> f64;
}

impl Lanes for f64 {
    const LANES: usize = 1;
    const SUFFIX: &'static str = "";
    fn pack(x: impl Fn(usize) -> f64) -> Self {
        x(0)
    }
    #[inline(always)]
    fn lane(&self, _: usize) -> f64 {
        *self
    }
}
