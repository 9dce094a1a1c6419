//! Columns that need not be exact: those of errors that are tested, some hundreds.

use super::{FEWEST, LEAST_SAMPLES, LONGER, OutputError};
use crate::estimate::along::Direction;
use crate::estimate::estimator::Estimator;
use crate::estimate::output_options::Options;
use crate::estimate::output_rows::OutputRows;
use crate::estimate::row_stream::RowBlock;
use crate::estimate::setup::SetupError;
use ff_least_squares::EvalError;
use nalgebra::DMatrix;

/// Samples per period of the fastest mode, and longest interval (s), of a survey; steps per period where a sample takes several, between which
/// nothing is interpolated.
const SURVEYED: f64 = 20.0;
const INTEGRATED: f64 = 10.0;
/// Most steps per sample of a survey, over those of its estimator.
const MORE: usize = 4;
const COARSEST: f64 = 0.1;
/// Part of the distance of knots that an interval takes at most where noise of a spline is predicted, which goes up to half a period from knot to knot.
const PER_KNOT: f64 = 0.5;

impl OutputError<'_> {
    /// [`OutputError::with_options`] for columns that need not be exact: simulated in steps of which twenty make a period of the fastest
    /// mode at `full`, but no more than a tenth of a second long, and interpolated at the readings where a step spans several; where a sample
    /// takes several steps, ten make a period. A component at a tenth of the grid's
    /// rate is then off by 3e-4 of itself (`docs/theory/output-operator.md`), one at a fifth by 2 %. Steps of which three make a period do as well
    /// where what they predict at the grid differs from the prediction at hand by less than a standard deviation of noise, all samples
    /// together: the fastest modes hardly ring. Where noise of the motion is loud, a step is half as long as its knots are apart
    /// at most, and modes that these let through are followed.
    ///
    /// # Errors
    /// [`SetupError`].
    pub fn survey(&self, options: &Options, full: &[f64]) -> Result<Self, SetupError> {
        let beside = options.oscillators.iter().map(|o| o.frequency_hz).fold(0.0, f64::max);
        let (own, dt) = (self.fastest(full).unwrap_or(0.0), self.rows.record.dt());
        let most = self.rows.record.samples() / LEAST_SAMPLES;
        let knots = match &self.tables.noise {
            Some(noise) if options.noise_is_loud => noise.spacing(),
            _ => f64::INFINITY,
        };
        let samples = |own: f64, per_period: f64| {
            let fastest = (SURVEYED * beside).max(per_period * own);
            let step = if fastest > 0.0 { COARSEST.min(1.0 / fastest) } else { COARSEST };
            ((step.min(PER_KNOT * knots) / dt) as usize).min(most)
        };
        let usual = samples(own, SURVEYED).max(1);
        // Modes that draws of the noise ring have to be followed, whether the motion rings them or not.
        let mut longer = if 2.0 * knots * own < 1.0 { usual } else { samples(own, FEWEST) };
        let shorter = |every: usize| every > usual || (every == 1 && dt * own * INTEGRATED > 1.0);
        let exact = if shorter(longer) { self.foretold(full) } else { None };
        while let Some(exact) = exact.as_ref().filter(|_| shorter(longer)) {
            let made = self.surveyed(options, longer, 1)?;
            if let Some(made) = self.foretells(made, longer, full, exact) {
                return Ok(made);
            }
            longer -= longer.div_ceil(3);
        }
        let in_steps = (dt * own.max(beside) * INTEGRATED).ceil() as usize;
        // The fit may have ended at springs that ask for more steps than it began with.
        let own_steps = self.steps();
        let mut substeps = if usual > 1 { 1 } else { in_steps.clamp(1, MORE * own_steps) };
        let (mut every, most) = (usual, MORE * substeps.max(own_steps));
        loop {
            let mut made = self.surveyed(options, every, substeps);
            if 2 * substeps > most || made.as_mut().is_ok_and(|made| made.predicts(full)) {
                return made;
            }
            // Where a mode is too fast for these steps, or a damper too strong, nothing is predicted.
            if every > 1 {
                every /= 2;
            } else {
                substeps *= 2;
            }
        }
    }
    /// What so many draws of the noise of the joint motion do to the residuals at these parameters, a column each, in the rows of this estimator; `None`
    /// where no motion was fitted to positions. Goes through the rows once, in the steps of a survey ([`OutputError::survey`]).
    ///
    /// # Errors
    /// [`EvalError`] where nothing can be predicted in these steps.
    pub fn draws_of_motion(&self, draws: usize, full: &[f64]) -> Result<Option<DMatrix<f64>>, EvalError> {
        if self.tables.noise.is_none() {
            return Ok(None);
        }
        let options = Options { motion_noise: draws, noise_is_loud: true, ..Options::new(self.rows.options.noise) };
        let mut shaken = self.survey(&options, full).map_err(|e| EvalError::Rejected(e.to_string()))?;
        let nuisance = shaken.nuisance();
        let is_draw = |k: &usize| nuisance[*k].name.starts_with("motion.noise[");
        let along: Vec<Direction> =
            (0..nuisance.len()).filter(is_draw).map(|k| Direction::of(full.len() + k)).collect();
        let place = self.places_in(&shaken);
        let (extra, mut block) = (vec![0.0; nuisance.len()], RowBlock::default());
        let mut all = DMatrix::zeros(shaken.rows(), along.len());
        for mut stream in shaken.streams_along(full, &extra, &along)? {
            while stream.next(&mut block)? {
                for (at, from) in block.places() {
                    all.rows_mut(at.start, at.len()).copy_from(&block.jacobian.rows(from, at.len()));
                }
            }
        }
        let order: Vec<usize> = (0..all.nrows()).map(place).collect();
        Ok(Some(all.select_rows(&order)))
    }
    /// Where another estimator of the same readings has the rows of this one: on a grid of their own, those of torques come before those of the gyro.
    fn places_in(&self, other: &Self) -> impl Fn(usize) -> usize + use<> {
        let (joints, rows) = (self.rows.model.nj(), self.rows.count());
        let samples = rows / (joints + 3);
        let turned = self.is_interleaved() && !other.is_interleaved();
        move |k: usize| match (k / (joints + 3), k % (joints + 3)) {
            _ if !turned => k,
            (i, c) if c < joints => i * joints + c,
            (i, c) => samples * joints + 3 * i + c - joints,
        }
    }
    fn surveyed(&self, options: &Options, every: usize, substeps: usize) -> Result<Self, SetupError> {
        let OutputRows { model, record, options: own, .. } = &self.rows;
        let tables = self.tables.thinned(every, substeps);
        Self::with_tables(model, record.clone(), &own.with(substeps, options), tables, every)
    }
    /// Residuals with nuisance unknowns of zero; `None` where nothing is predicted. Allocates spans of tables.
    fn foretold(&self, full: &[f64]) -> Option<Vec<f64>> {
        let (mut r, extra) = (vec![0.0; self.rows.count()], vec![0.0; self.rows.nuisance().len()]);
        self.predict_in(self.steps(), full, &extra, &mut r).ok()?;
        Some(r)
    }
    /// Another estimator of the same rows that simulates every `every`-th sample, if it predicts there what this one does, `own` ([`LONGER`]),
    /// with nuisance unknowns of zero.
    fn foretells(&self, mut other: Self, every: usize, full: &[f64], own: &[f64]) -> Option<Self> {
        let (mut r, extra) = (vec![0.0; other.rows.count()], vec![0.0; other.rows.nuisance().len()]);
        if r.len() != own.len() || other.residuals(full, &extra, &mut r).is_err() {
            return None;
        }
        let rows = if self.is_interleaved() { self.rows.every(every) } else { (0..own.len()).collect() };
        let place = self.places_in(&other);
        let squares: f64 = rows.into_iter().map(|k| (r[place(k)] - own[k]).powi(2)).sum();
        (squares < LONGER * LONGER).then_some(other)
    }
    /// Whether there is a prediction at these parameters, and nuisance unknowns of zero.
    fn predicts(&mut self, full: &[f64]) -> bool {
        let (mut r, extra) = (vec![0.0; self.rows.count()], vec![0.0; self.rows.nuisance().len()]);
        self.residuals(full, &extra, &mut r).is_ok() && r.iter().all(|r| r.is_finite())
    }
}
