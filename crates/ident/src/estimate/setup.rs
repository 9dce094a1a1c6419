//! Noise of the sensors, and why an estimator cannot be set up.

use ff_records::time_base::TimeBaseError;

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
    /// Sample times that it cannot work with.
    #[error(transparent)]
    TimeBase(#[from] TimeBaseError),
    /// The rigid estimator was given a model with appendages.
    #[error("the rigid estimator takes a model without passive coordinates, this one has {0}; freeze them first")]
    NotRigid(usize),
    /// A kinematic parameter that the model does not have.
    #[error("no joint or mount has a placement '{name}'{}", .near.as_ref().map(|n| format!("; did you mean {n}?")).unwrap_or_default())]
    Placement {
        /// As asked for.
        name: String,
        /// The nearest name there is.
        near: Option<String>,
    },
    /// The same kinematic parameter under two names, or twice.
    #[error("'{0}' is asked for twice; the rotation of a joint's placement about its own axis is its offset")]
    PlacementTwice(String),
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
