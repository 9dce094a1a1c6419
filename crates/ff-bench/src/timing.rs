//! Median and spread of repeated runs, as `peers/src/bench.hpp` takes them.

use std::hint::black_box;
use std::time::Instant;

/// Nanoseconds per state over the repetitions.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub(crate) struct Timing {
    pub(crate) n: usize,
    pub(crate) reps: usize,
    pub(crate) median_ns: f64,
    pub(crate) min_ns: f64,
    pub(crate) max_ns: f64,
    pub(crate) p90_ns: f64,
    pub(crate) checksum: f64,
}

/// Repetitions that are run first and not counted.
const WARM_UP: usize = 3;

/// Times `f(0..calls)`; each call does the work of `lanes` states. What `f` returns is summed, so that no call can be
/// left out.
pub(crate) fn time(calls: usize, lanes: usize, reps: usize, mut f: impl FnMut(usize) -> f64) -> Timing {
    let n = calls * lanes;
    let mut ns = Vec::with_capacity(reps);
    let mut sink = 0.0;
    for rep in 0..WARM_UP + reps {
        let start = Instant::now();
        for i in 0..calls {
            sink += f(black_box(i));
        }
        let taken = start.elapsed();
        if rep >= WARM_UP {
            ns.push(taken.as_secs_f64() * 1e9 / n as f64);
        }
    }
    ns.sort_by(f64::total_cmp);
    Timing {
        n,
        reps,
        median_ns: ns[reps / 2],
        min_ns: ns[0],
        max_ns: ns[reps - 1],
        p90_ns: ns[reps * 9 / 10],
        checksum: sink / (WARM_UP + reps) as f64,
    }
}
