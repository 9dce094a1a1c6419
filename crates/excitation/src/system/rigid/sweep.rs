//! One sample of the arm: screws, subtrees, base twist and acceleration.

use super::RigidBase;
use ff_model::tree::JointCoordinate;
use ff_model::{Force, Inertia, JointKind, Motion, Xform};
use nalgebra::{Cholesky, Const, Matrix3, Rotation3, Unit, Vector3};

/// Joint `l` with what it carries, in base coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Link {
    /// Index of the joint that carries this one; `None` on the base.
    pub(super) parent: Option<usize>,
    /// The coordinate that moves it.
    pub(super) of: JointCoordinate,
    /// `S_l` and its rate.
    pub(super) screw: Motion<f64>,
    d_screw: Motion<f64>,
    /// Twist of the carrying body relative to the base, and its rate.
    carried: Motion<f64>,
    d_carried: Motion<f64>,
    /// Subtree: inertia, momentum relative to the base, and their rates.
    pub(super) inertia: Inertia<f64>,
    d_inertia: Inertia<f64>,
    h: Force<f64>,
    dh: Force<f64>,
    /// `F_l = I_l S_l`.
    pub(super) momentum: Force<f64>,
    /// `n_l = -I^-1 F_l`: base twist per unit of joint rate.
    pub(super) basis: Motion<f64>,
}

/// The arm at one sample.
#[derive(Clone, Debug)]
pub(super) struct Arm {
    pub(super) links: Vec<Link>,
    /// Factorised composite inertia of everything, and its rate.
    total: Cholesky<f64, Const<6>>,
    pub(super) d_inertia: Inertia<f64>,
    /// `V` and `A`.
    pub(super) twist: Motion<f64>,
    pub(super) accel: Motion<f64>,
}

impl Arm {
    /// `None` when the composite inertia is not positive definite. Allocates the links.
    ///
    /// # Panics
    /// If a slice has the wrong length.
    pub(super) fn new(robot: &RigidBase, q: &[f64], qd: &[f64], qdd: &[f64]) -> Option<Self> {
        let n = robot.model.nj();
        assert!(q.len() == n && qd.len() == n && qdd.len() == n, "joint positions, rates, accelerations");
        let n = robot.model.n_joints();
        // Pose, relative twist and its rate of every body; the base does not move against itself.
        let mut poses = vec![(Xform::identity(), Motion::zero(), Motion::zero()); n + 1];
        let mut links: Vec<Link> = Vec::with_capacity(n);
        for (l, b) in robot.model.bodies().iter().enumerate() {
            let (x, carried, d_carried) = poses[b.parent];
            let (joint, axis) = (&b.joint, b.joint.axis);
            let of = robot.model.coordinate(l);
            let (m, k) = (of.multiplier, of.index);
            let (q, qd, qdd) = (m * q[k] + of.offset, m * qd[k], m * qdd[k]);
            let (moved, local) = match joint.kind {
                JointKind::Prismatic => {
                    (Xform::new(Matrix3::identity(), axis * q), Motion::new(axis, Vector3::zeros()))
                }
                _ => {
                    let turn = Rotation3::from_axis_angle(&Unit::new_unchecked(axis), q);
                    (Xform::new(turn.into_inner(), Vector3::zeros()), Motion::new(Vector3::zeros(), axis))
                }
            };
            let x = x * joint.placement * moved;
            let screw = x.motion_to_parent(&local);
            let d_screw = carried.cross(&screw);
            let s = carried + screw.scaled(qd);
            let ds = d_carried + screw.scaled(qdd) + d_screw.scaled(qd);
            poses[l + 1] = (x, s, ds);
            let inertia = robot.inertias[l + 1].to_parent(&x);
            let d_inertia = inertia.rate(&s);
            links.push(Link {
                parent: b.parent.checked_sub(1),
                of,
                screw,
                d_screw,
                carried,
                d_carried,
                inertia,
                d_inertia,
                h: inertia.mul_motion(&s),
                dh: d_inertia.mul_motion(&s) + inertia.mul_motion(&ds),
                momentum: Force::zero(),
                basis: Motion::zero(),
            });
        }
        let (mut all, mut d_all) = (robot.inertias[0], Inertia::zero());
        let (mut h, mut dh) = (Force::zero(), Force::zero());
        for l in (0..n).rev() {
            let c = links[l];
            links[l].momentum = c.inertia.mul_motion(&c.screw);
            if let Some(p) = c.parent {
                links[p].inertia += c.inertia;
                links[p].d_inertia += c.d_inertia;
                links[p].h += c.h;
                links[p].dh += c.dh;
            } else {
                all += c.inertia;
                d_all += c.d_inertia;
                h += c.h;
                dh += c.dh;
            }
        }
        let total = all.to_matrix().cholesky()?;
        let zero = Motion::zero();
        let mut arm = Self { links, total, d_inertia: d_all, twist: zero, accel: zero };
        arm.twist = -arm.solve(&h);
        arm.accel = -arm.solve(&(d_all.mul_motion(&arm.twist) + dh));
        for l in 0..n {
            arm.links[l].basis = -arm.solve(&arm.links[l].momentum);
        }
        Some(arm)
    }
    /// `I^-1 f`.
    pub(super) fn solve(&self, f: &Force<f64>) -> Motion<f64> {
        Motion::from_slice(self.total.solve(&f.to_vector()).as_slice())
    }
    /// `g_l` and `g_l'` (module documentation of [`super`]).
    pub(super) fn displaced(&self, k: &Link) -> (Force<f64>, Force<f64>) {
        let (v, a) = (&self.twist, &self.accel);
        let p = k.inertia.mul_motion(v) + k.h;
        let dp = k.d_inertia.mul_motion(v) + k.inertia.mul_motion(a) + k.dh;
        let (w, dw) = (*v + k.carried, *a + k.d_carried);
        let shift = k.screw.cross(&w);
        let d_shift = k.d_screw.cross(&w) + k.screw.cross(&dw);
        (
            k.screw.cross_force(&p) - k.inertia.mul_motion(&shift),
            k.d_screw.cross_force(&p) + k.screw.cross_force(&dp)
                - k.d_inertia.mul_motion(&shift)
                - k.inertia.mul_motion(&d_shift),
        )
    }
    /// `-I n_l' = I' n_l + F_l'`, `F_l' = I_l' S_l + I_l S_l'`.
    pub(super) fn basis_rate(&self, k: &Link) -> Force<f64> {
        self.d_inertia.mul_motion(&k.basis) + k.d_inertia.mul_motion(&k.screw) + k.inertia.mul_motion(&k.d_screw)
    }
    /// True when joint `l` is joint `j` or lies between it and the base.
    pub(super) fn carries(&self, l: usize, j: usize) -> bool {
        let mut at = Some(j);
        while let Some(i) = at {
            if i == l {
                return true;
            }
            at = self.links[i].parent;
        }
        false
    }
}

impl Link {
    /// `a . (dI/dq_l b)` for the composite inertia of anything that contains the subtree:
    /// `dI/dq_l = S_l x* I_l - I_l S_l x`.
    pub(super) fn turned(&self, a: &Motion<f64>, b: &Motion<f64>) -> f64 {
        -self.screw.cross(a).dot(&self.inertia.mul_motion(b)) - self.screw.cross(b).dot(&self.inertia.mul_motion(a))
    }
}
