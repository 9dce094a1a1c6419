//! Factorisations by faer, with input checked and rank decided.

use faer::linalg::solvers::SolveLstsq;
use faer::{MatRef, Side};
use nalgebra::{Complex, DMatrix, DVector};

/// Why a factorisation was refused or failed.
///
/// ```
/// use ff_linalg::{LinalgError, least_squares};
/// use nalgebra::{DMatrix, DVector};
///
/// // The second column is the third times -2: the data cannot separate the two.
/// let a = DMatrix::from_row_slice(4, 3, &[0.3, -4.0, 2.0, 0.7, 6.0, -3.0, -0.4, 2.4, -1.2, 1.1, 0.8, -0.4]);
/// let refused = least_squares(&a, &DVector::from_row_slice(&[0.2, 0.9, -0.5, 1.3]));
/// let Err(LinalgError::RankDeficient { rank, dependent, .. }) = refused else { panic!("{refused:?}") };
/// assert_eq!((rank, dependent), (2, vec![2]));
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LinalgError {
    /// An element is NaN or infinite.
    #[error("{what} has a non-finite element at row {row}, column {column}")]
    NotFinite {
        /// Name of the matrix.
        what: &'static str,
        /// Row from 0.
        row: usize,
        /// Column from 0.
        column: usize,
    },
    /// Shapes do not fit together.
    #[error("{what} is {rows} x {columns}, needed {needed}")]
    Shape {
        /// Name of the matrix.
        what: &'static str,
        /// Rows it has.
        rows: usize,
        /// Columns it has.
        columns: usize,
        /// What was needed.
        needed: String,
    },
    /// The columns are linearly dependent to working precision.
    #[error("rank {rank} of {columns} columns; dependent columns {dependent:?} (in pivot order)")]
    RankDeficient {
        /// Numerical rank.
        rank: usize,
        /// Number of columns.
        columns: usize,
        /// Columns that pivoting left to last, from 0.
        dependent: Vec<usize>,
    },
    /// An iterative factorisation gave up.
    #[error("{what} did not converge")]
    NoConvergence {
        /// Which factorisation.
        what: &'static str,
    },
    /// A transform refused its buffers; a bug of this crate.
    #[error("fast Fourier transform: {0}")]
    Transform(String),
}

type Result<T> = core::result::Result<T, LinalgError>;

/// faer's zero-copy view of a nalgebra matrix (both are column-major and contiguous).
fn view(a: &DMatrix<f64>) -> MatRef<'_, f64> {
    MatRef::from_column_major_slice(a.as_slice(), a.nrows(), a.ncols())
}
fn back(a: MatRef<'_, f64>) -> DMatrix<f64> {
    DMatrix::from_fn(a.nrows(), a.ncols(), |i, j| a[(i, j)])
}
fn square(what: &'static str, a: &DMatrix<f64>) -> Result<()> {
    if a.nrows() == a.ncols() {
        return Ok(());
    }
    Err(LinalgError::Shape { what, rows: a.nrows(), columns: a.ncols(), needed: "a square matrix".into() })
}

/// Refuses a matrix that holds NaN or infinity. Does not allocate unless it refuses.
///
/// # Errors
/// [`LinalgError::NotFinite`] with the first such element in column-major order.
pub fn check_finite(what: &'static str, a: &DMatrix<f64>) -> Result<()> {
    match a.as_slice().iter().position(|x| !x.is_finite()) {
        None => Ok(()),
        Some(k) => Err(LinalgError::NotFinite { what, row: k % a.nrows(), column: k / a.nrows() }),
    }
}

/// Refuses a vector that holds NaN or infinity (see [`check_finite`]).
///
/// # Errors
/// [`LinalgError::NotFinite`] with the first such element.
pub fn check_finite_slice(what: &'static str, a: &[f64]) -> Result<()> {
    match a.iter().position(|x| !x.is_finite()) {
        None => Ok(()),
        Some(row) => Err(LinalgError::NotFinite { what, row, column: 0 }),
    }
}

/// The tolerance below which a singular value (or pivot) counts as zero, relative to the largest:
/// `max(m, n) * 2.2e-16`, the rule of LAPACK and numpy.
pub fn default_rank_tolerance(rows: usize, columns: usize) -> f64 {
    rows.max(columns) as f64 * f64::EPSILON
}

/// `A^T A` (n x n) of an m x n matrix. Squares the condition number: safe for well conditioned columns only, and then cheaper than a
/// factorisation.
///
/// # Errors
/// [`LinalgError::NotFinite`].
pub fn gram(a: &DMatrix<f64>) -> Result<DMatrix<f64>> {
    check_finite("matrix", a)?;
    let v = view(a);
    Ok(back((v.transpose() * v).as_ref()))
}

/// `A^T v`. Compiled once, for those who are not built to be fast.
///
/// # Panics
/// If `v` has another length than the columns.
pub fn tr_mul(a: &DMatrix<f64>, v: &[f64]) -> DVector<f64> {
    assert_eq!(v.len(), a.nrows(), "length of the vector");
    let rows = a.nrows().max(1);
    DVector::from_iterator(a.ncols(), a.as_slice().chunks_exact(rows).map(|c| dot(c, v)))
}

/// Sums side by side: one alone waits for every addition before the next.
const SUMS: usize = 16;

fn dot(a: &[f64], b: &[f64]) -> f64 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<SUMS>(), b.as_chunks::<SUMS>());
    let mut sums = [0.0; SUMS];
    for (a, b) in a.iter().zip(b) {
        for k in 0..SUMS {
            sums[k] += a[k] * b[k];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + rest
}

/// Upper triangular `R` (min(m,n) x n) of `A = Q R`, without forming `Q`.
///
/// To reduce a least-squares problem `min |A x - b|`, pass `[A b]`: the last column of `R` is then
/// `[Q^T b; rho]` with `rho` the norm of the residual. The sign of a row of `R` is not fixed.
///
/// # Errors
/// [`LinalgError::NotFinite`].
pub fn qr_r(a: &DMatrix<f64>) -> Result<DMatrix<f64>> {
    check_finite("matrix", a)?;
    let qr = view(a).qr();
    Ok(back(qr.thin_R()).upper_triangle())
}

/// Least squares `min |A x - b|` for full column rank, by column-pivoted QR.
///
/// # Errors
/// [`LinalgError::RankDeficient`] when a pivot falls below [`default_rank_tolerance`], naming the columns
/// left over; [`LinalgError::Shape`] when m < n or `b` has another length; [`LinalgError::NotFinite`].
pub fn least_squares(a: &DMatrix<f64>, b: &DVector<f64>) -> Result<DVector<f64>> {
    let (m, n) = a.shape();
    if m < n || b.len() != m {
        return Err(LinalgError::Shape {
            what: "least-squares matrix",
            rows: m,
            columns: n,
            needed: format!("at least as many rows as columns, and {} rows for the right-hand side", b.len()),
        });
    }
    check_finite_slice("right-hand side", b.as_slice())?;
    let piv = col_piv_qr(a)?;
    let rank = piv.rank(default_rank_tolerance(m, n));
    if rank < n {
        return Err(LinalgError::RankDeficient { rank, columns: n, dependent: piv.order[rank..].to_vec() });
    }
    let rhs = MatRef::from_column_major_slice(b.as_slice(), m, 1);
    let x = view(a).col_piv_qr().solve_lstsq(rhs);
    Ok(DVector::from_fn(n, |i, _| x[(i, 0)]))
}

/// `A P = Q R` with columns taken in order of largest remaining norm (LAPACK `geqp3`).
///
/// ```
/// use nalgebra::DMatrix;
///
/// let a = DMatrix::from_row_slice(3, 2, &[0.3, 4.0, -0.2, 3.0, 0.5, 12.0]);
/// let qr = ff_linalg::col_piv_qr(&a)?;
/// assert_eq!((qr.order, qr.r[(0, 0)].abs()), (vec![1, 0], 13.0)); // the longest column comes first
/// # Ok::<(), ff_linalg::LinalgError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ColPivQr {
    /// Upper triangular factor, min(m,n) x n; `|R_ii|` does not increase.
    pub r: DMatrix<f64>,
    /// `order[k]` is the column of `A` that came k-th.
    pub order: Vec<usize>,
}

impl ColPivQr {
    /// Number of pivots above `tolerance * |R_00|`.
    pub fn rank(&self, tolerance: f64) -> usize {
        let k = self.r.nrows();
        let limit = if k > 0 { tolerance * self.r[(0, 0)].abs() } else { 0.0 };
        (0..k).take_while(|&i| self.r[(i, i)].abs() > limit).count()
    }
}

/// Column-pivoted QR, for base parameters and rank decisions.
///
/// # Errors
/// [`LinalgError::NotFinite`].
pub fn col_piv_qr(a: &DMatrix<f64>) -> Result<ColPivQr> {
    check_finite("matrix", a)?;
    let qr = view(a).col_piv_qr();
    let (order, _) = qr.P().arrays();
    Ok(ColPivQr { r: back(qr.thin_R()).upper_triangle(), order: order.to_vec() })
}

/// Thin singular value decomposition `A = U diag(s) V^T`, `k = min(m, n)`.
///
/// ```
/// use nalgebra::DMatrix;
///
/// // Two parameters of which the data know one combination only: 3 p0 + 4 p1.
/// let a = DMatrix::from_row_slice(3, 2, &[3.0, 4.0, -6.0, -8.0, 1.5, 2.0]);
/// let d = ff_linalg::svd(&a)?;
/// assert_eq!(d.rank(1e-12), 1);
/// assert!((d.v.column(1).dot(&nalgebra::DVector::from_row_slice(&[3.0, 4.0]))).abs() < 1e-14);
/// # Ok::<(), ff_linalg::LinalgError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Svd {
    /// Left vectors, m x k.
    pub u: DMatrix<f64>,
    /// Singular values, descending.
    pub s: DVector<f64>,
    /// Right vectors, n x k (not transposed).
    pub v: DMatrix<f64>,
}

impl Svd {
    /// Number of singular values above `tolerance * s[0]`.
    pub fn rank(&self, tolerance: f64) -> usize {
        rank_of(self.s.as_slice(), tolerance)
    }
}

/// Number of descending singular values above `tolerance * s[0]`; 0 for none or all zero.
pub fn rank_of(s: &[f64], tolerance: f64) -> usize {
    match s.first() {
        Some(&top) if top > 0.0 => s.iter().take_while(|&&x| x > tolerance * top).count(),
        _ => 0,
    }
}

/// Thin SVD.
///
/// # Errors
/// [`LinalgError::NotFinite`], [`LinalgError::NoConvergence`].
pub fn svd(a: &DMatrix<f64>) -> Result<Svd> {
    check_finite("matrix", a)?;
    // One in thousands of matrices does not converge; another iteration takes it.
    let Ok(d) = view(a).thin_svd() else { return implicit_qr_svd(a) };
    let s = d.S().column_vector();
    Ok(Svd { u: back(d.U()), s: DVector::from_fn(s.nrows(), |i, _| s[i]), v: back(d.V()) })
}

/// Iterations of [`implicit_qr_svd`], at most.
const ITERATIONS: usize = 100_000;

/// Thin SVD by Golub and Kahan's iteration (G. Golub, C. Van Loan, *Matrix Computations*, 4th ed., 8.6.3), where divide and conquer fails.
fn implicit_qr_svd(a: &DMatrix<f64>) -> Result<Svd> {
    let failed = LinalgError::NoConvergence { what: "singular value decomposition" };
    let Some(d) = a.clone().try_svd(true, true, f64::EPSILON, ITERATIONS) else { return Err(failed) };
    let (Some(u), Some(v_t)) = (d.u, d.v_t) else { return Err(failed) };
    Ok(Svd { u, s: d.singular_values, v: v_t.transpose() })
}

/// Singular values, descending.
///
/// # Errors
/// As [`svd`].
pub fn singular_values(a: &DMatrix<f64>) -> Result<Vec<f64>> {
    check_finite("matrix", a)?;
    match view(a).singular_values() {
        Ok(s) => Ok(s),
        Err(_) => Ok(implicit_qr_svd(a)?.s.iter().copied().collect()),
    }
}

/// Eigenvalues (ascending) and orthonormal eigenvectors (columns) of a symmetric matrix; reads the lower half.
///
/// # Errors
/// [`LinalgError::NotFinite`], [`LinalgError::Shape`], [`LinalgError::NoConvergence`].
pub fn symmetric_eigen(a: &DMatrix<f64>) -> Result<(DVector<f64>, DMatrix<f64>)> {
    square("symmetric matrix", a)?;
    check_finite("symmetric matrix", a)?;
    let e = view(a)
        .self_adjoint_eigen(Side::Lower)
        .map_err(|_| LinalgError::NoConvergence { what: "symmetric eigenvalue decomposition" })?;
    let s = e.S().column_vector();
    Ok((DVector::from_fn(s.nrows(), |i, _| s[i]), back(e.U())))
}

/// Eigenvalues and right eigenvectors (columns) of a general real matrix.
///
/// ```
/// use nalgebra::DMatrix;
///
/// // An oscillator of 3 rad/s with damping: x'' = -9 x - 1.2 x'.
/// let (values, _) = ff_linalg::general_eigen(&DMatrix::from_row_slice(2, 2, &[0.0, 1.0, -9.0, -1.2]))?;
/// assert!((values[0].norm() - 3.0).abs() < 1e-14 && (values[0].re + 0.6).abs() < 1e-14);
/// # Ok::<(), ff_linalg::LinalgError>(())
/// ```
pub type ComplexEigen = (Vec<Complex<f64>>, DMatrix<Complex<f64>>);

/// Eigenvalues of a general real matrix and its right eigenvectors (columns, not normalised).
///
/// # Errors
/// [`LinalgError::NotFinite`], [`LinalgError::Shape`], [`LinalgError::NoConvergence`].
pub fn general_eigen(a: &DMatrix<f64>) -> Result<ComplexEigen> {
    square("matrix", a)?;
    check_finite("matrix", a)?;
    let e = view(a).eigen().map_err(|_| LinalgError::NoConvergence { what: "eigenvalue decomposition" })?;
    let s = e.S().column_vector();
    let values = (0..s.nrows()).map(|i| Complex::new(s[i].re, s[i].im)).collect();
    let u = e.U();
    Ok((values, DMatrix::from_fn(u.nrows(), u.ncols(), |i, j| Complex::new(u[(i, j)].re, u[(i, j)].im))))
}

/// What is left of the unknowns of a matrix of some rank: columns `kept` (in the order of what each adds), and the others as their
/// combinations, `A_left = A_kept C`.
///
/// ```
/// use nalgebra::DMatrix;
///
/// // The third unknown acts as 2 times the first and -3 times the second.
/// let a = DMatrix::from_fn(5, 3, |i, j| {
///     let (x, y) = ((0.7 * i as f64).sin(), 0.4 + (1.1 * i as f64).cos());
///     [x, y, 2.0 * x - 3.0 * y][j]
/// });
/// let e = ff_linalg::eliminate(&a, 2)?;
/// let column = |j: usize| a.column(j).into_owned();
/// let rebuilt = column(e.kept[0]) * e.c[(0, 0)] + column(e.kept[1]) * e.c[(1, 0)];
/// assert!((rebuilt - column(e.left[0])).norm() < 1e-13);
/// # Ok::<(), ff_linalg::LinalgError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Elimination {
    /// Columns that stay, by index.
    pub kept: Vec<usize>,
    /// Columns that are combinations of them, by index.
    pub left: Vec<usize>,
    /// Triangle of the kept columns, rank x rank.
    pub r: DMatrix<f64>,
    /// Rank x left.
    pub c: DMatrix<f64>,
}

/// Eliminates all but `rank` columns by QR with column pivoting: `A P = Q [R_11 R_12; 0 0]`, `C = R_11^-1 R_12` (M. Gautier,
/// *Numerical calculation of the base inertial parameters of robots*, J. Robotic Systems 8(4), 1991). Allocates.
///
/// # Errors
/// [`LinalgError`]; `RankDeficient` when the rank is lower.
pub fn eliminate(a: &DMatrix<f64>, rank: usize) -> Result<Elimination> {
    let n = a.ncols();
    let qr = col_piv_qr(a)?;
    let (kept, left) = (qr.order[..rank].to_vec(), qr.order[rank..].to_vec());
    let r = qr.r.view((0, 0), (rank, rank)).into_owned();
    let c = r.solve_upper_triangular(&qr.r.view((0, rank), (rank, n - rank)).into_owned());
    let c = c.ok_or_else(|| LinalgError::RankDeficient {
        rank: rank.saturating_sub(1),
        columns: n,
        dependent: left.clone(),
    })?;
    Ok(Elimination { kept, left, r, c })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ways_to_the_singular_values_agree() {
        for (m, n) in [(9, 4), (4, 9), (6, 6)] {
            let a = DMatrix::from_fn(m, n, |i, k| (0.7 * (i * n + k) as f64 + 0.3).sin() + 0.2 * (i as f64 - k as f64));
            let (one, other) = (svd(&a).unwrap(), implicit_qr_svd(&a).unwrap());
            assert!((&one.s - &other.s).amax() < 1e-12 * one.s[0], "{} {}", one.s, other.s);
            for d in [one, other] {
                let again = &d.u * DMatrix::from_diagonal(&d.s) * d.v.transpose();
                assert!((again - &a).amax() < 1e-12 * d.s[0]);
            }
        }
    }
}
