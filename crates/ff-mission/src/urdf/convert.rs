//! Numbers of the file as quantities of the model: limits, poses, inertia.

use super::raw::{RawInertial, RawJoint, RawPose};
use ff_model::spatial::so3::{quat_to_rot, rot_of_rpy};
use ff_model::tree::JointLimits;
use ff_model::{Inertia, Xform};
use nalgebra::Vector3;

/// Limits of a joint as the file gives them.
pub(super) fn limits(j: &RawJoint) -> JointLimits {
    let mut limits = JointLimits::default();
    if let Some(l) = j.limit {
        limits.velocity = l.velocity.filter(|v| *v > 0.0).unwrap_or(limits.velocity);
        limits.effort = l.effort.unwrap_or(limits.effort);
        if j.kind != "continuous" && (l.lower.is_some() || l.upper.is_some()) {
            limits.lower = l.lower.unwrap_or(0.0);
            limits.upper = l.upper.unwrap_or(0.0);
        }
    }
    limits
}

pub(super) fn xform(p: &RawPose) -> Xform<f64> {
    let rot = p.quat.map_or_else(|| rot_of_rpy(&Vector3::from(p.rpy)), |q| quat_to_rot(&q.into()));
    Xform::new(rot, Vector3::from(p.xyz))
}

/// Inertia of a link about its own frame.
pub(super) fn inertia(i: &RawInertial) -> Inertia<f64> {
    let in_own_frame = Inertia::from_com(i.mass, &Vector3::zeros(), &i.matrix());
    in_own_frame.to_parent(&xform(&i.origin))
}
