//! A record of output error gone through span by span: state and sensitivities are handed from one to the next.
//!
//! A span is [`SPAN`] samples of the grid. Where readings are interpolated, those are handed out whose six samples of the grid have
//! come, and the samples that later readings need are kept.

use crate::estimate::along::Straight;
use crate::estimate::output_rows::{Operators, OutputRows, Readings, Window};
use crate::estimate::row_stream::{RowBlock, RowStream};
use crate::motion::tables::{Displaced, Table, Tables};
use ff_dynamics::Wanted;
use ff_dynamics::reduced::ReducedError;
use ff_dynamics::reduced::sensitivity::{Carried, sensitivities_span};
use ff_least_squares::EvalError;
use ff_model::Params;

/// Samples of a span: a few megabytes of rows, and little beside them to set up.
pub(crate) const SPAN: usize = 512;

/// Spans of a record, and which readings each completes.
pub(crate) struct Spans<'s, 'a> {
    rows: &'s OutputRows<'a>,
    tables: &'s mut Tables,
    params: Params<f64>,
    placed: Displaced,
    wanted: Wanted,
    by: Operators,
    /// Samples of a span.
    length: usize,
    /// First sample of the grid of the next span, and readings handed out.
    next: usize,
    done: [usize; 2],
    held: Option<Window>,
}

pub(crate) fn failed(e: ReducedError) -> EvalError {
    EvalError::Rejected(e.to_string())
}

impl<'s, 'a> Spans<'s, 'a> {
    pub(crate) fn new(
        rows: &'s OutputRows<'a>,
        tables: &'s mut Tables,
        (params, placed): (Params<f64>, Displaced),
        wanted: Wanted,
        by: Operators,
        length: usize,
    ) -> Self {
        Self { rows, tables, params, placed, wanted, by, length, next: 0, done: [0; 2], held: None }
    }
    pub(crate) fn operators(&self) -> &Operators {
        &self.by
    }
    /// The next window with readings that it completes, of what `make` gives for the samples of a table; `None` at the end.
    pub(crate) fn advance(
        &mut self,
        mut make: impl FnMut(&Params<f64>, &Wanted, &Table<'_>, usize) -> Result<Window, EvalError>,
    ) -> Result<Option<(Window, Readings)>, EvalError> {
        let all = self.rows.grid.0;
        while self.next < all {
            let span = self.next..(self.next + self.length).min(all);
            let table = self.tables.span(self.rows.model, &self.params, &self.placed, &self.wanted, span.clone());
            let new = make(&self.params, &self.wanted, &table, span.start)?;
            self.next = span.end;
            let window = match self.held.take() {
                Some(held) => held.followed_by(&new, self.needed()),
                None => new,
            };
            let of = self.completed(span.end);
            self.done = [of[0].end, of[1].end];
            if self.by.iter().any(Option::is_some) && span.end < all {
                // The next span joins on what is needed of this one.
                self.held = Some(window.clone());
            }
            if of.iter().any(|r| !r.is_empty()) {
                return Ok(Some((window, of)));
            }
        }
        Ok(None)
    }
    /// First sample of the grid that readings which are not handed out yet need.
    fn needed(&self) -> usize {
        let of = |g: usize| match &self.by[g] {
            Some(o) if self.done[g] < self.rows.readings()[g].end => o.first(self.done[g]),
            Some(_) => usize::MAX,
            None => self.done[g],
        };
        of(0).min(of(1))
    }
    /// Readings that are complete with the samples of the grid before `end`.
    fn completed(&self, end: usize) -> Readings {
        let all = self.rows.readings();
        let mut of: Readings = core::array::from_fn(|g| {
            let mut last = self.done[g];
            match &self.by[g] {
                Some(o) => {
                    while last < all[g].end && o.end(last) <= end {
                        last += 1;
                    }
                }
                None => last = end.min(all[g].end),
            }
            self.done[g]..last
        });
        if self.rows.interleaved() {
            let both = of[0].end.min(of[1].end);
            of.iter_mut().for_each(|r| r.end = both);
        }
        of
    }
}

/// Blocks of rows of [`crate::OutputError`].
pub(crate) struct SpanRows<'s, 'a> {
    pub(crate) spans: Spans<'s, 'a>,
    pub(crate) carried: Carried,
    pub(crate) extra: Vec<f64>,
    pub(crate) along: Straight,
}

impl RowStream for SpanRows<'_, '_> {
    fn next(&mut self, block: &mut RowBlock) -> Result<bool, EvalError> {
        let Self { spans, carried, extra, along } = self;
        let model = spans.rows.model;
        let next = spans.advance(|params, wanted, table, first| {
            let Table { table, samples } = table;
            let made = sensitivities_span(model, params, table, samples.clone(), carried, wanted);
            made.map(|(y, d)| Window::new(first, y, Some(d))).map_err(failed)
        })?;
        let Some((window, of)) = next else { return Ok(false) };
        spans.rows.block(&window, &spans.by, extra, along, &of, block);
        Ok(true)
    }
}
