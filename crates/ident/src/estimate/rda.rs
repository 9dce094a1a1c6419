//! The Reduced Dynamics Algorithm: a rigid system from joint motion, joint torques and the base gyro.
//!
//! Base acceleration is eliminated by momentum conservation, so neither it nor base position, velocity or
//! attitude has to be measured: `tau = H* qdd + c* = N^T Y phi`, rational in `phi`, with the exact Jacobian
//! `N^T Y` ([`ff_dynamics::reduced_torques`]; Rackl, Lampariello, Albu-Schaeffer 2013).

use crate::estimate::estimator::Estimator;
use crate::motion::tables::Tables;
use ff_dynamics::{Wanted, reduced_torques};
use ff_least_squares::EvalError;
use ff_model::{Model, Params};
use ff_records::Record;
use nalgebra::DMatrix;

/// Standard deviations that whiten the residuals.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Noise {
    /// Joint torque (N m).
    pub torque: f64,
    /// Gyro (rad/s).
    pub gyro: f64,
}

/// The rigid estimator.
pub struct Rda<'a> {
    model: &'a Model,
    record: &'a Record,
    sigma: f64,
    tables: Tables,
}

/// Why an estimator cannot be set up.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    /// The joint motion could not be fitted.
    #[error("joint motion: {0}")]
    JointMotion(String),
    /// Record and model have different joints.
    #[error("the record has {got} joints, the model {want}; give one column per joint of the URDF")]
    Joints {
        /// In the record.
        got: usize,
        /// In the model.
        want: usize,
    },
    /// The rigid estimator was given a model with appendages.
    #[error("the rigid estimator takes a model without passive coordinates, this one has {0}; freeze them first")]
    NotRigid(usize),
    /// A standard deviation that is not positive and finite.
    #[error("noise of the {channel} is {value}; it must be positive and finite")]
    Noise {
        /// Which sensor.
        channel: &'static str,
        /// The value.
        value: f64,
    },
}

pub(crate) fn check_noise(noise: &Noise) -> Result<(), SetupError> {
    for (channel, value) in [("torque sensors", noise.torque), ("gyro", noise.gyro)] {
        if !(value > 0.0 && value.is_finite()) {
            return Err(SetupError::Noise { channel, value });
        }
    }
    Ok(())
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
        let links = wanted.links(self.model);
        let (model, rates) = (self.model, self.record.gyro());
        let table = self.tables.get(model, &params, &links);
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
