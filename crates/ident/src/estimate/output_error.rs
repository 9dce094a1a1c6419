//! Output error: passive states are simulated, torques and base rates compared.
//!
//! Panel and fuel motion is not measured. The reduced system ([`ff_dynamics::reduced::system`]) is integrated under
//! the measured joint motion from an initial state, and joint torques and gyro are compared with the record,
//! each divided by its noise (the paper's eq. (11), squared and weighted as it must be; `docs/paper-errata.md`).
//! The Jacobian comes from the sensitivities integrated beside the states, exact for the discrete solution.

use crate::belief::covariance::Unknown;
use crate::estimate::delay::Delay;
use crate::estimate::estimator::{Coarse, Estimator};
use crate::estimate::setup::{Noise, SetupError, check_noise};
use crate::motion::tables::Tables;
use ff_dynamics::{Boundary, Response, Wanted, modes, sensitivities, simulate_reduced};
use ff_least_squares::EvalError;
use ff_model::diagnostics::{clip, nearest};
use ff_model::{Kinematics, Model, Params};
use ff_records::Record;
use nalgebra::{DMatrix, DMatrixView};
use std::borrow::Cow;

/// Samples per period of the fastest mode that are left for a first pass, and for a pass before that.
const PER_PERIOD: [f64; 2] = [10.0, 5.0];
/// Samples that a first pass needs at least.
const LEAST_SAMPLES: usize = 200;
/// Beyond, a first pass would no longer be what takes the time.
const THINNEST: usize = 10;

/// What the estimator assumes and what else it may adjust.
///
/// ```
/// use ident::{Noise, Options};
///
/// // Sensors with biases, and a robot that need not be at rest when the record begins.
/// let noise = Noise { torque: 0.1, gyro: 1.5e-4 };
/// let options = Options { gyro_bias: true, torque_bias: true, initial_state: true, ..Options::new(noise) };
/// assert_eq!((options.substeps, options.noise), (2, noise));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Noise that whitens the residuals.
    pub noise: Noise,
    /// Integration steps per sample.
    pub substeps: usize,
    /// Estimate a constant bias of every gyro axis.
    pub gyro_bias: bool,
    /// Estimate a constant bias of every torque sensor.
    pub torque_bias: bool,
    /// Estimate the initial base rate and passive state instead of assuming rest.
    pub initial_state: bool,
    /// Estimate by how much the torque readings are late against the joint positions (s); negative when early.
    pub torque_delay: bool,
    /// The same for the gyro.
    pub gyro_delay: bool,
    /// Placements of joints and mounts to estimate, by name ([`Model::kinematic_params`]: `joint3.offset`,
    /// `joint3.placement.x`, `wing.mount.rx`); all others stay where the model has them.
    pub kinematics: Vec<String>,
}

impl Options {
    /// Given noise, two steps per sample, no nuisance unknowns, start at rest.
    pub fn new(noise: Noise) -> Self {
        Self {
            noise,
            substeps: 2,
            gyro_bias: false,
            torque_bias: false,
            initial_state: false,
            torque_delay: false,
            gyro_delay: false,
            kinematics: Vec::new(),
        }
    }
}

/// The estimator for systems with passive coordinates.
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
    model: &'a Model,
    record: Cow<'a, Record>,
    options: Options,
    tables: Tables,
    /// Kinematic parameters and initial-state components that are estimated.
    kinematics: Vec<usize>,
    initial: Vec<usize>,
    /// One over the standard deviation of each row.
    inverse: Vec<f64>,
    /// How often its record has been thinned.
    thinned: usize,
}

impl<'a> OutputError<'a> {
    /// For a model and a record of it.
    ///
    /// # Errors
    /// [`SetupError`].
    pub fn new(model: &'a Model, record: &'a Record, options: &Options) -> Result<Self, SetupError> {
        check_noise(&options.noise)?;
        // A uniform velocity changes nothing that is measured, so it is not among the unknowns.
        let initial = if options.initial_state { (3..6 + 2 * model.np()).collect() } else { Vec::new() };
        let kinematics = placements(model, &options.kinematics)?;
        let tables = Tables::new(model, record, options.substeps.max(1), Some(&options.noise), !options.initial_state)?;
        Ok(Self { kinematics, ..Self::over(model, Cow::Borrowed(record), options.clone(), tables, initial) })
    }
    fn over(model: &'a Model, record: Cow<'a, Record>, options: Options, tables: Tables, initial: Vec<usize>) -> Self {
        let n = model.nj();
        let of = |row: usize| 1.0 / if row % (n + 3) < n { options.noise.torque } else { options.noise.gyro };
        let inverse = (0..record.samples() * (n + 3)).map(of).collect();
        Self { model, record, options, tables, kinematics: Vec::new(), initial, inverse, thinned: 0 }
    }
    /// How many samples a first pass can go on by. With ten of them left per period of the fastest mode, steps of the integration
    /// as long are off by less than 0.2 % in its frequency (`(2 pi / 10)^4 / 120`), with five by 2 %.
    fn stride(&self, full: &[f64]) -> Option<usize> {
        let per_period = PER_PERIOD.get(self.thinned)?;
        let params = Params::from_values(self.model, full.to_vec());
        let q: Vec<f64> = self.record.q().row(0).iter().copied().collect();
        let eta = self.model.rest_position(&params);
        let modes = modes(self.model, &params, &q, &eta, Boundary::JointsHeld).ok()?;
        let fastest = modes.iter().map(|m| m.frequency_hz).fold(0.0, f64::max);
        let every = 1.0 / (per_period * fastest * self.record.dt());
        // NaN where there is no mode.
        let enough = self.record.samples() / LEAST_SAMPLES;
        if every.is_finite() { Some((every as usize).min(enough).min(THINNEST)) } else { None }
    }
    /// Initial state: springs relaxed, base at rest, plus what is estimated.
    fn start(&self, params: &Params<f64>, extra: &[f64]) -> Vec<f64> {
        let mut z = vec![0.0; 6];
        z.extend(self.model.rest_position(params));
        z.resize(6 + 2 * self.model.np(), 0.0);
        for (&i, x) in self.initial.iter().zip(&extra[self.biases() + self.kinematics.len()..]) {
            z[i] += x;
        }
        z
    }
    /// Where joints and mounts are.
    fn placed(&self, extra: &[f64]) -> Kinematics<f64> {
        let mut values = vec![0.0; self.model.n_kinematic_params()];
        for (&i, &x) in self.kinematics.iter().zip(&extra[self.biases()..]) {
            values[i] = x;
        }
        Kinematics::from_values(self.model, values)
    }
    /// Nuisance unknowns before placements and the initial state.
    fn biases(&self) -> usize {
        self.delays_at() + usize::from(self.options.torque_delay) + usize::from(self.options.gyro_delay)
    }
    /// Nuisance unknowns before the delays.
    fn delays_at(&self) -> usize {
        3 * usize::from(self.options.gyro_bias) + self.model.nj() * usize::from(self.options.torque_bias)
    }
    /// Delay of torques and gyro, where they are estimated.
    fn delays(&self, extra: &[f64]) -> Result<[Option<Delay>; 2], EvalError> {
        let mut next = extra[self.delays_at()..].iter();
        let (samples, dt) = (self.record.samples(), self.record.dt());
        let mut take = |wanted: bool, what: &str| {
            let Some(&d) = (if wanted { next.next() } else { None }) else { return Ok(None) };
            let delay = Delay::new(samples, dt, d);
            delay.map(Some).ok_or_else(|| EvalError::Rejected(format!("{what} delay of {d} s exceeds the record")))
        };
        Ok([take(self.options.torque_delay, "torque")?, take(self.options.gyro_delay, "gyro")?])
    }
    /// Residuals: what the sensors would read but for noise, with bias and delay, less what they read.
    fn fill(&self, y: &Response, delays: &[Option<Delay>; 2], extra: &[f64], r: &mut [f64]) {
        let n = self.model.nj();
        let late = |d: &Option<Delay>, y: DMatrixView<'_, f64>| -> Option<DMatrix<f64>> {
            d.as_ref().map(|d| d.of(&y.into_owned()))
        };
        let (late_tau, late_gyro) = (late(&delays[0], y.tau.as_view()), late(&delays[1], y.twist.columns(3, 3)));
        let tau: DMatrixView<'_, f64> = late_tau.as_ref().map_or_else(|| y.tau.as_view(), |m| m.as_view());
        let gyro: DMatrixView<'_, f64> = late_gyro.as_ref().map_or_else(|| y.twist.columns(3, 3), |m| m.as_view());
        let (gyro_bias, rest) = extra.split_at(3 * usize::from(self.options.gyro_bias));
        let torque_bias = &rest[..n * usize::from(self.options.torque_bias)];
        let channels = n + 3;
        let mut channel = |c: usize, predicted: &[f64], measured: &[f64], bias: f64| {
            for (i, (p, m)) in predicted.iter().zip(measured).enumerate() {
                let row = i * channels + c;
                r[row] = (p + bias - m) * self.inverse[row];
            }
        };
        let bias = |b: &[f64], j: usize| b.get(j).copied().unwrap_or(0.0);
        for j in 0..n {
            let (p, m) = (tau.column(j), self.record.tau().column(j));
            channel(j, p.as_slice(), m.as_slice(), bias(torque_bias, j));
        }
        for j in 0..3 {
            let (p, m) = (gyro.column(j), self.record.gyro().column(j));
            channel(n + j, p.as_slice(), m.as_slice(), bias(gyro_bias, j));
        }
    }
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
        self.record.samples() * (self.model.nj() + 3)
    }
    fn nuisance(&self) -> Vec<Unknown> {
        let mut out = Vec::new();
        let mut add = |name: String, unit: &str, size: f64| out.push(Unknown { name, unit: unit.to_owned(), size });
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
        let declared = if self.kinematics.is_empty() { Vec::new() } else { self.model.kinematic_params() };
        for &i in &self.kinematics {
            add(declared[i].name.clone(), declared[i].unit, 1e-2);
        }
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
    fn coarse(&self, full: &[f64]) -> Option<Coarse<'_>> {
        let every = self.stride(full).filter(|&every| every > 1)?;
        let record = self.record.thinned(every).ok()?;
        let channels = self.model.nj() + 3;
        let rows = (0..record.samples()).flat_map(|i| (0..channels).map(move |c| i * every * channels + c)).collect();
        let (options, tables) = (self.options.clone(), self.tables.thinned(every));
        let thin = OutputError::over(self.model, Cow::Owned(record), options, tables, self.initial.clone());
        let kinematics = self.kinematics.clone();
        Some(Coarse { estimator: Box::new(OutputError { thinned: self.thinned + 1, kinematics, ..thin }), rows })
    }
    fn residuals(&mut self, full: &[f64], extra: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
        let params = Params::from_values(self.model, full.to_vec());
        let z0 = self.start(&params, extra);
        let model = self.model;
        let placed = self.placed(extra);
        let table = self.tables.get(model, &params, &placed, &Wanted::default());
        let y = simulate_reduced(model, &params, table, &z0).map_err(|e| EvalError::Rejected(e.to_string()))?;
        self.fill(&y, &self.delays(extra)?, extra, r);
        Ok(())
    }
    fn jacobian(
        &mut self,
        full: &[f64],
        extra: &[f64],
        selected: &[usize],
        r: &mut [f64],
        j: &mut DMatrix<f64>,
    ) -> Result<(), EvalError> {
        let params = Params::from_values(self.model, full.to_vec());
        let z0 = self.start(&params, extra);
        let (kinematics, initial) = (self.kinematics.clone(), self.initial.clone());
        let wanted = Wanted { params: selected.to_vec(), kinematics, initial, ..Wanted::default() };
        let (model, placed) = (self.model, self.placed(extra));
        let table = self.tables.get(model, &params, &placed, &wanted);
        let (y, d) =
            sensitivities(model, &params, table, &z0, &wanted).map_err(|e| EvalError::Rejected(e.to_string()))?;
        let delays = self.delays(extra)?;
        self.fill(&y, &delays, extra, r);
        let [late_torque, late_gyro] = delays;
        let n = model.nj();
        let channels = n + 3;
        let biases = self.biases();
        let d_tau = late_torque.as_ref().map(|late| late.of_rows(&d.tau, n));
        let d_gyro = late_gyro.as_ref().map(|late| late.of_rows(&d.gyro, 3));
        let (d_tau, d_gyro) = (d_tau.as_ref().unwrap_or(&d.tau), d_gyro.as_ref().unwrap_or(&d.gyro));
        let rows = self.record.samples() * channels;
        j.columns_mut(selected.len(), j.ncols() - selected.len()).fill(0.0);
        for c in 0..wanted.len() {
            let col = if c < selected.len() { c } else { c + biases };
            let out = &mut j.as_mut_slice()[col * rows..(col + 1) * rows];
            let tau = &d_tau.as_slice()[c * d_tau.nrows()..(c + 1) * d_tau.nrows()];
            let gyro = &d_gyro.as_slice()[c * d_gyro.nrows()..(c + 1) * d_gyro.nrows()];
            for (i, (out, w)) in out.chunks_exact_mut(channels).zip(self.inverse.chunks_exact(channels)).enumerate() {
                let derivatives = tau[i * n..(i + 1) * n].iter().chain(&gyro[i * 3..(i + 1) * 3]);
                out.iter_mut().zip(derivatives).zip(w).for_each(|((o, d), w)| *o = d * w);
            }
        }
        let mut col = selected.len();
        let each = |j: &mut DMatrix<f64>, first: usize, col: usize, value: &dyn Fn(usize) -> f64| {
            for i in 0..self.record.samples() {
                let row = i * channels + first;
                j[(row, col)] = value(i) * self.inverse[row];
            }
        };
        if self.options.gyro_bias {
            (0..3).for_each(|k| each(j, n + k, col + k, &|_| 1.0));
            col += 3;
        }
        if self.options.torque_bias {
            (0..n).for_each(|k| each(j, k, col + k, &|_| 1.0));
            col += n;
        }
        if let Some(late) = late_torque {
            let slope = late.slope(&y.tau);
            (0..n).for_each(|k| each(j, k, col, &|i| slope[(i, k)]));
            col += 1;
        }
        if let Some(late) = late_gyro {
            let slope = late.slope(&y.twist.columns(3, 3).into_owned());
            (0..3).for_each(|k| each(j, n + k, col, &|i| slope[(i, k)]));
        }
        Ok(())
    }
}
