//! Columns along directions in the space of parameters and nuisance unknowns, not only along single ones.
//!
//! A tie, an error that records share, a change from one record to the next: each is a function of which parameters and nuisance
//! unknowns are made, `(p, e) = f(q)`, and its columns are `J df/dq`. An estimator that integrates sensitivities can integrate those
//! sums themselves: one column for the ten numbers of a body that is heavier, not ten ([`crate::Estimator::jacobian_along`]).
//! Others make their columns one by one, and they are summed here.

use crate::estimate::row_stream::{RowBlock, RowStream};
use ff_least_squares::EvalError;
use nalgebra::DMatrix;
use std::sync::Arc;

/// A direction: what a column of a Jacobian is the derivative along. Its parts are unknowns with their factors; the indices of
/// nuisance unknowns follow those of all parameters. Without parts, a direction that nothing depends on.
///
/// ```
/// use ident::estimate::Direction;
///
/// // Of 60 parameters: mass and first moment of a body in proportion, and the second nuisance unknown.
/// let (heavier, bias) = (Direction(vec![(10, 8.6), (11, 0.86)]), Direction::of(60 + 1));
/// assert_eq!((heavier.0.len(), bias.only()), (2, Some(61)));
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Direction(pub Vec<(usize, f64)>);

impl Direction {
    /// Along one unknown. Allocates.
    pub fn of(unknown: usize) -> Self {
        Self(vec![(unknown, 1.0)])
    }
    /// The one unknown that it is along.
    pub fn only(&self) -> Option<usize> {
        match self.0[..] {
            [(unknown, 1.0)] => Some(unknown),
            _ => None,
        }
    }
    /// Those of `selected` parameters and of all nuisance unknowns, in the order of [`crate::Estimator::jacobian`]. Allocates.
    pub fn of_columns(selected: &[usize], parameters: usize, nuisance: usize) -> Vec<Self> {
        let nuisance = parameters..parameters + nuisance;
        selected.iter().copied().chain(nuisance).map(Self::of).collect()
    }
    /// The direction over other unknowns, each of the present ones being `slopes`. Allocates.
    ///
    /// # Panics
    /// If an unknown has no slope.
    #[must_use]
    pub fn through(&self, slopes: &[Self]) -> Self {
        let mut out: Vec<(usize, f64)> = Vec::new();
        for &(unknown, by) in &self.0 {
            for &(k, slope) in &slopes[unknown].0 {
                match out.iter_mut().find(|o| o.0 == k) {
                    Some(o) => o.1 += by * slope,
                    None => out.push((k, by * slope)),
                }
            }
        }
        Self(out)
    }
}

/// How columns along directions are made of those along single unknowns.
pub(crate) struct Sums {
    /// Parameters that they touch, ascending.
    pub(crate) wanted: Vec<usize>,
    /// By column: columns of wanted parameters, then nuisance, with their factors.
    made: Vec<Vec<(usize, f64)>>,
}

impl Sums {
    /// For so many parameters in all.
    pub(crate) fn new(parameters: usize, along: &[Direction]) -> Self {
        let parts = along.iter().flat_map(|d| &d.0);
        let mut wanted: Vec<usize> = parts.map(|p| p.0).filter(|&i| i < parameters).collect();
        wanted.sort_unstable();
        wanted.dedup();
        let mut column = vec![0; parameters];
        wanted.iter().enumerate().for_each(|(c, &i)| column[i] = c);
        let at = |i: usize| if i < parameters { column[i] } else { wanted.len() + i - parameters };
        let made = along.iter().map(|d| d.0.iter().map(|&(i, by)| (at(i), by)).collect()).collect();
        Self { wanted, made }
    }
    /// With the directions of the columns that it takes: those of wanted parameters and all of so many nuisance unknowns.
    pub(crate) fn every(parameters: usize, nuisance: usize, along: &[Direction]) -> (Self, Vec<Direction>) {
        let sums = Self::new(parameters, along);
        let every = Direction::of_columns(&sums.wanted, parameters, nuisance);
        (sums, every)
    }
    pub(crate) fn gather(&self, from: &DMatrix<f64>, to: &mut DMatrix<f64>) {
        for (made, mut to) in self.made.iter().zip(to.column_iter_mut()) {
            match made[..] {
                [(i, 1.0)] => to.copy_from(&from.column(i)),
                _ => {
                    to.fill(0.0);
                    made.iter().for_each(|(i, by)| to.axpy(*by, &from.column(*i), 1.0));
                }
            }
        }
    }
    /// Streams of the columns made of those of `streams`.
    pub(crate) fn over<'s>(self, streams: Vec<Box<dyn RowStream + 's>>) -> Vec<Box<dyn RowStream + 's>> {
        let sums = Arc::new(self);
        let summed = |inner| -> Box<dyn RowStream + 's> {
            Box::new(Summed { inner, sums: Arc::clone(&sums), buffer: RowBlock::default() })
        };
        streams.into_iter().map(summed).collect()
    }
}

/// Rows along directions.
struct Summed<'s> {
    inner: Box<dyn RowStream + 's>,
    sums: Arc<Sums>,
    buffer: RowBlock,
}

impl RowStream for Summed<'_> {
    fn next(&mut self, block: &mut RowBlock) -> Result<bool, EvalError> {
        if !self.inner.next(&mut self.buffer)? {
            return Ok(false);
        }
        block.resize(&self.buffer.rows, self.sums.made.len());
        core::mem::swap(&mut block.residuals, &mut self.buffer.residuals);
        self.sums.gather(&self.buffer.jacobian, &mut block.jacobian);
        Ok(true)
    }
}

/// Directions that an estimator makes columns of without a detour: along parameters, their sums, and nuisance unknowns once each.
pub(crate) struct Straight {
    /// Parameters, and sums of them.
    pub(crate) params: Vec<usize>,
    pub(crate) combined: Vec<Vec<(usize, f64)>>,
    /// By column in the order parameters, sums: where it belongs.
    pub(crate) to: Vec<usize>,
    /// By nuisance unknown: where its column belongs, if there is one.
    pub(crate) extra: Vec<Option<usize>>,
}

impl Straight {
    /// `None` where a direction is of another kind.
    pub(crate) fn new(parameters: usize, nuisance: usize, along: &[Direction]) -> Option<Self> {
        let (mut params, mut combined, mut extra) = (Vec::new(), Vec::new(), vec![None; nuisance]);
        for (column, d) in along.iter().enumerate() {
            match d.only() {
                Some(i) if i < parameters => params.push((i, column)),
                Some(i) if extra[i - parameters].is_none() => extra[i - parameters] = Some(column),
                None if d.0.iter().all(|p| p.0 < parameters) => combined.push((d.0.clone(), column)),
                _ => return None,
            }
        }
        let (params, mut to): (Vec<usize>, Vec<usize>) = params.into_iter().unzip();
        let (combined, places): (Vec<_>, Vec<usize>) = combined.into_iter().unzip();
        to.extend(places);
        Some(Self { params, combined, to, extra })
    }
    /// Columns of all of them.
    pub(crate) fn columns(&self) -> usize {
        self.to.len() + self.extra.iter().flatten().count()
    }
    /// Nuisance unknowns among `of` with a column, counted from its beginning.
    pub(crate) fn wanted(&self, of: core::ops::Range<usize>) -> impl Iterator<Item = usize> + '_ {
        let first = of.start;
        of.filter(|&k| self.extra[k].is_some()).map(move |k| k - first)
    }
}
