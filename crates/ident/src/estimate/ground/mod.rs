//! Calibration of the arm on the ground: link parameters and joint friction from a fixed base with gravity.
//!
//! ```text
//! tau_j = (Y(q, qd, qdd, g) phi)_j + v_j qd_j + c_j sgn(qd_j) + o_j
//! ```
//!
//! with viscous friction `v_j`, Coulomb friction `c_j` and offset `o_j` of every joint: linear in all unknowns. More terms of a joint
//! ([`JointTerm`]) are estimated where other parts of the log bear them out ([`Ground::choose_terms`]); currents of motors stand for torques
//! with gains that are unknown, too. It is how the
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

mod blocks;
mod calibration;
mod elastic;
mod equations;
mod foretold;
mod gains;
pub(crate) mod joint_terms;
mod near_mission;
mod physical;
mod problem;
mod scatter;
mod selection;
mod smoothed;

pub use blocks::Blocks;
pub use calibration::Ground;
pub use elastic::Elastic;
pub use foretold::{Calibrated, Foretold};
pub use joint_terms::{Friction, JointTerm, JointTorques, NearRest};
pub use selection::TermChoice;
pub use smoothed::smoothed;

use crate::solve::linear;
use crate::solve::linear::{LinearError, LinearEstimate};
use equations::{Group, Instants, Window};
use ff_records::Record;
use joint_terms::Moving;
use nalgebra::DMatrix;
use problem::Problem;

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
/// use ident::estimate::JointTerm;
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
/// assert!(found.joints.coefficient(0, JointTerm::Viscous).abs() < 1e-3); // the simulation has none (N m s/rad)
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct GroundEstimate {
    /// Parameters, `extra` holding the terms of the joints by name ([`JointTerm::name`]) and `drive.<joint>.gain` where there are currents.
    pub fit: LinearEstimate,
    /// Friction, reflected inertia and gains of the joints.
    pub joints: JointTorques,
    /// Part of the samples of each joint that was used.
    pub used: Vec<f64>,
}

impl GroundEstimate {
    /// Standard deviation of the residual of every joint, in N m where its current was measured, too.
    pub(super) fn torque_sigma(&self) -> Vec<f64> {
        self.fit.kinds.iter().zip(&self.joints.gains).map(|(k, g)| k.sigma * g.map_or(1.0, f64::abs)).collect()
    }
}

impl Ground<'_> {
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
    /// Independent samples that one sample behind the low pass counts as, `sum h_k^2` of its impulse response (white noise in the torques); 1
    /// without a low pass. Allocates.
    ///
    /// # Errors
    /// [`LinearError::Option`].
    pub fn worth(&self, record: &Record) -> Result<f64, LinearError> {
        Ok(self.window(record)?.filter.map_or(1.0, |z| z.noise_gain()))
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
        let groups = self.checked(records, selected, start)?;
        let currents = currents(records, self.model.nj())?;
        let terms: Vec<(usize, JointTerm)> = self.all_terms();
        let loaded = terms.iter().any(|t| t.1 == JointTerm::Load);
        let problem = Problem::new(self, &groups, currents, (selected, start), terms);
        let mut triangles = problem.triangles(&groups, start)?;
        let mut solved = problem.solve(&triangles, &self.weights)?;
        if loaded {
            // The load of a gear follows from what the first solution says of the bodies.
            triangles = problem.triangles(&groups, &solved.fit.values)?;
            solved = problem.solve(&triangles, &self.weights)?;
        }
        let n: usize = groups.iter().map(equations::Group::samples).sum();
        let used = |j| groups.iter().map(|g| g.used(j)).sum::<f64>() / n.max(1) as f64;
        let used = (0..self.model.nj()).map(used).collect();
        Ok(GroundEstimate { fit: solved.fit, joints: solved.joints, used })
    }
    fn checked(&self, records: &[&Record], selected: &[usize], start: &[f64]) -> Result<Vec<Group>, LinearError> {
        linear::check(&self.model.param_decls(), selected, start)?;
        if records.is_empty() {
            return Err(LinearError::Shape("no record is given".into()));
        }
        if !(self.terms.is_empty() || self.terms.len() == self.model.nj()) {
            return Err(LinearError::Shape(format!(
                "terms of {} joints, needed {}",
                self.terms.len(),
                self.model.nj()
            )));
        }
        equations::groups(self, records)
    }
    /// Torques (N x n) that parameters and joints predict at the samples of [`Ground::seen`] (currents, A, of joints that have these), and
    /// residuals `measured - predicted`, zero close to rest. Allocates.
    ///
    /// # Errors
    /// [`LinearError::Setup`], [`LinearError::Option`], [`LinearError::Shape`].
    pub fn predict(
        &self,
        record: &Record,
        values: &[f64],
        joints: &JointTorques,
    ) -> Result<(DMatrix<f64>, DMatrix<f64>), LinearError> {
        let (at, mut tau) = self.unfiltered(record, values, joints)?;
        let residual = self.counted(&at, &at.measured - &tau);
        if let Some(z) = &at.filter {
            z.columns(&mut tau);
        }
        Ok((at.of_rows(&tau), residual))
    }
    /// What counts of the torques of all samples that are used: behind the filter, zero close to rest, without transients.
    fn counted(&self, at: &Instants, mut torques: DMatrix<f64>) -> DMatrix<f64> {
        if let Some(z) = &at.filter {
            z.columns(&mut torques);
        }
        for (x, rate) in torques.iter_mut().zip(at.qd.iter()) {
            *x = if self.moves(*rate) { *x } else { 0.0 };
        }
        at.of_rows(&torques)
    }
    /// What joints read with these parameters at all samples that are used, before a filter.
    fn unfiltered(
        &self,
        record: &Record,
        values: &[f64],
        joints: &JointTorques,
    ) -> Result<(Instants, DMatrix<f64>), LinearError> {
        let (model, nj) = (self.model, self.model.nj());
        let (p, want) = (values.len(), model.n_params());
        if p != want || joints.terms.len() != nj {
            let f = joints.terms.len();
            return Err(LinearError::Shape(format!("{p} parameters and terms of {f} joints, needed {want} and {nj}")));
        }
        let measures = currents(&[record], nj)?;
        let gain = |j: usize| match (measures[j], joints.gains.get(j).copied().flatten()) {
            (false, _) => Ok(1.0),
            (true, Some(k)) => Ok(k),
            (true, None) => Err(LinearError::Shape(format!(
                "the record has the current of {}, whose gain was not estimated",
                model.own_body(j).joint.name
            ))),
        };
        let gains = (0..nj).map(gain).collect::<Result<Vec<_>, _>>()?;
        let at = self.instants(record)?;
        let rigid = equations::rigid_torques(model, values, (&at.q, &at.qd, &at.qdd));
        let tau = DMatrix::from_fn(at.q.nrows(), nj, |i, j| {
            let qd = at.qd[(i, j)];
            let of = Moving { qd, qdd: at.qdd[(i, j)], sign: self.sign(qd), load: rigid[(i, j)] };
            let external = at.external.as_ref().map_or(0.0, |e| e[(i, j)]);
            (rigid[(i, j)] + joints.torque(j, of) - external) / gains[j]
        });
        Ok((at, tau))
    }
    /// Root mean square of the prediction error of each joint (N m) on a record that played no part in the estimate.
    /// Allocates.
    ///
    /// # Errors
    /// As [`Ground::predict`].
    pub fn held_out(&self, record: &Record, estimate: &GroundEstimate) -> Result<Vec<f64>, LinearError> {
        let (_, residual) = self.predict(record, &estimate.fit.values, &estimate.joints)?;
        let rms = |j: usize| {
            let c = residual.column(j);
            let count = c.iter().filter(|x| **x != 0.0).count().max(1);
            c.norm() / (count as f64).sqrt()
        };
        Ok((0..self.model.nj()).map(rms).collect())
    }
}

/// Joints whose currents were measured in place of torques: the same in all records.
fn currents(records: &[&Record], joints: usize) -> Result<Vec<bool>, LinearError> {
    let of = |r: &Record| if r.has_torques() { vec![false; joints] } else { r.currents().to_vec() };
    let first = records.first().map_or_else(|| vec![false; joints], |r| of(r));
    match records.iter().position(|r| of(r) != first) {
        None => Ok(first),
        Some(k) => Err(LinearError::Shape(format!(
            "record {} has currents of other joints than the first; give torques or currents of a joint in all of them",
            k + 1
        ))),
    }
}
