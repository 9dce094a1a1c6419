//! `H = L^T D L` of a mass matrix with the sparsity of a tree, without fill-in.
//!
//! `H` has an entry only between a degree of freedom and its ancestors; eliminating from the leaves keeps it so
//! (Featherstone 2008, sec. 6.4 and table 6.3). Nothing allocates, nothing branches on values.

use ff_model::Scalar;

/// Factorises the row-major lower triangle `h` in place: `1/D` on the diagonal, `L` below it. `parent[i] < i`
/// is the parent of degree of freedom `i`, or `i` itself at the root.
///
/// # Errors
/// The degree of freedom whose pivot is not positive and finite.
#[inline(always)]
pub(crate) fn factor<T: Scalar>(h: &mut [T], n: usize, parent: &[usize]) -> Result<(), usize> {
    let mut bad = usize::MAX;
    for k in (0..n).rev() {
        let d = h[k * n + k];
        if !d.is_positive() {
            bad = k;
        }
        let inv = T::one() / d;
        h[k * n + k] = inv;
        let (upper, row) = h.split_at_mut(k * n);
        let mut i = k;
        while parent[i] != i {
            i = parent[i];
            let a = row[i] * inv;
            let mut j = i;
            let target = &mut upper[i * n..i * n + i + 1];
            loop {
                target[j] = (-a).mul_add(row[j], target[j]);
                if parent[j] == j {
                    break;
                }
                j = parent[j];
            }
        }
        let mut i = k;
        while parent[i] != i {
            i = parent[i];
            row[i] *= inv;
        }
    }
    if bad == usize::MAX { Ok(()) } else { Err(bad) }
}

/// Solves `L^T D L x = b` in place of `b`.
#[inline(always)]
pub(crate) fn solve<T: Scalar>(h: &[T], n: usize, parent: &[usize], b: &mut [T]) {
    for k in (0..n).rev() {
        let x = b[k];
        let mut i = k;
        while parent[i] != i {
            i = parent[i];
            b[i] = (-h[k * n + i]).mul_add(x, b[i]);
        }
    }
    for k in 0..n {
        let mut x = b[k] * h[k * n + k];
        let mut i = k;
        while parent[i] != i {
            i = parent[i];
            x = (-h[k * n + i]).mul_add(b[i], x);
        }
        b[k] = x;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn solves_with_the_sparsity_of_a_branched_tree() {
        // Two branches on a root of two: 0 - 1 - 2, and 3 - 4 on 1.
        let parent = [0, 0, 1, 1, 3];
        let mut h = [0.0; 25];
        let entries = [
            (0, 0, 4.1),
            (1, 0, 0.7),
            (1, 1, 3.3),
            (2, 0, -0.4),
            (2, 1, 0.9),
            (2, 2, 2.6),
            (3, 0, 0.3),
            (3, 1, -0.8),
            (3, 3, 2.9),
            (4, 0, 0.2),
            (4, 1, 0.5),
            (4, 3, -0.6),
            (4, 4, 1.8),
        ];
        let mut full = [[0.0; 5]; 5];
        for (i, j, x) in entries {
            h[5 * i + j] = x;
            (full[i][j], full[j][i]) = (x, x);
        }
        let want = [0.3, -1.2, 0.8, 1.7, -0.5];
        let mut b: [f64; 5] = core::array::from_fn(|i| (0..5).map(|j| full[i][j] * want[j]).sum());
        factor(&mut h, 5, &parent).unwrap();
        solve(&h, 5, &parent, &mut b);
        for i in 0..5 {
            assert_relative_eq!(b[i], want[i], max_relative = 1e-13);
        }
        let mut bad = [1.0, 0.0, 2.0, 1.0];
        assert_eq!(factor(&mut bad, 2, &[0, 0]), Err(0));
    }
}
