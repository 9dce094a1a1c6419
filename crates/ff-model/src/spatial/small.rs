//! Products of 3-vectors and 3 x 3 matrices, unrolled and inlined for every scalar.
//!
//! nalgebra sends these through its general matrix-vector kernels, which the compiler does not inline for
//! dual numbers: they were a third of the time of a sensitivity run (`docs/decisions/0003-small-products.md`).

use crate::scalar::traits::Scalar;
use nalgebra::{Matrix3, Vector3};

/// `a b + c d + e f`.
#[inline(always)]
fn sum3<T: Scalar>(a: T, b: T, c: T, d: T, e: T, f: T) -> T {
    e.mul_add(f, c.mul_add(d, a * b))
}

/// `a + b`.
#[inline(always)]
pub fn add<T: Scalar>(a: &Vector3<T>, b: &Vector3<T>) -> Vector3<T> {
    Vector3::new(a.x + b.x, a.y + b.y, a.z + b.z)
}

/// `a - b`.
#[inline(always)]
pub fn sub<T: Scalar>(a: &Vector3<T>, b: &Vector3<T>) -> Vector3<T> {
    Vector3::new(a.x - b.x, a.y - b.y, a.z - b.z)
}

/// `k a`.
#[inline(always)]
pub fn scaled<T: Scalar>(a: &Vector3<T>, k: T) -> Vector3<T> {
    Vector3::new(a.x * k, a.y * k, a.z * k)
}

/// `m v`.
#[inline(always)]
pub fn mv<T: Scalar>(m: &Matrix3<T>, v: &Vector3<T>) -> Vector3<T> {
    let m = &m.data.0; // columns
    Vector3::new(
        sum3(m[0][0], v.x, m[1][0], v.y, m[2][0], v.z),
        sum3(m[0][1], v.x, m[1][1], v.y, m[2][1], v.z),
        sum3(m[0][2], v.x, m[1][2], v.y, m[2][2], v.z),
    )
}

/// `m^T v`.
#[inline(always)]
pub fn mtv<T: Scalar>(m: &Matrix3<T>, v: &Vector3<T>) -> Vector3<T> {
    let m = &m.data.0;
    Vector3::new(
        sum3(m[0][0], v.x, m[0][1], v.y, m[0][2], v.z),
        sum3(m[1][0], v.x, m[1][1], v.y, m[1][2], v.z),
        sum3(m[2][0], v.x, m[2][1], v.y, m[2][2], v.z),
    )
}

/// `a b`.
#[inline(always)]
pub fn mm<T: Scalar>(a: &Matrix3<T>, b: &Matrix3<T>) -> Matrix3<T> {
    let b = &b.data.0;
    let col = |j: usize| mv(a, &Vector3::new(b[j][0], b[j][1], b[j][2]));
    let (x, y, z) = (col(0), col(1), col(2));
    Matrix3::new(x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z)
}

/// `a x b`.
#[inline(always)]
pub fn cross<T: Scalar>(a: &Vector3<T>, b: &Vector3<T>) -> Vector3<T> {
    Vector3::new((-a.z).mul_add(b.y, a.y * b.z), (-a.x).mul_add(b.z, a.z * b.x), (-a.y).mul_add(b.x, a.x * b.y))
}

/// `a . b`.
#[inline(always)]
pub fn dot<T: Scalar>(a: &Vector3<T>, b: &Vector3<T>) -> T {
    sum3(a.x, b.x, a.y, b.y, a.z, b.z)
}

/// `r s r^T` for symmetric `s`; the result is symmetric to the last bit.
#[inline(always)]
pub fn rotate_sym<T: Scalar>(r: &Matrix3<T>, s: &Matrix3<T>) -> Matrix3<T> {
    let t = mm(r, s);
    let (t, r) = (&t.data.0, &r.data.0);
    let e = |i: usize, j: usize| sum3(t[0][i], r[0][j], t[1][i], r[1][j], t[2][i], r[2][j]);
    let (xx, xy, xz, yy, yz, zz) = (e(0, 0), e(0, 1), e(0, 2), e(1, 1), e(1, 2), e(2, 2));
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn products_are_those_of_nalgebra() {
        let a = Matrix3::new(0.3, -1.2, 0.7, 2.1, 0.4, -0.9, -0.5, 1.6, 1.1);
        let b = Matrix3::new(1.4, 0.2, -0.8, -0.3, 0.9, 2.2, 0.6, -1.7, 0.1);
        let s = b + b.transpose();
        let (u, v) = (Vector3::new(0.7, -0.2, 1.3), Vector3::new(-1.1, 0.5, 0.9));
        assert_relative_eq!(mv(&a, &u), a * u, epsilon = 1e-15);
        assert_relative_eq!(mtv(&a, &u), a.tr_mul(&u), epsilon = 1e-15);
        assert_relative_eq!(mm(&a, &b), a * b, epsilon = 1e-15);
        assert_relative_eq!(cross(&u, &v), u.cross(&v), epsilon = 1e-15);
        assert_relative_eq!(dot(&u, &v), u.dot(&v), epsilon = 1e-15);
        assert_relative_eq!(rotate_sym(&a, &s), a * s * a.transpose(), epsilon = 1e-14);
    }
}
