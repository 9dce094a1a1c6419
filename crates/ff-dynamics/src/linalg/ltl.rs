//! Solves with a mass matrix of the sparsity of a tree, `H = L^T D L` without fill-in.
//!
//! `H` has an entry only between a degree of freedom and its ancestors; eliminating from the leaves keeps it so
//! (Featherstone 2008, sec. 6.4 and table 6.3). A floating base is an ancestor of everything: its six columns are
//! treated as one block of a size the compiler knows, and what is left at the end is 6 x 6. Nothing allocates, nothing
//! branches on values.

use crate::linalg::ldl;
use ff_model::Scalar;

/// Parent of a degree of freedom that has none besides the base.
pub(crate) const ROOT: usize = usize::MAX;

/// Solves `H x = b` in place of `b`; `h`, the row-major lower triangle, is overwritten by its factors.
///
/// `parent[i] < i` is the parent of degree of freedom `i` among joints and passive coordinates, or [`ROOT`]; entries of
/// the base, `nb` of them, are not read.
///
/// # Errors
/// The degree of freedom whose pivot is not positive and finite; 0 for any of the base.
#[inline(always)]
pub(crate) fn solve<T: Scalar>(h: &mut [T], nb: usize, parent: &[usize], b: &mut [T]) -> Result<(), usize> {
    let n = parent.len();
    let (h, b) = (&mut h[..n * n], &mut b[..n]);
    if nb == 6 { eliminate::<T, 6>(h, parent, b) } else { eliminate::<T, 0>(h, parent, b) }
}

/// Columns of the base in a row.
#[inline(always)]
fn base<T: Scalar, const B: usize>(row: &[T]) -> [T; B] {
    let mut out = [T::zero(); B];
    out.copy_from_slice(&row[..B]);
    out
}

/// `y -= a x`.
#[inline(always)]
fn subtract<T: Scalar, const B: usize>(a: T, x: &[T; B], y: &mut [T]) {
    let y = &mut y[..B];
    for c in 0..B {
        y[c] = (-a).mul_add(x[c], y[c]);
    }
}

#[inline(always)]
fn eliminate<T: Scalar, const B: usize>(h: &mut [T], parent: &[usize], b: &mut [T]) -> Result<(), usize> {
    let (n, mut bad) = (parent.len(), None);
    let mut core = [[T::zero(); B]; B];
    for (i, row) in core.iter_mut().enumerate() {
        row[..=i].copy_from_slice(&h[i * n..=i * n + i]);
    }
    let mut rest = base::<T, B>(b);
    for k in (B..n).rev() {
        let (upper, row) = h.split_at_mut(k * n);
        let row = &mut row[..n];
        if !row[k].is_positive() {
            bad = Some(k);
        }
        let inv = T::one() / row[k];
        row[k] = inv;
        let (own, x) = (base::<T, B>(row), b[k]);
        let mut i = parent[k];
        while i < n {
            let a = row[i] * inv;
            let target = &mut upper[i * n..][..n];
            subtract(a, &own, target);
            // The ancestors of an ancestor are its own.
            let mut j = i;
            while j < n {
                target[j] = (-a).mul_add(row[j], target[j]);
                j = parent[j];
            }
            row[i] = a;
            b[i] = (-a).mul_add(x, b[i]);
            i = parent[i];
        }
        let mut scaled = [T::zero(); B];
        for c in 0..B {
            scaled[c] = own[c] * inv;
            row[c] = scaled[c];
        }
        subtract(x, &scaled, &mut rest);
        for i in 0..B {
            for j in 0..=i {
                core[i][j] = (-scaled[i]).mul_add(own[j], core[i][j]);
            }
        }
    }
    if B > 0 && !ldl::factor_fixed(&mut core) {
        bad = Some(0);
    }
    ldl::solve_fixed(&core, &mut rest);
    b[..B].copy_from_slice(&rest);
    for k in B..n {
        let row = &h[k * n..][..n];
        let mut x = b[k] * row[k];
        for c in 0..B {
            x = (-row[c]).mul_add(rest[c], x);
        }
        let mut i = parent[k];
        while i < n {
            x = (-row[i]).mul_add(b[i], x);
            i = parent[i];
        }
        b[k] = x;
    }
    bad.map_or(Ok(()), Err)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// The matrix of a tree of nine: two branches and an appendage of two, on a base of `nb`; and its lower triangle.
    fn system(nb: usize) -> (Vec<usize>, [[f64; 9]; 9], Vec<f64>) {
        let parent = [ROOT, 0, 1, 2, 3, 4, 5, 5, 7].map(|p| if p < nb { ROOT } else { p });
        let related = |mut i: usize, j: usize| loop {
            if i == j || j < nb {
                return true;
            }
            if parent[i] == ROOT {
                return false;
            }
            i = parent[i];
        };
        let mut full = [[0.0; 9]; 9];
        for i in 0..9 {
            for j in (0..=i).filter(|&j| related(i, j)) {
                let x = (0.83 * (i * 9 + j) as f64).sin() + if i == j { 9.1 } else { 0.0 };
                (full[i][j], full[j][i]) = (x, x);
            }
        }
        // What must not be read is not a number.
        let mut h = vec![f64::NAN; 81];
        for i in 0..9 {
            for j in (0..=i).filter(|&j| related(i, j)) {
                h[9 * i + j] = full[i][j];
            }
        }
        (parent.to_vec(), full, h)
    }

    #[test]
    fn solves_with_the_sparsity_of_a_branched_tree() {
        for nb in [0, 6] {
            let (parent, full, mut h) = system(nb);
            let want = [0.3, -1.2, 0.8, 1.7, -0.5, 0.9, -0.7, 1.1, 0.4];
            let mut b: [f64; 9] = core::array::from_fn(|i| (0..9).map(|j| full[i][j] * want[j]).sum());
            solve(&mut h, nb, &parent, &mut b).unwrap();
            for i in 0..9 {
                assert_relative_eq!(b[i], want[i], max_relative = 1e-12);
            }
        }
    }

    #[test]
    fn names_the_pivot_that_is_not_positive() {
        for (nb, at, named) in [(0, 3, 3), (6, 7, 7), (6, 4, 0)] {
            let (parent, _, mut h) = system(nb);
            h[10 * at] = -40.0;
            assert_eq!(solve(&mut h, nb, &parent, &mut [1.0; 9]), Err(named));
        }
    }
}
