//! The Reduced Dynamics Algorithm: a rigid system from joint motion, joint torques and the base gyro.
//!
//! Base acceleration is eliminated by momentum conservation, so neither it nor base position, velocity or
//! attitude has to be measured: `tau = H* qdd + c* = N^T Y phi`, rational in `phi`, with the exact Jacobian
//! `N^T Y` ([`ff_dynamics::reduced_torques`]; Rackl, Lampariello, Albu-Schaeffer 2013).

use crate::estimate::estimator::Estimator;
use crate::estimate::setup::{Noise, SetupError, check_noise};
use crate::motion::tables::Tables;
use ff_dynamics::{Wanted, reduced_torques};
use ff_least_squares::EvalError;
use ff_model::{Kinematics, Model, Params};
use ff_records::Record;
use nalgebra::DMatrix;

/// The rigid estimator.
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
/// use ident::{Noise, Rda, Request, estimate};
///
/// let mut rda = Rda::new(&robot, &record, &Noise { torque: 0.01, gyro: 1e-5 })?;
/// let fit = estimate(&Request::new(&decls, &mass, &start), &mut rda)?;
/// assert!(fit.status.is_converged() && (fit.values[0] - 60.0).abs() < 0.05);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Rda<'a> {
    model: &'a Model,
    record: &'a Record,
    sigma: f64,
    tables: Tables,
}

impl<'a> Rda<'a> {
    /// For a rigid model and a record of it.
    ///
    /// # Errors
    /// [`SetupError`].
    pub fn new(model: &'a Model, record: &'a Record, noise: &Noise) -> Result<Self, SetupError> {
        check_noise(noise)?;
        if model.np() > 0 {
            return Err(SetupError::NotRigid(model.np()));
        }
        Ok(Self { model, record, sigma: noise.torque, tables: Tables::new(model, record, 1, Some(noise), true)? })
    }
    fn fill(&self, tau: &DMatrix<f64>, r: &mut [f64]) {
        let n = self.model.nj();
        for i in 0..tau.nrows() {
            for j in 0..n {
                r[i * n + j] = (tau[(i, j)] - self.record.tau()[(i, j)]) / self.sigma;
            }
        }
    }
    fn run(&mut self, full: &[f64], selected: &[usize]) -> Result<(DMatrix<f64>, DMatrix<f64>), EvalError> {
        let params = Params::from_values(self.model, full.to_vec());
        let wanted = Wanted { params: selected.to_vec(), initial: Vec::new(), ..Wanted::default() };
        let (model, rates) = (self.model, self.record.gyro());
        let table = self.tables.get(model, &params, &Kinematics::fixed(model), &wanted);
        reduced_torques(model, &params, table, rates, &wanted).map_err(|e| EvalError::Rejected(e.to_string()))
    }
}

impl Estimator for Rda<'_> {
    fn rows(&self) -> usize {
        self.record.samples() * self.model.nj()
    }
    fn residuals(&mut self, full: &[f64], _extra: &[f64], r: &mut [f64]) -> Result<(), EvalError> {
        let (tau, _) = self.run(full, &[])?;
        self.fill(&tau, r);
        Ok(())
    }
    fn jacobian(
        &mut self,
        full: &[f64],
        _extra: &[f64],
        selected: &[usize],
        r: &mut [f64],
        j: &mut DMatrix<f64>,
    ) -> Result<(), EvalError> {
        let (tau, d) = self.run(full, selected)?;
        self.fill(&tau, r);
        j.columns_mut(0, selected.len()).copy_from(&(d / self.sigma));
        Ok(())
    }
}
