//! One rigid segment with its hinge, and what makes it acceptable.

use ff_model::diagnostics::Limit;
use ff_model::keys::{check_damping, check_stiffness};
use ff_model::spatial::InertiaError;
use ff_model::{Area, Inertia, Problem, Problems};
use nalgebra::{Matrix3, Vector3};

/// A rigid panel segment on a sprung, damped revolute hinge.
///
/// Hinge position and axis are geometry, assumed known; the ten inertial parameters, stiffness and damping
/// are the nominal values of the parameters an estimator may change.
///
/// ```
/// use ff_model::nalgebra::{Matrix3, Vector3};
/// use flex_panel::Segment;
///
/// let inertia_com = Matrix3::new(15.0, 0.7, -0.4, 0.7, 11.0, 0.5, -0.4, 0.5, 16.0);
/// let (hinge, axis) = (Vector3::new(0.1, 0.3, -0.2), Vector3::new(1.0, 0.1, -0.2));
/// let segment = Segment::new(33.0, Vector3::new(0.06, 1.07, -0.04), &inertia_com, hinge, axis).with_spring(200.0, 2.0);
/// assert_eq!((segment.inertia.mass, segment.stiffness, segment.damping), (33.0, 200.0, 2.0));
/// // About the hinge, not the centre of mass.
/// assert!(segment.inertia.rot[(0, 0)] > 15.0 + 33.0 * 1.07 * 1.07);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Segment {
    /// Ten inertial parameters about the hinge, in the segment frame (kg, kg m, kg m^2).
    pub inertia: Inertia<f64>,
    /// Hinge origin in the frame of the previous segment, or in the mount frame for segment 0 (m).
    pub hinge: Vector3<f64>,
    /// Hinge axis, the same components in the segment frame and in its parent; any length but zero.
    pub axis: Vector3<f64>,
    /// Spring stiffness `k >= 0` (N m/rad).
    pub stiffness: f64,
    /// Damper coefficient `d >= 0` (N m s/rad).
    pub damping: f64,
    /// Angle at which the spring is relaxed (rad).
    pub rest: f64,
}

impl Segment {
    /// A segment from its mass (kg), centre of mass (m) and inertia about the centre of mass (kg m^2), both
    /// in the segment frame, on a hinge at `hinge` (m, parent frame) about `axis`; no spring, no damper.
    ///
    /// Nothing is checked here; [`crate::chain::PanelChain::new`] checks everything at once.
    pub fn new(
        mass: f64,
        com: Vector3<f64>,
        inertia_com: &Matrix3<f64>,
        hinge: Vector3<f64>,
        axis: Vector3<f64>,
    ) -> Self {
        Self {
            inertia: Inertia::from_com(mass, &com, inertia_com),
            hinge,
            axis,
            stiffness: 0.0,
            damping: 0.0,
            rest: 0.0,
        }
    }

    /// With spring stiffness `k` (N m/rad) and damper coefficient `d` (N m s/rad).
    #[must_use]
    pub fn with_spring(mut self, k: f64, d: f64) -> Self {
        self.stiffness = k;
        self.damping = d;
        self
    }

    /// With the angle at which the spring is relaxed (rad).
    #[must_use]
    pub fn with_rest(mut self, rest: f64) -> Self {
        self.rest = rest;
        self
    }

    /// Adds everything that is wrong with segment number `i` to `problems`. Allocates.
    pub(crate) fn check(&self, i: usize, problems: &mut Problems) {
        let at = |key: &str| format!("segments[{i}].{key}");
        let springs = [
            check_stiffness(&at("stiffness_nm_per_rad"), self.stiffness),
            check_damping(&at("damping_nms_per_rad"), self.damping),
        ];
        springs.into_iter().flatten().for_each(|p| problems.push(p));
        let bad = |code, key: &str, message: String, hint: &str| {
            Problem::error(Area::Config, code, message).on(at(key)).hint(hint)
        };
        if !self.rest.is_finite() {
            let why = format!("{} rad is not a finite number", self.rest);
            problems.push(bad("Config::NotFinite", "rest_rad", why, "0 is the default"));
        } else if self.rest.abs() > std::f64::consts::PI {
            let why = format!("{} rad is outside the hinge range of -pi to pi rad", self.rest);
            let limit = Limit::Within(-std::f64::consts::PI, std::f64::consts::PI);
            let p = bad("Config::Param", "rest_rad", why, "angles are in rad, not in degrees");
            problems.push(p.violating(self.rest, limit, "rad"));
        }
        if self.hinge.iter().any(|x| !x.is_finite()) {
            let why = format!("{:?} m holds a number that is not finite", self.hinge.as_slice());
            problems.push(bad(
                "Config::NotFinite",
                "hinge_m",
                why,
                "give three finite coordinates in the parent frame",
            ));
        }
        if self.axis.iter().any(|x| !x.is_finite()) {
            let why = format!("{:?} holds a number that is not finite", self.axis.as_slice());
            problems.push(bad("Config::NotFinite", "hinge_axis", why, "give a direction such as [0.0, 1.0, 0.0]"));
        } else if !(AXIS_MIN..=AXIS_MAX).contains(&self.axis.amax()) {
            // The square of a subnormal or huge component under- or overflows: the direction would be noise.
            let why = format!(
                "{:?} has largest component {:e}, outside {AXIS_MIN:e} to {AXIS_MAX:e}: it gives no direction",
                self.axis.as_slice(),
                self.axis.amax()
            );
            problems.push(bad(
                "Config::Axis",
                "hinge_axis",
                why,
                "give a direction such as [0.0, 1.0, 0.0]; any length will do",
            ));
        }
        if let Err(e) = self.inertia.check() {
            problems.push(inertia_problem(&e, at));
        }
    }
}

/// The problem of an inertia that no body has; `at` makes a path of a key. Allocates.
pub(crate) fn inertia_problem(e: &InertiaError, at: impl Fn(&str) -> String) -> Problem {
    let (code, key) = inertia_fault(e);
    let p = Problem::error(Area::Config, code, e.to_string()).on(at(key)).hint(INERTIA_HINT);
    match e {
        InertiaError::NotFinite { .. } => p,
        InertiaError::NonPositiveMass { value } => p.violating(*value, Limit::Above(0.0), "kg"),
        InertiaError::NotPsd { moments } => {
            p.violating(moments.iter().copied().fold(f64::INFINITY, f64::min), Limit::AtLeast(0.0), "kg m^2")
        }
        InertiaError::Triangle { violation, .. } => p.violating(*violation, Limit::AtMost(0.0), "kg m^2"),
    }
}

/// What to do about an inertia that no body has.
const INERTIA_HINT: &str = "give finite numbers, a mass above 0 kg, and the inertia about the centre of mass, \
                                       not about the hinge or mount, in the order xx, xy, xz, yy, yz, zz";

/// Code and mission-file key of a fault of ten inertial parameters.
fn inertia_fault(e: &InertiaError) -> (&'static str, &'static str) {
    match e {
        InertiaError::NotFinite { name } => ("Config::NotFinite", key_of(name)),
        InertiaError::NonPositiveMass { .. } => ("Config::Inertia", "mass_kg"),
        _ => ("Config::Inertia", "inertia_com_kgm2"),
    }
}

/// The mission-file key behind one of the ten inertial parameters.
fn key_of(name: &str) -> &'static str {
    match name {
        "mass" => "mass_kg",
        n if n.starts_with('h') => "com_m",
        _ => "inertia_com_kgm2",
    }
}

/// Shortest and longest largest component of a usable axis.
const AXIS_MIN: f64 = 1e-9;
const AXIS_MAX: f64 = 1e9;
