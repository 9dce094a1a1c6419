//! What is to be judged.

use crate::workflow::identify::UncertainItems;
use excitation::Constraint;
use excitation::plan::LimitReport;
use ff_dynamics::motion::JointMotion;
use ff_mission::mission::Sensors;
use ff_model::{Model, Params};
use serde::Serialize;

/// What the sensors do, as far as a fit is concerned.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sensing {
    /// Standard deviation of one torque sample, quantisation included (N m).
    pub torque_nm: f64,
    /// Standard deviation of one gyro sample, quantisation included (rad/s).
    pub gyro_rad_per_s: f64,
    /// Samples per second (Hz).
    pub rate_hz: f64,
}

impl Sensing {
    /// The sensors of a mission: white noise and quantisation (`lsb / sqrt(12)`).
    pub fn of(s: &Sensors) -> Self {
        let sigma = |noise: f64, lsb: f64| noise.hypot(lsb / 12f64.sqrt());
        Self {
            torque_nm: sigma(s.torque.noise_std_nm, s.torque.lsb_nm),
            gyro_rad_per_s: sigma(s.gyro.noise_std_rad_per_s, s.gyro.lsb_rad_per_s),
            rate_hz: s.rate_hz,
        }
    }
}

/// What is to be judged.
#[derive(Clone, Copy)]
pub struct Question<'a> {
    /// The robot.
    pub model: &'a Model,
    /// Its parameters, at which everything is predicted.
    pub params: &'a Params<f64>,
    /// Indices of the parameters that will be estimated, ascending.
    pub selected: &'a [usize],
    /// The joint motion.
    pub motion: &'a dyn JointMotion,
    /// The sensors.
    pub sensing: Sensing,
    /// Relative standard deviation above which a parameter is called weak.
    pub weak: f64,
    /// Margins to the joint limits, when they have been proven for all time.
    pub proven: Option<&'a LimitReport>,
    /// Limits of the mission; those of the joints are judged by them.
    pub limits: &'a ff_mission::mission::Limits,
    /// Limits of the whole system ([`crate::workflow::excite::demands()`]).
    pub constraints: &'a [&'a dyn Constraint],
    /// Index of the frame of the end effector, if there is one.
    pub end_effector: Option<usize>,
    /// What the mission is not sure of beside the selected parameters ([`UncertainItems::beside`]): marginalised with its priors, as
    /// the fit will do. Nothing, if not given.
    pub uncertain: Option<&'a UncertainItems>,
    /// Small errors ([`UncertainItems::small`]) of what is taken as exact, to be told what they would move.
    pub small: Option<&'a UncertainItems>,
}
