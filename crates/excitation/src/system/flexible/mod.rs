//! What a record of the real system tells: Fisher information of named parameters of base, links, panels and fuel.
//!
//! The sensitivities `S(t)` of torques, gyro and accelerometer to the parameters and to everything else that is not
//! known are those of the reduced flexible system (`docs/theory/reduced.md`, [`ff_dynamics::sensitivities`]). With the
//! noise of the sensors in `W` and `P` the prior information,
//!
//! ```text
//! F = rate int S^T W S dt + P,      C = [F^-1]_theta,theta = (F_tt - F_tn F_nn^-1 F_nt)^-1
//! ```
//!
//! is the bound of the covariance of the named parameters `theta` when the nuisance parameters `n` (biases, the start of
//! the passive states, further parameters) are estimated beside them: the Schur complement projects them out.
//! [`FisherCost`](crate::objective::fisher::FisherCost) makes a number of `C` that should be small.
//!
//! The gradient over control points and duration is exact for the discrete (Runge-Kutta) solution: the adjoint of the
//! tangent equations, one backward sweep whatever the number of variables (`docs/theory/excitation.md`). The joints'
//! motion enters through the numbers of the arm's table only (`ff_dynamics::reduced::table`).
pub(crate) mod back;
pub(crate) mod carried;
pub(crate) mod element;
pub(crate) mod flow;
pub(crate) mod system;

use crate::objective::{State, Sweep, uniform_nodes};
use crate::plan::spline::{Duration, SplinePlan};
use crate::system::rigid::{RigidError, SensorNoise};
use element::{Element, Place};
use ff_dynamics::motion::JointMotion;
use ff_dynamics::reduced::{ArmModel, Frame};
use ff_dynamics::sim::Accelerometer;
use ff_model::{BaseKind, Model, ParamGroup, Params, Xform};
use flow::{Flow, Joints, Table};
use nalgebra::{DMatrix, DVector};
use system::{Outputs, System};

/// A parameter, its size and what is known of it beforehand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimated {
    /// Index into the parameter vector.
    pub index: usize,
    /// Standard deviation known beforehand (unit of the parameter), if any.
    pub prior: Option<f64>,
}

/// What is unknown besides parameters: standard deviations known beforehand, `None` where it is known exactly.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Nuisance {
    /// Constant bias of each gyro axis (rad/s).
    pub gyro_bias: Option<f64>,
    /// Constant bias of each torque sensor (N m).
    pub torque_bias: Option<f64>,
    /// Constant bias of each accelerometer axis (m/s^2).
    pub accel_bias: Option<f64>,
    /// Passive coordinates at the start (rad or m).
    pub deflection: Option<f64>,
    /// Passive rates at the start (rad/s or m/s).
    pub rate: Option<f64>,
}

/// What is to be found, with which sensors.
#[derive(Clone, Debug, PartialEq)]
pub struct FlexibleRequest {
    /// Parameters the record is made for.
    pub named: Vec<Estimated>,
    /// Further unknown parameters, to be projected out.
    pub others: Vec<Estimated>,
    /// Torque sensors and gyro; sample rate.
    pub noise: SensorNoise,
    /// Accelerometer and the standard deviation of one of its samples (m/s^2).
    pub accelerometer: Option<(Accelerometer, f64)>,
    /// What else is unknown.
    pub nuisance: Nuisance,
    /// Longest integration step (s); a quarter of a radian of the fastest mode is plenty.
    pub step: f64,
}

/// Why the information cannot be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FlexibleError {
    /// The model or the sensors.
    #[error(transparent)]
    Rigid(#[from] RigidError),
    /// A parameter that does not exist, or is asked for twice.
    #[error("parameter {index} {what}; the model has {count}")]
    Parameter {
        /// Index asked for.
        index: usize,
        /// What is wrong.
        what: &'static str,
        /// Number of parameters.
        count: usize,
    },
    /// A number that must be positive and finite.
    #[error("{what} is {value}; it must be positive and finite")]
    Value {
        /// Which.
        what: &'static str,
        /// Its value.
        value: f64,
    },
}

/// Fisher information of a flexible free-floating system at given parameter values.
///
/// ```
/// use excitation::system::flexible::{Estimated, FlexibleRequest, Nuisance};
/// use excitation::{FlexibleInformation, SensorNoise};
/// use ff_model::Params;
/// # let robot = ff_testkit::tree::system();
///
/// // The stiffness of the wings, gyro bias unknown.
/// let named = robot.parameter_indices("*.k[0]")?.into_iter().map(|index| Estimated { index, prior: None }).collect();
/// let noise = SensorNoise { torque: 0.1, gyro: Some(1.5e-4), rate: 100.0 };
/// let nuisance = Nuisance { gyro_bias: Some(1e-4), torque_bias: None, accel_bias: None, deflection: None, rate: None };
/// let request = FlexibleRequest { named, others: Vec::new(), noise, accelerometer: None, nuisance, step: 0.02 };
/// let information = FlexibleInformation::new(&robot, &Params::nominal(&robot), &request)?;
/// assert_eq!(information.named(), 4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct FlexibleInformation {
    system: System,
    /// Named, then other parameters.
    parameters: Vec<Estimated>,
    named: usize,
    names: Vec<(String, &'static str)>,
    values: Vec<f64>,
    /// Size of every column of `F`, dynamic ones first, then biases.
    sizes: Vec<f64>,
    /// Prior information on scaled columns.
    prior: Vec<f64>,
    /// `eta(0)` and the initial states that are columns.
    rest: Vec<f64>,
    initial: Vec<usize>,
    noise: SensorNoise,
    accel_sigma: f64,
    /// Bias columns: channel group (0 torque, 1 gyro, 2 accelerometer) and channel.
    biases: Vec<(usize, usize)>,
    step: f64,
}

/// Information without prior knowledge of a parameter: known to this many times its size.
const UNKNOWN: f64 = 1e4;

impl FlexibleInformation {
    /// From a model with a free base and no gravity. Allocates.
    ///
    /// The size of an inertial parameter is the mass `m`, `m l` or `m l^2` of its body (`l` its radius of gyration about
    /// the frame origin), that of another parameter its value, or 1 in its unit where that is zero.
    ///
    /// # Errors
    /// [`FlexibleError`].
    ///
    /// # Panics
    /// If `params` belongs to another model.
    pub fn new(model: &Model, params: &Params<f64>, request: &FlexibleRequest) -> Result<Self, FlexibleError> {
        if model.base_kind() != BaseKind::Floating || model.gravity().norm() != 0.0 {
            return Err(RigidError::NotFreeFloating.into());
        }
        request.noise.check()?;
        positive("integration step", request.step)?;
        let nuisance = &request.nuisance;
        for (what, x) in [
            ("noise of the accelerometer", request.accelerometer.map(|a| a.1)),
            ("prior of the gyro bias", nuisance.gyro_bias),
            ("prior of the torque bias", nuisance.torque_bias),
            ("prior of the accelerometer bias", nuisance.accel_bias),
            ("prior of the initial deflection", nuisance.deflection),
            ("prior of the initial passive rate", nuisance.rate),
        ] {
            x.map_or(Ok(()), |x| positive(what, x))?;
        }
        let decls = model.param_decls();
        let parameters: Vec<Estimated> = request.named.iter().chain(&request.others).copied().collect();
        for (i, p) in parameters.iter().enumerate() {
            let bad = |what| Err(FlexibleError::Parameter { index: p.index, what, count: decls.len() });
            if p.index >= decls.len() {
                return bad("does not exist");
            }
            if parameters[..i].iter().any(|o| o.index == p.index) {
                return bad("is asked for twice");
            }
            p.prior.map_or(Ok(()), |x| positive("prior of a parameter", x))?;
        }
        if request.named.is_empty() {
            return Err(RigidError::Selection.into());
        }
        let system = Self::system(model, params, &parameters, request);
        let m = model.np();
        let mut sizes: Vec<f64> = parameters.iter().map(|p| size(model, params, &decls, p.index)).collect();
        let mut prior: Vec<f64> =
            parameters.iter().zip(&sizes).map(|(p, s)| p.prior.map_or(UNKNOWN.powi(-2), |x| (s / x).powi(2))).collect();
        let mut initial = Vec::new();
        for (first, std) in [(3, nuisance.deflection), (3 + m, nuisance.rate)] {
            if let Some(std) = std {
                initial.extend(first..first + m);
                sizes.extend(std::iter::repeat_n(std, m));
            }
        }
        let mut biases = Vec::new();
        let gyro = nuisance.gyro_bias.filter(|_| request.noise.gyro.is_some());
        let accel = nuisance.accel_bias.filter(|_| request.accelerometer.is_some());
        for (group, std, count) in [(0, nuisance.torque_bias, model.nj()), (1, gyro, 3), (2, accel, 3)] {
            if let Some(std) = std {
                biases.extend((0..count).map(|c| (group, c)));
                sizes.extend(std::iter::repeat_n(std, count));
            }
        }
        prior.resize(sizes.len(), 1.0);
        let values = params.values();
        let out = Self {
            named: request.named.len(),
            names: parameters.iter().map(|p| (decls[p.index].name.clone(), decls[p.index].unit)).collect(),
            values: parameters.iter().map(|p| values[p.index]).collect(),
            system: System { columns: parameters.len() + initial.len(), ..system },
            parameters,
            sizes,
            prior,
            rest: model.rest_position(params),
            initial,
            noise: request.noise,
            accel_sigma: request.accelerometer.map_or(1.0, |a| a.1),
            biases,
            step: request.step,
        };
        // A singular mass matrix is found here rather than in the middle of a search.
        let still: Joints = [vec![0.0; model.nj()], vec![0.0; model.nj()], vec![0.0; model.nj()]];
        let table = Table::new(&out.system, std::slice::from_ref(&still), 1.0);
        Flow::new(&out.system, &table, out.start(), out.columns()).ok_or(RigidError::Singular)?;
        Ok(out)
    }

    fn system(model: &Model, params: &Params<f64>, parameters: &[Estimated], request: &FlexibleRequest) -> System {
        let bodies = 10 * model.n_bodies();
        let mut sites = Vec::new();
        let mut place = |host: usize, x: Xform<f64>| {
            if host == 0 {
                return Place::Base(Box::new(Frame::fixed(&x)));
            }
            sites.push((host, x));
            Place::Moving(sites.len() - 1)
        };
        let mut elements: Vec<Element> = model
            .appendages()
            .iter()
            .enumerate()
            .map(|(k, a)| Element::port(model, params, k, place(a.host, a.mount)))
            .collect();
        let ports = elements.len();
        let mut base_wanted = Vec::new();
        for (column, p) in parameters.iter().enumerate() {
            if p.index < 10 {
                base_wanted.push((p.index, column));
            } else if p.index < bodies {
                let body = p.index / 10;
                let known = elements[ports..].iter().position(|e| e.host == body);
                let at = known.map_or(elements.len(), |i| ports + i);
                if known.is_none() {
                    elements.push(Element::link(params, body, place(body, Xform::identity())));
                }
                elements[at].wanted.push((p.index % 10, column));
            } else {
                let k = model.appendages().iter().rposition(|a| a.param_offset <= p.index).unwrap_or(0);
                elements[k].wanted.push((p.index - model.appendages()[k].param_offset, column));
            }
        }
        elements.iter_mut().for_each(Element::probe);
        let m = model.np();
        let speed = elements.iter().any(|e| e.speed);
        let lifted: Vec<_> = sites.iter().map(|(host, x)| (*host, x.lift())).collect();
        System {
            arm: ArmModel::new(model, params, &sites),
            arm_grad: ArmModel::new(model, &params.lift(model), &lifted),
            joints: model.nj(),
            of: (0..model.n_joints()).map(|i| model.coordinate(i)).collect(),
            above: above(model),
            elements,
            base: params.body(0).to_params(),
            base_wanted,
            m,
            nz: 3 + 2 * m + if speed { 3 } else { 0 },
            columns: parameters.len(),
            accelerometer: request.accelerometer.map(|a| a.0),
        }
    }

    /// Number of named parameters.
    pub fn named(&self) -> usize {
        self.named
    }
    /// Full name and unit of every parameter, the named ones first.
    pub fn names(&self) -> &[(String, &'static str)] {
        &self.names
    }
    /// Value of every parameter, the named ones first.
    pub fn values(&self) -> &[f64] {
        &self.values
    }
    /// Indices of the parameters, the named ones first.
    pub fn parameters(&self) -> &[Estimated] {
        &self.parameters
    }
    /// Size of every column of the information matrix: parameters, initial states, biases.
    pub fn sizes(&self) -> &[f64] {
        &self.sizes
    }
    fn start(&self) -> DVector<f64> {
        let mut z = DVector::zeros(self.system.nz);
        z.as_mut_slice()[3..3 + self.rest.len()].copy_from_slice(&self.rest);
        z
    }
    fn columns(&self) -> DMatrix<f64> {
        let mut s = DMatrix::zeros(self.system.nz, self.system.columns);
        for (c, &i) in self.initial.iter().enumerate() {
            s[(i, self.parameters.len() + c)] = 1.0;
        }
        s
    }
    /// Steps of the integration: the longest duration of a plan decides, so that the number does not change.
    fn steps(&self, longest: f64) -> usize {
        // The bound keeps a senseless request affordable.
        (longest / self.step).ceil().clamp(1.0, 100_000.0) as usize
    }
    /// Information matrix over scaled columns (parameters, initial states, biases), priors included, for any rest-to-rest
    /// motion; `None` where the system cannot be integrated. Allocates.
    ///
    /// # Panics
    /// If the motion has another number of joints.
    pub fn of_motion(&self, motion: &dyn JointMotion) -> Option<DMatrix<f64>> {
        let n = self.system.joints;
        assert_eq!(motion.dof(), n, "joints of robot and motion");
        let steps = self.steps(motion.duration());
        let h = motion.duration() / steps as f64;
        let node = |i: usize| {
            let mut x = [vec![0.0; n], vec![0.0; n], vec![0.0; n]];
            let [q, qd, qdd] = &mut x;
            motion.eval(0.5 * h * i as f64, q, qd, qdd);
            x
        };
        let nodes: Vec<Joints> = (0..=2 * steps).map(node).collect();
        let table = Table::new(&self.system, &nodes, h);
        let flow = Flow::new(&self.system, &table, self.start(), self.columns())?;
        let (f, _) = self.assemble(&flow, &table);
        f.iter().all(|x| x.is_finite()).then_some(f)
    }
    /// [`FlexibleInformation::of_motion`] of a plan, with whatever `f` says about it: `f` gets the matrix and returns a
    /// value and its symmetric gradient over the matrix; the gradient over `x` is written into `grad`. NaN where the
    /// system cannot be integrated or `f` has no answer. Allocates.
    ///
    /// # Panics
    /// If `x` or `grad` has the wrong length, or the plan another number of joints.
    pub fn value_gradient(
        &self,
        plan: &SplinePlan,
        x: &[f64],
        grad: &mut [f64],
        f: impl FnOnce(&DMatrix<f64>) -> Option<(f64, DMatrix<f64>)>,
    ) -> f64 {
        assert_eq!(self.system.joints, plan.dof(), "joints of robot and plan");
        let (Duration::Fixed(longest) | Duration::Free { max: longest, .. }) = plan.spec().duration;
        let steps = self.steps(longest);
        let nodes = uniform_nodes(plan, 2 * steps + 1);
        let mut sweep = Sweep::new(plan, x);
        let duration = sweep.duration;
        let mut joints = Vec::with_capacity(nodes.len());
        sweep.forward(&nodes, |_, s: &State| joints.push([s.q.clone(), s.qd.clone(), s.qdd.clone()]));
        let table = Table::new(&self.system, &joints, duration / steps as f64);
        let Some(flow) = Flow::new(&self.system, &table, self.start(), self.columns()) else { return f64::NAN };
        let (matrix, samples) = self.assemble(&flow, &table);
        if matrix.iter().any(|x| !x.is_finite()) {
            return f64::NAN;
        }
        let Some((value, slope)) = f(&matrix) else { return f64::NAN };
        // Over the samples; over their common weight, which grows with the duration.
        let mut over = Vec::with_capacity(samples.len());
        let mut over_duration = 0.0;
        let k = self.system.columns;
        for (i, y) in samples.iter().enumerate() {
            let c = y * &slope * (2.0 * self.weight(i, &table));
            over_duration += 0.5 * c.dot(y) / duration;
            let n = plan.dof();
            let scaled = DMatrix::from_fn(y.nrows(), k, |r, col| c[(r, col)] * self.sizes[col] / self.sigma(r));
            let gyro = if self.noise.gyro.is_some() { scaled.rows(n, 3).into_owned() } else { DMatrix::zeros(3, k) };
            let accel = self.system.accelerometer.map(|_| scaled.rows(y.nrows() - 3, 3).into_owned());
            over.push(Outputs { torque: scaled.rows(0, n).into_owned(), gyro, accel });
        }
        let (numbers, over_step) = flow.pull(&self.system, &table, &over);
        let mut at = numbers.iter().enumerate();
        let mut arm = self.system.arm_grad.clone();
        sweep.backward(&nodes, grad, |_, s, adj| {
            let Some((i, weights)) = at.next() else { return };
            let [q, qd, qdd] = &self.system.of_tree([&s.q, &s.qd, &s.qdd]);
            let mut over = [vec![0.0; q.len()], vec![0.0; q.len()], vec![0.0; q.len()]];
            let [by_q, by_qd, by_qdd] = &mut over;
            arm.pull_back([q, qd, qdd], i % 2 == 0, weights, [by_q, by_qd, by_qdd]);
            for (to, over) in [&mut adj.q, &mut adj.qd, &mut adj.qdd].into_iter().zip(&over) {
                over.iter().zip(&self.system.of).for_each(|(x, c)| to[c.index] += c.multiplier * x);
            }
        });
        if let Some(i) = plan.duration_index() {
            grad[i] += over_duration + over_step / steps as f64;
        }
        value
    }
    /// Trapezoidal weight of sample `i` in the sum over the samples of the record.
    fn weight(&self, i: usize, table: &Table) -> f64 {
        let end = i == 0 || i == table.steps();
        self.noise.rate * table.step * if end { 0.5 } else { 1.0 }
    }
    /// Standard deviation of channel `r`.
    fn sigma(&self, r: usize) -> f64 {
        let n = self.system.joints;
        match self.noise.gyro {
            _ if r < n => self.noise.torque,
            Some(gyro) if r < n + 3 => gyro,
            _ => self.accel_sigma,
        }
    }
    /// The matrix, and the whitened, scaled rows of every sample.
    fn assemble(&self, flow: &Flow, table: &Table) -> (DMatrix<f64>, Vec<DMatrix<f64>>) {
        let (n, k, all) = (self.system.joints, self.system.columns, self.sizes.len());
        let mut m = DMatrix::from_diagonal(&DVector::from_column_slice(&self.prior));
        let mut rows = Vec::new();
        for (i, Outputs { torque, gyro, accel }) in flow.samples(&self.system, table).into_iter().enumerate() {
            let with_gyro = self.noise.gyro.is_some();
            let (first, count) = (n + if with_gyro { 3 } else { 0 }, if accel.is_some() { 3 } else { 0 });
            let mut y = DMatrix::zeros(first + count, all);
            y.view_mut((0, 0), (n, k)).copy_from(&torque);
            if with_gyro {
                y.view_mut((n, 0), (3, k)).copy_from(&gyro);
            }
            if let Some(a) = &accel {
                y.view_mut((first, 0), (3, k)).copy_from(a);
            }
            for (c, (group, channel)) in self.biases.iter().enumerate() {
                y[([0, n, first][*group] + channel, k + c)] = 1.0;
            }
            for r in 0..y.nrows() {
                for c in 0..all {
                    y[(r, c)] *= self.sizes[c] / self.sigma(r);
                }
            }
            m.gemm_tr(self.weight(i, table), &y, &y, 1.0);
            rows.push(y);
        }
        (m, rows)
    }
}

/// Joints between each body and the base.
fn above(model: &Model) -> Vec<Vec<usize>> {
    let mut above = vec![Vec::new(); model.n_bodies()];
    for (l, b) in model.bodies().iter().enumerate() {
        let mut path = above[b.parent].clone();
        path.push(l);
        above[l + 1] = path;
    }
    above
}

fn positive(what: &'static str, value: f64) -> Result<(), FlexibleError> {
    if value > 0.0 && value.is_finite() { Ok(()) } else { Err(FlexibleError::Value { what, value }) }
}

/// Size of a parameter in its own unit.
fn size(model: &Model, params: &Params<f64>, decls: &[ff_model::ParamDecl], index: usize) -> f64 {
    let value = params.values()[index];
    let usable = |x: f64| if x.is_finite() && x > 0.0 { x } else { 1.0 };
    let ten = if index < 10 * model.n_bodies() {
        Some(10 * (index / 10))
    } else if let ParamGroup::Inertial(name) = &decls[index].group {
        // Ten in a row of one body.
        let owner = model.appendages().iter().rev().find(|a| a.param_offset <= index);
        let first = owner.map_or(0, |a| a.param_offset);
        (first..=index).find(|&i| matches!(&decls[i].group, ParamGroup::Inertial(n) if n == name))
    } else {
        None
    };
    match ten {
        Some(first) => {
            let p = &params.values()[first..first + 10];
            let m = usable(p[0].abs());
            let l = usable(((p[4] + p[6] + p[9]).abs() / (2.0 * m)).sqrt());
            m * l.powi([0, 1, 1, 1, 2, 2, 2, 2, 2, 2][index - first])
        }
        None => usable(value.abs()),
    }
}
