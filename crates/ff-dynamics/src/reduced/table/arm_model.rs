//! The prescribed arm at one instant, over any scalar.

use super::numbers::{ARM, Arm, FRAME, Frame, JointRow, ROW};
use super::sweep::Sweep;
use ff_model::scalar::Grad;
use ff_model::spatial::vec3::{M3, Pose, RotationKind, V3};
use ff_model::{Kinematics, Model, Params, Scalar, Xform};

/// The links of an arm and frames on them, over any scalar: numbers, dual numbers (derivatives with respect to joint
/// motion, inertial or kinematic parameters), or lanes with other links in every lane.
///
/// Joints are all those of the tree: where some follow others, their motion is that of [`ff_model::tree::Coordinates::positions`], and rows are
/// theirs.
///
/// ```
/// use ff_dynamics::reduced::ArmModel;
/// use ff_model::{BaseKind, Inertia, Joint, JointKind, Model, Params, Xform};
/// use ff_model::tree::JointLimits;
/// use nalgebra::{Matrix3, Vector3};
///
/// let body = Inertia::from_com(3.0, &Vector3::new(0.2, 0.0, 0.1), &Matrix3::identity());
/// let mut model = Model::new("one", "hull", body, BaseKind::Floating);
/// let placement = Xform::new(Matrix3::identity(), Vector3::new(0.0, 0.0, 0.5));
/// let joint = Joint {
///     name: "j1".into(),
///     kind: JointKind::Revolute,
///     axis: Vector3::z(),
///     placement,
///     limits: JointLimits::default(),
/// };
/// model.add_body(0, "link", joint, body);
/// let mut arm = ArmModel::new(&model, &Params::<f64>::nominal(&model), &[]);
/// arm.evaluate([&[0.0], &[2.0], &[0.0]]);
/// // The centre of mass 0.2 m off the axis: centripetal force 3 kg * 0.2 m * (2 rad/s)^2.
/// assert!((arm.arm().ddh.x + 2.4).abs() < 1e-12);
/// ```
#[derive(Clone, Debug)]
pub struct ArmModel<T: Scalar> {
    sweep: Sweep<T>,
    sites: Vec<(usize, Pose<T>)>,
}

impl<T: Scalar> ArmModel<T> {
    /// For the links' parameters in `params` (base and appendages play no part). `sites` are frames to follow: the body that
    /// carries each (0 is the base) and its pose in it. Allocates.
    ///
    /// # Panics
    /// If `params` belong to another model, or a body does not exist.
    pub fn new(model: &Model, params: &Params<T>, sites: &[(usize, Xform<T>)]) -> Self {
        let pose = |(host, x): &(usize, Xform<T>)| {
            assert!(*host < model.n_bodies(), "body {host} does not exist");
            let mut pose = Pose::identity();
            (pose.turn, pose.r, pose.p) = (RotationKind::General, M3::from(&x.rot), V3::from(&x.pos));
            (*host, pose)
        };
        Self { sweep: Sweep::new(model, params), sites: sites.iter().map(pose).collect() }
    }
    /// With the joints displaced. Mounts are sites: displace those with [`ff_model::tree::Displacement::apply`]. Allocates.
    ///
    /// # Panics
    /// If `by` belongs to another model.
    #[must_use]
    pub fn displaced(self, by: &Kinematics<T>) -> Self {
        Self { sweep: self.sweep.displaced(by), sites: self.sites }
    }
    /// Number of joints of the tree.
    pub fn joints(&self) -> usize {
        self.sweep.joints()
    }
    /// Evaluates the arm for joint positions, rates and accelerations (rad or m, s). Does not allocate.
    ///
    /// # Panics
    /// If one of them is shorter than the number of joints.
    pub fn evaluate(&mut self, [q, qd, qdd]: [&[T]; 3]) {
        self.sweep.outwards(q, qd, qdd);
        for i in (1..=self.joints()).rev() {
            self.sweep.inwards(i);
        }
    }
    /// What the base feels of all links, after [`ArmModel::evaluate`].
    pub fn arm(&self) -> Arm<T> {
        self.sweep.arm()
    }
    /// Frame `i` of the sites, after [`ArmModel::evaluate`].
    ///
    /// # Panics
    /// If there is no such site.
    pub fn frame(&self, i: usize) -> Frame<T> {
        let (host, pose) = &self.sites[i];
        self.sweep.frame(*host, pose)
    }
    /// Row of joint `j`, after [`ArmModel::evaluate`].
    ///
    /// # Panics
    /// If there is no such joint.
    pub fn row(&self, j: usize) -> JointRow<T> {
        JointRow::from_slice(&self.sweep.row(j + 1))
    }
    /// Length of [`ArmModel::numbers`].
    pub fn len(&self, rows: bool) -> usize {
        self.row_at(if rows { self.joints() } else { 0 })
    }
    /// Where the numbers of site `i` begin in [`ArmModel::numbers`].
    pub fn frame_at(&self, i: usize) -> usize {
        ARM + FRAME * i
    }
    /// Where the numbers of the row of joint `j` begin in [`ArmModel::numbers`].
    pub fn row_at(&self, j: usize) -> usize {
        ARM + FRAME * self.sites.len() + ROW * j
    }
    /// Evaluates the arm and fills `out` with all its numbers: of the arm, of every site and, with `rows`, of every joint's
    /// row ([`Arm::from_slice`], [`Frame::from_slice`], [`JointRow::from_slice`]). Allocates where `out` has no room.
    ///
    /// # Panics
    /// As [`ArmModel::evaluate`].
    pub fn numbers(&mut self, joints: [&[T]; 3], rows: bool, out: &mut Vec<T>) {
        self.evaluate(joints);
        out.clear();
        out.extend(self.arm().numbers());
        for i in 0..self.sites.len() {
            out.extend(self.frame(i).numbers());
        }
        if rows {
            for j in 0..self.joints() {
                out.extend(self.sweep.row(j + 1));
            }
        }
    }
}

impl ArmModel<Grad> {
    /// Adds to `gradient`, over `[q, qd, qdd]`, that of `weights . numbers` ([`ArmModel::numbers`]). Allocates.
    ///
    /// # Panics
    /// If a slice is shorter than the number of joints, or `weights` has not [`ArmModel::len`] numbers.
    pub fn pull_back(&mut self, joints: [&[f64]; 3], rows: bool, weights: &[f64], gradient: [&mut [f64]; 3]) {
        const CHUNK: usize = ff_model::scalar::DIRECTIONS;
        let n = self.joints();
        assert_eq!(weights.len(), self.len(rows), "one weight per number");
        let mut x: Vec<Grad> = joints.iter().flat_map(|x| &x[..n]).map(|&x| Grad::constant(x)).collect();
        let mut out = Vec::with_capacity(weights.len());
        for first in (0..3 * n).step_by(CHUNK) {
            let count = CHUNK.min(3 * n - first);
            for k in 0..count {
                x[first + k].eps[k] = 1.0;
            }
            self.numbers([&x[..n], &x[n..2 * n], &x[2 * n..]], rows, &mut out);
            for k in 0..count {
                x[first + k].eps[k] = 0.0;
                let slope: f64 = out.iter().zip(weights).map(|(o, w)| w * o.eps[k]).sum();
                gradient[(first + k) / n][(first + k) % n] += slope;
            }
        }
    }
}
