//! Rows over unknowns that parameters are tied to, made of rows over the parameters.

use crate::estimate::row_stream::{RowBlock, RowStream};
use ff_least_squares::EvalError;
use nalgebra::DMatrix;
use std::sync::Arc;

/// How columns over the shorter vector are made of those over the full one.
pub(crate) struct TiedColumns {
    /// What the selection touches: itself, and the parameters of its ties.
    pub(crate) wanted: Vec<usize>,
    /// By selected unknown: column of the full vector, or those of a tie with their derivatives.
    pub(crate) made: Vec<Made>,
    /// Columns of nuisance unknowns.
    pub(crate) extras: usize,
}

pub(crate) enum Made {
    Free(usize),
    Tied(Vec<(usize, f64)>),
}

impl TiedColumns {
    /// Columns over the full vector.
    pub(crate) fn inner(&self) -> usize {
        self.wanted.len() + self.extras
    }
    pub(crate) fn gather(&self, from: &DMatrix<f64>, to: &mut DMatrix<f64>) {
        for (c, made) in self.made.iter().enumerate() {
            match made {
                Made::Free(i) => to.set_column(c, &from.column(*i)),
                Made::Tied(parts) => {
                    to.column_mut(c).fill(0.0);
                    parts.iter().for_each(|(i, d)| to.column_mut(c).axpy(*d, &from.column(*i), 1.0));
                }
            }
        }
        to.columns_mut(self.made.len(), self.extras).copy_from(&from.columns(self.wanted.len(), self.extras));
    }
}

/// Rows over the shorter vector.
pub(crate) struct TiedRows<'s> {
    pub(crate) inner: Box<dyn RowStream + 's>,
    pub(crate) columns: Arc<TiedColumns>,
    pub(crate) buffer: RowBlock,
}

impl RowStream for TiedRows<'_> {
    fn next(&mut self, block: &mut RowBlock) -> Result<bool, EvalError> {
        if !self.inner.next(&mut self.buffer)? {
            return Ok(false);
        }
        block.resize(&self.buffer.rows, self.columns.made.len() + self.columns.extras);
        core::mem::swap(&mut block.residuals, &mut self.buffer.residuals);
        self.columns.gather(&self.buffer.jacobian, &mut block.jacobian);
        Ok(true)
    }
}
