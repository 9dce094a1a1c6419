//! Trajectories as files: written so that they are read back bit for bit, read so that nothing wrong gets in.
//!
//! | file | holds | read back |
//! |---|---|---|
//! | JSON ([`TrajectoryFile`]) | degree, knots and control points of a spline, or the specification of a manoeuvre | the same motion, bit for bit |
//! | CSV ([`Samples`]) | `time[s]`, then `q.`, `qd.` and `qdd.` of every joint, sampled | the same samples, bit for bit |
//!
//! Readers report every problem at once ([`Problems`], area `Data`, exit code 12), with the place in the file.
pub(crate) mod csv;
pub(crate) mod json;

pub use self::csv::{Samples, write_csv};

use crate::plan::manoeuvre::{Manoeuvre, ManoeuvreSpec};
use ff_dynamics::motion::JointMotion;
use ff_dynamics::motion::bspline::BSplineMotion;
use ff_model::diagnostics::{list, nearest};
use ff_model::{Area, JointKind, Model, Problem, Problems};
use std::path::Path;

/// Largest trajectory file read (bytes).
pub const MAX_BYTES: usize = 64 << 20;
/// What the field `format` of a JSON file must say.
pub const FORMAT: &str = "ffid-trajectory";
/// Version of the format that is written, and the only one that is read.
pub const VERSION: u64 = 1;

/// A joint by name, with the unit of its position.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NamedJoint {
    /// Name in the URDF.
    pub name: String,
    /// `rad` or `m`.
    pub unit: &'static str,
}

/// The joints of a model that move by themselves, in its order. Allocates.
pub fn named_joints(model: &Model) -> Vec<NamedJoint> {
    let unit = |k: JointKind| if k == JointKind::Prismatic { "m" } else { "rad" };
    model.own_bodies().map(|b| NamedJoint { name: b.joint.name.clone(), unit: unit(b.joint.kind) }).collect()
}

/// A motion that a file can hold exactly.
///
/// ```
/// # use excitation::{Duration, End, JointLimits, PlanSpec, SplinePlan, random_plan};
/// # let limits = JointLimits { lower: -1.5, upper: 1.7, velocity: 0.17, acceleration: 0.15, jerk: None };
/// # let (start, end, duration) = (vec![0.3, -0.2], End::Free, Duration::Fixed(30.0));
/// # let plan = SplinePlan::new(PlanSpec { start, end, duration, degree: 5, free: 8, limits: vec![limits; 2], refine: 1 })?;
/// use excitation::Trajectory;
///
/// let x = random_plan(&plan, 1, 0, 0.9)?;
/// let trajectory = Trajectory::Spline(plan.motion(&x)?);
/// assert_eq!((trajectory.motion().dof(), trajectory.motion().duration()), (2, 30.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum Trajectory {
    /// A B-spline: degree, knots, control points.
    Spline(BSplineMotion),
    /// A manoeuvre and what it was built from.
    Manoeuvre(ManoeuvreSpec, Manoeuvre),
}

impl Trajectory {
    /// The motion.
    pub fn motion(&self) -> &dyn JointMotion {
        match self {
            Self::Spline(m) => m,
            Self::Manoeuvre(_, m) => m,
        }
    }
}

/// Where a trajectory comes from; for people, not for programs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Origin {
    /// Name of the robot it was planned for.
    pub robot: String,
    /// What it was planned for, such as `information`.
    pub goal: String,
    /// Seed of the plan.
    pub seed: u64,
    /// Program and version.
    pub program: String,
}

/// A trajectory with the names of its joints: what a JSON file holds.
///
/// ```
/// # use excitation::{Duration, End, JointLimits, PlanSpec, SplinePlan, random_plan};
/// # let limits = JointLimits { lower: -1.5, upper: 1.7, velocity: 0.17, acceleration: 0.15, jerk: None };
/// # let (start, end, duration) = (vec![0.3, -0.2], End::Free, Duration::Fixed(30.0));
/// # let plan = SplinePlan::new(PlanSpec { start, end, duration, degree: 5, free: 8, limits: vec![limits; 2], refine: 1 })?;
/// use excitation::trajectory::{NamedJoint, Origin};
/// use excitation::{Trajectory, TrajectoryFile};
///
/// let joints = ["shoulder", "elbow"].map(|name| NamedJoint { name: name.into(), unit: "rad" }).to_vec();
/// let trajectory = Trajectory::Spline(plan.motion(&random_plan(&plan, 1, 0, 0.9)?)?);
/// let file = TrajectoryFile { joints, origin: Origin::default(), trajectory };
/// // Every number comes back to the last bit.
/// assert_eq!(TrajectoryFile::from_json(&file.to_json())?, file);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct TrajectoryFile {
    /// Joints, in the order of the control points.
    pub joints: Vec<NamedJoint>,
    /// Where it comes from.
    pub origin: Origin,
    /// The motion.
    pub trajectory: Trajectory,
}

impl TrajectoryFile {
    /// The file as JSON text. Numbers are printed in their shortest exact form. Allocates.
    pub fn to_json(&self) -> String {
        json::write(self)
    }
    /// Reads a JSON text.
    ///
    /// # Errors
    /// All problems of the text: `Data::Syntax` with line and column, `Data::Format`, `Data::Version`,
    /// `Data::MissingKey`, `Data::UnknownKey`, `Data::WrongType`, `Data::NotFinite`, `Data::WrongLength`,
    /// `Data::BadSpline`, `Data::BadManoeuvre`, `Data::DuplicateName`, `Data::UnknownJoint`.
    pub fn from_json(text: &str) -> Result<Self, Problems> {
        json::read(text)
    }
    /// Reads a file of at most [`MAX_BYTES`] for a model, whose joints it must name; another order is put right.
    ///
    /// # Errors
    /// Those of [`TrajectoryFile::from_json`], with the file; `Io::Read`, `Data::NameMismatch`, `Data::Unit`.
    pub fn load(path: &Path, model: &Model) -> Result<Self, Problems> {
        let text = ff_model::diagnostics::text_file(path, MAX_BYTES)?;
        Self::from_json(&text).and_then(|f| f.for_model(model)).map_err(|p| p.in_file(path))
    }
    /// The same trajectory with its joints in the order of the model.
    ///
    /// # Errors
    /// `Data::NameMismatch`, `Data::Unit`.
    pub fn for_model(self, model: &Model) -> Result<Self, Problems> {
        let joints = named_joints(model);
        let order = match_joints(&self.joints, &joints)?;
        let trajectory = match self.trajectory {
            Trajectory::Spline(m) => {
                let c = m.control();
                let control = nalgebra::DMatrix::from_fn(c.nrows(), c.ncols(), |i, k| c[(order[i], k)]);
                Trajectory::Spline(BSplineMotion::new(m.knots().clone(), control).map_err(|e| bad_spline(&e))?)
            }
            Trajectory::Manoeuvre(mut spec, _) => {
                spec.start = order.iter().map(|&i| spec.start[i]).collect();
                for c in &mut spec.commands {
                    c.joint = order.iter().position(|&i| i == c.joint).unwrap_or(c.joint);
                }
                let m = Manoeuvre::new(&spec).map_err(|e| bad_manoeuvre(&e))?;
                Trajectory::Manoeuvre(spec, m)
            }
        };
        Ok(Self { joints, origin: self.origin, trajectory })
    }
}

/// For each joint of the model its place in the file.
fn match_joints(file: &[NamedJoint], model: &[NamedJoint]) -> Result<Vec<usize>, Problems> {
    let mut bad = Problems::default();
    let place = |j: &NamedJoint| file.iter().position(|f| f.name == j.name);
    let order: Vec<Option<usize>> = model.iter().map(place).collect();
    let missing: Vec<&str> =
        model.iter().zip(&order).filter(|(_, o)| o.is_none()).map(|(j, _)| j.name.as_str()).collect();
    let extra: Vec<&str> =
        file.iter().filter(|f| !model.iter().any(|j| j.name == f.name)).map(|f| f.name.as_str()).collect();
    if !missing.is_empty() || !extra.is_empty() {
        let say = |what: &str, names: &[&str]| {
            if names.is_empty() { String::new() } else { format!("{what}: {}", list(names.iter().copied(), 12)) }
        };
        let what = [say("missing", &missing), say("extra", &extra)].into_iter().filter(|s| !s.is_empty());
        let what =
            format!("joints of the trajectory are not those of the robot; {}", what.collect::<Vec<_>>().join("; "));
        let near =
            extra.first().and_then(|e| nearest(e, missing.iter().copied()).map(|n| format!("is {e} meant to be {n}?")));
        bad.push(
            data("Data::NameMismatch", what)
                .on("joints")
                .hint(near.unwrap_or_else(|| "use the trajectory with its own robot".into())),
        );
        return Err(bad);
    }
    for (j, o) in model.iter().zip(order.iter().flatten()) {
        if file[*o].unit != j.unit {
            let what = format!("position in {}, the joint of the robot moves in {}", file[*o].unit, j.unit);
            bad.push(data("Data::Unit", what).on(&j.name).hint("use the trajectory with its own robot"));
        }
    }
    if bad.has_errors() { Err(bad) } else { Ok(order.into_iter().flatten().collect()) }
}

fn data(code: &'static str, message: impl Into<String>) -> Problem {
    Problem::error(Area::Data, code, message)
}

fn bad_spline(e: &dyn std::fmt::Display) -> Problems {
    Problems(vec![data("Data::BadSpline", e.to_string()).on("motion").hint("write the file again with `ffid excite`")])
}

fn bad_manoeuvre(e: &dyn std::fmt::Display) -> Problems {
    Problems(vec![
        data("Data::BadManoeuvre", e.to_string()).on("motion").hint("write the file again with `ffid excite`"),
    ])
}
