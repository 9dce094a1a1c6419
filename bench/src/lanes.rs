//! Numbers that carry one state or several: what the batched variants are written over.

use crate::functions::{Function, Runner};
use ff_model::ModelScalar;

/// A scalar that holds one number per state.
pub(crate) trait Lanes: ModelScalar {
    /// States carried at once.
    const LANES: usize;
    /// Appended to the names of functions measured over this type, such as `.x8`.
    const SUFFIX: &'static str;
    /// What exists over this type.
    const FUNCTIONS: &'static [Function];
    /// One number per lane; `x` gives that of lane `i`.
    fn pack(x: impl Fn(usize) -> f64) -> Self;
    /// The number of lane `i`.
    fn lane(&self, i: usize) -> f64;
    /// The regressor of state `i` into `runner.y`, where it exists over this type.
    fn regressor(runner: &mut Runner<'_, Self>, i: usize);
}

impl Lanes for f64 {
    const LANES: usize = 1;
    const SUFFIX: &'static str = "";
    const FUNCTIONS: &'static [Function] = &Function::ALL;
    fn pack(x: impl Fn(usize) -> f64) -> Self {
        x(0)
    }
    #[inline(always)]
    fn lane(&self, _: usize) -> f64 {
        *self
    }
    #[inline(always)]
    fn regressor(r: &mut Runner<'_, Self>, i: usize) {
        ff_dynamics::regressor(r.model, &r.params, &r.set.states[i], &r.set.a[i], &mut r.work, &mut r.y);
    }
}

// PLACE FOR LANES of 4 and 8 states: `impl Lanes for F64x4` and `F64x8` with SUFFIX ".x4" and ".x8", and their lines in
// `micro::one` and `count::run`.
