//! Information as a cost: of the real system ([`FisherCost`]) and of anything that gives rows per sample
//! ([`Optimality`]), under any [`Criterion`].

use super::Cost;
use super::criterion::Criterion;
use super::information::{Information, SampleInformation};
use crate::plan::spline::SplinePlan;
use crate::system::flexible::FlexibleInformation;

/// A criterion of the Fisher information of the flexible system (goal (c) of the planning). NaN where the system cannot
/// be integrated or the information is not positive definite.
#[derive(Clone, Debug)]
pub struct FisherCost {
    /// What the record tells.
    pub information: FlexibleInformation,
    /// What is made small.
    pub criterion: Criterion,
}

impl Cost for FisherCost {
    fn value_gradient(&self, plan: &SplinePlan, x: &[f64], grad: &mut [f64]) -> f64 {
        let named = self.information.named();
        self.information.value_gradient(plan, x, grad, |f| self.criterion.value_slope(f, named))
    }
}

/// A criterion of an information that is a sum over samples, such as that of the rigid model: with
/// [`Criterion::Condition`] the condition number of the base-parameter regressor. NaN as [`FisherCost`].
#[derive(Clone, Debug)]
pub struct Optimality<S> {
    /// What the record tells.
    pub information: Information<S>,
    /// What is made small.
    pub criterion: Criterion,
}

impl<S: SampleInformation> Cost for Optimality<S> {
    fn value_gradient(&self, plan: &SplinePlan, x: &[f64], grad: &mut [f64]) -> f64 {
        let named = self.information.source.parameters();
        self.information.value_gradient_of(plan, x, grad, |f| self.criterion.value_slope(f, named))
    }
}
