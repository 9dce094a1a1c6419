//! The costs behind the goals of `[excite]`.

use super::error::ExciteError;
use crate::exit::Exit;
use crate::workflow::preflight::Sensing;
use excitation::objective::{
    Disturbance, FisherCost, Information, ModalResponse, Optimality as RigidCriterion, ResponseTarget, Robust,
};
use excitation::planning::named_quantities;
use excitation::system::driven_modes;
use excitation::system::flexible::{Estimated, FlexibleRequest, Nuisance};
use excitation::system::rigid::RigidBase;
use excitation::{Cost, CostSum, Criterion, Duration, FlexibleInformation, RigidInformation, SensorNoise, SplinePlan};
use ff_dynamics::{Boundary, modes};
use ff_mission::mission::{Excite, Goal, Optimality};
use ff_model::{Model, Params};

/// Quadrature samples per knot span, and the fewest per second.
const PER_SPAN: usize = 8;
const PER_SECOND: f64 = 2.0;
/// Prior information on scaled parameters: far too little to matter, but it keeps the determinant positive.
const PRIOR: f64 = 1e-4;
/// Sharpness of smoothed maxima.
const POWER: f64 = 8.0;
/// What is known beforehand of biases and initial states: next to nothing (rad/s, N m, rad or m, and per second).
const UNKNOWN: Nuisance = Nuisance {
    gyro_bias: Some(1e-2),
    torque_bias: Some(1.0),
    accel_bias: None,
    deflection: Some(0.1),
    rate: Some(0.1),
};
/// Integration steps per radian of the fastest mode, and the longest step (s).
const PER_RADIAN: f64 = 4.0;
const LONGEST_STEP: f64 = 0.1;
/// Modes that a modal plan drives unless the mission names some.
const DRIVEN: usize = 2;
/// Frequencies looked at within the error of each mode.
const FAN: usize = 5;

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
    /// What the cost makes of the covariance of the selected parameters, with the size of each of them, where that is what it is.
    pub criterion: Option<(Criterion, Vec<f64>)>,
    /// A cheap problem whose plans are good starts, when there is one.
    pub warm: Option<Box<dyn Cost>>,
}

impl GoalCost {
    /// Value of the cost at the plan `x`.
    pub fn value(&self, plan: &SplinePlan, x: &[f64]) -> f64 {
        self.cost.value_gradient(plan, x, &mut vec![0.0; x.len()])
    }
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
            notes.push("planned for the parameters of the base; the verdict covers all that are named".into());
        }
        let source = RigidInformation::new(self.model, self.params, &base, self.noise())
            .map_err(|e| self.wrong(e, "see [sensors] and the parameters of [excite]"))?;
        let (Duration::Fixed(t) | Duration::Free { max: t, .. }) = plan.spec().duration;
        let by_time = (PER_SECOND * t).ceil().min(10_000.0) as usize;
        let samples = by_time.max(PER_SPAN * (plan.spec().free + 1)) + 1;
        Ok(Information { source, samples, rate: self.sensing.rate_hz, delta: PRIOR })
    }
    /// What a record of the real system tells about the named parameters, everything else that is unknown beside them.
    fn flexible(&self) -> Result<FlexibleInformation, ExciteError> {
        let (model, params) = (self.model, self.params);
        let hint = "see [sensors] and the parameters of [excite]";
        let rest = model.rest_position(params);
        let found = modes(model, params, self.start, &rest, Boundary::JointsHeld).map_err(|e| self.wrong(e, hint))?;
        let fastest = found.iter().map(|m| std::f64::consts::TAU * m.frequency_hz).fold(0.0, f64::max);
        let request = FlexibleRequest {
            named: self.selected.iter().map(|&index| Estimated { index, prior: None }).collect(),
            others: Vec::new(),
            noise: self.noise(),
            accelerometer: None,
            nuisance: UNKNOWN,
            step: LONGEST_STEP.min(1.0 / (PER_RADIAN * fastest)),
        };
        FlexibleInformation::new(model, params, &request).map_err(|e| self.wrong(e, hint))
    }
    fn criterion(&self, information: &FlexibleInformation) -> (Criterion, &'static str) {
        match self.settings.optimality {
            Optimality::D => (Criterion::D, "log det of the covariance of the scaled parameters"),
            Optimality::A => (Criterion::A, "log of the mean variance of the scaled parameters"),
            Optimality::E => (Criterion::E { power: POWER }, "log of the largest variance of any scaled combination"),
            Optimality::Largest => {
                let quantities = named_quantities(information);
                (Criterion::Largest { quantities, power: POWER }, "log of the largest relative standard deviation")
            }
        }
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
            if asked.selected.is_empty() {
                return Err(asked.wrong("no parameters are named", "name them in [excite] or [estimate]"));
            }
            let warm = asked.base_information(plan, &mut Vec::new())?;
            let information = asked.flexible()?;
            let (criterion, means) = asked.criterion(&information);
            let sizes = information.sizes()[..information.named()].to_vec();
            let of_covariance = Some((criterion.clone(), sizes));
            let cost = Box::new(FisherCost { information, criterion });
            Ok(GoalCost { cost, means, notes, criterion: of_covariance, warm: Some(Box::new(warm)) })
        }
        Goal::Condition => {
            let information = asked.base_information(plan, &mut notes)?;
            let cost = Box::new(RigidCriterion { information, criterion: Criterion::Condition { power: POWER } });
            let means = "log of the condition number of the regressor of the base parameters";
            Ok(GoalCost { cost, means, notes, criterion: None, warm: None })
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
            Ok(GoalCost { cost: Box::new(CostSum(terms)), means, notes, criterion: None, warm: None })
        }
        Goal::Modal => {
            let hint = "modal plans need appendages on a free base; choose goal = \"information\"";
            let response = RigidBase::new(model, params).map_err(|e| asked.wrong(e, hint))?;
            let found = driven_modes(model, params, asked.start, &asked.noise());
            let mut driven = found.map_err(|e| asked.wrong(e, hint))?;
            if driven.is_empty() {
                return Err(asked.wrong("the model has no modes", hint));
            }
            if asked.settings.modes_hz.is_empty() {
                driven.truncate(DRIVEN);
            } else {
                let nearest = |f: &f64| {
                    let off = |m: &excitation::objective::DrivenMode| (m.frequency - f).abs();
                    driven.iter().min_by(|a, b| off(a).total_cmp(&off(b))).copied()
                };
                driven = asked.settings.modes_hz.iter().filter_map(nearest).collect();
            }
            let hz: Vec<String> = driven.iter().map(|m| format!("{:.4}", m.frequency)).collect();
            notes.push(format!("drives the modes at {} Hz", hz.join(", ")));
            let target = |mode| ResponseTarget { mode, spread: asked.settings.frequency_error, importance: 1.0 };
            let targets = driven.into_iter().map(target).collect();
            let cost = Box::new(ModalResponse { response, targets, fan: FAN, robust: Robust::Worst { power: 4.0 } });
            let means = "-log of the least squared rate amplitude within the frequency error, summed over the modes";
            Ok(GoalCost { cost, means, notes, criterion: None, warm: None })
        }
        Goal::Paper => Err(asked.wrong("this goal is not optimised", "choose another goal")),
    }
}
