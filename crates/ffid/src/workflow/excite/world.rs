//! Which of several plans is best where not everything is known exactly.
//!
//! The gradient of the information is that of the parameters to plan for, with everything else exact: columns of sensors and placements
//! have no adjoint. The plans it leads to, and those it started from, are compared by the criterion of the marginal covariance
//! ([`marginal_covariance`]), and the best of them is taken.

use super::goal::GoalCost;
use crate::open::Opened;
use crate::workflow::identify::UncertainItems;
use crate::workflow::preflight::{Question, Sensing, marginal_covariance};
use excitation::{Criterion, SplinePlan};
use ff_mission::mission::Limits;
use ff_model::Params;
use nalgebra::DMatrix;
use serde::Serialize;

/// The plan among its rivals, with what the mission is not sure of.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct InWorld {
    /// Quantities that the mission is not sure of.
    pub uncertain: usize,
    /// Plans that were compared.
    pub compared: usize,
    /// Cost of the plan that was taken, with these marginalised.
    pub cost: f64,
    /// Of the plan that would have been taken were everything exact: what the choice gains is the difference.
    pub cost_of_exact_choice: f64,
    /// Cost that the taken plan would have were everything exact.
    pub cost_if_exact: f64,
}

/// What plans are compared by.
pub(super) struct World<'a> {
    opened: &'a Opened,
    params: Params<f64>,
    limits: &'a Limits,
    sensing: Sensing,
    weak: f64,
    criterion: Criterion,
    sizes: Vec<f64>,
    items: UncertainItems,
}

impl<'a> World<'a> {
    /// Of a goal that is a criterion of the covariance, where the mission is not sure of something.
    pub(super) fn of(
        opened: &'a Opened,
        limits: &'a Limits,
        sensing: Sensing,
        weak: f64,
        goal: &GoalCost,
    ) -> Option<Self> {
        let (criterion, sizes) = goal.criterion.clone()?;
        let items = UncertainItems::beside(opened, &opened.excited);
        let params = Params::nominal(&opened.model);
        (items.count() > 0).then_some(Self { opened, params, limits, sensing, weak, criterion, sizes, items })
    }
    /// Number of quantities that the mission is not sure of.
    pub(super) fn uncertain(&self) -> usize {
        self.items.count()
    }
    /// The criterion of the plan `x`; infinite where a record of it does not determine all parameters, or cannot be simulated.
    pub(super) fn cost(&self, plan: &SplinePlan, x: &[f64]) -> f64 {
        let Ok(motion) = plan.motion(x) else { return f64::INFINITY };
        let question = Question {
            model: &self.opened.model,
            params: &self.params,
            selected: &self.opened.excited,
            motion: &motion,
            sensing: self.sensing,
            weak: self.weak,
            proven: None,
            limits: self.limits,
            constraints: &[],
            end_effector: None,
            uncertain: Some(&self.items),
            small: None,
        };
        let Ok(Some(c)) = marginal_covariance(&question) else { return f64::INFINITY };
        let scaled = DMatrix::from_fn(c.nrows(), c.ncols(), |i, j| c[(i, j)] / (self.sizes[i] * self.sizes[j]));
        self.criterion.value(&scaled).unwrap_or(f64::INFINITY)
    }
}
