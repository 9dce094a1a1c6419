//! Joint limits, and the proof that a spline keeps them for all time.
//!
//! A B-spline and each of its derivatives lie in the convex hull of their control points (Piegl and
//! Tiller, *The NURBS Book*, P3.3 and section 3.3), so limits on control points are sufficient for every
//! instant, not only for samples. Knot refinement draws the polygons onto the curves (their distance
//! falls with the square of the spacing), which makes the test nearly necessary as well.

use crate::plan::manoeuvre::Manoeuvre;
use ff_dynamics::motion::JointMotion;
use ff_dynamics::motion::bspline::{BSplineError, BSplineMotion};
use std::fmt;
use thiserror::Error;

/// Slack for rounding when a limit is tested, relative to the limit.
pub const ROUNDING: f64 = 1e-12;

/// What one joint may do.
///
/// ```
/// use excitation::JointLimits;
///
/// let joint = ff_model::tree::JointLimits { lower: -1.9, upper: 2.1, velocity: 0.5, effort: 30.0 };
/// let limits = JointLimits { jerk: Some(0.8), ..JointLimits::from_model(&joint, 0.15) };
/// assert_eq!((limits.upper, limits.acceleration), (2.1, 0.15));
/// assert!(JointLimits { lower: 2.2, ..limits }.check(4).is_err()); // names joint 4
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLimits {
    /// Lowest position (rad or m); may be `-inf`.
    pub lower: f64,
    /// Highest position (rad or m); may be `inf`.
    pub upper: f64,
    /// Greatest speed (rad/s or m/s); may be `inf`.
    pub velocity: f64,
    /// Greatest acceleration (rad/s^2 or m/s^2); may be `inf`.
    pub acceleration: f64,
    /// Greatest jerk (rad/s^3 or m/s^3), if limited.
    pub jerk: Option<f64>,
}

impl JointLimits {
    /// Position and speed limits of a joint of the model; the URDF has none for the acceleration
    /// (rad/s^2 or m/s^2), which must be given.
    pub fn from_model(joint: &ff_model::tree::JointLimits, acceleration: f64) -> Self {
        Self { lower: joint.lower, upper: joint.upper, velocity: joint.velocity, acceleration, jerk: None }
    }
    /// Refuses limits that no motion could keep or that are not numbers.
    ///
    /// # Errors
    /// [`LimitError::Limits`] naming `joint` and the quantity.
    pub fn check(&self, joint: usize) -> Result<(), LimitError> {
        let bad = |what, value| Err(LimitError::Limits { joint, what, value });
        if self.lower.is_nan() || self.upper.is_nan() || self.lower >= self.upper {
            return bad("range upper - lower", self.upper - self.lower);
        }
        for (what, x) in
            [("velocity", self.velocity), ("acceleration", self.acceleration), ("jerk", self.jerk.unwrap_or(1.0))]
        {
            if x.is_nan() || x <= 0.0 {
                return bad(what, x);
            }
        }
        Ok(())
    }
}

/// Which limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Quantity {
    /// Lower position limit.
    Lower,
    /// Upper position limit.
    Upper,
    /// Speed.
    Velocity,
    /// Acceleration.
    Acceleration,
    /// Jerk.
    Jerk,
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Lower => "lower position limit",
            Self::Upper => "upper position limit",
            Self::Velocity => "speed limit",
            Self::Acceleration => "acceleration limit",
            Self::Jerk => "jerk limit",
        })
    }
}

/// Why limits could not be tested.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum LimitError {
    /// Limits that make no sense.
    #[error("{what} of joint {joint} is {value}; it must be positive")]
    Limits {
        /// Joint index, from 0.
        joint: usize,
        /// Which limit.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// One limit set per joint is needed.
    #[error("{got} limit sets for {dof} joints")]
    Count {
        /// Limit sets given.
        got: usize,
        /// Number of joints.
        dof: usize,
    },
    /// A derivative that is limited does not exist for all time.
    #[error(transparent)]
    Spline(#[from] BSplineError),
}

/// How far one joint stays from one limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margin {
    /// Joint index, from 0.
    pub joint: usize,
    /// Which limit.
    pub quantity: Quantity,
    /// Bound, for all time, of the position or of the size of the rate.
    pub bound: f64,
    /// The limit.
    pub limit: f64,
    /// Distance left (SI units); negative when the limit may be broken.
    pub margin: f64,
    /// About when (s): Greville abscissa of the worst control point.
    pub time: f64,
}

/// Margins of every joint to every finite limit.
#[derive(Clone, Debug, PartialEq)]
pub struct LimitReport {
    /// Worst margin per joint and quantity, joint by joint.
    pub margins: Vec<Margin>,
    /// True when every limit holds for all time.
    pub holds: bool,
}

impl LimitReport {
    fn new(margins: Vec<Margin>) -> Self {
        let holds = margins.iter().all(|m| m.margin >= -ROUNDING * m.limit.abs().max(1e-3));
        Self { margins, holds }
    }
    /// The smallest margin relative to its limit (to 1 for a limit below 1e-3); `None` without finite limits.
    pub fn worst(&self) -> Option<&Margin> {
        let relative = |m: &Margin| m.margin / if m.limit.abs() > 1e-3 { m.limit.abs() } else { 1.0 };
        self.margins.iter().min_by(|a, b| relative(a).total_cmp(&relative(b)))
    }
}

/// Bounds position, speed, acceleration and jerk of a spline for all time and compares them with `limits`
/// (one per joint). Each knot span is first divided into `refine` parts (1: none); more parts, less
/// conservatism. Allocates.
///
/// # Errors
/// [`LimitError`] if limits are missing or senseless, or a limited derivative does not exist.
pub fn check_for_all_time(
    motion: &BSplineMotion,
    limits: &[JointLimits],
    refine: usize,
) -> Result<LimitReport, LimitError> {
    let n = motion.dof();
    check_limits(limits, n)?;
    let mut margins = Vec::new();
    let top = if limits.iter().any(|l| l.jerk.is_some()) { 3 } else { 2 };
    for order in 0..=top {
        if order >= 1 && limits.iter().all(|l| !rate_limit(l, order).1.is_finite()) {
            continue;
        }
        let (knots, control) = motion.derivative_control(order)?;
        let fine = knots.refine(refine.max(1));
        let (control, times) = (fine.apply(&control), fine.knots().greville());
        for joint in 0..n {
            let l = &limits[joint];
            let mut push = |quantity, limit: f64, sense: fn(f64) -> f64| {
                if !limit.is_finite() {
                    return;
                }
                let (mut at, mut worst) = (0, f64::NEG_INFINITY);
                for (i, p) in control.row(joint).iter().enumerate() {
                    if sense(*p) > worst {
                        (at, worst) = (i, sense(*p));
                    }
                }
                let lower = quantity == Quantity::Lower;
                let (bound, margin) = if lower { (-worst, -limit - worst) } else { (worst, limit - worst) };
                margins.push(Margin { joint, quantity, bound, limit, margin, time: times[at] });
            };
            if order == 0 {
                push(Quantity::Lower, l.lower, |p| -p);
                push(Quantity::Upper, l.upper, |p| p);
            } else {
                let (quantity, limit) = rate_limit(l, order);
                push(quantity, limit, f64::abs);
            }
        }
    }
    margins.sort_by_key(|m| m.joint);
    Ok(LimitReport::new(margins))
}

/// Compares the peaks of a manoeuvre, which are known in closed form, with `limits` (one per joint).
///
/// # Errors
/// [`LimitError`] if limits are missing or senseless.
pub fn check_manoeuvre(manoeuvre: &Manoeuvre, limits: &[JointLimits]) -> Result<LimitReport, LimitError> {
    check_limits(limits, manoeuvre.dof())?;
    let mut margins = Vec::new();
    for (joint, l) in limits.iter().enumerate() {
        let (lo, hi) = manoeuvre.excursion(joint);
        let m = manoeuvre.moves().iter().find(|m| m.joint == joint);
        let time = m.map_or(0.0, |m| m.start);
        let mut push = |quantity, limit: f64, bound: f64, margin: f64| {
            if limit.is_finite() {
                margins.push(Margin { joint, quantity, bound, limit, margin, time });
            }
        };
        push(Quantity::Lower, l.lower, lo, lo - l.lower);
        push(Quantity::Upper, l.upper, hi, l.upper - hi);
        if let Some(m) = m {
            push(Quantity::Velocity, l.velocity, m.velocity, l.velocity - m.velocity);
            push(Quantity::Acceleration, l.acceleration, m.acceleration, l.acceleration - m.acceleration);
            push(Quantity::Jerk, rate_limit(l, 3).1, m.jerk, rate_limit(l, 3).1 - m.jerk);
        }
    }
    Ok(LimitReport::new(margins))
}

/// The limit on derivative `order` in `1..=3`; infinite where there is none.
pub(crate) fn rate_limit(l: &JointLimits, order: usize) -> (Quantity, f64) {
    match order {
        1 => (Quantity::Velocity, l.velocity),
        2 => (Quantity::Acceleration, l.acceleration),
        _ => (Quantity::Jerk, l.jerk.unwrap_or(f64::INFINITY)),
    }
}

pub(crate) fn check_limits(limits: &[JointLimits], dof: usize) -> Result<(), LimitError> {
    if limits.len() != dof {
        return Err(LimitError::Count { got: limits.len(), dof });
    }
    limits.iter().enumerate().try_for_each(|(i, l)| l.check(i))
}
