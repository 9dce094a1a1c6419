//! Drive the hinges through the base: the paper's eq. (10), corrected.
//!
//! Printed, `Gamma = (sum_j omegad_b,j || beta_p)^-1` is signed: over a rest-to-rest motion at zero momentum
//! the sum vanishes, so `Gamma` is singular (`theory.md` 5.7). Here
//! `Gamma = [sum_r int (c_r . a_b)^2 dt]^-1` with the base acceleration `a_b = [linear; angular]` of the rigid
//! free-floating robot. `c = [0; e]` is the paper's component about the hinge axis `e`; a linear part
//! reaches the symmetric modes that rotation cannot drive (eq. (8), `theory.md` 5.6).

use super::{Cost, Form, Sweep, uniform_nodes};
use crate::plan::spline::SplinePlan;
use nalgebra::{Matrix6xX, Vector6};

/// Partial derivatives of the base acceleration, `6 x n` each.
#[derive(Clone, Debug, PartialEq)]
pub struct BasePartials {
    /// With respect to `q`.
    pub q: Matrix6xX<f64>,
    /// With respect to `qd` (the base twist that follows from `qd` by conserved momentum included).
    pub qd: Matrix6xX<f64>,
    /// With respect to `qdd`.
    pub qdd: Matrix6xX<f64>,
}

impl BasePartials {
    /// Zeros for `n` joints. Allocates.
    pub fn new(n: usize) -> Self {
        Self { q: Matrix6xX::zeros(n), qd: Matrix6xX::zeros(n), qdd: Matrix6xX::zeros(n) }
    }
}

/// Base acceleration of a free-floating robot at zero momentum, given its joint motion.
pub trait BaseResponse: Send + Sync {
    /// Number of joints `n`.
    fn dof(&self) -> usize;
    /// Base acceleration `[linear; angular]` in base axes (m/s^2, rad/s^2).
    fn base_acceleration(&self, q: &[f64], qd: &[f64], qdd: &[f64], out: &mut [f64; 6]);
    /// The same, with its partial derivatives.
    fn partials(&self, q: &[f64], qd: &[f64], qdd: &[f64], out: &mut [f64; 6], partials: &mut BasePartials);
}

impl<B: BaseResponse + ?Sized> BaseResponse for &B {
    fn dof(&self) -> usize {
        (**self).dof()
    }
    fn base_acceleration(&self, q: &[f64], qd: &[f64], qdd: &[f64], out: &mut [f64; 6]) {
        (**self).base_acceleration(q, qd, qdd, out);
    }
    fn partials(&self, q: &[f64], qd: &[f64], qdd: &[f64], out: &mut [f64; 6], partials: &mut BasePartials) {
        (**self).partials(q, qd, qdd, out, partials);
    }
}

/// `1/S` or `-log S` of `S = sum_r int (c_r . a_b)^2 dt`, by the trapezoidal rule. `value_gradient` panics if
/// the robot and the plan differ in their number of joints.
pub struct BaseMotion<B> {
    /// The robot.
    pub response: B,
    /// Directions `c_r = [linear; angular]`, base axes. `S` has the unit of `(c . a)^2 s`.
    pub directions: Vec<Vector6<f64>>,
    /// Number of samples ("preselected points" of the paper), at least 2.
    pub samples: usize,
    /// Inverse (the paper) or logarithm.
    pub form: Form,
}

impl<B: BaseResponse> Cost for BaseMotion<B> {
    fn value_gradient(&self, plan: &SplinePlan, x: &[f64], grad: &mut [f64]) -> f64 {
        assert_eq!(self.response.dof(), plan.dof(), "joints of robot and plan");
        let nodes = uniform_nodes(plan, self.samples);
        let mut sweep = Sweep::new(plan, x);
        let duration = sweep.duration;
        let mut partials = BasePartials::new(plan.dof());
        let mut sum = 0.0;
        sweep.backward(&nodes, grad, |node, s, adj| {
            let mut a = [0.0; 6];
            self.response.partials(&s.q, &s.qd, &s.qdd, &mut a, &mut partials);
            let a = Vector6::from(a);
            let mut da = Vector6::zeros();
            for c in &self.directions {
                let y = c.dot(&a);
                sum += node.weight * duration * y * y;
                adj.duration += node.weight * y * y;
                da += c * (2.0 * y * node.weight * duration);
            }
            for (out, m) in [(&mut adj.q, &partials.q), (&mut adj.qd, &partials.qd), (&mut adj.qdd, &partials.qdd)] {
                for (o, column) in out.iter_mut().zip(m.column_iter()) {
                    *o += column.dot(&da);
                }
            }
        });
        let (value, slope) = self.form.apply(sum);
        grad.iter_mut().for_each(|g| *g *= slope);
        value
    }
}
