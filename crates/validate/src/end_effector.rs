//! How far two models of the same robot carry the end effector apart when the joints do the same.
//!
//! On a free base the same joint motion moves the hand differently for different base inertias, which makes
//! the end-effector error along a reference trajectory the paper's measure of a model (Tables II and III).

use ff_dynamics::motion::JointMotion;
use ff_dynamics::{Drive, SimError, SimOptions, State, Work, frame_pose, simulate};
use ff_model::spatial::so3::{Quat, geodesic_angle, quat_to_rot, rot_to_quat, rpy_of};
use ff_model::{Model, Params};
use nalgebra::Vector3;
use serde::Serialize;

/// Path of a frame in the world, one pose per sample.
///
/// ```
/// use ff_dynamics::SimOptions;
/// use ff_model::Params;
/// use validate::{FramePath, frame_path};
/// # let robot = ff_testkit::tree::peers_arm(ff_model::BaseKind::Floating);
/// # let motion = ff_testkit::motion::Wave(robot.nj()); // every joint its own two sines
///
/// let options = SimOptions { duration_s: 2.0, step_s: 0.01, sample_s: 0.5 };
/// let path: FramePath = frame_path(&robot, &Params::nominal(&robot), &motion, "tool", &options)?;
/// assert_eq!(path.pos.len(), 5);
/// assert!((path.pos[4] - path.pos[0]).norm() > 0.05); // m
/// # Ok::<(), validate::PathErrorKind>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct FramePath {
    /// Positions (m).
    pub pos: Vec<Vector3<f64>>,
    /// Attitudes `[w, x, y, z]`.
    pub att: Vec<Quat<f64>>,
}

/// Differences of two paths over all samples.
///
/// ```
/// use ff_model::nalgebra::{Vector3, Vector4};
/// use validate::{FramePath, PathError, compare};
///
/// let path = |shift: f64| FramePath {
///     pos: vec![Vector3::new(0.7, 0.2, -0.4), Vector3::new(0.8 + shift, 0.3, -0.5)],
///     att: vec![Vector4::new(0.8, 0.6, 0.0, 0.0), Vector4::new(0.8, 0.0, 0.6, 0.0)],
/// };
/// let error: PathError = compare(&path(0.0), &path(0.02))?;
/// assert!((error.max_pos_m - 0.02).abs() < 1e-15 && (error.mean_pos_m - 0.01).abs() < 1e-15);
/// # Ok::<(), validate::PathErrorKind>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PathError {
    /// Mean distance of the positions (m).
    pub mean_pos_m: f64,
    /// Largest distance (m).
    pub max_pos_m: f64,
    /// Mean norm of the differences of roll, pitch and yaw, each wrapped to +-pi (rad). As the paper's rows;
    /// it depends on the axes and has poles, so judge by the angle below.
    pub mean_rpy_rad: f64,
    /// Largest such norm (rad).
    pub max_rpy_rad: f64,
    /// Mean geodesic angle between the attitudes (rad).
    pub mean_angle_rad: f64,
    /// Largest geodesic angle (rad).
    pub max_angle_rad: f64,
}

/// Why a path could not be computed.
///
/// ```
/// use ff_dynamics::SimOptions;
/// use ff_model::Params;
/// use validate::{PathErrorKind, frame_path};
/// # let robot = ff_testkit::tree::peers_arm(ff_model::BaseKind::Floating);
/// # let motion = ff_testkit::motion::Wave(robot.nj());
///
/// let options = SimOptions { duration_s: 2.0, step_s: 0.01, sample_s: 0.5 };
/// let refused = frame_path(&robot, &Params::nominal(&robot), &motion, "gripper", &options);
/// assert_eq!(refused, Err(PathErrorKind::NoFrame("gripper".into())));
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PathErrorKind {
    /// The simulation stopped.
    #[error(transparent)]
    Simulation(#[from] SimError),
    /// The model has no such frame.
    #[error("the model has no frame '{0}'; name a link of the URDF")]
    NoFrame(String),
    /// Paths of different length.
    #[error("the paths have {0} and {1} samples; compute both with the same options")]
    Length(usize, usize),
}

/// Path of `frame` when the joints follow `motion` from rest (springs relaxed, base at the world origin).
///
/// Full dynamics, [`simulate()`]. Allocates.
///
/// # Errors
/// [`PathErrorKind`].
pub fn frame_path(
    model: &Model,
    params: &Params<f64>,
    motion: &dyn JointMotion,
    frame: &str,
    options: &SimOptions,
) -> Result<FramePath, PathErrorKind> {
    let tool = model.frame(frame).ok_or_else(|| PathErrorKind::NoFrame(frame.to_owned()))?;
    let mut start = State::zero(model);
    start.eta = model.rest_position(params);
    let trace = simulate(model, params, &start, &Drive::Prescribed(motion), options)?;
    let mut work = Work::new(model);
    let (mut pos, mut att) = (Vec::with_capacity(trace.len()), Vec::with_capacity(trace.len()));
    for i in 0..trace.len() {
        let x = frame_pose(model, &trace.state(model, i), tool, &mut work);
        pos.push(x.pos);
        att.push(rot_to_quat(&x.rot));
    }
    Ok(FramePath { pos, att })
}

/// Compares two paths sample by sample.
///
/// # Errors
/// [`PathErrorKind::Length`].
pub fn compare(a: &FramePath, b: &FramePath) -> Result<PathError, PathErrorKind> {
    if a.pos.len() != b.pos.len() || a.pos.is_empty() {
        return Err(PathErrorKind::Length(a.pos.len(), b.pos.len()));
    }
    let n = a.pos.len() as f64;
    let stat = |f: &dyn Fn(usize) -> f64| {
        let (mut sum, mut max) = (0.0, 0.0f64);
        for i in 0..a.pos.len() {
            let x = f(i);
            sum += x;
            max = max.max(x);
        }
        (sum / n, max)
    };
    let wrap = |x: f64| x.sin().atan2(x.cos());
    let rpy = |i: usize| (rpy_of(&quat_to_rot(&a.att[i])) - rpy_of(&quat_to_rot(&b.att[i]))).map(wrap).norm();
    let (mean_pos_m, max_pos_m) = stat(&|i| (a.pos[i] - b.pos[i]).norm());
    let (mean_rpy_rad, max_rpy_rad) = stat(&rpy);
    let (mean_angle_rad, max_angle_rad) = stat(&|i| geodesic_angle(&a.att[i], &b.att[i]));
    Ok(PathError { mean_pos_m, max_pos_m, mean_rpy_rad, max_rpy_rad, mean_angle_rad, max_angle_rad })
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use ff_model::spatial::so3::exp_so3;
    use ff_testkit::scaled;

    #[test]
    fn errors_are_those_of_known_displacements() {
        let u = [Vector3::new(0.1, -0.2, 0.3), Vector3::new(-0.4, 0.25, 0.05)];
        let d = [Vector3::new(0.01, 0.02, -0.02), Vector3::new(-0.04, 0.0, 0.03)];
        let a = FramePath { pos: vec![Vector3::new(1.0, 2.0, 3.0); 2], att: vec![exp_so3(&Vector3::zeros()); 2] };
        let b = FramePath { pos: vec![a.pos[0] + d[0], a.pos[1] + d[1]], att: u.iter().map(exp_so3).collect() };
        let e = compare(&a, &b).unwrap();
        assert_relative_eq!(e.mean_pos_m, 0.5 * (d[0].norm() + d[1].norm()), max_relative = scaled(1e-14));
        assert_relative_eq!(e.max_pos_m, 0.05, max_relative = scaled(1e-12));
        assert_relative_eq!(e.mean_angle_rad, 0.5 * (u[0].norm() + u[1].norm()), max_relative = scaled(1e-12));
        assert_relative_eq!(e.max_angle_rad, u[1].norm(), max_relative = scaled(1e-12));
        assert!(e.max_rpy_rad > 0.4 && e.mean_rpy_rad < e.max_rpy_rad);
        assert!(compare(&a, &FramePath { pos: vec![], att: vec![] }).is_err());
    }
}
