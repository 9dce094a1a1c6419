//! A linearisation folded into its triangle while it is handed out ([`crate::estimate::row_stream`]): memory does not grow with the rows.
//!
//! Every block is reduced by itself and merged with the triangle of the blocks before it in its stream; the triangles of the streams
//! are merged in their order. Which thread goes through which stream plays no part in that, so that any number of threads gives the
//! same bits.

use crate::estimate::estimator::Estimator;
use crate::estimate::row_stream::{RowBlock, RowStream};
use crate::solve::loss::Loss;
use ff_least_squares::EvalError;
use ff_least_squares::{NOT_FINITE, rounding};
use ff_least_squares::{Tall, triangle_of};
use ff_linalg::LinalgError;
use nalgebra::{DMatrix, DVector};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Where a linearisation is taken, of what.
#[derive(Clone, Copy)]
pub(crate) struct At<'a> {
    pub(crate) full: &'a [f64],
    pub(crate) extra: &'a [f64],
    pub(crate) selected: &'a [usize],
    pub(crate) threads: usize,
}

/// What is left of a linearisation.
#[derive(Clone, Debug, Default)]
pub(crate) struct Folded {
    /// Upper triangle of `[J r]`, after the loss.
    pub(crate) triangle: DMatrix<f64>,
    /// Upper triangle of `J` before the loss; empty for squares, where it is part of the other.
    pub(crate) plain: DMatrix<f64>,
    /// See [`ff_least_squares::Linearise::rounding`].
    pub(crate) rounding: f64,
}

impl Folded {
    /// With the rows of a later block or stream below.
    fn merge(self, later: Self) -> Result<Self, LinalgError> {
        Ok(Self {
            triangle: stacked(self.triangle, later.triangle)?,
            plain: stacked(self.plain, later.plain)?,
            rounding: self.rounding + later.rounding,
        })
    }
}

/// The triangle of two triangles, one below the other.
fn stacked(a: DMatrix<f64>, b: DMatrix<f64>) -> Result<DMatrix<f64>, LinalgError> {
    if a.is_empty() {
        return Ok(b);
    }
    let n = a.ncols();
    let mut both = DMatrix::zeros(a.nrows() + b.nrows(), n);
    both.rows_mut(0, a.nrows()).copy_from(&a);
    both.rows_mut(a.nrows(), b.nrows()).copy_from(&b);
    ff_linalg::qr_r(&both)
}

/// What no trial point can repair ends the fit; numbers that are not finite are a reason to step less far.
fn refused(e: LinalgError) -> EvalError {
    match e {
        LinalgError::NotFinite { .. } => EvalError::Rejected(NOT_FINITE.into()),
        e => EvalError::Fatal(Box::new(e)),
    }
}

fn locked<T>(m: &Mutex<T>) -> MutexGuard<'_, T> {
    m.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Goes through all streams on as many threads as asked for, and gives what `each` makes of them, in their order.
fn side_by_side<T: Send>(
    streams: Vec<Box<dyn RowStream + '_>>,
    threads: usize,
    each: impl Fn(&mut dyn RowStream) -> Result<T, EvalError> + Sync,
) -> Result<Vec<T>, EvalError> {
    let threads = threads.clamp(1, streams.len().max(1));
    let done: Mutex<Vec<Option<Result<T, EvalError>>>> = Mutex::new(streams.iter().map(|_| None).collect());
    let queue = Mutex::new(streams.into_iter().enumerate());
    let work = || {
        loop {
            let next = locked(&queue).next();
            let Some((i, mut stream)) = next else { break };
            let result = each(&mut *stream);
            locked(&done)[i] = Some(result);
        }
    };
    if threads == 1 {
        work();
    } else {
        std::thread::scope(|s| (0..threads).for_each(|_| drop(s.spawn(work))));
    }
    // Each has been gone through; the first error in the order of the streams is the one that is told.
    done.into_inner().unwrap_or_else(PoisonError::into_inner).into_iter().flatten().collect()
}

/// Folds the linearisation `at` a point; whitened residuals before the loss go to `residuals`, one per row of the estimator.
pub(crate) fn fold<E: Estimator + ?Sized>(
    estimator: &mut E,
    at: At<'_>,
    loss: Loss,
    residuals: &mut [f64],
) -> Result<Folded, EvalError> {
    let values = values(&at);
    let to = Mutex::new(residuals);
    let each = |stream: &mut dyn RowStream| {
        let (mut block, mut all) = (RowBlock::default(), Folded::default());
        while stream.next(&mut block)? {
            for (rows, from) in block.places() {
                let count = rows.len();
                locked(&to)[rows].copy_from_slice(&block.residuals[from..from + count]);
            }
            let part = of_block(&block, &values, loss).map_err(refused)?;
            all = all.merge(part).map_err(refused)?;
        }
        Ok(all)
    };
    let parts = side_by_side(estimator.streams(at.full, at.extra, at.selected)?, at.threads, each)?;
    parts.into_iter().try_fold(Folded::default(), Folded::merge).map_err(refused)
}

/// The unknowns that columns belong to, in physical units.
fn values(at: &At<'_>) -> Vec<f64> {
    at.selected.iter().map(|&i| at.full[i]).chain(at.extra.iter().copied()).collect()
}

fn of_block(block: &RowBlock, values: &[f64], loss: Loss) -> Result<Folded, LinalgError> {
    let whole = Tall::new(&block.jacobian);
    if loss == Loss::Squares {
        let triangle = triangle_of(&whole.with(&block.residuals))?;
        return Ok(Folded {
            triangle,
            plain: DMatrix::default(),
            rounding: rounding(&block.jacobian, values, &block.residuals),
        });
    }
    let (roots, slopes): (Vec<f64>, Vec<f64>) = block.residuals.iter().map(|&r| loss.root(r)).unzip();
    Ok(Folded {
        triangle: triangle_of(&whole.with(&roots).weighted(&slopes))?,
        plain: triangle_of(&whole)?,
        rounding: rounding(&block.jacobian, values, &roots),
    })
}

/// `J^T diag(weights) v` by going through the rows once more; no weights are ones.
pub(crate) fn transposed<E: Estimator + ?Sized>(
    estimator: &mut E,
    at: At<'_>,
    v: &[f64],
    weights: &[f64],
) -> Result<DVector<f64>, EvalError> {
    let columns = at.selected.len() + at.extra.len();
    let each = |stream: &mut dyn RowStream| {
        let (mut block, mut sum) = (RowBlock::default(), DVector::zeros(columns));
        while stream.next(&mut block)? {
            let mut own = DVector::zeros(block.count());
            for (rows, from) in block.places() {
                for (k, row) in rows.enumerate() {
                    own[from + k] = v[row] * weights.get(row).copied().unwrap_or(1.0);
                }
            }
            sum.gemv_tr(1.0, &block.jacobian, &own, 1.0);
        }
        Ok(sum)
    };
    let parts = side_by_side(estimator.streams(at.full, at.extra, at.selected)?, at.threads, each)?;
    Ok(parts.into_iter().fold(DVector::zeros(columns), |s, p| s + p))
}
