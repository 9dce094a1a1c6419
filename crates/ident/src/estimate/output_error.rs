//! Output error: passive states are simulated, torques and base rates compared.
//!
//! Panel and fuel motion is not measured. The reduced system ([`ff_dynamics::reduced::system`]) is integrated under
//! the measured joint motion from an initial state, and joint torques and gyro are compared with the record,
//! each divided by its noise (the paper's eq. (11), squared and weighted as it must be; `docs/paper-errata.md`).
//! The Jacobian comes from the sensitivities integrated beside the states, exact for the discrete solution.

use crate::belief::covariance::Unknown;
use crate::estimate::along::{Direction, Straight, Sums};
use crate::estimate::estimator::{At, Between, Coarse, Estimator, Steps, columns_by_directions};
use crate::estimate::output_options::Options;
use crate::estimate::output_rows::{OutputRows, Window};
use crate::estimate::output_spans::{SPAN, SpanRows, Spans, failed};
use crate::estimate::remembered::Remembered;
use crate::estimate::request::FINEST;
use crate::estimate::row_stream::{RowBlock, RowStream};
use crate::estimate::setup::{SetupError, check_noise};
use crate::motion::joint_motion::MotionNoise;
use crate::motion::tables::{Displaced, KEPT, Table, Tables};
use crate::uncertain::oscillator::Oscillator;
use disturbed::disturbances;
use ff_dynamics::reduced::sensitivity::{Carried, sensitivities_over};
use ff_dynamics::reduced::{Disturbance, simulate_reduced_batch, simulate_reduced_span};
use ff_dynamics::{Boundary, Wanted, modes, sensitivities, simulate_reduced};
use ff_least_squares::EvalError;
use ff_model::diagnostics::{clip, nearest};
use ff_model::{Model, Params};
use ff_records::Record;
use nalgebra::DMatrix;
use std::borrow::Cow;
use steps::{Compared, steps_for};

mod disturbed;
mod steps;
mod strides;
mod survey;

/// Steps per period of the fastest mode that are left at least where it hardly rings, so that it need not be followed: the method is stable up to 2.2,
/// and where springs stiffen beyond that on the way, steps of the fit are taken back. And what the integration may be off by in such steps, in
/// whitened residuals: by so much of a deviation an estimate could move, and all data have the last word.
const FEWEST: f64 = 3.0;
/// See [`FEWEST`].
const LONGER: f64 = 1.0;
/// Samples that a first pass needs at least.
const LEAST_SAMPLES: usize = 200;
/// Samples that the beginning of a record needs at least.
const BEGINNING: usize = 12;
/// Factor on [`Options::step_error`] from which steps are made finer.
const TOO_COARSE: f64 = 2.0;
/// Factor on the steps up to which they are made shorter until something is predicted.
const SHORTEST: usize = 64;
/// Numbers of all stages of an integration up to which they are kept for the derivatives along it (32 MB; three are kept).
const KEPT_STAGES: usize = 1 << 22;
/// The estimator for systems with passive coordinates.
///
/// Torques and gyro may have sample times of their own; predictions are then interpolated where they were read
/// (`docs/theory/output-operator.md`). Rows are listed sample by sample, torques before gyro; where one of the two has times of its
/// own, those of all torque samples come first.
///
/// ```
/// # use ff_dynamics::{Drive, SimOptions, State, motion::FnMotion, simulate};
/// # use ff_model::nalgebra::{Matrix3, Vector3};
/// # use ff_model::{BaseKind, Inertia, Joint, JointKind, Model, Params, Xform, tree::JointLimits};
/// # let hull = Inertia::from_com(60.0, &Vector3::new(0.2, 0.1, 0.3), &Matrix3::from_diagonal(&Vector3::new(15.0, 14.0, 13.0)));
/// # let mut robot = Model::new("probe", "hull", hull, BaseKind::Floating);
/// # let (kind, placement) = (JointKind::Revolute, Xform::new(Matrix3::identity(), Vector3::new(0.5, 0.1, 0.4)));
/// # let (axis, limits) = (Vector3::new(0.1, -0.2, 0.9), JointLimits::default());
/// # let link = Inertia::from_com(8.6, &Vector3::new(0.1, 0.21, -0.1), &Matrix3::from_diagonal(&Vector3::new(0.4, 0.05, 0.37)));
/// # robot.add_body(0, "arm", Joint { name: "shoulder".into(), kind, axis, placement, limits }, link);
/// # let truth = Params::<f64>::nominal(&robot);
/// # let motion = FnMotion::new(1, 10.0, |t, q, qd, qdd| {
/// #     let (sin, cos) = (0.9 * t).sin_cos();
/// #     (q[0], qd[0], qdd[0]) = (0.7 * (1.0 - cos), 0.63 * sin, 0.567 * cos);
/// # })?;
/// # let options = SimOptions { duration_s: 10.0, step_s: 0.01, sample_s: 0.01 };
/// # let trace = simulate(&robot, &truth, &State::zero(&robot), &Drive::Prescribed(&motion), &options)?;
/// # let record = ff_records::RecordBuilder::new(["shoulder"]).uniform(0.0, 100.0).q(trace.q.clone()).tau(trace.tau.clone());
/// # let (record, _) = record.gyro(trace.gyro()).build()?;
/// # let (decls, mass) = (robot.param_decls(), robot.parameter_indices("base.mass")?);
/// # let mut start = truth.values().to_vec();
/// # start[mass[0]] = 72.0;
/// use ident::{Estimator, Noise, Options, OutputError, Request, estimate};
///
/// let noise = Noise { torque: 0.01, gyro: 1e-5 };
/// let mut fit = OutputError::new(&robot, &record, &Options { gyro_bias: true, ..Options::new(noise) })?;
/// assert_eq!(fit.nuisance().len(), 3);
/// let e = estimate(&Request::new(&decls, &mass, &start), &mut fit)?;
/// assert!((e.values[0] - 60.0).abs() < 0.05 && e.nuisance.iter().all(|bias| bias.value.abs() < 1e-6));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct OutputError<'a> {
    rows: OutputRows<'a>,
    tables: Tables,
    /// How often its record has been thinned.
    thinned: usize,
    /// [`OutputError::integration_error`] where it was looked at last, and the steps per sample that it was of.
    error: Option<(f64, usize)>,
    /// Predictions in the steps at hand.
    remembered: Remembered,
    /// The last rows that were handed over, whose memory the next take.
    block: RowBlock,
}

impl<'a> OutputError<'a> {
    /// For a model and a record of it.
    ///
    /// # Errors
    /// [`SetupError`].
    pub fn new(model: &'a Model, record: &'a Record, options: &Options) -> Result<Self, SetupError> {
        check_noise(&options.noise)?;
        let weighed = (&options.noise, &options.reflected_inertia[..]);
        // Shapes are compared without looking for kinks.
        let how = (!options.initial_state, !options.all_alike);
        let tables = Tables::new(model, record, options.substeps.max(1), Some(weighed), how)?;
        Self::with_tables(model, Cow::Borrowed(record), options, tables, 1)
    }
    /// Of the same record and motion with other options; noise and steps stay, and so do the terms and gains of joints, which belong to what
    /// the channels of the record are.
    ///
    /// # Errors
    /// [`SetupError`].
    pub fn with_options(&self, options: &Options) -> Result<Self, SetupError> {
        let OutputRows { model, record, options: own, .. } = &self.rows;
        Self::with_tables(model, record.clone(), &own.with(own.substeps, options), self.tables.shared(), 1)
    }
    /// With as many integration steps per sample as [`Options::step_error`] asks for at these parameters, and nuisance unknowns of zero; with
    /// those that it has where that is not given, or nothing can be predicted there.
    ///
    /// # Errors
    /// [`SetupError`].
    pub fn suited(self, full: &[f64]) -> Result<Self, SetupError> {
        let Some(limit) = self.rows.options.step_error else { return Ok(self) };
        let extra = vec![0.0; self.nuisance().len()];
        let mut tried = self.in_steps(self.steps().div_ceil(4))?;
        match tried.integration_error(full, &extra) {
            Ok(error) if error.is_finite() => {
                // More than a first pass over all samples takes, so that there is one.
                let least = self.first_pass(full, false).filter(|first| first.0 == 1).map_or(1, |first| first.1 + 1);
                let looked = Some((error, tried.steps()));
                Ok(Self { error: looked, ..self.in_steps(steps_for(limit, tried.steps(), error).max(least))? })
            }
            _ => Ok(self),
        }
    }
    /// [`OutputError::integration_error`] in the steps that it has, or in half of them and so on, where a mode is too fast for these or a damper too
    /// strong, and nothing is predicted; these steps stay, unless nothing is predicted in any.
    fn predictable(&mut self, full: &[f64], extra: &[f64], most: usize) -> Result<Compared, EvalError> {
        let before = self.steps();
        let most = (SHORTEST.min(most) * before).min(FINEST);
        loop {
            let failed = match self.compared(full, extra) {
                Ok(found) if found.error.is_finite() => return Ok(found),
                failed => failed,
            };
            if 2 * self.steps() > most {
                self.take_steps(before);
                let not_finite = EvalError::Rejected("residuals are not finite".into());
                return Err(failed.err().unwrap_or(not_finite));
            }
            self.take_steps(2 * self.steps());
        }
    }
    /// Takes as many steps as [`Options::step_error`] asks for there, where that is given, and says whether these are more.
    fn refine_steps(&mut self, full: &[f64], extra: &[f64], most: usize) -> Result<bool, EvalError> {
        let Some(limit) = self.rows.options.step_error else { return Ok(false) };
        let before = self.steps();
        let compared = self.predictable(full, extra, most)?;
        let (error, limit) = (compared.error, compared.allowed(limit, self.rows.count()));
        let steps = self.steps();
        self.error = Some((error, steps));
        let finer = steps_for(limit, steps, error);
        if error > TOO_COARSE * limit && finer > steps {
            if finer > most.saturating_mul(before) {
                self.take_steps(before);
                return Err(EvalError::Rejected(format!("{finer} integration steps per sample instead of {before}")));
            }
            self.take_steps(finer);
        }
        Ok(self.steps() > before)
    }
    fn take_steps(&mut self, substeps: usize) {
        self.tables = self.tables.thinned(1, substeps);
        self.rows.options.substeps = substeps;
        self.remembered = Remembered::default();
    }
    fn in_steps(&self, substeps: usize) -> Result<Self, SetupError> {
        let OutputRows { model, record, options, .. } = &self.rows;
        let options = Options { substeps: substeps.max(1), ..options.clone() };
        Self::with_tables(model, record.clone(), &options, self.tables.thinned(1, options.substeps), 1)
    }
    /// Kinks of the fitted motion, and readings of torques and gyro, of all, that do not count because these leave them open.
    pub fn kinks(&self) -> (usize, usize, usize) {
        let kinks = self.tables.noise.as_ref().map_or(0, MotionNoise::kinks);
        let untold = if kinks > 0 { self.left_out() } else { 0 };
        (kinks, untold, self.rows.count())
    }
    /// When kinks of the fitted motion are (s since the first sample), in no order; none where none was fitted. Allocates.
    pub fn kink_times(&self) -> Vec<f64> {
        self.tables.noise.as_ref().map(MotionNoise::kink_times).unwrap_or_default()
    }
    /// Frequency (Hz) at which what positions tell of the acceleration of some joint is as loud as the noise of the torques: above, torques say how it moves.
    /// `None` where no motion was fitted to positions.
    pub fn told_hz(&self) -> Option<f64> {
        self.tables.noise.as_ref().and_then(MotionNoise::told_hz)
    }
    /// Integration steps per sample.
    pub fn steps(&self) -> usize {
        self.rows.options.substeps
    }
    /// Norm of what the integration is off by, in whitened residuals: their difference from those of twice as many steps, times 16/15 for a
    /// method of fourth order (Hairer, Norsett, Wanner, *Solving Ordinary Differential Equations I*, II.4). By the projection of it the
    /// estimates move, none by more of its deviations than this. Allocates two spans of tables, and the rows twice.
    ///
    /// # Errors
    /// [`EvalError`].
    pub fn integration_error(&mut self, full: &[f64], extra: &[f64]) -> Result<f64, EvalError> {
        self.compared(full, extra).map(|c| c.error)
    }
    fn compared(&mut self, full: &[f64], extra: &[f64]) -> Result<Compared, EvalError> {
        let (mut coarse, mut fine) = (vec![0.0; self.rows.count()], vec![0.0; self.rows.count()]);
        let steps = self.steps();
        for (many, r) in [(steps, &mut coarse), (2 * steps, &mut fine)] {
            self.at_hand(many, full, extra, r)?;
        }
        let squares: f64 = coarse.iter().zip(&fine).map(|(a, b)| (a - b).powi(2)).sum();
        Ok(Compared { error: 16.0 / 15.0 * squares.sqrt(), residual: fine.iter().map(|b| b * b).sum() })
    }
    /// [`OutputError::predict_in`], unless they are remembered.
    fn at_hand(&self, steps: usize, full: &[f64], extra: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
        if steps == self.steps() && self.remembered.fill(full, extra, r) {
            return Ok(());
        }
        self.predict_in(steps, full, extra, r)
    }
    /// Residuals in so many steps per sample, with tables that are not kept.
    fn predict_in(&self, steps: usize, full: &[f64], extra: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
        by_spans(&self.rows, &mut self.tables.thinned(1, steps).passing(), full, extra, r)
    }
    /// Whether rows are listed sample by sample, torques before gyro; else those of all torque samples come first.
    pub fn is_interleaved(&self) -> bool {
        self.rows.interleaved()
    }
    /// The fastest mode (Hz) at these parameters, at the first sample.
    fn fastest(&self, full: &[f64]) -> Option<f64> {
        let OutputRows { model, record, .. } = &self.rows;
        let params = Params::from_values(model, full.to_vec());
        let q: Vec<f64> = record.q().row(0).iter().copied().collect();
        let eta = model.rest_position(&params);
        let modes = modes(model, &params, &q, &eta, Boundary::JointsHeld).ok()?;
        Some(modes.iter().map(|m| m.frequency_hz).fold(0.0, f64::max))
    }
    fn with_tables(
        model: &'a Model,
        record: Cow<'a, Record>,
        options: &Options,
        mut tables: Tables,
        every: usize,
    ) -> Result<Self, SetupError> {
        // A uniform velocity changes nothing that is measured, so it is not among the unknowns.
        let initial = if options.initial_state { (3..6 + 2 * model.np()).collect() } else { Vec::new() };
        let kinematics = placements(model, &options.kinematics)?;
        if let Some(o) = options.oscillators.iter().find(|o| !o.is_valid()) {
            let Oscillator { frequency_hz, damping_ratio, .. } = *o;
            return Err(SetupError::Oscillator { frequency_hz, damping_ratio });
        }
        if options.errors.iter().any(|e| !e.exists(model.nj(), options.oscillators.len())) {
            return Err(SetupError::NoSuchError(model.nj()));
        }
        options.check_channels(model, &record)?;
        let (motion, samples) = (tables.moving(), record.samples());
        let mut rows = OutputRows::new(model, record, options.clone(), (kinematics, initial), motion);
        if every > 1 {
            rows = rows.on_coarse_grid(every);
        }
        if samples < 6 && !(rows.interleaved() && options.errors.is_empty()) {
            return Err(SetupError::JointMotion("interpolation of readings needs six samples of the grid".into()));
        }
        tables.disturbances.clear();
        tables.disturbances = disturbances(&rows, &mut tables)?;
        if let Some(noise) = &tables.noise {
            let draws = noise.draws(&rows.record, options.motion_noise)?;
            rows.draws = draws.len();
            rows.shaken = rows.errors.shaken(&draws);
            tables.disturbances.extend(draws.into_iter().map(Disturbance::Motion));
        }
        Ok(Self::of(rows, tables, 0))
    }
    fn of(rows: OutputRows<'a>, tables: Tables, thinned: usize) -> Self {
        Self { rows, tables, thinned, error: None, remembered: Remembered::default(), block: RowBlock::default() }
    }
}

/// Residuals, with tables that are made span by span.
fn by_spans(
    rows: &OutputRows<'_>,
    tables: &mut Tables,
    full: &[f64],
    extra: &[f64],
    r: &mut [f64],
) -> Result<(), EvalError> {
    let params = Params::from_values(rows.model, full.to_vec());
    let (mut z, by) = (rows.start(&params, extra), rows.operators(extra)?);
    let mut spans = Spans::new(rows, tables, (params, rows.placed(extra)), Wanted::default(), by, SPAN);
    let mut block = RowBlock::default();
    while let Some((window, of)) = spans.advance(|params, _, table, first| {
        let Table { table, samples } = table;
        let y = simulate_reduced_span(rows.model, params, table, samples.clone(), &mut z).map_err(failed)?;
        Ok(Window::new(first, y, None))
    })? {
        block.resize(&rows.rows(&of), 0);
        rows.residuals(&window, spans.operators(), extra, &of, &mut block.residuals);
        for (at, from) in block.places() {
            let count = at.len();
            r[at].copy_from_slice(&block.residuals[from..from + count]);
        }
    }
    Ok(())
}

/// Indices of kinematic parameters by name.
fn placements(model: &Model, names: &[String]) -> Result<Vec<usize>, SetupError> {
    let mut found = Vec::with_capacity(names.len());
    for name in names {
        let Some(i) = model.kinematic_index(name) else {
            let known = model.kinematic_params();
            let near = nearest(name, known.iter().map(|p| p.name.as_str())).map(str::to_owned);
            return Err(SetupError::Placement { name: clip(name), near });
        };
        if found.contains(&i) {
            return Err(SetupError::PlacementTwice(model.kinematic_params().swap_remove(i).name));
        }
        found.push(i);
    }
    Ok(found)
}

impl Estimator for OutputError<'_> {
    fn rows(&self) -> usize {
        self.rows.count()
    }
    fn left_out(&self) -> usize {
        self.rows.not_counted.iter().map(Vec::len).sum()
    }
    fn nuisance(&self) -> Vec<Unknown> {
        self.rows.nuisance()
    }
    fn coarse(&self, full: &[f64]) -> Option<Coarse<'_>> {
        self.over_fewer(full, false)
    }
    fn rough(&self, full: &[f64]) -> Option<Coarse<'_>> {
        self.over_fewer(full, true)
    }
    fn stepped(&self, full: &[f64], steps: Steps) -> Option<Coarse<'_>> {
        self.over_stepped(full, steps)
    }
    fn beginning(&self, share: f64) -> Option<Coarse<'_>> {
        let OutputRows { model, record, options, kinematics, initial, grid, .. } = &self.rows;
        let samples = (share * grid.0 as f64) as usize;
        let cut = record.averaging().is_some() || *grid != (record.samples(), record.dt());
        if cut || samples < BEGINNING || samples > grid.0 {
            return None;
        }
        // Readings at times of their own are those up to the last sample of the grid that is left.
        let first = if record.is_uniform() {
            record.rows(0..samples)
        } else {
            record.window(0.0, samples as f64 * grid.1).ok()?
        };
        let motion = self.tables.moving();
        let known = (kinematics.clone(), initial.clone());
        let mut rows = OutputRows::new(model, Cow::Owned(first), options.clone(), known, motion);
        (rows.draws, rows.grid) = (self.rows.draws, (samples, grid.1));
        let of_all = (rows.interleaved() == self.rows.interleaved()).then(|| self.rows.rows(&rows.readings()))?;
        let begun = OutputError::of(rows, self.tables.beginning(samples), self.thinned);
        let rows: Vec<usize> = of_all.into_iter().flatten().collect();
        let between = if rows.len() == self.rows() { Between::same(rows.len()) } else { Vec::new() };
        Some(Coarse { estimator: Box::new(begun), rows, between })
    }
    fn residuals(&mut self, full: &[f64], extra: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
        if self.remembered.fill(full, extra, r) {
            return Ok(());
        }
        let (rows, tables) = (&self.rows, &mut self.tables);
        let params = Params::from_values(rows.model, full.to_vec());
        let (z, by) = (rows.start(&params, extra), rows.operators(extra)?);
        let stages = 4 * rows.grid.0 * rows.options.substeps * (12 + 3 * rows.model.np());
        let kept = rows.grid.0 <= KEPT && stages <= KEPT_STAGES;
        if rows.grid.0 <= KEPT {
            let table = tables.get(rows.model, &params, &rows.placed(extra), &Wanted::default());
            let y = match kept {
                true => self.remembered.spare.integrate(rows.model, &params, table, &z),
                false => simulate_reduced(rows.model, &params, table, &z),
            };
            rows.residuals(&Window::new(0, y.map_err(failed)?, None), &by, extra, &rows.readings(), r);
        } else {
            by_spans(rows, tables, full, extra, r)?;
        }
        self.remembered.keep(full, extra, r, kept);
        Ok(())
    }
    /// In lanes, where base and appendages alone differ between the places, so that one table of the arm serves all.
    fn residuals_at(&mut self, at: &[At<'_>], r: &mut [&mut [f64]]) -> Vec<Result<(), EvalError>> {
        let (rows, tables) = (&self.rows, &mut self.tables);
        let params: Vec<_> = at.iter().map(|(full, _)| Params::from_values(rows.model, full.to_vec())).collect();
        let placed: Vec<Displaced> = at.iter().map(|(_, extra)| rows.placed(extra)).collect();
        let places: Vec<_> = params.iter().zip(&placed).collect();
        if at.len() < 2 || rows.grid.0 > KEPT || !tables.serve_all(rows.model, &places) {
            return at.iter().zip(r).map(|(&(full, extra), r)| self.residuals(full, extra, r)).collect();
        }
        let starts: Vec<Vec<f64>> = params.iter().zip(at).map(|(p, (_, extra))| rows.start(p, extra)).collect();
        let runs: Vec<_> = params.iter().zip(&starts).map(|(p, z)| (p, &z[..])).collect();
        let table = tables.get(rows.model, &params[0], &placed[0], &Wanted::default());
        let all = match simulate_reduced_batch(rows.model, table, &runs) {
            Ok(all) => all,
            Err(e) => return at.iter().map(|_| Err(failed(e.clone()))).collect(),
        };
        let one = |((y, &(_, extra)), r): ((Result<_, _>, &At<'_>), &mut &mut [f64])| {
            let by = rows.operators(extra)?;
            rows.residuals(&Window::new(0, y.map_err(failed)?, None), &by, extra, &rows.readings(), r);
            Ok(())
        };
        all.into_iter().zip(at).zip(r).map(one).collect()
    }
    fn refine(&mut self, full: &[f64], extra: &[f64], most: usize) -> Result<bool, EvalError> {
        let finer = self.refine_steps(full, extra, most)?;
        Ok(self.deflect_anew(full, extra)? || finer)
    }
    columns_by_directions!();
    fn jacobian_along(
        &mut self,
        full: &[f64],
        extra: &[f64],
        along: &[Direction],
        r: &mut [f64],
        j: &mut DMatrix<f64>,
    ) -> Result<(), EvalError> {
        let Some(straight) = Straight::new(full.len(), extra.len(), along) else {
            let (sums, every) = Sums::every(full.len(), extra.len(), along);
            let mut all = DMatrix::zeros(r.len(), every.len());
            self.jacobian_along(full, extra, &every, r, &mut all)?;
            sums.gather(&all, j);
            return Ok(());
        };
        let wanted = self.rows.wanted(&straight);
        if self.tables.by_spans(&wanted) {
            let mut block = core::mem::take(&mut self.block);
            for mut stream in self.streams_along(full, extra, along)? {
                while stream.next(&mut block)? {
                    for (at, from) in block.places() {
                        let (start, count) = (at.start, at.len());
                        r[at].copy_from_slice(&block.residuals[from..from + count]);
                        j.rows_mut(start, count).copy_from(&block.jacobian.rows(from, count));
                    }
                }
            }
            self.block = block;
            return Ok(());
        }
        let (rows, tables) = (&self.rows, &mut self.tables);
        let params = Params::from_values(rows.model, full.to_vec());
        let (z0, by) = (rows.start(&params, extra), rows.operators(extra)?);
        let table = tables.get(rows.model, &params, &rows.placed(extra), &wanted);
        let made = match self.remembered.stages(full, extra) {
            Some(stages) => sensitivities_over(rows.model, &params, table, stages, &wanted),
            None => sensitivities(rows.model, &params, table, &z0, &wanted),
        };
        let (y, d) = made.map_err(failed)?;
        let (window, all) = (Window::new(0, y, Some(d)), rows.readings());
        rows.residuals(&window, &by, extra, &all, r);
        rows.jacobian(&window, (&by, extra), &straight, &all, j);
        Ok(())
    }
    fn streams_along<'s>(
        &'s mut self,
        full: &[f64],
        extra: &[f64],
        along: &[Direction],
    ) -> Result<Vec<Box<dyn RowStream + 's>>, EvalError> {
        let Some(straight) = Straight::new(full.len(), extra.len(), along) else {
            let (sums, every) = Sums::every(full.len(), extra.len(), along);
            return Ok(sums.over(self.streams_along(full, extra, &every)?));
        };
        let (rows, tables) = (&self.rows, &mut self.tables);
        let params = Params::from_values(rows.model, full.to_vec());
        let (z0, by, wanted) = (rows.start(&params, extra), rows.operators(extra)?, rows.wanted(&straight));
        let carried = Carried::start(rows.model, &z0, &wanted);
        let spans = Spans::new(rows, tables, (params, rows.placed(extra)), wanted, by, SPAN);
        Ok(vec![Box::new(SpanRows { spans, carried, extra: extra.to_vec(), along: straight })])
    }
}
