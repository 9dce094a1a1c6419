//! `A = L D L^T` of small symmetric positive definite matrices over any scalar, in place, without
//! allocating and without branching on values (so that duals and lanes pass through).

use ff_model::Scalar;

/// Factorises the row-major `n x n` matrix `a` in place: unit lower triangle `L` below the diagonal, `D` on
/// it. Only the lower triangle is read.
///
/// Returns false when a pivot is not positive and finite (the matrix is then not positive definite and the
/// contents are meaningless).
#[inline(always)]
pub fn factor<T: Scalar>(a: &mut [T], n: usize) -> bool {
    let mut ok = true;
    for j in 0..n {
        let mut d = a[j * n + j];
        for k in 0..j {
            let l = a[j * n + k];
            d -= l * l * a[k * n + k];
        }
        ok &= d.is_positive();
        a[j * n + j] = d;
        let inv = T::one() / d;
        for i in j + 1..n {
            let mut s = a[i * n + j];
            for k in 0..j {
                s -= a[i * n + k] * a[j * n + k] * a[k * n + k];
            }
            a[i * n + j] = s * inv;
        }
    }
    ok
}

/// Solves `L D L^T x = b` in place of `b` with a factorisation from [`factor`].
#[inline(always)]
pub fn solve<T: Scalar>(l: &[T], n: usize, b: &mut [T]) {
    for i in 0..n {
        let mut s = b[i];
        for k in 0..i {
            s -= l[i * n + k] * b[k];
        }
        b[i] = s;
    }
    for i in (0..n).rev() {
        let mut s = b[i] / l[i * n + i];
        for k in i + 1..n {
            s -= l[k * n + i] * b[k];
        }
        b[i] = s;
    }
}

/// [`factor`] with `1/D` on the diagonal, for many right-hand sides. Only the lower triangle is read.
#[inline(always)]
pub(crate) fn factor_inverted<T: Scalar>(a: &mut [T], n: usize) -> bool {
    let ok = factor(a, n);
    for i in 0..n {
        a[i * n + i] = T::one() / a[i * n + i];
    }
    ok
}

/// Solves with a factorisation from [`factor_inverted`].
#[inline(always)]
pub(crate) fn solve_inverted<T: Scalar>(l: &[T], n: usize, b: &mut [T]) {
    let (l, b) = (&l[..n * n], &mut b[..n]);
    for i in 1..n {
        let mut s = b[i];
        for (&l, &x) in l[i * n..i * n + i].iter().zip(&*b) {
            s = (-l).mul_add(x, s);
        }
        b[i] = s;
    }
    for i in 0..n {
        b[i] *= l[i * n + i];
    }
    // Row by row, so that rows of `l` are read along.
    for i in (1..n).rev() {
        let x = -b[i];
        for (&l, y) in l[i * n..i * n + i].iter().zip(&mut b[..i]) {
            *y = l.mul_add(x, *y);
        }
    }
}

/// [`factor`] for a size known to the compiler, with `1/D` on the diagonal. Only the lower triangle is read.
#[inline(always)]
pub(crate) fn factor_fixed<T: Scalar, const N: usize>(a: &mut [[T; N]; N]) -> bool {
    let mut ok = true;
    for j in 0..N {
        let mut v = [T::zero(); N];
        v[..j].copy_from_slice(&a[j][..j]); // row j still holds L D
        let mut d = a[j][j];
        for k in 0..j {
            let l = v[k] * a[k][k];
            d = (-l).mul_add(v[k], d);
            a[j][k] = l;
        }
        ok &= d.is_positive();
        a[j][j] = T::one() / d;
        for i in j + 1..N {
            let mut s = a[i][j];
            for k in 0..j {
                s = (-a[i][k]).mul_add(a[j][k], s);
            }
            a[i][j] = s;
        }
    }
    ok
}

/// Solves with a factorisation from [`factor_fixed`].
#[inline(always)]
pub(crate) fn solve_fixed<T: Scalar, const N: usize>(l: &[[T; N]; N], b: &mut [T; N]) {
    for i in 0..N {
        for k in 0..i {
            b[i] = (-l[i][k]).mul_add(b[k], b[i]);
        }
    }
    for i in (0..N).rev() {
        let mut s = b[i] * l[i][i];
        for k in i + 1..N {
            s = (-l[k][i]).mul_add(b[k], s);
        }
        b[i] = s;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn solves_and_reports_indefinite_matrices() {
        let a0 = [4.0, 1.2, -0.7, 1.2, 3.1, 0.4, -0.7, 0.4, 2.2];
        let mut a = a0;
        assert!(factor(&mut a, 3));
        let mut b = [0.3, -1.1, 0.8];
        solve(&a, 3, &mut b);
        for i in 0..3 {
            let r: f64 = (0..3).map(|j| a0[3 * i + j] * b[j]).sum();
            assert_relative_eq!(r, [0.3, -1.1, 0.8][i], max_relative = 1e-14);
        }
        let mut f = [[4.0, 1.2, -0.7], [1.2, 3.1, 0.4], [-0.7, 0.4, 2.2]];
        assert!(factor_fixed(&mut f));
        let mut x = [0.3, -1.1, 0.8];
        solve_fixed(&f, &mut x);
        for i in 0..3 {
            assert_relative_eq!(x[i], b[i], max_relative = 1e-14);
        }
        assert!(!factor(&mut [1.0, 2.0, 2.0, 1.0], 2));
        assert!(!factor(&mut [f64::NAN], 1));
    }
}
