//! Rest-to-rest B-spline trajectories as decision variables with linear limits.
//!
//! `theory.md` 3 (reference 14 of the paper): clamped knots and three equal control points at each end
//! give zero velocity and acceleration there (`P'_0 = P'_1 = 0`). The basis lives on unit time
//! `s = t / T`, so the maps from control points to derivative polygons are constant and the limits read
//! `|M_r P| <= L_r T^r` with `L_r` the limit on derivative `r`.

use crate::plan::error::{PlanError, PlanLimit};
use crate::plan::limits::{JointLimits, Quantity, check_limits, rate_limit};
use ff_dynamics::motion::bspline::{BSplineMotion, Knots};
use nalgebra::DMatrix;

/// Control points that are equal at each end.
pub const REPEAT: usize = 3;

/// Where a plan ends.
///
/// ```
/// # use excitation::{Duration, End, JointLimits, PlanSpec, SplinePlan, random_plan};
/// # let limits = JointLimits { lower: -1.5, upper: 1.7, velocity: 0.17, acceleration: 0.15, jerk: None };
/// # let (start, end, duration) = (vec![0.3, -0.2], End::Free, Duration::Fixed(30.0));
/// # let plan = SplinePlan::new(PlanSpec { start, end, duration, degree: 5, free: 8, limits: vec![limits; 2], refine: 1 })?;
///
/// // An end that is given leaves fewer decision variables: one per joint.
/// let spec = PlanSpec { end: End::Fixed(vec![-0.1, 0.5]), ..plan.spec().clone() };
/// let fixed = SplinePlan::new(spec)?;
/// assert_eq!(plan.variables() - fixed.variables(), 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum End {
    /// At a given configuration (rad or m).
    Fixed(Vec<f64>),
    /// Anywhere: the end configuration is a decision variable.
    Free,
}

/// How long a plan takes.
///
/// ```
/// # use excitation::{Duration, End, JointLimits, PlanSpec, SplinePlan, random_plan};
/// # let limits = JointLimits { lower: -1.5, upper: 1.7, velocity: 0.17, acceleration: 0.15, jerk: None };
/// # let (start, end, duration) = (vec![0.3, -0.2], End::Free, Duration::Fixed(30.0));
/// # let plan = SplinePlan::new(PlanSpec { start, end, duration, degree: 5, free: 8, limits: vec![limits; 2], refine: 1 })?;
///
/// let spec = PlanSpec { duration: Duration::Free { min: 20.0, max: 45.0 }, ..plan.spec().clone() };
/// let free = SplinePlan::new(spec)?;
/// let x = random_plan(&free, 1, 0, 0.9)?;
/// assert_eq!((free.duration_index(), plan.duration_index()), (Some(free.variables() - 1), None));
/// assert!((20.0..=45.0).contains(&free.duration(&x)) && free.longest() == 45.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Duration {
    /// Given (s).
    Fixed(f64),
    /// A decision variable between two bounds (s).
    Free {
        /// Shortest.
        min: f64,
        /// Longest.
        max: f64,
    },
}

/// What to plan.
///
/// ```
/// use excitation::{Duration, End, JointLimits, PlanSpec, SplinePlan};
///
/// let limits = JointLimits { lower: -1.5, upper: 1.7, velocity: 0.17, acceleration: 0.15, jerk: None };
/// let spec = PlanSpec {
///     start: vec![0.3, -0.2],
///     end: End::Free,
///     duration: Duration::Fixed(30.0),
///     degree: 5,
///     free: 8,
///     limits: vec![limits; 2],
///     refine: 1,
/// };
/// assert_eq!(SplinePlan::new(spec.clone())?.variables(), 2 * (8 + 1));
/// // A start outside its limits is refused at once.
/// assert!(SplinePlan::new(PlanSpec { start: vec![0.3, -1.6], ..spec }).is_err());
/// # Ok::<(), excitation::plan::PlanError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct PlanSpec {
    /// Start configuration, one entry per joint (rad or m).
    pub start: Vec<f64>,
    /// End configuration.
    pub end: End,
    /// Duration.
    pub duration: Duration,
    /// Degree `p`; 5 unless there is a reason.
    pub degree: usize,
    /// Control points that are free, per joint.
    pub free: usize,
    /// Limits, one set per joint.
    pub limits: Vec<JointLimits>,
    /// Parts into which each knot span is divided for the limits (1: none). More parts allow faster
    /// motion at the price of more constraints.
    pub refine: usize,
}

/// `sign (sum_c coef x[c] + constant) <= limit T^power`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Row {
    pub(crate) joint: usize,
    pub(crate) quantity: Quantity,
    pub(crate) columns: Vec<(usize, f64)>,
    pub(crate) constant: f64,
    pub(crate) limit: f64,
    pub(crate) power: i32,
    /// Divides the row so that its slack is relative.
    pub(crate) scale: f64,
}

/// Free control points (joint by joint, in order of time, then a free end point) and, last, a free
/// duration: the decision variables `x` of an excitation trajectory, with their linear limits.
///
/// ```
/// # use excitation::{Duration, End, JointLimits, PlanSpec, SplinePlan, random_plan};
/// # let limits = JointLimits { lower: -1.5, upper: 1.7, velocity: 0.17, acceleration: 0.15, jerk: None };
/// # let (start, end, duration) = (vec![0.3, -0.2], End::Free, Duration::Fixed(30.0));
/// # let plan = SplinePlan::new(PlanSpec { start, end, duration, degree: 5, free: 8, limits: vec![limits; 2], refine: 1 })?;
/// use excitation::check_for_all_time;
/// use ff_dynamics::motion::JointMotion;
///
/// let x = random_plan(&plan, 1, 0, 0.9)?;
/// assert!(plan.violated(&x).is_none());
/// let motion = plan.motion(&x)?;
/// assert_eq!((motion.dof(), motion.duration()), (2, 30.0));
/// assert!(check_for_all_time(&motion, &plan.spec().limits, 1)?.holds);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct SplinePlan {
    spec: PlanSpec,
    unit: Knots,
    per_joint: usize,
    pub(crate) rows: Vec<Row>,
}

impl SplinePlan {
    /// Checks the request and builds the limits. Allocates.
    ///
    /// # Errors
    /// [`PlanError`]; `Infeasible` names the limit that the start or end configuration breaks.
    pub fn new(spec: PlanSpec) -> Result<Self, PlanError> {
        let n = spec.start.len();
        check_limits(&spec.limits, n)?;
        let argument = |what, got: String, expected: String| PlanError::Argument { what, got, expected };
        if n == 0 {
            return Err(argument("start configuration", "0 joints".into(), "at least 1".into()));
        }
        if !(3..=7).contains(&spec.degree) {
            // Below 3 the acceleration jumps; above 7 there is no basis.
            return Err(argument("degree", spec.degree.to_string(), "3..=7".into()));
        }
        match spec.duration {
            Duration::Fixed(t) => drop(Knots::uniform(1, 2, t)?),
            Duration::Free { min, max } => {
                drop((Knots::uniform(1, 2, min)?, Knots::uniform(1, 2, max)?));
                if min >= max {
                    return Err(argument("duration bounds", format!("{min} .. {max}"), "min < max".into()));
                }
            }
        }
        if let End::Fixed(e) = &spec.end
            && e.len() != n
        {
            return Err(argument("end configuration", format!("{} joints", e.len()), n.to_string()));
        }
        let unit = Knots::uniform(spec.degree, spec.free + 2 * REPEAT, 1.0)?;
        let per_joint = spec.free + usize::from(spec.end == End::Free);
        if per_joint == 0 {
            return Err(argument("free control points", "0".into(), "at least 1".into()));
        }
        let mut plan = Self { spec, unit, per_joint, rows: Vec::new() };
        plan.check_ends()?;
        plan.rows = plan.build_rows()?;
        Ok(plan)
    }
    fn check_ends(&self) -> Result<(), PlanError> {
        let ends: &[&Vec<f64>] =
            if let End::Fixed(e) = &self.spec.end { &[&self.spec.start, e] } else { &[&self.spec.start] };
        for (joint, l) in self.spec.limits.iter().enumerate() {
            for q in ends.iter().map(|e| e[joint]) {
                if !q.is_finite() {
                    let (got, expected) = (format!("{q} for joint {joint}"), "finite".into());
                    return Err(PlanError::Argument { what: "configuration", got, expected });
                }
                for (quantity, limit, excess) in
                    [(Quantity::Lower, l.lower, l.lower - q), (Quantity::Upper, l.upper, q - l.upper)]
                {
                    if excess > 0.0 {
                        let which = PlanLimit { joint: Some(joint), quantity, limit, excess };
                        return Err(PlanError::Infeasible { which });
                    }
                }
            }
        }
        Ok(())
    }
    fn build_rows(&self) -> Result<Vec<Row>, PlanError> {
        let mut rows = Vec::new();
        let limits = &self.spec.limits;
        let top = if limits.iter().any(|l| l.jerk.is_some()) { 3 } else { 2 };
        for order in 0..=top {
            let (knots, map) = self.unit.derivative_map(order)?;
            let map = knots.refine(self.spec.refine.max(1)).matrix() * map;
            for (joint, l) in limits.iter().enumerate() {
                for m in map.row_iter() {
                    let (columns, constant) = self.affine(joint, |i| m[i]);
                    if columns.is_empty() {
                        continue; // fixed by the ends, already checked
                    }
                    let range = l.upper - l.lower;
                    let scale = if range.is_finite() { range } else { 1.0 };
                    let sides = if order == 0 {
                        [(1.0, Quantity::Upper, l.upper, scale), (-1.0, Quantity::Lower, -l.lower, scale)]
                    } else {
                        let (quantity, limit) = rate_limit(l, order);
                        [(1.0, quantity, limit, limit), (-1.0, quantity, limit, limit)]
                    };
                    for (sign, quantity, limit, scale) in sides.into_iter().filter(|s| s.2.is_finite()) {
                        rows.push(Row {
                            joint,
                            quantity,
                            columns: columns.iter().map(|(c, v)| (*c, sign * v)).collect(),
                            constant: sign * constant,
                            limit,
                            power: order as i32,
                            scale,
                        });
                    }
                }
            }
        }
        Ok(rows)
    }
    /// `sum_i weight(i) P_i` of one joint as an affine function of `x`.
    fn affine(&self, joint: usize, weight: impl Fn(usize) -> f64) -> (Vec<(usize, f64)>, f64) {
        let (mut columns, mut constant, mut end) = (Vec::new(), 0.0, 0.0);
        let (f, k) = (self.spec.free, self.unit.count());
        for i in 0..k {
            let w = weight(i);
            if i < REPEAT {
                constant += w * self.spec.start[joint];
            } else if i < REPEAT + f {
                if w != 0.0 {
                    columns.push((joint * self.per_joint + i - REPEAT, w));
                }
            } else {
                end += w;
            }
        }
        match &self.spec.end {
            End::Fixed(e) => constant += end * e[joint],
            End::Free if end.abs() > 1e-14 => columns.push((joint * self.per_joint + f, end)),
            End::Free => {}
        }
        (columns, constant)
    }
    /// The request.
    pub fn spec(&self) -> &PlanSpec {
        &self.spec
    }
    /// Basis on unit time `s = t / T`.
    pub fn unit_knots(&self) -> &Knots {
        &self.unit
    }
    /// Number of joints `n`.
    pub fn dof(&self) -> usize {
        self.spec.start.len()
    }
    /// Variables per joint: free control points, and the end point if free.
    pub fn per_joint(&self) -> usize {
        self.per_joint
    }
    /// Index of the duration in `x`, if it is free.
    pub fn duration_index(&self) -> Option<usize> {
        matches!(self.spec.duration, Duration::Free { .. }).then_some(self.dof() * self.per_joint)
    }
    /// Length of `x`.
    pub fn variables(&self) -> usize {
        self.dof() * self.per_joint + usize::from(self.duration_index().is_some())
    }
    /// Duration of the trajectory `x` (s).
    ///
    /// # Panics
    /// If `x` is too short.
    pub fn duration(&self, x: &[f64]) -> f64 {
        match self.spec.duration {
            Duration::Fixed(t) => t,
            Duration::Free { .. } => x[self.dof() * self.per_joint],
        }
    }
    /// The longest duration allowed (s).
    pub fn longest(&self) -> f64 {
        match self.spec.duration {
            Duration::Fixed(t) => t,
            Duration::Free { max, .. } => max,
        }
    }
    /// All control points of the trajectory `x`, `n x k`. Allocates.
    ///
    /// # Panics
    /// If `x` is too short.
    pub fn control(&self, x: &[f64]) -> DMatrix<f64> {
        let f = self.spec.free;
        DMatrix::from_fn(self.dof(), self.unit.count(), |j, i| {
            if i < REPEAT {
                self.spec.start[j]
            } else if i < REPEAT + f {
                x[j * self.per_joint + i - REPEAT]
            } else {
                match &self.spec.end {
                    End::Fixed(e) => e[j],
                    End::Free => x[j * self.per_joint + f],
                }
            }
        })
    }
    /// Adds to `grad` (over `x`) a gradient over all control points (`n x k`): transpose of
    /// [`SplinePlan::control`]. Does not allocate.
    ///
    /// # Panics
    /// If shapes do not fit.
    pub fn pull_back(&self, control_gradient: &DMatrix<f64>, grad: &mut [f64]) {
        let f = self.spec.free;
        for j in 0..self.dof() {
            for i in 0..f {
                grad[j * self.per_joint + i] += control_gradient[(j, REPEAT + i)];
            }
            if self.spec.end == End::Free {
                grad[j * self.per_joint + f] += (0..REPEAT).map(|i| control_gradient[(j, REPEAT + f + i)]).sum::<f64>();
            }
        }
    }
    /// The trajectory `x` as a motion. Allocates.
    ///
    /// # Errors
    /// [`PlanError`] if `x` has the wrong length, is not finite or has no positive duration.
    pub fn motion(&self, x: &[f64]) -> Result<BSplineMotion, PlanError> {
        if x.len() != self.variables() {
            let (got, expected) = (x.len().to_string(), self.variables().to_string());
            return Err(PlanError::Argument { what: "length of x", got, expected });
        }
        Ok(BSplineMotion::new(self.unit.with_duration(self.duration(x))?, self.control(x))?)
    }
    /// The constraint that `x` breaks most, relative to its limit; `None` when all hold (to rounding).
    /// Does not allocate.
    ///
    /// # Panics
    /// If `x` is too short.
    pub fn violated(&self, x: &[f64]) -> Option<PlanLimit> {
        let t = self.duration(x);
        let mut worst: Option<(f64, PlanLimit)> = None;
        let mut note = |relative: f64, which: PlanLimit| {
            // Negated so that NaN counts as broken.
            let fine = relative >= -crate::plan::limits::ROUNDING;
            if !fine && worst.as_ref().is_none_or(|w| relative < w.0) {
                worst = Some((relative, which));
            }
        };
        for r in &self.rows {
            let slack = r.slack(x, t);
            note(slack, r.which(-slack * r.scale));
        }
        if let Duration::Free { min, max } = self.spec.duration {
            let w = |quantity, limit, excess| PlanLimit { joint: None, quantity, limit, excess };
            note((t - min) / min, w(Quantity::Lower, min, min - t));
            note((max - t) / max, w(Quantity::Upper, max, t - max));
        }
        worst.map(|w| w.1)
    }
}

impl Row {
    /// Names this constraint.
    pub(crate) fn which(&self, excess: f64) -> PlanLimit {
        let limit = if self.quantity == Quantity::Lower { -self.limit } else { self.limit };
        PlanLimit { joint: Some(self.joint), quantity: self.quantity, limit, excess }
    }
    /// `sum_c coef x[c] + constant`.
    pub(crate) fn value(&self, x: &[f64]) -> f64 {
        self.columns.iter().map(|(c, v)| v * x[*c]).sum::<f64>() + self.constant
    }
    /// Slack relative to the limit at duration `t`; for rates this is `(L - |rate|) / L`.
    pub(crate) fn slack(&self, x: &[f64], t: f64) -> f64 {
        let tp = t.powi(self.power);
        (self.limit * tp - self.value(x)) / (self.scale * tp)
    }
}
