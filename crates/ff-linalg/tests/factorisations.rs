//! Factorisations against their definitions, and what they refuse.
#![allow(clippy::unwrap_used)] // helpers outside #[test] may panic too

use approx::assert_relative_eq;
use ff_linalg::{
    LinalgError, col_piv_qr, general_eigen, gram, least_squares, qr_r, singular_values, svd, symmetric_eigen, tr_mul,
};
use nalgebra::{Complex, DMatrix, DVector};

fn sample() -> DMatrix<f64> {
    DMatrix::from_fn(7, 3, |i, j| ((3 * i + 5 * j + 1) as f64).sin() + 0.3 * (i as f64 - j as f64))
}

#[test]
fn least_squares_leaves_a_residual_orthogonal_to_the_columns() {
    let a = sample();
    let b = DVector::from_fn(7, |i, _| (1.7 * i as f64).cos());
    let x = least_squares(&a, &b).unwrap();
    assert!((a.transpose() * (&b - &a * &x)).norm() < 1e-13);
    // The augmented triangle carries the same answer.
    let mut ab = a.clone().insert_column(3, 0.0);
    ab.set_column(3, &b);
    let r = qr_r(&ab).unwrap();
    let y = r.view((0, 0), (3, 3)).into_owned().solve_upper_triangular(&r.view((0, 3), (3, 1)).into_owned());
    assert_relative_eq!(y.unwrap().column(0).into_owned(), x, max_relative = 1e-12);
    assert_relative_eq!(r[(3, 3)].abs(), (&b - &a * &x).norm(), max_relative = 1e-12);
}

#[test]
fn rank_deficiency_names_the_dependent_columns_instead_of_returning_huge_numbers() {
    let mut a = sample().insert_column(3, 0.0);
    let c = a.column(0) * 2.0 - a.column(2) * 0.7;
    a.set_column(3, &c);
    let e = least_squares(&a, &DVector::from_element(7, 1.3)).unwrap_err();
    assert!(matches!(e, LinalgError::RankDeficient { rank: 3, columns: 4, ref dependent } if dependent.len() == 1));
}

#[test]
fn pivoting_follows_column_norms() {
    // The case in which nalgebra's `col_piv_qr` picks the largest element (crates.md, section 2).
    let mut a = DMatrix::from_element(100, 3, 1.0);
    a.column_mut(0).fill(0.0);
    a[(0, 0)] = 5.0;
    a[(17, 2)] += 1e-9;
    let qr = col_piv_qr(&a).unwrap();
    assert_eq!(qr.order[1], 0);
    assert_relative_eq!(qr.r[(0, 0)].abs(), 10.0, max_relative = 1e-9);
    assert!(qr.r[(2, 2)].abs() < 1e-8);
}

#[test]
fn factorisations_rebuild_the_matrix() {
    let a = sample();
    let d = svd(&a).unwrap();
    assert_relative_eq!(&d.u * DMatrix::from_diagonal(&d.s) * d.v.transpose(), a, epsilon = 1e-13);
    assert_eq!(d.rank(1e-12), 3);
    assert_relative_eq!(DVector::from_vec(singular_values(&a).unwrap()), d.s, max_relative = 1e-12);
    let g = gram(&a).unwrap();
    assert_relative_eq!(g, a.transpose() * &a, max_relative = 1e-13);
    let (w, v) = symmetric_eigen(&g).unwrap();
    assert!(w[0] <= w[1] && w[1] <= w[2]);
    assert_relative_eq!(&g * &v, &v * DMatrix::from_diagonal(&w), epsilon = 1e-12);
    let m = DMatrix::from_row_slice(2, 2, &[0.3, -1.7, 0.9, 0.4]);
    let (l, u) = general_eigen(&m).unwrap();
    let mc = m.map(|x| Complex::new(x, 0.0));
    for k in 0..2 {
        assert!((&mc * u.column(k) - u.column(k) * l[k]).norm() < 1e-14);
    }
}

#[test]
fn non_finite_input_stops_at_the_door() {
    let mut a = sample();
    a[(4, 1)] = f64::INFINITY;
    let e = LinalgError::NotFinite { what: "matrix", row: 4, column: 1 };
    assert_eq!(svd(&a).unwrap_err(), e);
    assert_eq!(gram(&a).unwrap_err(), e);
    assert_eq!(col_piv_qr(&a).unwrap_err(), e);
    assert_eq!(qr_r(&a).unwrap_err(), e);
    let square = LinalgError::Shape { what: "symmetric matrix", rows: 7, columns: 3, needed: "a square matrix".into() };
    assert_eq!(symmetric_eigen(&a).unwrap_err(), square);
}

/// Against the defining sum, for a length with a large prime factor, an odd one and a power of two.
#[test]
fn the_transform_is_the_defining_sum() {
    for n in [2 * 37, 45, 64] {
        let x: Vec<f64> = (0..n).map(|i| (0.3 * i as f64).sin() + 0.2 * ((i * i) % 7) as f64).collect();
        let mut fft = ff_linalg::fourier::RealFft::new(n);
        // Twice: nothing of the first run stays.
        for _ in 0..2 {
            fft.input().copy_from_slice(&x);
            let got = fft.run().unwrap().to_vec();
            assert_eq!((got.len(), fft.lines()), (n / 2 + 1, n / 2 + 1));
            for (j, z) in got.iter().enumerate() {
                let phase = |i: usize| -std::f64::consts::TAU * ((i * j) % n) as f64 / n as f64;
                let (re, im) = x
                    .iter()
                    .enumerate()
                    .fold((0.0, 0.0), |(re, im), (i, x)| (re + x * phase(i).cos(), im + x * phase(i).sin()));
                assert!((z.re - re).hypot(z.im - im) < 1e-11, "n = {n}, line {j}: {z} for {re} + {im} i");
            }
        }
    }
}

#[test]
fn products_with_the_transpose_are_those_of_nalgebra_whatever_the_length() {
    for rows in [1, 7, 16, 17, 53] {
        let a = DMatrix::from_fn(rows, 3, |i, j| (1.7 * i as f64 - 0.9 * j as f64 + 0.3).sin());
        let v = DVector::from_fn(rows, |i, _| (0.4 * i as f64 + 1.1).cos());
        let off = (tr_mul(&a, v.as_slice()) - a.tr_mul(&v)).amax();
        assert!(off < 1e-14 * rows as f64, "{rows} rows: {off:e}");
    }
}
