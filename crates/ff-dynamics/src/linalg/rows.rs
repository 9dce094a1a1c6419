//! Rows of a product, a few at a time, so that what they are summed in stays in registers.

use ff_model::scalar::ModelScalar;

/// Something to be done for rows of a product, a few at a time.
pub(crate) trait RowTask {
    /// For rows `from..from + R`: they and the numbers of a column stay in registers.
    fn rows<const R: usize>(&mut self, from: usize);
}

/// Does `task` for all rows, in parts as equal as can be: at least four products should be under way at any time, and what
/// they are summed in has to fit the registers, `W` for each row.
#[inline(always)]
pub(crate) fn by_rows<const W: usize>(rows: core::ops::Range<usize>, task: &mut impl RowTask) {
    let most = if W == 1 { 8 } else { 4 };
    let mut at = rows.start;
    while at < rows.end {
        let left = rows.end - at;
        let now = if left > most && left < 2 * most { left.div_ceil(2) } else { left.min(most) };
        match now {
            1 => task.rows::<1>(at),
            2 => task.rows::<2>(at),
            3 => task.rows::<3>(at),
            5 if W == 1 => task.rows::<5>(at),
            6 if W == 1 => task.rows::<6>(at),
            7 if W == 1 => task.rows::<7>(at),
            8 if W == 1 => task.rows::<8>(at),
            _ => task.rows::<4>(at),
        }
        at += now;
    }
}

/// Adds rows `from..from + R` of `G x`; `G` has `n` rows and lies column by column. Its elements are numbers, the same for all lanes
/// (`lift` is `splat`), or lanes themselves (`identity`).
#[inline(always)]
pub(crate) fn accumulate<T: ModelScalar, G: Copy, const R: usize, const W: usize>(
    s: &mut [[T; W]; R],
    lift: impl Fn(G) -> T,
    gain: &[G],
    n: usize,
    from: usize,
    x: &[[T; W]],
) {
    for (x, g) in x.iter().zip(gain.chunks_exact(n)) {
        let g = &g[from..from + R];
        for r in 0..R {
            let k = lift(g[r]);
            for w in 0..W {
                s[r][w] = fma(k, x[w], s[r][w]);
            }
        }
    }
}

/// Copies the first `R` of a few vectors. Not a loop, of which the compiler would make a call of `memcpy`.
#[inline(always)]
pub(crate) fn copy<T: Copy, const R: usize>(from: &[T], to: &mut [T]) {
    const { assert!(R <= 8) };
    let (from, to) = (&from[..R], &mut to[..R]);
    if R > 0 {
        to[0] = from[0];
    }
    if R > 1 {
        to[1] = from[1];
    }
    if R > 2 {
        to[2] = from[2];
    }
    if R > 3 {
        to[3] = from[3];
    }
    if R > 4 {
        to[4] = from[4];
    }
    if R > 5 {
        to[5] = from[5];
    }
    if R > 6 {
        to[6] = from[6];
    }
    if R > 7 {
        to[7] = from[7];
    }
}

/// `a b + c`, whichever trait's method of that name is meant.
#[inline(always)]
pub(crate) fn fma<T: ModelScalar>(a: T, b: T, c: T) -> T {
    a.mul_add(b, c)
}
