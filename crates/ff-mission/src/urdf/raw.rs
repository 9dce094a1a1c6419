//! A URDF as read, before it is known to make sense: names, numbers and the lines they stand on.

use ff_model::tree::JointImpedance;
use nalgebra::{Matrix3, Vector3};

/// A pose as URDF writes it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct RawPose {
    /// Position (m).
    pub(crate) xyz: [f64; 3],
    /// Roll, pitch, yaw (rad).
    pub(crate) rpy: [f64; 3],
    /// Unit quaternion, scalar first, in place of `rpy`, for formats that give no angles.
    pub(crate) quat: Option<[f64; 4]>,
}

/// An `<inertial>` element.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct RawInertial {
    /// Pose of the inertia frame in the link frame.
    pub(crate) origin: RawPose,
    /// Mass (kg).
    pub(crate) mass: f64,
    /// `ixx ixy ixz iyy iyz izz` about the centre of mass (kg m^2).
    pub(crate) inertia: [f64; 6],
}

impl RawInertial {
    /// The symmetric matrix.
    pub(crate) fn matrix(&self) -> Matrix3<f64> {
        let [xx, xy, xz, yy, yz, zz] = self.inertia;
        Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
    }
    /// Centre of mass in the link frame (m).
    pub(crate) fn com(&self) -> Vector3<f64> {
        Vector3::from(self.origin.xyz)
    }
    /// No mass and no inertia.
    pub(crate) fn is_zero(&self) -> bool {
        self.mass == 0.0 && self.inertia.iter().all(|&x| x == 0.0)
    }
}

/// A `<link>`.
#[derive(Clone, Debug, Default)]
pub(crate) struct RawLink {
    pub(crate) name: String,
    pub(crate) line: usize,
    /// `None` without an `<inertial>` element, and its line otherwise.
    pub(crate) inertial: Option<(RawInertial, usize)>,
    /// It has a `<visual>` or a `<collision>`: more than a frame.
    pub(crate) shape: bool,
    /// Something of the link could not be read, so its numbers say nothing.
    pub(crate) unsure: bool,
}

/// A `<limit>`; `None` where an attribute is absent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct RawLimit {
    pub(crate) line: usize,
    pub(crate) lower: Option<f64>,
    pub(crate) upper: Option<f64>,
    pub(crate) velocity: Option<f64>,
    pub(crate) effort: Option<f64>,
}

/// A `<mimic>`: `q = multiplier q(joint) + offset`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RawMimic {
    pub(crate) line: usize,
    /// The joint that is followed.
    pub(crate) joint: String,
    pub(crate) multiplier: f64,
    /// Position when the followed joint is at zero (rad or m).
    pub(crate) offset: f64,
}

/// A `<joint>`.
#[derive(Clone, Debug, Default)]
pub(crate) struct RawJoint {
    pub(crate) name: String,
    pub(crate) line: usize,
    /// The `type` attribute.
    pub(crate) kind: String,
    pub(crate) origin: RawPose,
    pub(crate) origin_line: usize,
    /// Parent link name and line.
    pub(crate) parent: (String, usize),
    /// Child link name and line.
    pub(crate) child: (String, usize),
    /// Axis as written (x when absent) and its line.
    pub(crate) axis: ([f64; 3], usize),
    pub(crate) limit: Option<RawLimit>,
    /// `<dynamics>`: zero where absent.
    pub(crate) impedance: JointImpedance,
    pub(crate) mimic: Option<RawMimic>,
    /// It follows a joint of the file that is not among those that are used.
    pub(crate) follows_outside: bool,
}

impl RawJoint {
    /// Joints that move.
    pub(crate) fn moves(&self) -> bool {
        self.kind != "fixed"
    }
}

/// A `<robot>`.
#[derive(Clone, Debug, Default)]
pub(crate) struct RawRobot {
    pub(crate) name: String,
    pub(crate) links: Vec<RawLink>,
    pub(crate) joints: Vec<RawJoint>,
}
