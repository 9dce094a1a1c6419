//! A finely sampled motion as sensors sample it whose torques come late.

use ff_dynamics::Trace;
use nalgebra::DMatrix;

/// Every `per`-th sample of a trace; torques are those of `late` samples before, those of the first sample where there are none yet.
/// What no sensor reads is left as it was.
pub(crate) fn delayed(fine: &Trace, per: usize, late: usize) -> Trace {
    let samples = (fine.q.nrows() - 1) / per + 1;
    let rows = |m: &DMatrix<f64>, late: usize| {
        DMatrix::from_fn(samples, m.ncols(), |i, j| m[((per * i).saturating_sub(late), j)])
    };
    Trace {
        dt: fine.dt * per as f64,
        q: rows(&fine.q, 0),
        tau: rows(&fine.tau, late),
        twist: rows(&fine.twist, 0),
        ..fine.clone()
    }
}
