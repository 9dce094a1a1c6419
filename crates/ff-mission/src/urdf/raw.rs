//! A URDF as read, before it is known to make sense: names, numbers and the lines they stand on.

use ff_model::tree::JointFriction;
use nalgebra::{Matrix3, Vector3};

/// A pose as URDF writes it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct RawPose {
    /// Position (m).
    pub(super) xyz: [f64; 3],
    /// Roll, pitch, yaw (rad).
    pub(super) rpy: [f64; 3],
}

/// An `<inertial>` element.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct RawInertial {
    /// Pose of the inertia frame in the link frame.
    pub(super) origin: RawPose,
    /// Mass (kg).
    pub(super) mass: f64,
    /// `ixx ixy ixz iyy iyz izz` about the centre of mass (kg m^2).
    pub(super) inertia: [f64; 6],
}

impl RawInertial {
    /// The symmetric matrix.
    pub(super) fn matrix(&self) -> Matrix3<f64> {
        let [xx, xy, xz, yy, yz, zz] = self.inertia;
        Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
    }
    /// Centre of mass in the link frame (m).
    pub(super) fn com(&self) -> Vector3<f64> {
        Vector3::from(self.origin.xyz)
    }
    /// No mass and no inertia.
    pub(super) fn is_zero(&self) -> bool {
        self.mass == 0.0 && self.inertia.iter().all(|&x| x == 0.0)
    }
}

/// A `<link>`.
#[derive(Clone, Debug, Default)]
pub(super) struct RawLink {
    pub(super) name: String,
    pub(super) line: usize,
    /// `None` without an `<inertial>` element, and its line otherwise.
    pub(super) inertial: Option<(RawInertial, usize)>,
    /// It has a `<visual>` or a `<collision>`: more than a frame.
    pub(super) shape: bool,
    /// Something of the link could not be read, so its numbers say nothing.
    pub(super) unsure: bool,
}

/// A `<limit>`; `None` where an attribute is absent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct RawLimit {
    pub(super) line: usize,
    pub(super) lower: Option<f64>,
    pub(super) upper: Option<f64>,
    pub(super) velocity: Option<f64>,
    pub(super) effort: Option<f64>,
}

/// A `<mimic>`: `q = multiplier q(joint) + offset`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RawMimic {
    pub(super) line: usize,
    /// The joint that is followed.
    pub(super) joint: String,
    pub(super) multiplier: f64,
    /// Position when the followed joint is at zero (rad or m).
    pub(super) offset: f64,
}

/// A `<joint>`.
#[derive(Clone, Debug, Default)]
pub(super) struct RawJoint {
    pub(super) name: String,
    pub(super) line: usize,
    /// The `type` attribute.
    pub(super) kind: String,
    pub(super) origin: RawPose,
    pub(super) origin_line: usize,
    /// Parent link name and line.
    pub(super) parent: (String, usize),
    /// Child link name and line.
    pub(super) child: (String, usize),
    /// Axis as written (x when absent) and its line.
    pub(super) axis: ([f64; 3], usize),
    pub(super) limit: Option<RawLimit>,
    /// `<dynamics>`: zero where absent.
    pub(super) friction: JointFriction,
    pub(super) mimic: Option<RawMimic>,
}

impl RawJoint {
    /// Joints that move.
    pub(super) fn moves(&self) -> bool {
        self.kind != "fixed"
    }
}

/// A `<robot>`.
#[derive(Clone, Debug, Default)]
pub(super) struct RawRobot {
    pub(super) name: String,
    pub(super) links: Vec<RawLink>,
    pub(super) joints: Vec<RawJoint>,
}
