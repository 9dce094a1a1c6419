//! Calibration of the arm on the ground: link parameters and joint friction from a fixed base with gravity.
//!
//! ```text
//! tau_j = (Y(q, qd, qdd, g) phi)_j + v_j qd_j + c_j sgn(qd_j) + o_j
//! ```
//!
//! with viscous friction `v_j`, Coulomb friction `c_j` and offset `o_j` of every joint: linear in all unknowns. It is how the
//! arm gets known that the estimators in orbit take as known. Torque sensors behind the gear see no friction of motor and gear;
//! then switch it off, or let the fit show that it is zero.
//!
//! Solved by weighted least squares, one standard deviation per joint, which the residuals of that joint give in two steps
//! (M. Gautier, P. Poignet, *Extended Kalman filtering and weighted least squares dynamic identification of robot*, Control
//! Eng. Practice 9, 2001, section 4). Rates and accelerations that were not recorded come from splines through the
//! positions, which shift no phase ([`crate::motion::spline_fit`]). Near rest the sign of a rate is noise and friction is not what the
//! formula says: [`NearRest`] says what becomes of such samples. Logs with noise that is not white, or whose positions are too
//! noisy for the splines, pass a low-pass filter: positions before they are differentiated ([`smoothed`]), then torques and every
//! column of the equations alike ([`Ground::low_pass`]). `docs/theory/ground.md`.

use crate::belief::covariance::Unknown;
use crate::estimate::complete::{motion_at, trimmed};
use crate::estimate::setup::SetupError;
use crate::motion::joint_motion::joint_motion;
use crate::motion::zero_phase::ZeroPhase;
use crate::solve::linear;
use crate::solve::linear::{LinearError, LinearEstimate, Task, Weights};
use crate::solve::regressor_rows::{Equations, Extra, Kind};
use core::ops::Range;
use ff_dynamics::{State, Work, rnea};
use ff_model::{BaseKind, Model, Params};
use ff_records::Record;
use nalgebra::DMatrix;

const NAME: &str = "the ground calibration";

/// What becomes of samples of a joint close to rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NearRest {
    /// The torque of the joint is not used while its rate is below this (rad/s or m/s); its motion still counts in the
    /// rows of the others. Beyond it the sign is exact.
    LeaveOut(f64),
    /// `sgn(qd)` is taken as `tanh(qd / width)`; nothing is left out. For friction that really is smooth at this rate.
    Smooth(f64),
}

/// Which friction the joints have.
///
/// ```
/// use ident::Friction;
/// use ident::estimate::NearRest;
///
/// // Dry friction and a torque offset, samples slower than 20 mrad/s left out.
/// let friction = Friction { viscous: false, near_rest: NearRest::LeaveOut(0.02), ..Friction::ALL };
/// assert!(friction.coulomb && !friction.viscous && friction != Friction::NONE);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friction {
    /// Torque in proportion to the rate.
    pub viscous: bool,
    /// Constant torque against the motion.
    pub coulomb: bool,
    /// Constant torque (of the sensor, or of a cable).
    pub offset: bool,
    /// Samples close to rest; without Coulomb friction none is treated differently.
    pub near_rest: NearRest,
}

impl Friction {
    /// Everything, samples below 0.01 rad/s left out.
    pub const ALL: Self = Self { viscous: true, coulomb: true, offset: true, near_rest: NearRest::LeaveOut(0.01) };
    /// None.
    pub const NONE: Self = Self { viscous: false, coulomb: false, offset: false, ..Self::ALL };
}

/// The estimator.
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
/// use ident::{Friction, Ground};
///
/// // In orbit the base moves: refused, with the estimators for that.
/// assert!(Ground::new(&robot, Friction::ALL).is_err());
/// let bench = robot.clone().with_base_kind(BaseKind::Fixed);
/// assert!(Ground::new(&bench, Friction::ALL).is_ok());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Ground<'a> {
    model: &'a Model,
    friction: Friction,
    weights: Weights,
    trim_s: f64,
    low_pass_hz: Option<f64>,
}

/// Its result.
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
/// use ff_records::RecordBuilder;
/// use ident::{Friction, Ground, GroundEstimate};
///
/// // The arm on a bench, from a record of its torques in simulation; its base does not move.
/// # let bench = robot.clone().with_base_kind(BaseKind::Fixed);
/// # let trace = simulate(&bench, &truth, &State::zero(&bench), &Drive::Prescribed(&motion), &options)?;
/// let record = RecordBuilder::new(["shoulder"]).uniform(0.0, 100.0).q(trace.q.clone()).tau(trace.tau.clone());
/// let (record, _) = record.fixed_base().build()?;
/// let friction = Friction { viscous: true, ..Friction::NONE };
/// let arm = bench.parameter_indices("arm.mass")?;
/// let found: GroundEstimate = Ground::new(&bench, friction)?.estimate(&[&record], &arm, truth.values())?;
/// assert!(found.friction[0][0].abs() < 1e-3); // the simulation has none (N m s/rad)
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct GroundEstimate {
    /// Parameters, `extra` holding `friction.<joint>.viscous`, `.coulomb` and `.offset` as far as they were asked for.
    pub fit: LinearEstimate,
    /// Friction `[v, c, o]` per joint, zero where it was not estimated (N m s/rad, N m, N m).
    pub friction: Vec<[f64; 3]>,
    /// Part of the samples of each joint that was used.
    pub used: Vec<f64>,
}

/// What is looked at of a record.
struct Window {
    /// Samples between the ends that are left out.
    used: Range<usize>,
    filter: Option<ZeroPhase>,
    /// Which of these count: all but the transients of the filter.
    rows: Range<usize>,
}

/// Motion and measured torques at the samples of a record.
struct Instants {
    q: DMatrix<f64>,
    qd: DMatrix<f64>,
    qdd: DMatrix<f64>,
    tau: DMatrix<f64>,
    filter: Option<ZeroPhase>,
    /// Rows that count: all but the transients of the filter.
    rows: Range<usize>,
}

impl<'a> Ground<'a> {
    /// For a rigid model with a fixed base, weights from the residuals, nothing cut off the ends of a record.
    ///
    /// # Errors
    /// [`LinearError::Base`], [`LinearError::Setup`], [`LinearError::Option`].
    pub fn new(model: &'a Model, friction: Friction) -> Result<Self, LinearError> {
        if model.base_kind() != BaseKind::Fixed {
            let hint = "give base = \"fixed\" in the mission file; in orbit use the RDA or the complete form";
            return Err(LinearError::Base { estimator: NAME, needed: "fixed", hint });
        }
        if model.np() > 0 {
            return Err(SetupError::NotRigid(model.np()).into());
        }
        let (NearRest::LeaveOut(value) | NearRest::Smooth(value)) = friction.near_rest;
        let smooth = matches!(friction.near_rest, NearRest::Smooth(_));
        if !(value.is_finite() && value >= 0.0 && !(smooth && value == 0.0)) {
            let needed = if smooth { "positive and finite" } else { "zero or positive" };
            return Err(LinearError::Option { what: "rate near rest (rad/s)".into(), value, needed });
        }
        Ok(Self { model, friction, weights: Weights::FromResiduals(3), trim_s: 0.0, low_pass_hz: None })
    }
    /// With other weights: one standard deviation per joint (N m).
    #[must_use]
    pub fn weights(mut self, weights: Weights) -> Self {
        self.weights = weights;
        self
    }
    /// Leaves out this many seconds at both ends, where a spline knows least of the acceleration.
    #[must_use]
    pub fn trim(mut self, seconds: f64) -> Self {
        self.trim_s = seconds;
        self
    }
    /// Takes away what is above this frequency (Hz) by a filter that shifts nothing ([`ZeroPhase`]): measured torques and every
    /// column of the equations pass it alike, friction included, which leaves their solution as it is. Rows at the ends of a record,
    /// where the filter lets more noise through, do not count.
    /// A tenth of the sampling rate at most. Positions are taken as they are: see [`smoothed`].
    #[must_use]
    pub fn low_pass(mut self, hz: f64) -> Self {
        self.low_pass_hz = Some(hz);
        self
    }
    /// A record as the estimator sees it: the samples that are used, torques behind the low pass. Allocates.
    ///
    /// # Errors
    /// [`LinearError::Option`].
    pub fn seen(&self, record: &Record) -> Result<Record, LinearError> {
        let Window { used, filter, rows } = self.window(record)?;
        let used = record.rows(used);
        let Some(z) = filter else { return Ok(used.rows(rows)) };
        let mut tau = used.tau().clone();
        z.columns(&mut tau);
        Ok(used.with_tau(tau).rows(rows))
    }
    fn window(&self, record: &Record) -> Result<Window, LinearError> {
        let used = trimmed(record, self.trim_s)?;
        let n = used.len();
        let Some(hz) = self.low_pass_hz else { return Ok(Window { used, filter: None, rows: 0..n }) };
        let z = filter(record, hz)?;
        let cut = z.transient();
        if n < 3 * cut {
            return Err(too_short(hz));
        }
        Ok(Window { used, filter: Some(z), rows: cut..n - cut })
    }
    fn instants(&self, record: &Record) -> Result<Instants, LinearError> {
        let Window { used, filter, rows } = self.window(record)?;
        let (q, qd, qdd) = motion_at(&*joint_motion(self.model, record)?, record, used.clone());
        let tau = record.tau().rows(used.start, used.len()).into_owned();
        Ok(Instants { q, qd, qdd, tau, filter, rows })
    }
    /// The sign of a rate.
    fn sign(&self, rate: f64) -> f64 {
        match self.friction.near_rest {
            NearRest::Smooth(width) => (rate / width).tanh(),
            NearRest::LeaveOut(_) if rate == 0.0 => 0.0,
            NearRest::LeaveOut(_) => rate.signum(),
        }
    }
    /// Whether the sign of a rate is to be trusted, or does not matter.
    fn moves(&self, rate: f64) -> bool {
        match self.friction.near_rest {
            NearRest::LeaveOut(band) => !self.friction.coulomb || rate.abs() > band,
            NearRest::Smooth(_) => true,
        }
    }
    /// Which of viscous, Coulomb and offset are estimated.
    fn terms(&self) -> impl Iterator<Item = usize> {
        let f = self.friction;
        [f.viscous, f.coulomb, f.offset].into_iter().enumerate().filter_map(|(k, on)| on.then_some(k))
    }
    /// Estimates the parameters `selected` and the friction; the other parameters keep their value in `start`, and so does
    /// what the data cannot tell. Several records of the same robot may be given: their rows are stacked, rates and
    /// accelerations fitted record by record. Allocates.
    ///
    /// # Errors
    /// [`LinearError`].
    pub fn estimate(
        &self,
        records: &[&Record],
        selected: &[usize],
        start: &[f64],
    ) -> Result<GroundEstimate, LinearError> {
        const TERMS: [(&str, &str); 3] = [("viscous", "N m s/rad"), ("coulomb", "N m"), ("offset", "N m")];
        let (model, nj) = (self.model, self.model.nj());
        let decls = model.param_decls();
        linear::check(&decls, selected, start)?;
        let parts = records.iter().map(|r| self.instants(r)).collect::<Result<Vec<_>, _>>()?;
        if parts.is_empty() {
            return Err(LinearError::Shape("no record is given".into()));
        }
        let stack = |of: fn(&Instants) -> &DMatrix<f64>| {
            let n = parts.iter().map(|p| of(p).nrows()).sum();
            let mut out = DMatrix::zeros(n, nj);
            let mut at = 0;
            for p in &parts {
                out.rows_mut(at, of(p).nrows()).copy_from(of(p));
                at += of(p).nrows();
            }
            out
        };
        let (q, qd, qdd, tau) = (stack(|p| &p.q), stack(|p| &p.qd), stack(|p| &p.qdd), stack(|p| &p.tau));
        let n = q.nrows();
        let (mut filters, mut first) = (Vec::new(), 0);
        for p in &parts {
            filters.extend(p.filter.as_ref().map(|z| (first..first + p.q.nrows(), z)));
            first += p.q.nrows();
        }
        let mut counts = Vec::with_capacity(n);
        parts.iter().for_each(|p| counts.extend((0..p.q.nrows()).map(|i| p.rows.contains(&i))));
        let keep = DMatrix::from_fn(n, nj, |i, j| f64::from(u8::from(counts[i] && self.moves(qd[(i, j)]))));
        let rms = |m: &DMatrix<f64>, j: usize| (m.column(j).norm() / (n as f64).sqrt()).max(1e-6);
        let (mut extra, mut unknowns) = (vec![], vec![]);
        for (j, joint) in model.joint_names().iter().enumerate() {
            for k in self.terms() {
                let factor = match k {
                    0 => qd.column(j).iter().copied().collect(),
                    1 => qd.column(j).iter().map(|&w| self.sign(w)).collect(),
                    _ => vec![1.0; n],
                };
                extra.push(Extra { dof: j, factor });
                let size = rms(&tau, j) / if k == 0 { rms(&qd, j) } else { 1.0 };
                let name = format!("friction.{joint}.{}", TERMS[k].0);
                unknowns.push((Unknown { name, unit: TERMS[k].1.into(), size }, 0.0));
            }
        }
        let used = (0..nj).map(|j| keep.column(j).mean()).collect();
        let joints = model.joint_names();
        let kinds = joints.iter().enumerate().map(|(j, n)| Kind { name: format!("torque {n}"), dofs: vec![j] });
        let equations = Equations {
            model,
            q,
            v: qd,
            a: qdd,
            measured: tau,
            selected,
            values: start,
            extra,
            keep: Some(keep),
            kinds: kinds.collect(),
        };
        let task = Task { decls: &decls, selected, start, extra: unknowns, weights: &self.weights };
        let triangles =
            if filters.is_empty() { equations.triangles()? } else { equations.filtered_triangles(&filters)? };
        let fit = linear::solve(&task, &triangles)?;
        let mut friction = vec![[0.0; 3]; nj];
        let places = (0..nj).flat_map(|j| self.terms().map(move |k| (j, k)));
        places.zip(&fit.extra).for_each(|((j, k), e)| friction[j][k] = e.value);
        Ok(GroundEstimate { fit, friction, used })
    }
    /// Torques (N x n) that parameters and friction predict at the samples of [`Ground::seen`], and residuals `measured -
    /// predicted`, zero close to rest. Allocates.
    ///
    /// # Errors
    /// [`LinearError::Setup`], [`LinearError::Option`], [`LinearError::Shape`].
    pub fn predict(
        &self,
        record: &Record,
        values: &[f64],
        friction: &[[f64; 3]],
    ) -> Result<(DMatrix<f64>, DMatrix<f64>), LinearError> {
        let (model, nj) = (self.model, self.model.nj());
        if values.len() != model.n_params() || friction.len() != nj {
            let (p, f) = (values.len(), friction.len());
            let want = model.n_params();
            return Err(LinearError::Shape(format!(
                "{p} parameters and friction of {f} joints, needed {want} and {nj}"
            )));
        }
        let at = self.instants(record)?;
        let params = Params::from_values(model, values.to_vec());
        let (mut work, mut state) = (Work::new(model), State::zero(model));
        let n = at.q.nrows();
        let mut tau = DMatrix::zeros(n, nj);
        let (mut acc, mut row) = (vec![0.0; nj], vec![0.0; nj]);
        for i in 0..n {
            for j in 0..nj {
                (state.q[j], state.v[j], acc[j]) = (at.q[(i, j)], at.qd[(i, j)], at.qdd[(i, j)]);
            }
            rnea(model, &params, &state, &acc, &mut work, &mut row);
            for (j, [v, c, o]) in friction.iter().enumerate() {
                tau[(i, j)] = row[j] + v * state.v[j] + c * self.sign(state.v[j]) + o;
            }
        }
        let mut residual = &at.tau - &tau;
        if let Some(z) = &at.filter {
            z.columns(&mut tau);
            z.columns(&mut residual);
        }
        for (r, rate) in residual.iter_mut().zip(at.qd.iter()) {
            *r = if self.moves(*rate) { *r } else { 0.0 };
        }
        let rows = |m: DMatrix<f64>| m.rows(at.rows.start, at.rows.len()).into_owned();
        Ok((rows(tau), rows(residual)))
    }
    /// Root mean square of the prediction error of each joint (N m) on a record that played no part in the estimate.
    /// Allocates.
    ///
    /// # Errors
    /// As [`Ground::predict`].
    pub fn held_out(&self, record: &Record, estimate: &GroundEstimate) -> Result<Vec<f64>, LinearError> {
        let (_, residual) = self.predict(record, &estimate.fit.values, &estimate.friction)?;
        let rms = |j: usize| {
            let c = residual.column(j);
            let count = c.iter().filter(|x| **x != 0.0).count().max(1);
            c.norm() / (count as f64).sqrt()
        };
        Ok((0..self.model.nj()).map(rms).collect())
    }
}

fn filter(record: &Record, value: f64) -> Result<ZeroPhase, LinearError> {
    let needed = "above zero and a tenth of the rate at most";
    let wrong = || LinearError::Option { what: "cutoff of the low pass (Hz)".into(), value, needed };
    ZeroPhase::new(record.rate_hz(), value).ok_or_else(wrong)
}

fn too_short(value: f64) -> LinearError {
    let needed = "higher, for a record as short as this";
    LinearError::Option { what: "cutoff of the low pass (Hz)".into(), value, needed }
}

/// A record with joint positions that passed a low pass, and their rates and accelerations, for positions too noisy for splines.
/// Rates and accelerations that were recorded, both, pass it as they are. Samples at the ends that depend on what was before or comes
/// after are cut off. Torques stay as they are. Allocates.
///
/// # Errors
/// [`LinearError::Option`] for a frequency out of range (a tenth of the sampling rate at most), or a record too short for it.
pub fn smoothed(record: &Record, hz: f64) -> Result<Record, LinearError> {
    let z = filter(record, hz)?;
    let (n, cut) = (record.samples(), z.transient());
    if n < 3 * cut {
        return Err(too_short(hz));
    }
    let pass = |m: &DMatrix<f64>| {
        let mut m = m.clone();
        z.columns(&mut m);
        m
    };
    let (q, dt) = (pass(record.q()), record.dt());
    let (qd, qdd) = match (record.qd(), record.qdd()) {
        (Some(v), Some(a)) => (pass(v), pass(a)),
        _ => (slopes(&q, dt, RATE), slopes(&q, dt * dt, ACCELERATION)),
    };
    Ok(record.clone().with_motion(q, qd, qdd).rows(cut..n - cut))
}

/// Central differences of order four: what two samples before to two behind count.
const RATE: [f64; 5] = [1.0 / 12.0, -8.0 / 12.0, 0.0, 8.0 / 12.0, -1.0 / 12.0];
const ACCELERATION: [f64; 5] = [-1.0 / 12.0, 16.0 / 12.0, -30.0 / 12.0, 16.0 / 12.0, -1.0 / 12.0];

/// Differences of every column over `step`; the two samples at each end, where a filter has not settled, take those next to them.
fn slopes(x: &DMatrix<f64>, step: f64, weights: [f64; 5]) -> DMatrix<f64> {
    let last = x.nrows() - 3;
    DMatrix::from_fn(x.nrows(), x.ncols(), |i, j| {
        let i = i.clamp(2, last);
        weights.iter().enumerate().map(|(k, w)| w * x[(i + k - 2, j)]).sum::<f64>() / step
    })
}
