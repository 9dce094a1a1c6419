//! What every estimator is set up with: the noise of the sensors, and why a set-up is refused.

use crate::resample::TimeBaseError;

/// Standard deviations that whiten the residuals.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Noise {
    /// Joint torque (N m).
    pub torque: f64,
    /// Gyro (rad/s).
    pub gyro: f64,
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
    /// Sample times that the estimator cannot work with.
    #[error(transparent)]
    TimeBase(#[from] TimeBaseError),
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
