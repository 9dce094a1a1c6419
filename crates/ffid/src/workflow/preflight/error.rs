//! Why there is no verdict.

use ff_dynamics::SimError;
use ff_dynamics::analysis::ModesError;
use ff_dynamics::motion::MotionError;
use ff_least_squares::EvalError;
use ff_linalg::LinalgError;
use ff_model::Problems;
use ident::SetupError;

/// Why there is no verdict.
#[derive(Debug, thiserror::Error)]
pub enum PreflightError {
    /// The base is fixed or gravity acts: identification knows free-floating systems only.
    #[error("the verdict needs a free-floating base and zero gravity, as identification does")]
    NotFreeFloating,
    /// Sensors without noise predict deviations of zero.
    #[error("noise of the {channel} is {value}; predictions need a positive number")]
    Noise {
        /// Which sensor.
        channel: &'static str,
        /// Its standard deviation.
        value: f64,
    },
    /// Nothing is to be estimated.
    #[error("no parameters are named; nothing can be predicted")]
    NoParameters,
    /// The motion has another number of joints.
    #[error("the motion has {got} joints, the robot {want}")]
    Joints {
        /// Of the motion.
        got: usize,
        /// Of the robot.
        want: usize,
    },
    /// The motion is not finite, or too short for its sensors.
    #[error("joint motion: {0}")]
    Motion(#[from] MotionError),
    /// Fewer samples than unknowns.
    #[error("{samples} samples ({duration} s at {rate} Hz) are too few")]
    TooShort {
        /// Samples.
        samples: usize,
        /// Duration (s).
        duration: f64,
        /// Rate (Hz).
        rate: f64,
    },
    /// The trajectory could not be simulated.
    #[error("simulation of the trajectory: {0}")]
    Simulation(#[from] SimError),
    /// The modes could not be computed.
    #[error("modes at the start: {0}")]
    Modes(#[from] ModesError),
    /// The simulated record was refused.
    #[error("simulated record: {0}")]
    Record(#[from] Problems),
    /// The estimator was refused.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// What the mission is not sure of makes no unknowns.
    #[error("what the mission is not sure of: {0}")]
    Uncertain(String),
    /// The estimator failed.
    #[error("sensitivities: {0}")]
    Sensitivities(String),
    /// A factorisation failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

impl From<EvalError> for PreflightError {
    fn from(e: EvalError) -> Self {
        Self::Sensitivities(e.to_string())
    }
}
