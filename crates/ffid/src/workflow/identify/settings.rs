//! Settings of a fit, the method for a model, and what the two refuse.

use super::error::config;
use super::result::fit::Method;
use crate::open::Opened;
use ff_mission::mission::Drive;
use ff_model::{Area, BaseKind, Model, Problem, Problems};
use ident::{Loss, Noise};

/// Settings beside mission and record.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// `None`: [`Method::Rda`] for a rigid model, else [`Method::OutputError`].
    pub method: Option<Method>,
    /// Standard deviations of the sensors.
    pub noise: Noise,
    /// Standard deviation of the currents of motors (A), where a record has them.
    pub current_noise: f64,
    /// What torque channels on the motor's side read beside the torques of the bodies (`[[drive]]` of the mission).
    pub drives: Vec<Drive>,
    /// Reflected inertia of the joints (kg m^2), roughly, by which a motion is fitted where torques are read on the motor's side: set by the fit itself.
    pub reflected_inertia: Vec<f64>,
    /// Estimate gyro and torque biases, where the method knows them.
    pub biases: bool,
    /// Estimate the initial base rate and passive state.
    pub initial_state: bool,
    /// Relative standard deviation of a prior on every parameter, about the values of the mission.
    pub prior: Option<f64>,
    /// Relative offset of the start from the values of the mission, for studies.
    pub start_offset: f64,
    /// Seed of the directions of that offset, and of other starts.
    pub seed: u64,
    /// Most linearisations.
    pub max_iterations: usize,
    /// Largest chi-squared per degree of freedom at which a model counts as explaining a record.
    pub limit: f64,
    /// Errors that are estimated beside the parameters, by name or pattern ([`ident::uncertain::hypotheses`]).
    pub adopt: Vec<String>,
    /// Errors of sensors and placements as an identification found them (`result.uncertain`), held in predictions of other data.
    pub held_errors: Vec<(String, f64)>,
    /// What a residual costs.
    pub loss: Loss,
    /// Cutoff of the low pass of the ground calibration (Hz); none of the other methods has one.
    pub low_pass_hz: Option<f64>,
}

/// Largest chi-squared per degree of freedom that counts as explained unless another is given: residuals of 1.4 times the
/// noise.
pub const EXPLAINED: f64 = 2.0;

/// The method for a model: a base that is bolted down is calibrated on the ground.
pub fn method(model: &Model, wanted: Option<Method>) -> Method {
    wanted.unwrap_or(if model.base_kind() == BaseKind::Fixed {
        Method::Ground
    } else if model.np() > 0 {
        Method::OutputError
    } else {
        Method::Rda
    })
}

/// Refuses missions and settings that do not belong together, and noise figures that are not positive.
pub(super) fn check(opened: &Opened, s: &Settings) -> Result<(), Problems> {
    let model = &opened.model;
    let ground = method(model, s.method) == Method::Ground;
    if ground != (model.base_kind() == BaseKind::Fixed) {
        let what = "the ground calibration is for a fixed base, and a fixed base for it";
        return Err(config("Config::NotFreeFloating", what, "leave --method out, or change [robot] base"));
    }
    if ground && model.np() > 0 {
        let what =
            format!("on the ground the arm alone is calibrated, but there are {} passive coordinates", model.np());
        return Err(config("Config::NotRigid", what, "remove the appendages from the mission"));
    }
    if !ground && model.gravity().norm() > 0.0 {
        let what = "identification of a free-floating robot knows no gravity";
        let hint = "remove gravity from [robot]; on the ground give base = \"fixed\"";
        return Err(config("Config::NotFreeFloating", what, hint));
    }
    if opened.estimated.is_empty() {
        let hint = "name some in [estimate], such as parameters = [\"base.*\"]";
        return Err(config("Config::NoParameters", "no parameter is to be estimated", hint));
    }
    if s.method == Some(Method::Rda) && model.np() > 0 {
        let what = format!("the rigid method cannot predict {} passive coordinates", model.np());
        return Err(config("Config::Method", what, "use output-error, or a mission without appendages"));
    }
    // On the ground the residuals say how large they are.
    if ground {
        return Ok(());
    }
    let sensors = [
        ("[sensors.torque]", "noise_std_nm", "--torque-noise", s.noise.torque, "N m"),
        ("[sensors.gyro]", "noise_std_rad_per_s", "--gyro-noise", s.noise.gyro, "rad/s"),
    ];
    let mut bad = Problems::default();
    for (section, key, flag, value, unit) in sensors {
        if !(value > 0.0 && value.is_finite()) {
            let what = format!("noise {value} {unit}, limit > 0 {unit}: residuals are weighed by it");
            let p = Problem::error(Area::Config, "Config::NoNoise", what).on(format!("{section} {key}"));
            bad.push(p.hint(format!("give {key} in {section}, or {flag} on the command line")));
        }
    }
    if bad.has_errors() { Err(bad) } else { Ok(()) }
}
