//! The same over fewer samples, in longer steps.

use super::{FEWEST, LEAST_SAMPLES, LONGER, OutputError};
use crate::estimate::estimator::{Coarse, Steps};
use crate::estimate::output_options::Options;
use crate::estimate::output_rows::OutputRows;
use std::borrow::Cow;

/// Samples per period of the fastest mode that are left for a first pass, and for a pass before that.
const PER_PERIOD: [f64; 2] = [10.0, 5.0];
/// Beyond, a first pass would no longer be what takes the time.
const THINNEST: usize = 10;

impl OutputError<'_> {
    /// Over every so many samples ([`OutputError::stride`]); `rough` ones do not follow what hardly rings.
    pub(super) fn over_fewer(&self, full: &[f64], rough: bool) -> Option<Coarse<'_>> {
        let (every, substeps) = self.stride(full, rough)?;
        self.in_strides(every, substeps)
    }
    /// See [`Estimator::stepped`](crate::Estimator::stepped).
    pub(super) fn over_stepped(&self, full: &[f64], steps: Steps) -> Option<Coarse<'_>> {
        let samples_per_step = 1.0 / (steps.per_period * self.fastest(full)? * self.rows.record.dt());
        let (every, substeps) = self.strided(samples_per_step, 1)?;
        let less = every > 1 || substeps < self.steps();
        less.then(|| self.in_strides(every, substeps * steps.each_in)).flatten()
    }
    /// Over every so many samples, in so many steps from one to the next.
    fn in_strides(&self, every: usize, substeps: usize) -> Option<Coarse<'_>> {
        let OutputRows { model, record, options, kinematics, initial, .. } = &self.rows;
        let record = if every > 1 { Cow::Owned(record.thinned(every).ok()?) } else { record.clone() };
        let (motion, options) = (self.tables.moving(), Options { substeps, step_error: None, ..options.clone() });
        let rows = OutputRows::new(model, record, options, (kinematics.clone(), initial.clone()), motion);
        let rows = OutputRows { draws: self.rows.draws, ..rows };
        let thin = OutputError::of(rows, self.tables.thinned(every, substeps), self.thinned + 1);
        Some(Coarse { estimator: Box::new(thin), rows: self.rows.every(every), between: self.rows.between(every) })
    }
    /// How many samples a first pass can go on by, and its steps per sample. With ten steps left per period of the fastest mode, it is off by
    /// less than 0.2 % in its frequency (`(2 pi / 10)^4 / 120`), with five by 2 %; steps per sample are rounded down, to no less than half of that.
    /// A `rough` one has three where that mode hardly rings ([`FEWEST`]). `None` where such a pass would not be cheaper.
    fn stride(&self, full: &[f64], rough: bool) -> Option<(usize, usize)> {
        self.first_pass(full, rough).filter(|(every, substeps)| *every > 1 || *substeps < self.steps())
    }
    /// [`OutputError::stride`], whatever it costs; `None` without modes.
    pub(super) fn first_pass(&self, full: &[f64], rough: bool) -> Option<(usize, usize)> {
        let (per_period, fastest) = (PER_PERIOD.get(self.thinned)?, self.fastest(full)?);
        let dt = self.rows.record.dt();
        let samples_per_step = 1.0 / (per_period * fastest * dt);
        // Of a method of fourth order.
        let suits = |every: &usize| self.error.is_some_and(|(e, steps)| e * ((every * steps) as f64).powi(4) < LONGER);
        let longest = if rough { (1.0 / (FEWEST * fastest * dt)) as usize } else { 0 };
        let longer = (2..=longest.min(self.most())).rev().find(suits).unwrap_or(1);
        self.strided(samples_per_step, longer)
    }
    /// How many samples steps of so many samples go on by, `least` or more, and steps per sample; `None` without modes.
    fn strided(&self, samples_per_step: f64, least: usize) -> Option<(usize, usize)> {
        // NaN where there is no mode.
        if !samples_per_step.is_finite() {
            return None;
        }
        let every = (samples_per_step as usize).min(self.most()).max(least);
        if every > 1 {
            return Some((every, 1));
        }
        // All samples, in longer steps.
        Some((1, (1.0 / samples_per_step).floor().max(1.0) as usize))
    }
    /// Most samples that one is left of.
    fn most(&self) -> usize {
        let record = &self.rows.record;
        let readings = if record.averaging().is_some() { record.tau().nrows() } else { record.samples() };
        (readings / LEAST_SAMPLES).min(THINNEST)
    }
}
