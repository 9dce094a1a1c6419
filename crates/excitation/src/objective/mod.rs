//! What makes a trajectory good: costs over the variables of a [`SplinePlan`], with exact gradients.
//!
//! Every cost is a function of samples of `(q, qd, qdd)`. With the basis on unit time `s = t/T`,
//! `q = N P`, `qd = N' P / T`, `qdd = N'' P / T^2`, so a gradient over the samples becomes one over the
//! control points by the transposed basis rows, and one over the duration by
//! `dJ/dT = -(J_qd . qd + 2 J_qdd . qdd) / T` plus the explicit part.
pub(crate) mod base;
pub(crate) mod criterion;
pub(crate) mod disturbance;
pub(crate) mod fisher;
pub(crate) mod information;
pub(crate) mod response;
pub(crate) mod spectrum;

pub use base::{BaseMotion, BasePartials, BaseResponse};
pub use criterion::{Criterion, RelativeQuantity, relative_deviations};
pub use disturbance::{Disturbance, DrivenMode};
pub use fisher::{FisherCost, Optimality};
pub use information::{Information, SampleInformation};
pub use response::{ModalResponse, ResponseTarget, Robust};
pub use spectrum::{Modal, Quiet, Target};

use crate::plan::spline::SplinePlan;
use ff_dynamics::motion::bspline::LOCAL;
use nalgebra::DMatrix;

/// A smooth function of the variables `x` of a plan, to be made small.
///
/// ```
/// # use excitation::{Duration, End, JointLimits, PlanSpec, SplinePlan, random_plan};
/// # let limits = JointLimits { lower: -1.5, upper: 1.7, velocity: 0.17, acceleration: 0.15, jerk: None };
/// # let (start, end, duration) = (vec![0.3, -0.2], End::Free, Duration::Fixed(30.0));
/// # let plan = SplinePlan::new(PlanSpec { start, end, duration, degree: 5, free: 8, limits: vec![limits; 2], refine: 1 })?;
/// use excitation::Cost;
///
/// /// Control points near zero: a lazy motion.
/// struct Lazy;
/// impl Cost for Lazy {
///     fn value_gradient(&self, _: &SplinePlan, x: &[f64], grad: &mut [f64]) -> f64 {
///         grad.iter_mut().zip(x).for_each(|(g, x)| *g = 2.0 * x);
///         x.iter().map(|x| x * x).sum()
///     }
/// }
/// let mut grad = vec![0.0; plan.variables()];
/// let x = random_plan(&plan, 1, 0, 0.9)?;
/// assert!(Lazy.value_gradient(&plan, &x, &mut grad) > 0.0 && grad[3] == 2.0 * x[3]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Cost: Send + Sync {
    /// Value at `x`; writes the gradient (length [`SplinePlan::variables`]) into `grad`. May return a
    /// non-finite value where the cost is not defined (no motion at all, for example); the gradient is
    /// then meaningless.
    ///
    /// # Panics
    /// If `x` or `grad` has the wrong length.
    fn value_gradient(&self, plan: &SplinePlan, x: &[f64], grad: &mut [f64]) -> f64;
}

/// Weighted sum of costs.
///
/// ```
/// # use excitation::{Duration, End, JointLimits, PlanSpec, SplinePlan, random_plan};
/// # let limits = JointLimits { lower: -1.5, upper: 1.7, velocity: 0.17, acceleration: 0.15, jerk: None };
/// # let (start, end, duration) = (vec![0.3, -0.2], End::Free, Duration::Fixed(30.0));
/// # let plan = SplinePlan::new(PlanSpec { start, end, duration, degree: 5, free: 8, limits: vec![limits; 2], refine: 1 })?;
/// use excitation::{Cost, CostSum};
/// # struct Lazy;
/// # impl Cost for Lazy {
/// #     fn value_gradient(&self, _: &SplinePlan, x: &[f64], grad: &mut [f64]) -> f64 {
/// #         grad.iter_mut().zip(x).for_each(|(g, x)| *g = 2.0 * x);
/// #         x.iter().map(|x| x * x).sum()
/// #     }
/// # }
///
/// let sum = CostSum(vec![(0.25, Box::new(Lazy)), (3.0, Box::new(Lazy))]);
/// let (mut one, mut all) = (vec![0.0; plan.variables()], vec![0.0; plan.variables()]);
/// let x = random_plan(&plan, 1, 0, 0.9)?;
/// let (value, total) = (Lazy.value_gradient(&plan, &x, &mut one), sum.value_gradient(&plan, &x, &mut all));
/// assert!((total - 3.25 * value).abs() < 1e-12 && (all[2] - 3.25 * one[2]).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Default)]
pub struct CostSum(
    /// Weights and terms.
    pub Vec<(f64, Box<dyn Cost>)>,
);

impl Cost for CostSum {
    fn value_gradient(&self, plan: &SplinePlan, x: &[f64], grad: &mut [f64]) -> f64 {
        grad.fill(0.0);
        let mut part = vec![0.0; grad.len()];
        let mut sum = 0.0;
        for (weight, cost) in &self.0 {
            sum += weight * cost.value_gradient(plan, x, &mut part);
            grad.iter_mut().zip(&part).for_each(|(g, p)| *g += weight * p);
        }
        sum
    }
}

/// How a gain `S > 0` that should be large becomes a cost that should be small.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// `1 / S`, as in the paper's eq. (10).
    Inverse,
    /// `-log S`: the same minima, but evenly scaled, which suits the optimiser.
    Log,
}

impl Form {
    /// Cost and its derivative with respect to `S`; infinite when `S` is not positive.
    pub(crate) fn apply(self, s: f64) -> (f64, f64) {
        let positive = s > 0.0;
        match self {
            _ if !positive => (f64::INFINITY, 0.0),
            Self::Inverse => (1.0 / s, -1.0 / (s * s)),
            Self::Log => (-s.ln(), -1.0 / s),
        }
    }
}

/// A sample on unit time.
pub(crate) struct Node {
    pub(crate) s: f64,
    /// Quadrature weight on unit time: `dt = weight T`.
    pub(crate) weight: f64,
    first: usize,
    basis: [[f64; LOCAL]; 3],
}

/// `count >= 2` equally spaced samples, ends included, with trapezoidal weights.
pub(crate) fn uniform_nodes(plan: &SplinePlan, count: usize) -> Vec<Node> {
    let last = count.max(2) - 1;
    (0..=last)
        .map(|i| {
            let s = i as f64 / last as f64;
            let (first, basis) = plan.unit_knots().local::<3>(s);
            let weight = if i == 0 || i == last { 0.5 } else { 1.0 } / last as f64;
            Node { s, weight, first, basis }
        })
        .collect()
}

/// Eight-point Gauss-Legendre rule on each of `parts` parts of every knot span (Abramowitz and Stegun,
/// *Handbook of Mathematical Functions*, table 25.4): spans are polynomials, so this is exact but for the
/// exponential that multiplies them.
pub(crate) fn gauss_nodes(plan: &SplinePlan, parts: usize) -> Vec<Node> {
    const X: [f64; 4] =
        [0.183_434_642_495_649_8, 0.525_532_409_916_329, 0.796_666_477_413_626_7, 0.960_289_856_497_536_3];
    const W: [f64; 4] =
        [0.362_683_783_378_362, 0.313_706_645_877_887_3, 0.222_381_034_453_374_5, 0.101_228_536_290_376_3];
    let breaks = plan.unit_knots().breaks();
    let mut out = Vec::with_capacity(8 * parts * breaks.len());
    for span in breaks.windows(2) {
        let half = 0.5 * (span[1] - span[0]) / parts as f64;
        for part in 0..parts {
            let middle = span[0] + half * (2 * part + 1) as f64;
            for i in 0..8 {
                let x = if i < 4 { -X[3 - i] } else { X[i - 4] };
                let s = middle + half * x;
                let (first, basis) = plan.unit_knots().local::<3>(s);
                out.push(Node { s, weight: half * W[if i < 4 { 3 - i } else { i - 4 }], first, basis });
            }
        }
    }
    out
}

/// One sample of the motion.
pub(crate) struct State {
    pub(crate) q: Vec<f64>,
    pub(crate) qd: Vec<f64>,
    pub(crate) qdd: Vec<f64>,
}

/// Gradient of a scalar with respect to one sample, and its explicit part in the duration.
pub(crate) struct Adjoint {
    pub(crate) q: Vec<f64>,
    pub(crate) qd: Vec<f64>,
    pub(crate) qdd: Vec<f64>,
    pub(crate) duration: f64,
}

/// Evaluates samples of the trajectory `x` and gathers gradients over them.
pub(crate) struct Sweep<'a> {
    plan: &'a SplinePlan,
    control: DMatrix<f64>,
    pub(crate) duration: f64,
    state: State,
}

impl<'a> Sweep<'a> {
    pub(crate) fn new(plan: &'a SplinePlan, x: &[f64]) -> Self {
        assert_eq!(x.len(), plan.variables(), "length of x");
        let z = || vec![0.0; plan.dof()];
        let state = State { q: z(), qd: z(), qdd: z() };
        Self { plan, control: plan.control(x), duration: plan.duration(x), state }
    }
    fn load(&mut self, node: &Node) {
        let (t, p) = (self.duration, self.plan.unit_knots().degree());
        for j in 0..self.plan.dof() {
            // Relative to one point: where nothing moves, rates are exactly zero (weights of rates sum to 0).
            let origin = self.control[(j, node.first)];
            let mut y = [0.0; 3];
            for i in 0..=p {
                let c = self.control[(j, node.first + i)] - origin;
                for (o, b) in y.iter_mut().zip(&node.basis) {
                    *o += b[i] * c;
                }
            }
            y[0] += origin;
            (self.state.q[j], self.state.qd[j], self.state.qdd[j]) = (y[0], y[1] / t, y[2] / (t * t));
        }
    }
    /// Calls `f` with every sample.
    pub(crate) fn forward(&mut self, nodes: &[Node], mut f: impl FnMut(&Node, &State)) {
        for node in nodes {
            self.load(node);
            f(node, &self.state);
        }
    }
    /// Calls `f` with every sample to fill its adjoint (given as zeros); writes the gradient over `x`.
    pub(crate) fn backward(
        &mut self,
        nodes: &[Node],
        grad: &mut [f64],
        mut f: impl FnMut(&Node, &State, &mut Adjoint),
    ) {
        let (t, p, n) = (self.duration, self.plan.unit_knots().degree(), self.plan.dof());
        let mut over_control = DMatrix::zeros(n, self.plan.unit_knots().count());
        let mut over_duration = 0.0;
        let z = || vec![0.0; n];
        let mut a = Adjoint { q: z(), qd: z(), qdd: z(), duration: 0.0 };
        for node in nodes {
            self.load(node);
            a.q.fill(0.0);
            a.qd.fill(0.0);
            a.qdd.fill(0.0);
            a.duration = 0.0;
            f(node, &self.state, &mut a);
            over_duration += a.duration;
            let [b0, b1, b2] = &node.basis;
            for j in 0..n {
                over_duration -= (a.qd[j] * self.state.qd[j] + 2.0 * a.qdd[j] * self.state.qdd[j]) / t;
                let (g0, g1, g2) = (a.q[j], a.qd[j] / t, a.qdd[j] / (t * t));
                for i in 0..=p {
                    over_control[(j, node.first + i)] += g0 * b0[i] + g1 * b1[i] + g2 * b2[i];
                }
            }
        }
        grad.fill(0.0);
        self.plan.pull_back(&over_control, grad);
        if let Some(i) = self.plan.duration_index() {
            grad[i] = over_duration;
        }
    }
}
