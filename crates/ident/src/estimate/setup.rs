//! Noise of the sensors, and why an estimator cannot be set up.

use ff_records::time_base::TimeBaseError;

/// Standard deviations that whiten the residuals.
///
/// ```
/// use ident::Noise;
///
/// // Whitened residuals: 0.25 N m beside a sensor of 0.1 N m.
/// let noise = Noise { torque: 0.1, gyro: 1.5e-4 };
/// assert_eq!(0.25 / noise.torque, 2.5);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Noise {
    /// Joint torque (N m).
    pub torque: f64,
    /// Gyro (rad/s).
    pub gyro: f64,
}

/// Why an estimator cannot be set up.
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
/// use ident::{Noise, Rda, SetupError};
///
/// let refused = Rda::new(&robot, &record, &Noise { torque: 0.01, gyro: -1e-5 }).err();
/// assert!(matches!(refused, Some(SetupError::Noise { value, .. }) if value == -1e-5));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
    /// An error of a joint that the robot does not have, or of a fourth axis.
    #[error("an error to estimate belongs to none of the {0} joints and three axes; see ErrorSource::all")]
    NoSuchError(usize),
    /// An oscillator that does not oscillate.
    #[error(
        "an oscillator of {frequency_hz} Hz with damping ratio {damping_ratio}; give a positive frequency and a ratio below one"
    )]
    Oscillator {
        /// Frequency (Hz).
        frequency_hz: f64,
        /// Damping ratio.
        damping_ratio: f64,
    },
    /// Deviations of single torque channels: one for each joint, positive and finite.
    #[error(
        "noise {value} of torque channel {channel}; one for each of the {joints} joints is needed, positive and finite"
    )]
    ChannelNoise {
        /// Which of them.
        channel: usize,
        /// The value.
        value: f64,
        /// Joints of the model.
        joints: usize,
    },
    /// A current of a joint without the gain of its drive among the errors, or a gain where the torque was measured.
    #[error("{}", if *.measured {
        format!("the record has the current of {joint} in place of its torque: add ErrorSource::DriveGain of that joint to the errors")
    } else {
        format!("a gain of the drive of {joint} is asked for, but the record has its torque, not its current")
    })]
    Currents {
        /// The joint.
        joint: String,
        /// Whether its current was measured.
        measured: bool,
    },
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
