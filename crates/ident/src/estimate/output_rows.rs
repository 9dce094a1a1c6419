//! Predictions of output error beside what was measured: which rows they are, whitened residuals, and their derivatives.
//!
//! Torques and gyro that are sampled on one clock are listed sample by sample, torques before gyro; where one of them has sample times
//! of its own, all torque samples come before all gyro samples.

use crate::belief::covariance::Unknown;
use crate::estimate::along::Straight;
use crate::estimate::delay::OutputOperator;
use crate::estimate::estimator::Between;
use crate::estimate::output_options::Options;
use crate::estimate::row_stream::RowBlock;
use crate::estimate::sensor_errors::SensorErrors;
use crate::motion::loose_ends::LooseEnds;
use crate::motion::tables::Displaced;
use crate::uncertain::source::{ActsOn, ErrorSource};
use core::ops::Range;
use ff_dynamics::motion::JointMotion;
use ff_dynamics::{Response, Sensitivities, Wanted};
use ff_least_squares::EvalError;
use ff_model::{Kinematics, Model, Params};
use ff_records::Record;
use ff_records::time_base::ChannelGroup;
use nalgebra::{DMatrix, Vector3};
use std::borrow::Cow;
use std::sync::Arc;

/// What is compared, in the order of rows.
pub(crate) const GROUPS: [ChannelGroup; 2] = [ChannelGroup::Torque, ChannelGroup::Gyro];

/// How readings are taken of predictions on the grid: torques, gyro. `None` where they are the predictions.
pub(crate) type Operators = [Option<OutputOperator>; 2];

/// Samples of torques and gyro.
pub(crate) type Readings = [Range<usize>; 2];

/// Predictions on some samples of the grid, and their derivatives where they were asked for.
#[derive(Clone, Debug, Default)]
pub(crate) struct Window {
    /// Sample of the grid that is the first here.
    pub(crate) first: usize,
    /// Torques and base rates, samples x channels.
    pub(crate) values: [DMatrix<f64>; 2],
    /// Row `channels * i + c` holds channel c at sample i.
    pub(crate) derivatives: [DMatrix<f64>; 2],
}

impl Window {
    /// Of a simulation from sample `first` of the grid on.
    pub(crate) fn new(first: usize, y: Response, d: Option<Sensitivities>) -> Self {
        let gyro = y.gyro();
        let derivatives = d.map_or_else(Default::default, |d| [d.tau, d.gyro]);
        Self { first, values: [y.tau, gyro], derivatives }
    }
    /// The sample of the grid behind the last here.
    pub(crate) fn end(&self) -> usize {
        self.first + self.values[0].nrows()
    }
    /// With the samples that `later` begins with below, from sample `from` of the grid on.
    pub(crate) fn followed_by(&self, later: &Self, from: usize) -> Self {
        let from = from.clamp(self.first, later.first);
        let joined = |a: &DMatrix<f64>, b: &DMatrix<f64>| {
            // Rows per sample, whatever they are of.
            let kept = a.nrows() / (self.end() - self.first).max(1) * (self.end() - from);
            let mut out = DMatrix::zeros(kept + b.nrows(), b.ncols());
            out.rows_mut(0, kept).copy_from(&a.rows(a.nrows() - kept, kept));
            out.rows_mut(kept, b.nrows()).copy_from(b);
            out
        };
        let of = |a: &[DMatrix<f64>; 2], b: &[DMatrix<f64>; 2]| core::array::from_fn(|g| joined(&a[g], &b[g]));
        Self {
            first: from,
            values: of(&self.values, &later.values),
            derivatives: of(&self.derivatives, &later.derivatives),
        }
    }
}

/// Record and model side by side.
pub(crate) struct OutputRows<'a> {
    pub(crate) model: &'a Model,
    pub(crate) record: Cow<'a, Record>,
    pub(crate) options: Options,
    /// Samples and interval (s) of the grid that is simulated.
    pub(crate) grid: (usize, f64),
    /// Sample times of torques and gyro, where they are not sampled on the grid.
    pub(crate) times: [Option<Arc<[f64]>>; 2],
    /// Errors of the sensors that are estimated, and what disturbs the motion.
    pub(crate) errors: SensorErrors,
    pub(crate) disturbing: Vec<ErrorSource>,
    /// Draws of the motion's noise, which disturb it behind those.
    pub(crate) draws: usize,
    /// Their rates and accelerations at the samples of the torques, where these have terms of joints in them.
    pub(crate) shaken: Vec<[DMatrix<f64>; 2]>,
    /// Kinematic parameters and initial-state components that are estimated.
    pub(crate) kinematics: Vec<usize>,
    pub(crate) initial: Vec<usize>,
    /// Readings of torques and gyro next to the ends of the motion, where its noise is larger than theirs, and what they count for.
    pub(crate) loose: [Vec<(usize, f64)>; 2],
    /// Readings of torques and gyro that do not count, sample and channel, ascending: torques of joints next to rest, and all where kinks of the motion
    /// leave them open.
    pub(crate) not_counted: [Vec<(usize, usize)>; 2],
    /// One over the standard deviation of every channel of torques and gyro.
    pub(crate) inverse: [Vec<f64>; 2],
}

impl<'a> OutputRows<'a> {
    /// With the indices of kinematic parameters and initial states among the unknowns. `motion` is that of the joints.
    pub(crate) fn new(
        model: &'a Model,
        record: Cow<'a, Record>,
        options: Options,
        (kinematics, initial): (Vec<usize>, Vec<usize>),
        (motion, ends): (&dyn JointMotion, Option<&LooseEnds>),
    ) -> Self {
        let times = GROUPS.map(|g| record.times(g).map(Arc::from));
        let of_motion = |e: &ErrorSource| e.acts_on() == ActsOn::Motion;
        let (disturbing, of_sensors) = options.errors.iter().partition(|e| of_motion(e));
        let errors = SensorErrors::new(of_sensors, &options.near_rest, &record, motion);
        let mut not_counted = [errors.at_rest(), Vec::new()];
        let less = GROUPS.map(|g| record.noise_gain(g));
        let of_channel = |j: usize| options.channel_noise.get(j).copied().unwrap_or(options.noise.torque);
        let torques = (0..model.nj()).map(|j| (less[0] * of_channel(j)).recip());
        let inverse = [torques.collect(), vec![1.0 / (less[1] * options.noise.gyro); 3]];
        let grid = (record.samples(), record.dt());
        let mut loose = [Vec::new(), Vec::new()];
        for g in 0..2 {
            let (readings, own): (_, &Option<Arc<[f64]>>) = ([record.tau(), record.gyro()][g], &times[g]);
            let time = |i: usize| own.as_ref().map_or(i as f64 * grid.1, |t| t[i]);
            let (count, channels) = readings.shape();
            let ends = ends.filter(|_| !options.all_alike);
            if let Some(ends) = ends {
                loose[g] = (0..count).map(|i| (i, ends.weight(time(i)))).filter(|w| w.1 < 1.0).collect();
            }
            let out = (0..count).filter(|&i| !record.counts(time(i)) || ends.is_some_and(|e| e.is_untold(time(i))));
            not_counted[g].extend(out.flat_map(|i| (0..channels).map(move |c| (i, c))));
            not_counted[g].sort_unstable();
            not_counted[g].dedup();
        }
        Self {
            model,
            record,
            options,
            grid,
            times,
            errors,
            disturbing,
            draws: 0,
            shaken: Vec::new(),
            kinematics,
            initial,
            loose,
            not_counted,
            inverse,
        }
    }
    /// Simulated on every `every`-th sample alone, and interpolated at all readings.
    pub(crate) fn on_coarse_grid(mut self, every: usize) -> Self {
        let (samples, dt) = self.grid;
        for (times, measured) in self.times.iter_mut().zip([self.record.tau().nrows(), self.record.gyro().nrows()]) {
            times.get_or_insert_with(|| (0..measured).map(|i| i as f64 * dt).collect());
        }
        self.grid = (samples.div_ceil(every), dt * every as f64);
        self
    }
    /// Channels of torques and of the gyro.
    pub(crate) fn channels(&self) -> [usize; 2] {
        [self.model.nj(), 3]
    }
    fn measured(&self) -> [&DMatrix<f64>; 2] {
        [self.record.tau(), self.record.gyro()]
    }
    /// Samples of torques and gyro.
    pub(crate) fn readings(&self) -> Readings {
        self.measured().map(|m| 0..m.nrows())
    }
    /// Whether torques and gyro are listed sample by sample.
    pub(crate) fn interleaved(&self) -> bool {
        self.times.iter().all(Option::is_none)
    }
    /// Number of rows.
    pub(crate) fn count(&self) -> usize {
        self.readings().iter().zip(self.channels()).map(|(r, c)| r.len() * c).sum()
    }
    /// Rows of some readings; those of both groups are the same samples where they are interleaved.
    pub(crate) fn rows(&self, of: &Readings) -> Vec<Range<usize>> {
        let [n, axes] = self.channels();
        if self.interleaved() {
            let rows = of[0].start * (n + axes)..of[0].end * (n + axes);
            return vec![rows];
        }
        let behind = self.record.tau().nrows() * n;
        vec![of[0].start * n..of[0].end * n, behind + of[1].start * axes..behind + of[1].end * axes]
    }
    /// Row of the first channel of a group at a sample, among those of `of`, and how far apart samples are.
    fn place(&self, of: &Readings, group: usize) -> (usize, usize) {
        let [n, axes] = self.channels();
        match (self.interleaved(), group) {
            (true, 0) => (0, n + axes),
            (true, _) => (n, n + axes),
            (false, 0) => (0, n),
            (false, _) => (of[0].len() * n, axes),
        }
    }
    /// Rows of every `every`-th sample, ascending.
    pub(crate) fn every(&self, every: usize) -> Vec<usize> {
        let all = self.readings();
        let mut rows = Vec::new();
        if self.interleaved() {
            let channels: usize = self.channels().iter().sum();
            for i in all[0].clone().step_by(every) {
                rows.extend(i * channels..(i + 1) * channels);
            }
            return rows;
        }
        for group in 0..2 {
            let (first, stride) = self.place(&all, group);
            for i in all[group].clone().step_by(every) {
                rows.extend(first + i * stride..first + (i + 1) * stride);
            }
        }
        rows
    }
    /// Where every row lies between those of every `every`-th sample; what lies behind the last of them is as that.
    pub(crate) fn between(&self, every: usize) -> Vec<Between> {
        if every == 1 {
            return Between::same(self.count());
        }
        let all = self.readings();
        let mut out = vec![Between::only(0); self.count()];
        let thinned: Readings = core::array::from_fn(|g| 0..all[g].len().div_ceil(every));
        for group in 0..2 {
            let (first, stride) = self.place(&all, group);
            let (thin, _) = self.place(&thinned, group);
            let count = thinned[group].len();
            let at = |i: usize| (i as f64 / every as f64).min(count as f64 - 1.0);
            let times = all[group].clone().map(at).collect();
            let operator = OutputOperator::new(count, 1.0, Some(times), 0.0);
            for i in all[group].clone() {
                for c in 0..self.channels()[group] {
                    let row = |k: usize| thin + k * stride + c;
                    out[first + i * stride + c] = match &operator {
                        Some(o) => {
                            let (from, parts) = o.parts(i);
                            Between { rows: core::array::from_fn(|k| row(from + k)), parts }
                        }
                        // Too few to interpolate between.
                        None => Between::only(row(i / every)),
                    };
                }
            }
        }
        out
    }
    /// Nuisance unknowns before placements and the initial state.
    pub(crate) fn biases(&self) -> usize {
        self.errors_at() + self.errors.of.len()
    }
    /// Nuisance unknowns before the errors of the sensors.
    fn errors_at(&self) -> usize {
        self.delays_at() + usize::from(self.options.torque_delay) + usize::from(self.options.gyro_delay)
    }
    /// Sizes of the errors of the sensors among the nuisance unknowns.
    fn errors_of<'e>(&self, extra: &'e [f64]) -> &'e [f64] {
        &extra[self.errors_at()..self.biases()]
    }
    /// Nuisance unknowns before the initial state.
    fn initial_at(&self) -> usize {
        self.biases() + self.kinematics.len() + self.disturbing.len() + self.draws
    }
    /// Sizes of what disturbs the motion, among the nuisance unknowns.
    pub(crate) fn disturbed<'e>(&self, extra: &'e [f64]) -> &'e [f64] {
        &extra[self.initial_at() - self.disturbing.len() - self.draws..self.initial_at()]
    }
    /// Nuisance unknowns before the delays.
    fn delays_at(&self) -> usize {
        3 * usize::from(self.options.gyro_bias) + self.model.nj() * usize::from(self.options.torque_bias)
    }
    /// Nuisance unknowns in their order.
    pub(crate) fn nuisance(&self) -> Vec<Unknown> {
        let mut out = Vec::new();
        let mut add = |name: String, unit: &str, size: f64| out.push(Unknown { name, unit: unit.into(), size });
        if self.options.gyro_bias {
            for axis in ["x", "y", "z"] {
                add(format!("gyro.bias.{axis}"), "rad/s", self.options.noise.gyro);
            }
        }
        if self.options.torque_bias {
            for j in self.model.joint_names() {
                add(format!("torque.bias.{j}"), "N m", self.options.noise.torque);
            }
        }
        // A sample is what a delay is compared with.
        for (wanted, name) in [(self.options.torque_delay, "torque.delay"), (self.options.gyro_delay, "gyro.delay")] {
            if wanted {
                add(name.to_owned(), "s", self.record.dt());
            }
        }
        let joints = self.model.joint_names();
        let noise = &self.options.noise;
        let error = |e: &ErrorSource, add: &mut dyn FnMut(String, &str, f64)| {
            add(e.name(&joints), e.unit(), e.size(noise.torque, noise.gyro, self.record.seconds()));
        };
        self.errors.of.iter().for_each(|e| error(e, &mut add));
        let declared = if self.kinematics.is_empty() { Vec::new() } else { self.model.kinematic_params() };
        for &i in &self.kinematics {
            add(declared[i].name.clone(), declared[i].unit, 1e-2);
        }
        self.disturbing.iter().for_each(|e| error(e, &mut add));
        (0..self.draws).for_each(|k| add(format!("motion.noise[{k}]"), "1", 1.0));
        let coords = self.model.passive_coords();
        for &i in &self.initial {
            match i {
                3..6 => add(format!("initial.rate.{}", ["x", "y", "z"][i - 3]), "rad/s", 1e-2),
                _ if i - 6 < coords.len() => add(format!("initial.{}", coords[i - 6].0), coords[i - 6].1.unit, 1e-2),
                _ => add(format!("initial.d/dt {}", coords[i - 6 - coords.len()].0), "1/s", 1e-2),
            }
        }
        out
    }
    /// Initial state: springs relaxed, base at rest, plus what is estimated.
    pub(crate) fn start(&self, params: &Params<f64>, extra: &[f64]) -> Vec<f64> {
        let mut z = vec![0.0; 6];
        z.extend(self.model.rest_position(params));
        z.resize(6 + 2 * self.model.np(), 0.0);
        for (&i, x) in self.initial.iter().zip(&extra[self.initial_at()..]) {
            z[i] += x;
        }
        z
    }
    /// Where joints and mounts are, and what disturbs the motion.
    pub(crate) fn placed(&self, extra: &[f64]) -> Displaced {
        let mut values = vec![0.0; self.model.n_kinematic_params()];
        for (&i, &x) in self.kinematics.iter().zip(&extra[self.biases()..]) {
            values[i] = x;
        }
        let kinematics = Kinematics::from_values(self.model, values);
        Displaced { kinematics, sizes: self.disturbed(extra).to_vec() }
    }
    /// What is differentiated with respect to.
    pub(crate) fn wanted(&self, along: &Straight) -> Wanted {
        let (first, last) = (self.biases(), self.initial_at());
        let between = first + self.kinematics.len();
        let kinematics = along.wanted(first..between).map(|k| self.kinematics[k]).collect();
        let disturbances = along.wanted(between..last).collect();
        let initial = along.wanted(last..last + self.initial.len()).map(|k| self.initial[k]).collect();
        let (params, combined) = (along.params.clone(), along.combined.clone());
        Wanted { params, combined, kinematics, disturbances, initial, ..Wanted::default() }
    }
    /// How readings are taken, with the delays that are estimated.
    pub(crate) fn operators(&self, extra: &[f64]) -> Result<Operators, EvalError> {
        let mut next = extra[self.delays_at()..].iter();
        let (samples, dt) = self.grid;
        let mut take = |wanted: bool, group: usize| {
            let d = if wanted { next.next().copied() } else { None };
            let skewed = self.errors.skewed(self.errors_of(extra), group);
            let times = skewed.or_else(|| self.times[group].clone());
            if d.is_none() && times.is_none() && !self.errors.retimes(group) {
                return Ok(None);
            }
            let d = d.unwrap_or(0.0);
            let lags = self.errors.lags(self.errors_of(extra), group, self.channels()[group]);
            let operator = OutputOperator::new(samples, dt, times, d).and_then(|o| o.with_lags(&lags));
            operator.map(|o| Some(o.of_means(self.record.averaging().map(|a| a.of(GROUPS[group]))))).ok_or_else(|| {
                let late = lags.iter().fold(0.0, |a: f64, b| if b.abs() > a.abs() { *b } else { a });
                EvalError::Rejected(format!("{} delay of {} s exceeds the record", GROUPS[group].name(), d + late))
            })
        };
        Ok([take(self.options.torque_delay, 0)?, take(self.options.gyro_delay, 1)?])
    }
    /// Residuals of the readings `of`: what the sensors would read but for noise, with bias and delay, less what they read.
    pub(crate) fn residuals(&self, w: &Window, by: &Operators, extra: &[f64], of: &Readings, r: &mut [f64]) {
        let n = self.model.nj();
        let (gyro_bias, rest) = extra.split_at(3 * usize::from(self.options.gyro_bias));
        let bias = [&rest[..n * usize::from(self.options.torque_bias)], gyro_bias];
        let inverse = &self.inverse;
        let errors = self.errors_of(extra);
        for group in 0..2 {
            let (readings, measured) = (of[group].clone(), self.measured()[group]);
            let taken = self.error_free(w, by, group, &readings).map(|mut taken| {
                self.errors.observe(errors, group, readings.clone(), &mut taken);
                taken
            });
            let (first, stride) = self.place(of, group);
            for c in 0..self.channels()[group] {
                let predicted = match &taken {
                    Some(taken) => taken.column(c),
                    None => w.values[group].column(c),
                };
                let predicted = match taken {
                    Some(_) => predicted.as_slice(),
                    None => &predicted.as_slice()[readings.start - w.first..readings.end - w.first],
                };
                let bias = bias[group].get(c).copied().unwrap_or(0.0) * self.errors.scale(errors, group, c);
                let column = measured.column(c);
                let measured = &column.as_slice()[readings.clone()];
                for (i, (p, m)) in predicted.iter().zip(measured).enumerate() {
                    r[first + i * stride + c] = (p + bias - m) * inverse[group][c];
                }
            }
        }
        self.weigh(of, |row, weight| r[row] *= weight);
    }
    /// Passes on the rows among those of the readings `of` that count for less than one, and for how much.
    fn weigh(&self, of: &Readings, mut each: impl FnMut(usize, f64)) {
        for group in 0..2 {
            let (first, stride) = self.place(of, group);
            for &(i, weight) in self.loose[group].iter().filter(|w| of[group].contains(&w.0)) {
                let row = first + (i - of[group].start) * stride;
                (row..row + self.channels()[group]).for_each(|row| each(row, weight));
            }
        }
        for (group, all) in self.not_counted.iter().enumerate() {
            let (first, stride) = self.place(of, group);
            let from = all.partition_point(|w| w.0 < of[group].start);
            for &(i, channel) in all[from..].iter().take_while(|w| w.0 < of[group].end) {
                each(first + (i - of[group].start) * stride + channel, 0.0);
            }
        }
    }
    /// What error-free sensors would read, readings x channels; `None` where that is the prediction and is read as it is.
    fn error_free(&self, w: &Window, by: &Operators, group: usize, readings: &Range<usize>) -> Option<DMatrix<f64>> {
        match &by[group] {
            Some(o) => Some(o.of(&w.values[group], w.first, readings.clone())),
            None if self.errors.of.is_empty() => None,
            None => {
                let from = readings.start - w.first;
                Some(w.values[group].rows(from, readings.len()).into_owned())
            }
        }
    }
    /// Derivatives of the rows of the readings `of` along directions.
    pub(crate) fn jacobian(
        &self,
        w: &Window,
        by: (&Operators, &[f64]),
        along: &Straight,
        of: &Readings,
        j: &mut DMatrix<f64>,
    ) {
        self.columns(w, by, along, of, j);
        self.weigh(of, |row, weight| j.row_mut(row).scale_mut(weight));
    }
    /// [`OutputRows::jacobian`] of readings that all count alike.
    fn columns(
        &self,
        w: &Window,
        (by, extra): (&Operators, &[f64]),
        along: &Straight,
        of: &Readings,
        j: &mut DMatrix<f64>,
    ) {
        let (rows, biases, channels) = (j.nrows(), self.biases(), self.channels());
        let of_sensors = &along.extra[..biases];
        of_sensors.iter().flatten().for_each(|&c| j.column_mut(c).fill(0.0));
        // Columns that are integrated, in the order of what is wanted.
        let to: Vec<usize> = along.to.iter().chain(along.extra[biases..].iter().flatten()).copied().collect();
        let inverse = &self.inverse;
        let errors = self.errors_of(extra);
        let bias_at = 3 * usize::from(self.options.gyro_bias);
        let bias = &extra[bias_at..self.delays_at()];
        // What error-free sensors would read.
        let values: [Option<DMatrix<f64>>; 2] =
            core::array::from_fn(|g| if self.errors.of.is_empty() { None } else { self.error_free(w, by, g, &of[g]) });
        let mut taken: [Cow<'_, DMatrix<f64>>; 2] = core::array::from_fn(|g| match &by[g] {
            Some(o) => Cow::Owned(o.of_rows(&w.derivatives[g], channels[g], w.first, of[g].clone())),
            None => Cow::Borrowed(&w.derivatives[g]),
        });
        // What errors of the sensors make of a channel: a factor, behind a rotation of the gyro.
        let (mut factors, mut turns) = (inverse.clone(), [None, None]);
        if errors.iter().any(|&e| e != 0.0) {
            for (g, d) in taken.iter_mut().enumerate() {
                let Some(values) = &values[g] else { continue };
                if let Some((gains, turn)) = self.errors.the_same_always(errors, g, channels[g]) {
                    factors[g].iter_mut().zip(gains).for_each(|(f, gain)| *f *= gain);
                    turns[g] = turn;
                    continue;
                }
                if by[g].is_none() {
                    // Of the readings alone, as they are with an operator.
                    let from = (of[g].start - w.first) * channels[g];
                    *d = Cow::Owned(d.rows(from, of[g].len() * channels[g]).into_owned());
                }
                self.errors.observe_rows(errors, g, of[g].clone(), values, d.to_mut());
            }
        }
        // Where the first row of the readings is in a column.
        let from = |g: usize| match taken[g] {
            Cow::Owned(_) => 0,
            Cow::Borrowed(_) => (of[g].start - w.first) * channels[g],
        };
        // Without joints there are no columns of torques.
        for c in 0..taken[1].ncols() {
            let col = to[c];
            let out = &mut j.as_mut_slice()[col * rows..(col + 1) * rows];
            let [tau, gyro] = core::array::from_fn(|g| {
                let (height, from) = (taken[g].nrows(), from(g));
                &taken[g].as_slice()[c * height + from..c * height + from + of[g].len() * channels[g]]
            });
            let [n, axes] = channels;
            let (of_torque, of_rate) = (&factors[0][..], &factors[1][..]);
            let torques = |out: &mut [f64], tau: &[f64]| {
                out.iter_mut().zip(tau).zip(of_torque).for_each(|((o, d), s)| *o = d * s);
            };
            let turn = &turns[1];
            let rates = |out: &mut [f64], gyro: &[f64]| match turn {
                Some(turn) => {
                    let w = turn * Vector3::new(gyro[0], gyro[1], gyro[2]);
                    out.iter_mut().zip(w.as_slice()).zip(of_rate).for_each(|((o, d), s)| *o = d * s);
                }
                None => out.iter_mut().zip(gyro).zip(of_rate).for_each(|((o, d), s)| *o = d * s),
            };
            if self.interleaved() {
                for (i, out) in out.chunks_exact_mut(n + axes).enumerate() {
                    let (to_torques, to_rates) = out.split_at_mut(n);
                    torques(to_torques, &tau[i * n..(i + 1) * n]);
                    rates(to_rates, &gyro[i * axes..(i + 1) * axes]);
                }
            } else {
                let (to_torques, to_rates) = out.split_at_mut(tau.len());
                let each = to_torques.chunks_exact_mut(n.max(1)).zip(tau.chunks_exact(n.max(1)));
                each.for_each(|(o, d)| torques(o, d));
                let each = to_rates.chunks_exact_mut(axes.max(1)).zip(gyro.chunks_exact(axes.max(1)));
                each.for_each(|(o, d)| rates(o, d));
            }
        }
        // Noise of the motion comes into these torques through friction and reflected inertia as well.
        let (first, stride) = self.place(of, 0);
        let shaken_at = biases + self.kinematics.len() + self.disturbing.len();
        for (k, [qd, qdd]) in self.shaken.iter().enumerate() {
            let Some(to) = along.extra[shaken_at + k] else { continue };
            for (row, i) in of[0].clone().enumerate() {
                for joint in 0..channels[0] {
                    let by = self.errors.through_terms(errors, i, joint, (qd[(i, joint)], qdd[(i, joint)]));
                    j[(first + row * stride + joint, to)] += by * inverse[0][joint];
                }
            }
        }
        let mut col = 0;
        let mut each = |group: usize, channel: usize, col: usize, value: &dyn Fn(usize) -> f64| {
            let Some(to) = of_sensors[col] else { return };
            let (first, stride) = self.place(of, group);
            for i in 0..of[group].len() {
                j[(first + i * stride + channel, to)] = value(i) * inverse[group][channel];
            }
        };
        if self.options.gyro_bias {
            (0..3).for_each(|k| each(1, k, col + k, &|_| 1.0));
            col += 3;
        }
        if self.options.torque_bias {
            (0..channels[0]).for_each(|k| each(0, k, col + k, &|_| self.errors.scale(errors, 0, k)));
            col += channels[0];
        }
        for (group, wanted) in [self.options.torque_delay, self.options.gyro_delay].into_iter().enumerate() {
            if let Some(o) = by[group].as_ref().filter(|_| wanted) {
                let mut slope = o.slope(&w.values[group], w.first, of[group].clone());
                if let Some(values) = &values[group] {
                    self.errors.turn(errors, group, of[group].clone(), values, &mut slope);
                }
                (0..channels[group]).for_each(|k| each(group, k, col, &|i| slope[(i, k)]));
                col += 1;
            }
        }
        if of_sensors[col..].iter().all(Option::is_none) {
            return;
        }
        for group in 0..2 {
            let Some(values) = &values[group] else { continue };
            let slope = by[group].as_ref().filter(|_| self.errors.retimes(group));
            let slope = slope.map(|o| o.slope(&w.values[group], w.first, of[group].clone()));
            let (first, stride) = self.place(of, group);
            for (k, source) in self.errors.of.iter().enumerate() {
                if source.acts_on().readings(group)
                    && let Some(to) = of_sensors[col + k]
                {
                    let readings = (group, of[group].clone());
                    let at = (values, if group == 0 { bias } else { &[] });
                    self.errors.column(k, errors, readings, at, slope.as_ref(), |row, channel, value| {
                        j[(first + row * stride + channel, to)] = value * inverse[group][channel];
                    });
                }
            }
        }
    }
    /// Both, as a block.
    pub(crate) fn block(
        &self,
        w: &Window,
        by: &Operators,
        extra: &[f64],
        along: &Straight,
        of: &Readings,
        to: &mut RowBlock,
    ) {
        to.resize(&self.rows(of), along.columns());
        self.residuals(w, by, extra, of, &mut to.residuals);
        self.jacobian(w, (by, extra), along, of, &mut to.jacobian);
    }
}
