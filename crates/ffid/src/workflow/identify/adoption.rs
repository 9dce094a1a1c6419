//! Errors that a fit estimates beside what the mission asks for: `--adopt`.

use super::error::config;
use super::evidence::EXTRA_MODE;
use super::ties::TieSpec;
use super::uncertain::UncertainItems;
use ff_model::diagnostics::nearest;
use ff_model::{Model, Problems};
use ident::parameters::matches;
use ident::uncertain::{ErrorSource, Hypothesis, hypotheses};
use ident::{Noise, Options};

/// Size of an error of a placement (m, rad).
const PLACEMENT: f64 = 1e-2;

/// What is estimated in addition.
#[derive(Clone, Debug, Default)]
pub(super) struct Adopted {
    errors: Vec<ErrorSource>,
    kinematics: Vec<String>,
    gyro_bias: bool,
    torque_bias: bool,
    torque_delay: bool,
    gyro_delay: bool,
    initial_state: bool,
    /// Parameters of the model that were held, by index, and bodies whose ten numbers change in proportion.
    pub(super) parameters: Vec<usize>,
    pub(super) ties: Vec<TieSpec>,
}

impl Adopted {
    /// Of the errors that patterns name, for a model of which `estimated` are estimated anyway.
    pub(super) fn new(model: &Model, estimated: &[usize], patterns: &[String]) -> Result<Self, Problems> {
        let mut out = Self::default();
        if patterns.is_empty() {
            return Ok(out);
        }
        let nominal: Vec<f64> = model.param_decls().iter().map(|d| d.nominal).collect();
        let all = hypotheses(model, estimated, &nominal);
        for pattern in patterns {
            let found: Vec<&Hypothesis> = all.iter().filter(|h| matches(pattern, &h.name)).collect();
            if pattern == EXTRA_MODE {
                let what = format!("--adopt {pattern}: a mode is no single number, and what carries it is not known");
                let hint = "add the [[appendage]] that result.json and the report list with it to the mission, and estimate it";
                return Err(config("Config::NotAdoptable", what, hint));
            }
            if found.is_empty() {
                let near = nearest(pattern, all.iter().map(|h| h.name.as_str()));
                let hint = near.map_or_else(
                    || "take a name from the list that `ffid identify` prints".to_owned(),
                    |n| format!("did you mean {n}?"),
                );
                let what = format!("--adopt {pattern}: no such error of this robot, or it is estimated already");
                return Err(config("Config::UnknownError", what, &hint));
            }
            found.into_iter().for_each(|h| out.take(model, h));
        }
        Ok(out)
    }
    fn take(&mut self, model: &Model, h: &Hypothesis) {
        let (decls, joints) = (model.param_decls(), model.joint_names());
        let sources = ErrorSource::all(model.nj());
        for c in &h.components {
            let [(name, _)] = &c.of[..] else {
                let slope = c.of.iter().cloned().collect();
                self.ties.push(TieSpec { name: h.name.clone(), slope, start: Some(0.0), ..TieSpec::default() });
                continue;
            };
            if let Some(i) = decls.iter().position(|d| d.name == *name) {
                self.parameters.push(i);
            } else if let Some(source) = sources.iter().find(|s| s.name(&joints) == *name) {
                if !self.errors.contains(source) {
                    self.errors.push(*source);
                }
            } else if model.kinematic_index(name).is_some() {
                self.kinematics.push(name.clone());
            } else {
                match name.as_str() {
                    "torque.delay" => self.torque_delay = true,
                    "gyro.delay" => self.gyro_delay = true,
                    n if n.starts_with("gyro.bias") => self.gyro_bias = true,
                    n if n.starts_with("torque.bias") => self.torque_bias = true,
                    _ => self.initial_state = true,
                }
            }
        }
    }
    /// Makes one unknown of an error of the robot that all records share: gains, scales, alignment, friction, compliance and placements.
    /// Biases, drifts, clocks and what pushes the base belong to each record.
    pub(super) fn share(&self, model: &Model, noise: &Noise, uncertain: &mut UncertainItems) {
        let joints = model.joint_names();
        for e in self.errors.iter().filter(|e| e.is_of_robot()) {
            uncertain.adopt(e.name(&joints), e.unit(), e.size(noise.torque, noise.gyro, 1.0));
        }
        for p in model.kinematic_params().into_iter().filter(|p| self.kinematics.contains(&p.name)) {
            uncertain.adopt(p.name, p.unit, PLACEMENT);
        }
    }
    /// Whether something among it is no parameter of the model, but an error of sensors, placements or the start.
    pub(super) fn of_sensors(&self) -> bool {
        let others = [self.gyro_bias, self.torque_bias, self.torque_delay, self.gyro_delay, self.initial_state];
        !self.errors.is_empty() || !self.kinematics.is_empty() || others.contains(&true)
    }
    /// Puts what belongs to records into the options of their estimators.
    pub(super) fn widen(&self, o: Options) -> Options {
        Options {
            gyro_bias: o.gyro_bias || self.gyro_bias,
            torque_bias: o.torque_bias || self.torque_bias,
            initial_state: o.initial_state || self.initial_state,
            torque_delay: o.torque_delay || self.torque_delay,
            gyro_delay: o.gyro_delay || self.gyro_delay,
            kinematics: self.kinematics.clone(),
            errors: self.errors.clone(),
            ..o
        }
    }
}

/// Of the patterns of `--adopt` those that name errors of sensors and placements alone, which are unknowns of every record; the others
/// are parameters of the model. Allocates.
pub fn adopted_sensor_errors(model: &Model, patterns: &[String]) -> Vec<String> {
    let alone = |p: &String| Adopted::new(model, &[], core::slice::from_ref(p));
    let is = |a: Adopted| a.parameters.is_empty() && a.ties.is_empty();
    patterns.iter().filter(|p| alone(p).is_ok_and(is)).cloned().collect()
}
