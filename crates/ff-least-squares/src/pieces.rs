//! Rows that know the same few columns.
//!
//! Beside unknowns that all rows depend on there may be some that belong to a few: a bias of one of ten records, the part of a walk that begins
//! late in it. Their columns are zero but for a range of rows. Cut where ranges begin and end, a matrix of m rows has pieces with few columns
//! each; their triangles cost `2 m w^2` for w columns that are not zero in place of `2 m n^2`, and are merged like any others
//! ([`crate::merge`]; block angular matrices: Å. Björck, *Numerical Methods for Least Squares Problems*, 1996, 6.3).

use nalgebra::DMatrix;
use std::ops::Range;

/// Rows, and the columns that are not zero there, ascending.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Piece {
    pub(crate) rows: Range<usize>,
    pub(crate) columns: Vec<usize>,
}

/// Most places at which a matrix is cut; of more, as many are looked at.
const CUTS: usize = 200;
/// Columns below which it is not worth looking.
const FEW: usize = 12;
/// Share of the operations that pieces must leave to be worth their bookkeeping.
const WORTH: f64 = 0.8;
/// Lanes whose triangles are merged into that of a piece, on common machines.
const LANES: f64 = 4.0;

/// Range of the rows in which a column has entries.
fn span(column: &[f64]) -> Range<usize> {
    match column.iter().position(|x| *x != 0.0) {
        None => 0..0,
        Some(first) => first..column.iter().rposition(|x| *x != 0.0).map_or(first, |last| last + 1),
    }
}

/// Operations for the triangle of rows over w columns, and for merging it into one over n.
fn work(rows: usize, w: usize, n: usize) -> f64 {
    let (rows, w, n) = (rows as f64, w as f64, n as f64);
    2.0 * (rows * w * w + LANES * w.powi(3) + w * n * n)
}

/// The pieces that cost least, in their order; one with all rows and columns where it is as good. `beside` is the number of further columns that
/// all rows know.
pub(crate) fn pieces(a: &DMatrix<f64>, beside: usize) -> Vec<Piece> {
    let (m, n) = a.shape();
    let whole = || vec![Piece { rows: 0..m, columns: (0..n).collect() }];
    if n < FEW || m == 0 {
        return whole();
    }
    let spans: Vec<Range<usize>> = a.as_slice().chunks_exact(m).map(span).collect();
    let mut cuts: Vec<usize> = spans.iter().flat_map(|s| [s.start, s.end]).chain([0, m]).collect();
    cuts.sort_unstable();
    cuts.dedup();
    let every = cuts.len().div_ceil(CUTS);
    cuts = cuts.iter().copied().enumerate().filter(|(k, at)| k % every == 0 || *at == m).map(|(_, at)| at).collect();
    let mut by_start: Vec<&Range<usize>> = spans.iter().filter(|s| !s.is_empty()).collect();
    by_start.sort_unstable_by_key(|s| s.start);
    // Cheapest way to the end of the rows before each cut, and the cut at which its last piece begins.
    let mut best = vec![(f64::INFINITY, 0); cuts.len()];
    best[0] = (0.0, 0);
    for i in 0..cuts.len() {
        let (mut known, mut next) = (beside, 0);
        for j in i + 1..cuts.len() {
            while let Some(s) = by_start.get(next).filter(|s| s.start < cuts[j]) {
                known += usize::from(s.end > cuts[i]);
                next += 1;
            }
            let cost = best[i].0 + work(cuts[j] - cuts[i], known, n + beside);
            if cost < best[j].0 {
                best[j] = (cost, i);
            }
        }
    }
    let last = cuts.len() - 1;
    let plain = 2.0 * (m as f64 + LANES * (n + beside) as f64) * ((n + beside) as f64).powi(2);
    if best[last].0 > WORTH * plain {
        return whole();
    }
    let (mut out, mut at) = (Vec::new(), last);
    while at > 0 {
        let rows = cuts[best[at].1]..cuts[at];
        let columns = (0..n).filter(|&k| spans[k].start < rows.end && spans[k].end > rows.start).collect();
        out.push(Piece { rows, columns });
        at = best[at].1;
    }
    out.reverse();
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tall_qr::{Tall, triangle_of};
    use approx::assert_relative_eq;
    use ff_testkit::scaled;

    /// Four records of 3000 rows that share 5 columns and have 8 of their own, the last of which begins late.
    fn records() -> DMatrix<f64> {
        DMatrix::from_fn(12_000, 5 + 4 * 8, |i, k| {
            let (record, own) = (i / 3000, k.wrapping_sub(5));
            let mine = k < 5 || (own / 8 == record && (own % 8 < 7 || i % 3000 > 1500));
            if mine { (0.37 * (k + 1) as f64 + 0.013 * (k % 7 + 1) as f64 * i as f64).sin() + 0.2 } else { 0.0 }
        })
    }

    #[test]
    fn records_are_pieces_of_their_own() {
        let a = records();
        let found = pieces(&a, 1);
        assert!(found.len() >= 4 && found.iter().all(|p| p.columns.len() <= 13), "{found:?}");
        assert_eq!((found[0].rows.start, found[found.len() - 1].rows.end), (0, 12_000));
        assert!(found.windows(2).all(|p| p[0].rows.end == p[1].rows.start));
        for p in &found {
            let outside = (0..a.ncols()).filter(|k| !p.columns.contains(k));
            assert!(
                outside.into_iter().all(|k| a.column(k).rows(p.rows.start, p.rows.len()).iter().all(|x| *x == 0.0))
            );
        }
    }

    #[test]
    fn a_full_matrix_is_one_piece() {
        let a = DMatrix::from_fn(5000, 40, |i, k| ((k + 1) as f64 * 0.11 * i as f64).cos() + 0.3);
        assert_eq!(pieces(&a, 1), [Piece { rows: 0..5000, columns: (0..40).collect() }]);
    }

    #[test]
    fn the_triangle_of_pieces_is_that_of_the_whole() {
        let a = records();
        let b: Vec<f64> = (0..a.nrows()).map(|i| (0.21 * i as f64).sin() - 0.1).collect();
        let weights: Vec<f64> = (0..a.nrows()).map(|i| 0.5 + (i % 3) as f64).collect();
        let r = triangle_of(&Tall::new(&a).with(&b).weighted(&weights)).unwrap();
        let full =
            DMatrix::from_fn(
                a.nrows(),
                a.ncols() + 1,
                |i, k| if k < a.ncols() { a[(i, k)] * weights[i] } else { b[i] },
            );
        assert_relative_eq!(r.tr_mul(&r), full.tr_mul(&full), max_relative = scaled(1e-11), epsilon = scaled(1e-8));
        assert_relative_eq!(r.upper_triangle(), r);
        // One record among the columns of all: what it does not know has rows of zeros.
        let own = a.rows(3000, 3000).into_owned();
        let r = triangle_of(&Tall::new(&own).with(&b[3000..6000])).unwrap();
        let full = own.clone().insert_column(own.ncols(), 0.0);
        let full =
            DMatrix::from_fn(3000, own.ncols() + 1, |i, k| if k < own.ncols() { full[(i, k)] } else { b[3000 + i] });
        assert_relative_eq!(r.tr_mul(&r), full.tr_mul(&full), max_relative = scaled(1e-11), epsilon = scaled(1e-8));
        assert_relative_eq!(r.upper_triangle(), r);
        // A number that is none is seen wherever it is.
        let mut bad = a;
        bad[(7000, 36)] = f64::NAN;
        assert!(triangle_of(&Tall::new(&bad)).is_err());
    }
}
