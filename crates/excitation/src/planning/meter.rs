//! Measures, and charges for, what a quiet plan has to keep small.

use super::{InformationRequest, PlanningError, QuietBand, Quietness};
use crate::objective::Cost;
use crate::objective::disturbance::Disturbance;
use crate::objective::spectrum::Quiet;
use crate::plan::spline::{Duration, SplinePlan};
use crate::system::modal_response::driven_modes;
use crate::system::rigid::{RigidBase, RigidInformation};
use ff_model::{Model, Params};

/// What is measured.
pub(super) enum Meter {
    Modes(Box<Disturbance<RigidBase>>),
    Band { quiet: Quiet, emphasis: f64 },
}

impl Meter {
    pub(super) fn new(
        quietness: &Quietness,
        model: &Model,
        params: &Params<f64>,
        request: &InformationRequest,
        plan: &SplinePlan,
        source: &RigidInformation,
    ) -> Result<Self, PlanningError> {
        match quietness {
            Quietness::Band(band) => Ok(Self::Band { quiet: quiet(band, plan)?, emphasis: band.emphasis }),
            &Quietness::Modes { emphasis } => {
                if model.np() == 0 {
                    return Err(PlanningError::NoBaseModes("the model has no appendages".into()));
                }
                if let Some(a) = model.appendages().iter().find(|a| a.host != 0) {
                    let on = model.body_name(a.host);
                    return Err(PlanningError::NoBaseModes(format!("'{}' hangs on '{on}', not on the base", a.name)));
                }
                let usable = emphasis >= 0.0 && emphasis.is_finite();
                if !usable {
                    return Err(PlanningError::Emphasis(emphasis));
                }
                Ok(Self::Modes(Box::new(Disturbance {
                    response: source.robot().clone(),
                    modes: driven_modes(model, params, &request.start, &request.noise)?,
                    rate: request.noise.rate,
                    duration: request.duration,
                    emphasis,
                })))
            }
        }
    }
    /// `chi^2` or band energy of the trajectory `x`.
    pub(super) fn read(&self, plan: &SplinePlan, x: &[f64]) -> f64 {
        match self {
            Self::Modes(d) => d.chi_square(plan, x),
            Self::Band { quiet, .. } => quiet.value_gradient(plan, x, &mut vec![0.0; x.len()]),
        }
    }
    /// Weight and cost, given the reading of random plans.
    pub(super) fn term(&self, random: f64) -> (f64, Box<dyn Cost>) {
        match self {
            Self::Modes(d) => (1.0, d.clone()),
            Self::Band { quiet, emphasis } => {
                (if random > 0.0 { emphasis / random } else { 0.0 }, Box::new(quiet.clone()))
            }
        }
    }
}

fn quiet(band: &QuietBand, plan: &SplinePlan) -> Result<Quiet, PlanningError> {
    let &QuietBand { low, high, emphasis, .. } = band;
    let bad = |expected| Err(PlanningError::Band { low, high, emphasis, expected });
    let edges = low >= 0.0 && high > low && high.is_finite();
    if !edges {
        return bad("edges must be 0 <= low < high");
    }
    let usable = |x: f64| x >= 0.0 && x.is_finite();
    if !usable(emphasis) {
        return bad("the emphasis must be 0 or positive");
    }
    if band.weights.len() != plan.dof() || !band.weights.iter().all(|&w| usable(w)) {
        return bad("there must be one weight per joint, 0 or positive");
    }
    let (Duration::Fixed(t) | Duration::Free { max: t, .. }) = plan.spec().duration;
    // A spacing of 1/(4 T) resolves the spectrum; the bound keeps a senseless band affordable.
    let points = (4.0 * t * (high - low)).ceil().clamp(1.0, 5000.0) as usize;
    Ok(Quiet { low, high, points, weights: band.weights.clone() })
}
