//! What base, joints, end effector and appendages do along the simulated trajectory.

use super::question::Question;
use ff_dynamics::{Trace, Work, frame_jacobian};
use ff_model::Model;
use nalgebra::{DMatrix, DVector, Vector3};
use serde::Serialize;

/// The largest value of something, and when.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Peak {
    /// Name of the joint or coordinate.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Largest absolute value.
    pub value: f64,
    /// Time of it (s).
    pub time_s: f64,
}

/// Excursions over the trajectory, from the full simulation, appendages swinging.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Excursion {
    /// Largest angle between the base's attitude and that at the start (rad): the geodesic angle.
    pub attitude: Peak,
    /// Largest angular speed of the base (rad/s).
    pub rate: Peak,
    /// Largest distance of the base origin from where it started (m).
    pub displacement: Peak,
    /// Base attitude at the end, as that angle (rad).
    pub final_attitude_rad: f64,
    /// Largest torque of every joint (N m or N).
    pub torques: Vec<Peak>,
    /// Largest deflection from rest of every passive coordinate.
    pub passive: Vec<Peak>,
    /// Largest speed of the end effector (m/s), if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub end_effector_speed: Option<Peak>,
}

/// Angle of the rotation from attitude `i` to the start: `2 atan2(|vec|, |w|)` of `q_0^-1 q_i`.
pub fn angle(t: &Trace, i: usize) -> f64 {
    let quat = |i: usize| nalgebra::Quaternion::new(t.att[(i, 0)], t.att[(i, 1)], t.att[(i, 2)], t.att[(i, 3)]);
    let r = quat(0).conjugate() * quat(i);
    2.0 * r.imag().norm().atan2(r.w.abs())
}

/// Displacement of the base origin at sample `i` (m, world axes).
pub fn displacement(t: &Trace, i: usize) -> Vector3<f64> {
    Vector3::from_fn(|k, _| t.pos[(i, k)] - t.pos[(0, k)])
}

fn peak(t: &Trace, name: &str, unit: &str, of: impl Fn(usize) -> f64) -> Peak {
    let (mut value, mut at) = (0.0, 0);
    for i in 0..t.len() {
        let x = of(i).abs();
        if x > value {
            (value, at) = (x, i);
        }
    }
    Peak { name: name.to_owned(), unit: unit.to_owned(), value, time_s: at as f64 * t.dt }
}

/// Speed of a frame's origin at every sample (m/s). Allocates.
fn speeds(model: &Model, frame: usize, t: &Trace) -> Vec<f64> {
    let frame = &model.frames()[frame];
    let mut work = Work::new(model);
    let mut j = DMatrix::zeros(6, model.nv());
    (0..t.len())
        .map(|i| {
            let state = t.state(model, i);
            frame_jacobian(model, &state, frame, &mut work, &mut j);
            (&j * DVector::from_column_slice(&state.v)).rows(0, 3).norm()
        })
        .collect()
}

pub(super) fn of(q: &Question<'_>, t: &Trace) -> Excursion {
    let model = q.model;
    let rest = model.rest_position(q.params);
    let joints = model.own_bodies().enumerate();
    let torque = |(k, b): (usize, &ff_model::Body)| {
        let unit = if b.joint.kind == ff_model::JointKind::Prismatic { "N" } else { "N m" };
        peak(t, &b.joint.name, unit, |i| t.tau[(i, k)])
    };
    let passive = model.passive_coords().into_iter().enumerate();
    let speed = q.end_effector.map(|f| {
        let v = speeds(model, f, t);
        peak(t, &format!("speed of {}", model.frames()[f].name), "m/s", |i| v[i])
    });
    Excursion {
        attitude: peak(t, "base attitude", "rad", |i| angle(t, i)),
        rate: peak(t, "base rate", "rad/s", |i| t.twist.row(i).columns(3, 3).norm()),
        displacement: peak(t, "base displacement", "m", |i| displacement(t, i).norm()),
        final_attitude_rad: angle(t, t.len() - 1),
        torques: joints.map(torque).collect(),
        passive: passive.map(|(k, (name, c))| peak(t, &name, c.unit, |i| t.eta[(i, k)] - rest[k])).collect(),
        end_effector_speed: speed,
    }
}
