//! What the world may do beside motion and model, of a size that can be estimated.
//!
//! A disturbance changes the tables of the prescribed arm in one direction, so that whatever simulates and differentiates with a
//! table does so with its disturbances, too:
//!
//! ```text
//! motion     q + s dq(t),  qd + s dqd(t),  qdd + s dqdd(t)
//! wrench     h.. - s F(t),  L. - s N(t)      in the balance of forces and torques of `crate::reduced::system`
//! ```

use super::numbers::ARM;
use crate::motion::joint::JointMotion;
use std::fmt;
use std::sync::Arc;

/// Where `h..` and `L.` are among the numbers of an arm.
const FORCE: usize = 13;
const TORQUE: usize = 25;

/// A force and a torque on the base at its origin, base axes (N, N m), at a time (s).
pub type BaseWrench = Arc<dyn Fn(f64) -> [f64; 6] + Send + Sync>;

/// A change of a prescribed motion, or of what pushes its base, per unit of a size.
#[derive(Clone)]
pub enum Disturbance {
    /// A change of the joint motion: consistent changes of positions, rates and accelerations, of as many joints.
    Motion(Arc<dyn JointMotion>),
    /// A wrench on the base.
    Wrench(BaseWrench),
}

impl fmt::Debug for Disturbance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Motion(_) => "Motion",
            Self::Wrench(_) => "Wrench",
        })
    }
}

/// Disturbances with their sizes.
///
/// ```
/// use ff_dynamics::reduced::{Disturbance, Disturbances};
/// use std::sync::Arc;
///
/// // A leaking thruster, of 2 mN at its measured place and direction.
/// let leak = Disturbance::Wrench(Arc::new(|_| [0.3, -0.2, 0.93, 0.11, 0.42, 0.05]));
/// let d = Disturbances::new(vec![leak], vec![2e-3]);
/// assert_eq!(d.sizes(), [2e-3]);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Disturbances {
    of: Vec<Disturbance>,
    sizes: Vec<f64>,
}

impl Disturbances {
    /// With one size for each, in units of what the disturbance is given per unit of.
    ///
    /// # Panics
    /// If there is not one size for each.
    pub fn new(of: Vec<Disturbance>, sizes: Vec<f64>) -> Self {
        assert_eq!(of.len(), sizes.len(), "a size for every disturbance");
        Self { of, sizes }
    }
    /// The disturbances.
    pub fn all(&self) -> &[Disturbance] {
        &self.of
    }
    /// Their sizes.
    pub fn sizes(&self) -> &[f64] {
        &self.sizes
    }
    /// Wrenches whose size is not zero.
    fn wrenches(&self) -> impl Iterator<Item = (&BaseWrench, f64)> {
        self.of.iter().zip(&self.sizes).filter_map(|(d, &s)| match d {
            Disturbance::Wrench(w) if s != 0.0 => Some((w, s)),
            _ => None,
        })
    }
    /// The wrenches into the numbers of the arm at nodes, whose times (s) `time` tells.
    pub(crate) fn push(&self, arm: &mut [f64], time: impl Fn(usize) -> f64) {
        for (wrench, size) in self.wrenches() {
            for (node, numbers) in arm.chunks_exact_mut(ARM).enumerate() {
                push(numbers, &wrench(time(node)), size);
            }
        }
    }
}

/// Adds a wrench of some size to the numbers of an arm.
pub(crate) fn push(numbers: &mut [f64], wrench: &[f64; 6], size: f64) {
    for i in 0..3 {
        numbers[FORCE + i] -= size * wrench[i];
        numbers[TORQUE + i] -= size * wrench[3 + i];
    }
}

/// A motion with its disturbances.
pub(crate) struct Disturbed<'a> {
    pub(crate) motion: &'a dyn JointMotion,
    pub(crate) by: &'a Disturbances,
}

impl JointMotion for Disturbed<'_> {
    fn dof(&self) -> usize {
        self.motion.dof()
    }
    fn duration(&self) -> f64 {
        self.motion.duration()
    }
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        self.motion.eval(t, q, qd, qdd);
        let n = self.dof();
        for (d, &size) in self.by.of.iter().zip(&self.by.sizes) {
            let Disturbance::Motion(d) = d else { continue };
            if size == 0.0 {
                continue;
            }
            let mut change = vec![0.0; 3 * n];
            let (dq, rest) = change.split_at_mut(n);
            let (dqd, dqdd) = rest.split_at_mut(n);
            d.eval(t, dq, dqd, dqdd);
            for (x, dx) in [(&mut *q, dq), (&mut *qd, dqd), (&mut *qdd, dqdd)] {
                x.iter_mut().zip(dx).for_each(|(x, dx)| *x += size * *dx);
            }
        }
    }
    fn breaks(&self) -> Vec<f64> {
        self.motion.breaks()
    }
}
