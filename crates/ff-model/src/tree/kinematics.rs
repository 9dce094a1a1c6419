//! Kinematic parameters: where joints and mounts are, and where the joints' zero positions are.
//!
//! A joint is placed by `X = (R0, p0)` in its parent body, a mount in its host body. Kinematic parameters displace these
//! poses; all are zero unless given. With the rotation vector `rho`, the shift `delta` (both in axes of the parent or host)
//! and the joint offset `q0`,
//!
//! ```text
//! revolute     R = exp(rho) R0 Rot(u, q + q0),   p = p0 + delta
//! prismatic    R = exp(rho) R0,                  p = p0 + delta + R u (q + q0)
//! mount        R = exp(rho) R0,                  p = p0 + delta
//! ```
//!
//! A rotation of a revolute joint's placement about the joint's own axis `a = R0 u` is the joint's offset, and so is a shift
//! of a prismatic joint along `a`: `exp(a q0) R0 Rot(u, q) = R0 Rot(u, q + q0)`. They are one parameter, the offset; the
//! others displace across `a`. Six parameters per joint and six per mount are therefore all there are, and none is a
//! combination of the others of its joint. The length of a link is the placement of the next joint
//! (`docs/theory/kinematic-parameters.md`).

use crate::scalar::traits::Scalar;
use crate::spatial::motion::Xform;
use crate::spatial::small::{add, mm, mv};
use crate::spatial::so3::{exp_so3, quat_to_rot};
use crate::tree::model::{JointKind, Model};
use nalgebra::Vector3;

/// Kinematic parameters of a joint, and of a mount.
const PER_PLACE: usize = 6;
/// Coordinate axes of the parent or host body.
const AXES: [&str; 3] = ["x", "y", "z"];

/// What a kinematic parameter displaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Placed {
    /// The joint of this index: it carries body `index + 1`.
    Joint(usize),
    /// The mount of the appendage of this index.
    Mount(usize),
}

/// How a kinematic parameter displaces it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DisplacementKind {
    /// A shift along a direction (m).
    Shift,
    /// A rotation about a direction (rad).
    Rotation,
    /// A change of the joint's zero position (rad or m).
    Offset,
}

/// Declaration of a kinematic parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct KinematicParam {
    /// `joint.placement.x`, `joint.placement.rx`, `joint.offset`, `appendage.mount.x`, `appendage.mount.rx`.
    pub name: String,
    /// `m` or `rad`.
    pub unit: &'static str,
    /// Which joint or mount.
    pub of: Placed,
    /// How it is displaced.
    pub kind: DisplacementKind,
    /// Unit vector of the shift or rotation in axes of the parent or host body: the coordinate axis of the name, made
    /// perpendicular to the joint's axis where the component along it is the offset. Of an offset, the joint's axis.
    pub direction: Vector3<f64>,
}

/// Displacement of one joint or mount.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Displacement<T: Scalar> {
    /// Rotation vector in axes of the parent or host body (rad).
    pub rotation: Vector3<T>,
    /// Shift in axes of the parent or host body (m).
    pub shift: Vector3<T>,
    /// Offset of the joint position (rad or m); zero for a mount.
    pub offset: T,
}

impl<T: Scalar> Displacement<T> {
    /// The displaced pose, joint offset left out: `(exp(rho) R0, p0 + delta)`.
    pub fn apply(&self, to: &Xform<f64>) -> Xform<T> {
        let at: Xform<T> = to.lift();
        Xform::new(mm(&quat_to_rot(&exp_so3(&self.rotation)), &at.rot), add(&at.pos, &self.shift))
    }
}

/// Values of all kinematic parameters of a [`Model`], in the order of [`Model::kinematic_params`]; all zero unless given.
///
/// ```
/// use ff_model::Kinematics;
/// # let arm = ff_testkit::tree::peers_arm(ff_model::BaseKind::Floating);
///
/// // The first joint stands 2 mrad beside its mark.
/// let mut values = vec![0.0; arm.n_kinematic_params()];
/// let offset = format!("{}.offset", arm.joint_names()[0]);
/// values[arm.kinematic_index(&offset).unwrap()] = 2e-3;
/// let built = Kinematics::from_values(&arm, values);
/// assert_eq!((built.joint(0).offset, built.joint(1).offset), (2e-3, 0.0));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Kinematics<T: Scalar> {
    values: Vec<T>,
    displacements: Vec<Displacement<T>>,
    joints: usize,
}

impl<T: Scalar> Kinematics<T> {
    /// Joints and mounts as the model has them: all values zero. Allocates.
    pub fn fixed(model: &Model) -> Self {
        Self::from_values(model, vec![T::zero(); model.n_kinematic_params()])
    }
    /// From all values (m, rad). Allocates.
    ///
    /// # Panics
    /// If the length is not [`Model::n_kinematic_params`].
    pub fn from_values(model: &Model, values: Vec<T>) -> Self {
        assert_eq!(values.len(), model.n_kinematic_params(), "number of kinematic parameters");
        let z = Vector3::from_element(T::zero());
        let still = Displacement { rotation: z, shift: z, offset: T::zero() };
        let mut displacements = vec![still; values.len() / PER_PLACE];
        for (i, (p, &x)) in model.kinematic_params().iter().zip(&values).enumerate() {
            let d = &mut displacements[i / PER_PLACE];
            let along = p.direction.map(|e| x.scale(e));
            match p.kind {
                DisplacementKind::Shift => d.shift = add(&d.shift, &along),
                DisplacementKind::Rotation => d.rotation = add(&d.rotation, &along),
                DisplacementKind::Offset => d.offset = x,
            }
        }
        Self { values, displacements, joints: model.n_joints() }
    }
    /// All values (m, rad).
    pub fn values(&self) -> &[T] {
        &self.values
    }
    /// Displacement of joint `j`.
    ///
    /// # Panics
    /// If there is no such joint.
    pub fn joint(&self, j: usize) -> &Displacement<T> {
        assert!(j < self.joints, "joint {j} does not exist");
        &self.displacements[j]
    }
    /// Displacement of the mount of appendage `k`.
    ///
    /// # Panics
    /// If there is no such appendage.
    pub fn mount(&self, k: usize) -> &Displacement<T> {
        &self.displacements[self.joints + k]
    }
}

impl Model {
    /// Number of kinematic parameters: six per joint of the tree, then six per mount.
    pub fn n_kinematic_params(&self) -> usize {
        PER_PLACE * (self.n_joints() + self.appendages().len())
    }
    /// All kinematic parameters: six per joint in order, then six per mount. Allocates.
    pub fn kinematic_params(&self) -> Vec<KinematicParam> {
        let mut out = Vec::with_capacity(self.n_kinematic_params());
        for (j, b) in self.bodies().iter().enumerate() {
            let axis = b.joint.placement.rot * b.joint.axis;
            let slides = b.joint.kind == JointKind::Prismatic;
            let (shifts, rotations) =
                if slides { (across(&axis), along_axes()) } else { (along_axes(), across(&axis)) };
            let name = format!("{}.placement.", b.joint.name);
            displacements(&mut out, Placed::Joint(j), &name, &shifts, &rotations);
            out.push(KinematicParam {
                name: format!("{}.offset", b.joint.name),
                unit: if slides { "m" } else { "rad" },
                of: Placed::Joint(j),
                kind: DisplacementKind::Offset,
                direction: axis,
            });
        }
        for (k, a) in self.appendages().iter().enumerate() {
            displacements(&mut out, Placed::Mount(k), &format!("{}.mount.", a.name), &along_axes(), &along_axes());
        }
        out
    }
    /// Index of the kinematic parameter called `name`. The component of a placement along the joint's own axis is the
    /// joint's offset: for a revolute joint about z, `joint.placement.rz` is `joint.offset` (with the axis along the
    /// negative coordinate axis, minus the offset). Allocates.
    pub fn kinematic_index(&self, name: &str) -> Option<usize> {
        let all = self.kinematic_params();
        if let Some(i) = all.iter().position(|p| p.name == name) {
            return Some(i);
        }
        let alias = |p: &KinematicParam| {
            let Placed::Joint(j) = p.of else { return false };
            let joint = &self.bodies()[j].joint;
            let turn = if joint.kind == JointKind::Prismatic { "" } else { "r" };
            p.kind == DisplacementKind::Offset
                && name == format!("{}.placement.{turn}{}", joint.name, AXES[p.direction.iamax()])
        };
        all.iter().position(alias)
    }
}

/// Adds shifts and rotations of one place.
fn displacements(
    out: &mut Vec<KinematicParam>,
    of: Placed,
    prefix: &str,
    shifts: &[(usize, Vector3<f64>)],
    rotations: &[(usize, Vector3<f64>)],
) {
    let kinds = [(DisplacementKind::Shift, "", "m", shifts), (DisplacementKind::Rotation, "r", "rad", rotations)];
    for (kind, turn, unit, directions) in kinds {
        out.extend(directions.iter().map(|&(i, direction)| KinematicParam {
            name: format!("{prefix}{turn}{}", AXES[i]),
            unit,
            of,
            kind,
            direction,
        }));
    }
}

fn unit(i: usize) -> Vector3<f64> {
    let mut e = Vector3::zeros();
    e[i] = 1.0;
    e
}

/// The coordinate axes.
fn along_axes() -> Vec<(usize, Vector3<f64>)> {
    (0..3).map(|i| (i, unit(i))).collect()
}

/// Two unit vectors perpendicular to the unit vector `u` and to each other, made of the coordinate axes but that nearest to
/// `u` (Gram-Schmidt), with the axes they are made of. Exactly the coordinate axes where `u` is one.
fn across(u: &Vector3<f64>) -> Vec<(usize, Vector3<f64>)> {
    let nearest = u.iamax();
    let mut out: Vec<(usize, Vector3<f64>)> = Vec::with_capacity(2);
    for i in (0..3).filter(|&i| i != nearest) {
        let mut e = unit(i);
        e -= u * u[i];
        if let Some((_, first)) = out.first() {
            e -= first * e.dot(first);
        }
        out.push((i, e / e.norm()));
    }
    out
}

/// The displaced placement of a joint, its offset included.
pub(crate) fn joint_pose(d: &Displacement<f64>, joint: &crate::tree::model::Joint) -> Xform<f64> {
    let mut at = d.apply(&joint.placement);
    let along = joint.axis * d.offset;
    if joint.kind == JointKind::Prismatic {
        at.pos = add(&at.pos, &mv(&at.rot, &along));
    } else if d.offset != 0.0 {
        at.rot = mm(&at.rot, &quat_to_rot(&exp_so3(&along)));
    }
    at
}
