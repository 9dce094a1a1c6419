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
