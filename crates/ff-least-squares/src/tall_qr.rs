//! The triangular factor of a tall matrix whose rows come in kinds, without ever holding the matrix.
//!
//! A regression over a record has 1e5 rows and 1e2 columns. What a least-squares fit needs of it is the triangle `R` of
//! `[A b] = Q R`: `R` carries solution, residual and covariance with the condition of `A`, where the Gram matrix
//! `A^T A` squares it (G. Golub, C. Van Loan, *Matrix Computations*, 4th ed., 5.3.8). Rows are folded into `R` a few at a
//! time by Householder reflections, `[R; C] = Q R'`, and triangles of parts are merged in the same way (TSQR: J. Demmel,
//! L. Grigori, M. Hoemmen, J. Langou, *Communication-optimal parallel and sequential QR and LU factorizations*, SIAM J.
//! Sci. Comput. 34(1), 2012). Memory does not grow with the record.
//!
//! Two things make it fast. Every lane ([`ff_model::scalar::lanes`]) folds its own samples into its own triangle, so that the
//! arithmetic needs no shuffles. And each kind of row (forces on the base, the torque of joint j) has a triangle
//! over only those columns that it can depend on: the torque of a joint knows nothing of the bodies before it.
//! Triangles per kind also tell the residual of each kind, so that reweighting needs no second pass over the data.

use crate::pieces::{Piece, pieces};
use ff_linalg::{self as linalg, LinalgError};
use ff_model::scalar::lanes::{Isa, LaneScalar, LaneTask, Lanes, dispatch};
use nalgebra::{DMatrix, DVector};

/// Rows folded at once: with the reflector they fill the registers of the widest lanes.
const ROWS: usize = 12;
/// Added to squared norms, so that a column without any entry has a reflector that changes nothing. Far below any
/// squared number that a record can hold.
const NOTHING: f64 = 1e-280;

/// The triangle of all rows of one kind, unweighted: what is left of `A x = b` for them.
///
/// ```
/// use ff_least_squares::Triangle;
/// use nalgebra::DMatrix;
///
/// // Torques of one joint, which depends on unknowns 1 and 4 of the fit; the last column is the measured torque.
/// let r = DMatrix::from_row_slice(3, 3, &[2.0, 0.5, 7.0, 0.0, 3.0, 12.0, 0.0, 0.0, 0.1]);
/// let elbow = Triangle { name: "torque elbow".into(), columns: vec![1, 4], r, rows: 500 };
/// let x = [9.0, 2.5, 9.0, 9.0, 4.0]; // 2 * 2.5 + 0.5 * 4 = 7, 3 * 4 = 12: the fit of these rows
/// assert!((elbow.cost(&x) - 0.01).abs() < 1e-12);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Triangle {
    /// What the rows are, such as `torque arm_j3`.
    pub name: String,
    /// Unknowns that these rows may depend on, ascending.
    pub columns: Vec<usize>,
    /// Upper triangle of `[A b]`, `(c + 1) x (c + 1)` for `c` columns; the last column belongs to `b`.
    pub r: DMatrix<f64>,
    /// Rows that went in.
    pub rows: usize,
}

impl Triangle {
    /// `|A x - b|^2` of these rows for all unknowns `x`. Allocates.
    ///
    /// # Panics
    /// If `x` is shorter than the last column asks for.
    pub fn cost(&self, x: &[f64]) -> f64 {
        let own = DVector::from_iterator(
            self.columns.len() + 1,
            self.columns.iter().map(|&c| x[c]).chain(std::iter::once(-1.0)),
        );
        (&self.r * own).norm_squared()
    }
    /// Root mean square of the entries of `[A diag(sizes), b]` per row: what the residuals are measured by.
    pub fn scale(&self, sizes: &[f64]) -> f64 {
        let c = self.columns.len();
        let of = |k: usize| self.r.column(k).norm_squared() * if k < c { sizes[self.columns[k]].powi(2) } else { 1.0 };
        ((0..=c).map(of).sum::<f64>() / self.rows.max(1) as f64).sqrt()
    }
}

/// The triangle of all kinds together, each divided by the standard deviation of its rows.
///
/// ```
/// use ff_least_squares::{Triangle, merge};
/// use nalgebra::DMatrix;
///
/// // Two joints measured one unknown each, with different noise: both know the last.
/// let part = |name: &str, columns: Vec<usize>, r: [f64; 9]| Triangle { name: name.into(), columns, r: DMatrix::from_row_slice(3, 3, &r), rows: 40 };
/// let shoulder = part("torque shoulder", vec![0, 2], [2.0, 0.5, 5.0, 0.0, 3.0, 6.0, 0.0, 0.0, 0.4]);
/// let elbow = part("torque elbow", vec![1, 2], [1.5, -0.4, 2.2, 0.0, 1.2, 2.4, 0.0, 0.0, 0.3]);
/// let all = merge(3, &[shoulder, elbow], &[0.4, 0.3])?;
/// let x = all.r.solve_upper_triangular(&all.d).unwrap();
/// assert!((x[2] - 2.0).abs() < 1e-12 && (x[0] - 2.0).abs() < 1e-12 && (x[1] - 2.0).abs() < 1e-12);
/// assert_eq!(all.rows, 80);
/// # Ok::<(), ff_linalg::LinalgError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Merged {
    /// Upper triangle of the whitened `A`, n x n.
    pub r: DMatrix<f64>,
    /// Its right-hand side, length n: the fit solves `r x = d`.
    pub d: DVector<f64>,
    /// Squared norm of what no `x` can explain.
    pub rest: f64,
    /// Rows that went in.
    pub rows: usize,
}

/// Merges triangles over `n` unknowns; `sigma` holds one standard deviation per triangle. Allocates.
///
/// # Errors
/// [`LinalgError::NotFinite`].
///
/// # Panics
/// If there is not one deviation per triangle, or a column is `n` or above.
pub fn merge(n: usize, parts: &[Triangle], sigma: &[f64]) -> Result<Merged, LinalgError> {
    assert_eq!(parts.len(), sigma.len(), "one deviation per kind of row");
    let stacked: usize = parts.iter().map(|t| t.r.nrows()).sum();
    let mut all = DMatrix::zeros(stacked.max(n + 1), n + 1);
    let mut at = 0;
    for (t, s) in parts.iter().zip(sigma) {
        let c = t.columns.len();
        for (k, &to) in t.columns.iter().chain(std::iter::once(&n)).enumerate() {
            for i in 0..=k.min(c) {
                all[(at + i, to)] = t.r[(i, k)] / s;
            }
        }
        at += c + 1;
    }
    let r = linalg::qr_r(&all)?;
    Ok(Merged {
        d: r.view((0, n), (n, 1)).column(0).into_owned(),
        rest: r[(n, n)].powi(2),
        r: r.view((0, 0), (n, n)).into_owned(),
        rows: parts.iter().map(|t| t.rows).sum(),
    })
}

/// Folds plain rows into a triangle, for those who make them one block at a time. Memory: five triangles.
///
/// ```
/// use ff_least_squares::TallQr;
/// use nalgebra::DMatrix;
///
/// // [A b] in blocks, as a record is read: y = 2 + 0.5 t.
/// let mut tall = TallQr::new(3);
/// for block in 0..20 {
///     let t = |i: usize| 0.1 * (50 * block + i) as f64;
///     tall.push(&DMatrix::from_fn(50, 3, |i, k| [1.0, t(i), 2.0 + 0.5 * t(i)][k]))?;
/// }
/// let (r, rows) = tall.finish()?;
/// assert_eq!(rows, 1000);
/// assert!((r[(1, 2)] / r[(1, 1)] - 0.5).abs() < 1e-12); // the slope, by back substitution
/// # Ok::<(), ff_linalg::LinalgError>(())
/// ```
#[derive(Clone, Debug)]
pub struct TallQr {
    /// The triangle in the first `width` rows, then rows that wait.
    block: DMatrix<f64>,
    waiting: usize,
    rows: usize,
}

impl TallQr {
    /// For rows of `width` numbers, the right-hand side included. Allocates.
    pub fn new(width: usize) -> Self {
        Self { block: DMatrix::zeros(5 * width.max(1), width), waiting: 0, rows: 0 }
    }
    /// Adds rows.
    ///
    /// # Errors
    /// [`LinalgError::NotFinite`]; [`LinalgError::Shape`] for another width.
    pub fn push(&mut self, rows: &DMatrix<f64>) -> Result<(), LinalgError> {
        let n = self.block.ncols();
        if rows.ncols() != n {
            let needed = format!("{n} columns");
            return Err(LinalgError::Shape { what: "rows", rows: rows.nrows(), columns: rows.ncols(), needed });
        }
        for i in 0..rows.nrows() {
            if n + self.waiting == self.block.nrows() {
                self.fold()?;
            }
            self.block.set_row(n + self.waiting, &rows.row(i));
            self.waiting += 1;
            self.rows += 1;
        }
        Ok(())
    }
    fn fold(&mut self) -> Result<(), LinalgError> {
        let n = self.block.ncols();
        let r = linalg::qr_r(&self.block)?;
        self.block.fill(0.0);
        self.block.view_mut((0, 0), (n, n)).copy_from(&r);
        self.waiting = 0;
        Ok(())
    }
    /// The triangle, width x width, and the number of rows.
    ///
    /// # Errors
    /// [`LinalgError::NotFinite`].
    pub fn finish(mut self) -> Result<(DMatrix<f64>, usize), LinalgError> {
        self.fold()?;
        let n = self.block.ncols();
        Ok((self.block.view((0, 0), (n, n)).into_owned(), self.rows))
    }
}

/// Rows per column from which a matrix is folded in lanes; more than the lanes of any machine.
const TALL: usize = 16;

/// [`linalg::qr_r`], in lanes where the matrix is much taller than wide. Allocates.
///
/// # Errors
/// [`LinalgError::NotFinite`].
pub fn qr_r(a: &DMatrix<f64>) -> Result<DMatrix<f64>, LinalgError> {
    if a.nrows() < TALL * a.ncols() {
        return linalg::qr_r(a);
    }
    linalg::check_finite("matrix", a)?;
    triangle_of(&Tall::new(a))
}

/// A tall matrix that is at hand, perhaps with one more column and a factor on every row.
///
/// ```
/// use ff_least_squares::{Tall, triangle_of};
/// use nalgebra::DMatrix;
///
/// let a = DMatrix::from_fn(900, 2, |i, k| ((0.1 + k as f64) * i as f64).cos());
/// let b: Vec<f64> = (0..900).map(|i| 3.0 * a[(i, 0)] - 0.5 * a[(i, 1)]).collect();
/// let weights: Vec<f64> = (0..900).map(|i| if i % 9 == 0 { 0.0 } else { 1.4 }).collect();
/// let r = triangle_of(&Tall::new(&a).weighted(&weights))?;
/// let weighted = DMatrix::from_fn(900, 2, |i, k| a[(i, k)] * weights[i]);
/// assert!((r.tr_mul(&r) - weighted.tr_mul(&weighted)).norm() < 1e-9);
/// // With the right-hand side as one more column nothing is left of the last row: b is in the span of a.
/// assert!(triangle_of(&Tall::new(&a).with(&b))?[(2, 2)].abs() < 1e-10);
/// # Ok::<(), ff_linalg::LinalgError>(())
/// ```
#[derive(Clone, Copy)]
pub struct Tall<'a> {
    matrix: &'a DMatrix<f64>,
    last: Option<&'a [f64]>,
    weights: &'a [f64],
}

/// Some rows of a tall matrix, over the columns that these know.
struct Part<'a> {
    of: Tall<'a>,
    piece: &'a Piece,
}

impl<'a> Tall<'a> {
    /// All rows of `matrix`, unweighted.
    pub fn new(matrix: &'a DMatrix<f64>) -> Self {
        Self { matrix, last: None, weights: &[] }
    }
    /// With one more column, of which the weights take nothing.
    ///
    /// # Panics
    /// If it has another length.
    pub fn with(self, last: &'a [f64]) -> Self {
        assert_eq!(last.len(), self.matrix.nrows(), "length of the last column");
        Self { last: Some(last), ..self }
    }
    /// With a factor on every row of the matrix; none are ones.
    ///
    /// # Panics
    /// If there are some, but not one per row.
    pub fn weighted(self, weights: &'a [f64]) -> Self {
        assert!(weights.is_empty() || weights.len() == self.matrix.nrows(), "one weight per row");
        Self { weights, ..self }
    }
}

/// Upper triangle of a tall matrix, n x n for n columns: [`qr_r`] of matrices much taller than
/// wide comes here. Columns that are zero in a range of rows cost nothing there. Numbers that are not finite are refused by what they leave in the
/// triangle. Allocates.
///
/// # Errors
/// [`LinalgError`] of the last, small factorisation.
pub fn triangle_of(a: &Tall<'_>) -> Result<DMatrix<f64>, LinalgError> {
    let beside = usize::from(a.last.is_some());
    let n = a.matrix.ncols() + beside;
    if n == 0 {
        return Ok(DMatrix::zeros(0, 0));
    }
    let pieces = pieces(a.matrix, beside);
    let mut parts = Vec::with_capacity(pieces.len());
    for piece in &pieces {
        let r = dispatch(Isa::detect(), Part { of: *a, piece })?;
        if pieces.len() == 1 && r.ncols() == n {
            return Ok(r);
        }
        let columns: Vec<usize> = piece.columns.iter().copied().chain((beside > 0).then_some(n - 1)).collect();
        parts.push((columns, r));
    }
    let stacked: usize = parts.iter().map(|(columns, _)| columns.len()).sum();
    let mut all = DMatrix::zeros(if parts.len() == 1 { n } else { stacked.max(n) }, n);
    let mut at = 0;
    for (columns, r) in &parts {
        for (k, &to) in columns.iter().enumerate() {
            for i in 0..=k {
                // A single triangle stays one: its rows go where their columns begin.
                let row = if parts.len() == 1 { columns[i] } else { at + i };
                all[(row, to)] = r[(i, k)];
            }
        }
        at += columns.len();
    }
    if parts.len() == 1 { Ok(all) } else { linalg::qr_r(&all) }
}

impl LaneTask for Part<'_> {
    type Output = Result<DMatrix<f64>, LinalgError>;
    #[inline(always)]
    fn run<L: LaneScalar>(self) -> Self::Output {
        let (Tall { matrix, last, weights }, Piece { rows, columns }) = (self.of, self.piece);
        let (m, n) = (matrix.nrows(), columns.len());
        if n + usize::from(last.is_some()) == 0 {
            return Ok(DMatrix::zeros(0, 0));
        }
        let mut stream = Stream::<L>::new(n + usize::from(last.is_some()) - 1);
        let whole = rows.end - rows.len() % L::N;
        let data = matrix.as_slice();
        for first in rows.clone().step_by(L::N) {
            let inside = first < whole;
            if weights.is_empty() {
                for (k, c) in columns.iter().enumerate() {
                    stream.put(k, part(&data[c * m + first..c * m + rows.end], inside));
                }
            } else {
                let weight = part::<L>(&weights[first..rows.end], inside);
                for (k, c) in columns.iter().enumerate() {
                    stream.put(k, part::<L>(&data[c * m + first..c * m + rows.end], inside) * weight);
                }
            }
            if let Some(last) = last {
                stream.put(n, part(&last[first..rows.end], inside));
            }
            stream.end_row();
        }
        stream.flush();
        stream.finish()
    }
}

/// The first numbers of a slice, one per lane; where it is not `full`, it has fewer than there are lanes, and what is missing is zero.
#[inline(always)]
fn part<L: LaneScalar>(x: &[f64], full: bool) -> L {
    if full {
        return L::load(x);
    }
    let mut lanes = [0.0; 8];
    let count = x.len().min(L::N);
    lanes[..count].copy_from_slice(&x[..count]);
    L::load(&lanes)
}

/// Rows of one kind, a stream per lane.
///
/// ```
/// use ff_least_squares::Stream;
///
/// // Rows [a | b] of a line through the origin, b = 2.5 a.
/// let mut stream = Stream::<f64>::new(1);
/// for a in [0.3, -1.2, 0.7, 2.0] {
///     stream.put(0, a);
///     stream.put(1, 2.5 * a);
///     stream.end_row();
/// }
/// stream.flush();
/// let r = stream.finish()?;
/// assert!((r[(0, 1)] / r[(0, 0)] - 2.5).abs() < 1e-14);
/// # Ok::<(), ff_linalg::LinalgError>(())
/// ```
pub struct Stream<L> {
    /// Columns and right-hand side.
    width: usize,
    /// Triangles, row by row.
    r: Vec<L>,
    /// Sign of the diagonal, the same in every lane: it turns with every reflection.
    sign: Vec<f64>,
    /// Rows that wait, column by column.
    waiting: Vec<[L; ROWS]>,
    filled: usize,
}

impl<L: LaneScalar> Stream<L> {
    /// For rows of `columns` entries and a right-hand side. Allocates.
    pub fn new(columns: usize) -> Self {
        let (width, z) = (columns + 1, L::splat(0.0));
        Self { width, r: vec![z; width * width], sign: vec![1.0; width], waiting: vec![[z; ROWS]; width], filled: 0 }
    }
    /// Entry `column` of the row that is being written; column `columns` is the right-hand side.
    #[inline(always)]
    pub fn put(&mut self, column: usize, x: L) {
        self.waiting[column][self.filled] = x;
    }
    /// Ends the row, all of whose entries must have been [`Stream::put`].
    #[inline(always)]
    pub fn end_row(&mut self) {
        self.filled += 1;
        if self.filled == ROWS {
            fold(self.width, &mut self.r, &mut self.sign, &mut self.waiting);
            self.filled = 0;
        }
    }
    /// Folds the rows that wait. Must come last, and from within the kernel: a fold that is not inlined there is slow.
    #[inline(always)]
    pub fn flush(&mut self) {
        if self.filled > 0 {
            for column in &mut self.waiting {
                column[self.filled..].fill(L::splat(0.0));
            }
            fold(self.width, &mut self.r, &mut self.sign, &mut self.waiting);
            self.filled = 0;
        }
    }
    /// The triangle of all lanes. Allocates.
    ///
    /// # Errors
    /// [`LinalgError::NotFinite`].
    pub fn finish(self) -> Result<DMatrix<f64>, LinalgError> {
        assert!(self.filled == 0, "rows still wait");
        let n = self.width;
        // At most eight rows per column: `qr_r` factorises it in one piece.
        let mut all = DMatrix::zeros(n * L::N, n);
        for i in 0..n {
            for k in i..n {
                for lane in 0..L::N {
                    all[(i * L::N + lane, k)] = self.r[i * n + k].lane(lane);
                }
            }
        }
        linalg::qr_r(&all)
    }
}

/// `[R; C] = Q R'` in every lane, for an upper triangle `R` and [`ROWS`] rows `C`, which become meaningless.
///
/// Reflections `1 - t v v^T`, `v = [1; c / (alpha - beta)]`, `t = (beta - alpha) / beta` with `beta` of the sign opposite
/// to `alpha`, so that nothing cancels (Golub and Van Loan, algorithm 5.1.1).
#[inline(always)]
fn fold<L: LaneScalar>(n: usize, r: &mut [L], sign: &mut [f64], c: &mut [[L; ROWS]]) {
    let zero = L::splat(0.0);
    for k in 0..n {
        let (head, tail) = c.split_at_mut(k + 1);
        let mut v = head[k];
        let row = &mut r[k * n + k..(k + 1) * n];
        let alpha = row[0];
        let mut s = [L::splat(NOTHING), zero, zero, alpha * alpha];
        for (i, &x) in v.iter().enumerate() {
            s[i % 4] = Lanes::mul_add(x, x, s[i % 4]);
        }
        sign[k] = -sign[k];
        let beta = ((s[0] + s[1]) + (s[2] + s[3])).sqrt() * L::splat(sign[k]);
        let first = alpha - beta;
        let minus_t = first / beta;
        let inverse = L::splat(1.0) / first;
        for x in &mut v {
            *x *= inverse;
        }
        row[0] = beta;
        for (top, column) in row[1..].iter_mut().zip(tail) {
            let mut d = [*top, zero, zero, zero];
            for i in 0..ROWS {
                d[i % 4] = Lanes::mul_add(v[i], column[i], d[i % 4]);
            }
            let t = ((d[0] + d[1]) + (d[2] + d[3])) * minus_t;
            *top += t;
            for i in 0..ROWS {
                column[i] = Lanes::mul_add(v[i], t, column[i]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use ff_testkit::scaled;

    const N: usize = 7;
    fn rows(count: usize) -> DMatrix<f64> {
        let scale = [1.0, 300.0, 0.02, 5.0, 40.0, 0.7, 9.0];
        DMatrix::from_fn(count, N, |i, k| {
            scale[k] * ((0.37 * (k + 1) as f64) * i as f64 + 0.4 + (i * k % 5) as f64).sin()
        })
    }
    /// Rows of a triangle have no fixed sign.
    fn same(a: &DMatrix<f64>, b: &DMatrix<f64>) {
        for i in 0..N {
            let s = a[(i, i)].signum() * b[(i, i)].signum();
            for k in i..N {
                let limit = 1e-12 * a.column(k).norm();
                assert!((a[(i, k)] - s * b[(i, k)]).abs() < limit, "{i} {k}: {} {}", a[(i, k)], b[(i, k)]);
            }
        }
    }

    struct InLanes<'a>(&'a DMatrix<f64>);
    impl LaneTask for InLanes<'_> {
        type Output = DMatrix<f64>;
        #[inline(always)]
        fn run<L: LaneScalar>(self) -> DMatrix<f64> {
            let mut s = Stream::<L>::new(N - 1);
            for first in (0..self.0.nrows()).step_by(L::N) {
                for k in 0..N {
                    let at = |lane: usize| if first + lane < self.0.nrows() { self.0[(first + lane, k)] } else { 0.0 };
                    let x: [f64; 8] = core::array::from_fn(at);
                    s.put(k, L::load(&x));
                }
                s.end_row();
            }
            s.flush();
            s.finish().unwrap()
        }
    }

    #[test]
    fn any_width_gives_the_triangle_of_the_whole_matrix() {
        for count in [5, 40, 1003] {
            let a = rows(count);
            let mut whole = DMatrix::zeros(N.max(count), N);
            whole.rows_mut(0, count).copy_from(&a);
            let r = linalg::qr_r(&whole).unwrap();
            for isa in ff_testkit::isa::instruction_sets() {
                let got = dispatch(isa, InLanes(&a));
                assert_relative_eq!(
                    got.transpose() * &got,
                    a.transpose() * &a,
                    max_relative = scaled(1e-12),
                    epsilon = scaled(1e-9)
                );
                if count >= N {
                    same(&r, &got);
                }
            }
            if count >= N {
                same(&r, &triangle_of(&Tall::new(&a)).unwrap());
            }
            let mut plain = TallQr::new(N);
            plain.push(&a.rows(0, 3).into_owned()).unwrap();
            plain.push(&a.rows(3, count - 3).into_owned()).unwrap();
            let (got, folded) = plain.finish().unwrap();
            assert_eq!(folded, count);
            if count >= N {
                same(&r, &got);
            }
        }
    }

    #[test]
    fn the_triangle_keeps_what_the_gram_matrix_loses() {
        // Two columns that differ by 1e-9 of their size: the Gram matrix sees one of them.
        let mut a = rows(400);
        let c = DVector::from_fn(400, |i, _| a[(i, 1)] + 3e-7 * (0.11 * i as f64).cos());
        a.set_column(2, &c);
        let a = a.columns(0, 6).into_owned();
        let mut wide = DMatrix::zeros(400, N);
        wide.columns_mut(0, 6).copy_from(&a);
        let r = dispatch(Isa::detect(), InLanes(&wide)).view((0, 0), (6, 6)).into_owned();
        let exact = linalg::singular_values(&a).unwrap();
        let kept = linalg::singular_values(&r).unwrap();
        assert_relative_eq!(kept[5], exact[5], max_relative = scaled(1e-5));
        let gram = linalg::symmetric_eigen(&linalg::gram(&a).unwrap()).unwrap().0;
        assert!((gram[0].abs().sqrt() / exact[5] - 1.0).abs() > 1.0, "{} {}", gram[0], exact[5]);
    }

    #[test]
    fn merging_weighs_each_kind_and_keeps_its_columns_apart() {
        let a = rows(60);
        let tri = |columns: Vec<usize>, from: usize, count: usize| {
            let mut own = DMatrix::zeros(count, columns.len() + 1);
            for (k, &c) in columns.iter().chain(&[N - 1]).enumerate() {
                own.set_column(k, &a.column(c).rows(from, count));
            }
            let mut q = TallQr::new(columns.len() + 1);
            q.push(&own).unwrap();
            let (r, rows) = q.finish().unwrap();
            Triangle { name: "t".into(), columns, r, rows }
        };
        let parts = [tri(vec![0, 2, 3], 0, 25), tri(vec![1, 2, 4, 5], 25, 35)];
        let sigma = [0.3, 7.0];
        let m = merge(N - 1, &parts, &sigma).unwrap();
        let mut whole = DMatrix::zeros(60, N);
        for (i, k) in (0..25).flat_map(|i| [0, 2, 3, 6].map(|k| (i, k))) {
            whole[(i, k)] = a[(i, k)] / 0.3;
        }
        for (i, k) in (25..60).flat_map(|i| [1, 2, 4, 5, 6].map(|k| (i, k))) {
            whole[(i, k)] = a[(i, k)] / 7.0;
        }
        let x = linalg::least_squares(&whole.columns(0, 6).into_owned(), &whole.column(6).into_owned()).unwrap();
        let y = m.r.solve_upper_triangular(&m.d).unwrap();
        assert_relative_eq!(x, y, max_relative = scaled(1e-9));
        let residual = (whole.columns(0, 6) * &x - whole.column(6)).norm_squared();
        assert_relative_eq!(m.rest, residual, max_relative = scaled(1e-9));
        let by_parts = parts[0].cost(x.as_slice()) / 0.09 + parts[1].cost(x.as_slice()) / 49.0;
        assert_relative_eq!(by_parts, residual, max_relative = scaled(1e-9));
        assert_eq!(m.rows, 60);
    }
}
