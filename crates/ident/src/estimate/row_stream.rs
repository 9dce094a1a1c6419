//! Rows of a linearisation block by block, for those who need not hold all of them.
//!
//! An estimator hands out [`RowStream`]s ([`crate::Estimator::streams`]). The blocks of a stream come in order, because a simulation
//! goes on where the block before has ended; streams share nothing and may be gone through side by side. How the rows are cut into
//! streams and blocks depends on the data alone, never on the number of threads, so that whatever is summed in a fixed order has
//! the same bits on any machine of the same kind.

use core::ops::Range;
use ff_least_squares::EvalError;
use nalgebra::DMatrix;

/// Some rows of a linearisation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RowBlock {
    /// Which rows of the estimator they are; the ranges follow one another in the block.
    pub rows: Vec<Range<usize>>,
    /// Whitened residuals, one per row.
    pub residuals: Vec<f64>,
    /// Their derivatives: columns are the selected parameters, then nuisance unknowns.
    pub jacobian: DMatrix<f64>,
}

impl RowBlock {
    /// Makes room for these rows and so many columns; contents are unspecified. Allocates unless there was a block as large.
    pub fn resize(&mut self, rows: &[Range<usize>], columns: usize) {
        self.rows.clear();
        self.rows.extend_from_slice(rows);
        let count = self.count();
        self.residuals.resize(count, 0.0);
        if self.jacobian.shape() != (count, columns) {
            let buffer = core::mem::take(&mut self.jacobian);
            let mut data: Vec<f64> = buffer.data.into();
            data.resize(count * columns, 0.0);
            self.jacobian = DMatrix::from_vec(count, columns, data);
        }
    }
    /// Number of rows.
    pub fn count(&self) -> usize {
        self.rows.iter().map(Range::len).sum()
    }
    /// Every range with where its rows begin in the block.
    pub fn places(&self) -> impl Iterator<Item = (Range<usize>, usize)> + '_ {
        self.rows.iter().scan(0, |at, r| {
            let here = *at;
            *at += r.len();
            Some((r.clone(), here))
        })
    }
}

/// Blocks of rows, one after the other.
pub trait RowStream: Send {
    /// The next rows into `block`, whose buffers are used again; false when there are none left.
    ///
    /// # Errors
    /// [`EvalError`]; the stream is then at its end.
    fn next(&mut self, block: &mut RowBlock) -> Result<bool, EvalError>;
}

/// Rows that are at hand, as a stream of one block.
pub(crate) struct Whole(pub(crate) Option<RowBlock>);

impl RowStream for Whole {
    fn next(&mut self, block: &mut RowBlock) -> Result<bool, EvalError> {
        let Some(all) = self.0.take() else { return Ok(false) };
        *block = all;
        Ok(true)
    }
}

/// Multiplies rows by the roots of their weights. Does not allocate.
pub(crate) fn weigh<'a>(rows: impl IntoIterator<Item = &'a mut f64>, roots: &[f64]) {
    rows.into_iter().zip(roots).for_each(|(x, w)| *x *= w);
}
