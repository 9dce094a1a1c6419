//! The costs behind the goals of `[excite]`.

use super::ExciteError;
use crate::excitation::cost::Form;
use crate::excitation::{
    Cost, CostSum, Disturbance, Duration, Information, Modal, RigidInformation, SensorNoise, SplinePlan, driven_modes,
    modal_targets,
};
use crate::exit::Exit;
use crate::model::mission::{Excite, Goal};
use crate::model::{Model, Params};
use crate::preflight::Sensing;

/// Quadrature samples per knot span, and the fewest per second.
const PER_SPAN: usize = 8;
const PER_SECOND: f64 = 2.0;
/// Prior information on scaled parameters: far too little to matter, but it keeps the determinant positive.
const PRIOR: f64 = 1e-4;

/// What a goal is computed from.
pub struct Asked<'a> {
    /// The robot.
    pub model: &'a Model,
    /// Its parameters.
    pub params: &'a Params<f64>,
    /// Parameters to plan for.
    pub selected: &'a [usize],
    /// The section.
    pub settings: &'a Excite,
    /// The sensors.
    pub sensing: &'a Sensing,
    /// Pose at the start.
    pub start: &'a [f64],
}

/// A cost and what it means.
pub struct GoalCost {
    /// The cost.
    pub cost: Box<dyn Cost>,
    /// Its meaning, in words.
    pub means: &'static str,
    /// What was taken otherwise than asked.
    pub notes: Vec<String>,
}

impl Asked<'_> {
    fn noise(&self) -> SensorNoise {
        let s = self.sensing;
        SensorNoise { torque: s.torque_nm, gyro: Some(s.gyro_rad_per_s), rate: s.rate_hz }
    }
    fn wrong(&self, what: impl ToString, hint: &str) -> ExciteError {
        ExciteError::new(Exit::Config, "Config::Excite", what.to_string(), hint).on("excite.goal")
    }
    /// Information about the base parameters, appendages frozen.
    fn base_information(
        &self,
        plan: &SplinePlan,
        notes: &mut Vec<String>,
    ) -> Result<Information<RigidInformation>, ExciteError> {
        let mut base: Vec<usize> = self.selected.iter().copied().filter(|&i| i < 10).collect();
        if base.is_empty() {
            base = (0..10).collect();
            notes.push("no parameter of the base is named: planned for all ten".into());
        } else if base.len() < self.selected.len() {
            notes.push(
                "planned for the parameters of the base, appendages frozen; the verdict covers all that are named"
                    .into(),
            );
        }
        let source = RigidInformation::new(self.model, self.params, &base, self.noise())
            .map_err(|e| self.wrong(e, "see [sensors] and the parameters of [excite]"))?;
        let (Duration::Fixed(t) | Duration::Free { max: t, .. }) = plan.spec().duration;
        let by_time = (PER_SECOND * t).ceil().min(10_000.0) as usize;
        let samples = by_time.max(PER_SPAN * (plan.spec().free + 1)) + 1;
        Ok(Information { source, samples, rate: self.sensing.rate_hz, delta: PRIOR })
    }
}

/// The cost of a goal.
///
/// # Errors
/// [`ExciteError`] when the goal does not fit the robot.
pub fn cost(asked: &Asked<'_>, plan: &SplinePlan) -> Result<GoalCost, ExciteError> {
    let mut notes = Vec::new();
    let (model, params) = (asked.model, asked.params);
    match asked.settings.goal {
        Goal::Information => {
            let information = asked.base_information(plan, &mut notes)?;
            Ok(GoalCost {
                cost: Box::new(information),
                means: "-log det of the information on scaled parameters",
                notes,
            })
        }
        Goal::Quiet => {
            let hint = "quiet plans need appendages on the base; choose goal = \"information\"";
            if model.np() == 0 {
                return Err(asked.wrong("the model has no appendages that could be kept quiet", hint));
            }
            if let Some(a) = model.appendages().iter().find(|a| a.host != 0 && a.dim() > 0) {
                let what = format!("'{}' hangs on '{}', not on the base", a.name, model.body_name(a.host));
                return Err(asked.wrong(what, hint));
            }
            let information = asked.base_information(plan, &mut notes)?;
            let (Duration::Fixed(duration) | Duration::Free { max: duration, .. }) = plan.spec().duration;
            let disturbance = Disturbance {
                response: information.source.robot().clone(),
                modes: driven_modes(model, params, asked.start, &asked.noise()).map_err(|e| asked.wrong(e, hint))?,
                rate: asked.sensing.rate_hz,
                duration,
                emphasis: asked.settings.emphasis,
            };
            let terms: Vec<(f64, Box<dyn Cost>)> = vec![(1.0, Box::new(information)), (1.0, Box::new(disturbance))];
            let means =
                "-log det of the information, plus emphasis times ln(1 + chi^2) of the modes' effect on the sensors";
            Ok(GoalCost { cost: Box::new(CostSum(terms)), means, notes })
        }
        Goal::Modal => {
            let hint = "modal plans need appendages; choose goal = \"information\"";
            let targets = modal_targets(model, params, asked.start).map_err(|e| asked.wrong(e, hint))?;
            if targets.is_empty() {
                return Err(asked.wrong("the model has no modes", hint));
            }
            Ok(GoalCost {
                cost: Box::new(Modal { targets, form: Form::Log }),
                means: "-sum of log |left swinging|^2 over the modes",
                notes,
            })
        }
        Goal::Condition | Goal::Paper => Err(asked.wrong("this goal is not optimised", "choose another goal")),
    }
}
