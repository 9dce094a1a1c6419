//! A function as joint motion.

use crate::motion::joint::{JointMotion, MotionError, at_rest, check_time, is_outside};

/// Joint motion from a function `f(t, q, qd, qdd)` that writes positions (rad or m), rates (rad/s or m/s) and accelerations
/// (rad/s^2 or m/s^2) of all joints at time `t` (s).
///
/// The function is called with `0 <= t <= duration` and slices that are as long as there are joints. Rates and accelerations
/// must be the derivatives of the positions: the dynamics takes all three as they are, and a rate that does not belong to the
/// positions shows as momentum that is not conserved. [`crate::motion::HermiteTable`] and the B-splines keep them consistent by
/// construction.
///
/// ```
/// use ff_dynamics::motion::{FnMotion, JointMotion};
///
/// // One joint swings by 0.3 rad at 0.5 rad/s.
/// let motion = FnMotion::new(1, 20.0, |t, q, qd, qdd| {
///     let (sin, cos) = (0.5 * t).sin_cos();
///     (q[0], qd[0], qdd[0]) = (0.3 * sin, 0.15 * cos, -0.075 * sin);
/// })?;
/// let (mut q, mut qd, mut qdd) = ([0.0], [0.0], [0.0]);
/// motion.eval(1.3, &mut q, &mut qd, &mut qdd);
/// assert_eq!(q[0], 0.3 * 0.65_f64.sin());
/// # Ok::<(), ff_dynamics::motion::MotionError>(())
/// ```
#[derive(Clone)]
pub struct FnMotion<F> {
    joints: usize,
    duration: f64,
    breaks: Vec<f64>,
    f: F,
}

impl<F: Fn(f64, &mut [f64], &mut [f64], &mut [f64]) + Send + Sync> FnMotion<F> {
    /// Motion of `joints` joints over `duration` (s), which may be zero. Calls `f` at both ends. Allocates.
    ///
    /// # Errors
    /// [`MotionError`] if there is no joint, the duration is negative or not finite, or `f` leaves a number that is not finite
    /// at the start (`index` 0) or at the end (`index` 1). A number that `f` does not write counts as not finite.
    pub fn new(joints: usize, duration: f64, f: F) -> Result<Self, MotionError> {
        if joints == 0 {
            return Err(MotionError::Empty("joint"));
        }
        check_time("duration", duration, false)?;
        for (index, t) in [0.0, duration].into_iter().enumerate() {
            let (mut q, mut qd, mut qdd) = (vec![f64::NAN; joints], vec![f64::NAN; joints], vec![f64::NAN; joints]);
            f(t, &mut q, &mut qd, &mut qdd);
            for (what, x) in [("position", &q), ("rate", &qd), ("acceleration", &qdd)] {
                if let Some(joint) = x.iter().position(|x| !x.is_finite()) {
                    return Err(MotionError::NotFinite { what, joint, index, value: x[joint] });
                }
            }
        }
        Ok(Self { joints, duration, breaks: Vec::new(), f })
    }
    /// With the times (s) at which the acceleration or one of its derivatives jumps ([`JointMotion::breaks`]); sorted here.
    ///
    /// # Errors
    /// [`MotionError::BadTime`] for a time that is negative or not finite.
    pub fn with_breaks(mut self, mut breaks: Vec<f64>) -> Result<Self, MotionError> {
        breaks.iter().try_for_each(|&t| check_time("break", t, false))?;
        breaks.sort_by(f64::total_cmp);
        self.breaks = breaks;
        Ok(self)
    }
}

impl<F> std::fmt::Debug for FnMotion<F> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FnMotion")
            .field("joints", &self.joints)
            .field("duration", &self.duration)
            .finish_non_exhaustive()
    }
}

impl<F: Fn(f64, &mut [f64], &mut [f64], &mut [f64]) + Send + Sync> JointMotion for FnMotion<F> {
    fn dof(&self) -> usize {
        self.joints
    }
    fn duration(&self) -> f64 {
        self.duration
    }
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        let n = self.joints;
        (self.f)(t.clamp(0.0, self.duration), &mut q[..n], &mut qd[..n], &mut qdd[..n]);
        if is_outside(t, self.duration) {
            at_rest(n, qd, qdd);
        }
    }
    fn breaks(&self) -> Vec<f64> {
        self.breaks.clone()
    }
}
