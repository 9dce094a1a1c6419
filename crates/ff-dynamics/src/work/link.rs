//! A body with the joint that carries it, as the fast passes hold it.

use ff_model::spatial::Axis;
use ff_model::spatial::vec3::{M3, Moving, PackedInertia, Pose, RotationKind, V3, turn};
use ff_model::{Body, JointKind, Model, Scalar};
use nalgebra::{Matrix3, Vector3};

/// One body with the joint that carries it; body 0 is the base.
#[derive(Clone, Debug)]
pub(crate) struct Link<T: Scalar> {
    pub(crate) parent: usize,
    /// Last of the bodies that it carries, and the one before it that has the same parent; zero if there is none.
    pub(crate) child: usize,
    pub(crate) sibling: usize,
    pub(crate) prismatic: bool,
    pub(crate) axis: Axis,
    origin: [f64; 3],
    /// Pose in the parent.
    pub(crate) pose: Pose<T>,
    /// Velocity of the origin; kept only where appendages hang on links ([`carry_velocities`]).
    pub(crate) v: V3<T>,
    /// Angular velocity and acceleration, classical acceleration of the origin, and their field.
    pub(crate) w: V3<T>,
    pub(crate) al: V3<T>,
    pub(crate) a: V3<T>,
    pub(crate) field: M3<T>,
    /// Force, and moment about the origin.
    pub(crate) f: V3<T>,
    pub(crate) n: V3<T>,
    /// Composite inertia.
    pub(crate) ic: PackedInertia<T>,
}

#[inline(always)]
pub(crate) fn lift<T: Scalar>(v: &[f64; 3]) -> V3<T> {
    V3::new(T::from_f64(v[0]), T::from_f64(v[1]), T::from_f64(v[2]))
}

impl<T: Scalar> Link<T> {
    pub(crate) fn base() -> Self {
        Self {
            parent: 0,
            child: 0,
            sibling: 0,
            prismatic: false,
            axis: Axis::new(&Vector3::z(), &Matrix3::identity()),
            origin: [0.0; 3],
            pose: Pose::identity(),
            v: V3::zero(),
            w: V3::zero(),
            al: V3::zero(),
            a: V3::zero(),
            field: M3::zero(),
            f: V3::zero(),
            n: V3::zero(),
            ic: PackedInertia::zero(),
        }
    }
    pub(crate) fn new(body: &Body) -> Self {
        let (j, mut l) = (&body.joint, Self::base());
        l.parent = body.parent;
        l.prismatic = j.kind == JointKind::Prismatic;
        l.origin = j.placement.pos.into();
        let r = j.placement.rot;
        l.axis = Axis::new(&j.axis, &r);
        let straight = r == Matrix3::identity();
        l.pose.turn = match (l.prismatic, straight) {
            (true, true) => RotationKind::None,
            (false, true) => l.axis.about(),
            _ => RotationKind::General,
        };
        l.pose.turn = l.pose.turn.of::<T>();
        l.pose.p = lift(&l.origin);
        let fixed: Matrix3<T> = r.map(T::from_f64);
        l.pose.r = M3::from(&fixed);
        l
    }
    /// Pose at joint position `q`.
    #[inline(always)]
    pub(crate) fn place(&mut self, q: T) {
        if self.prismatic {
            let along = self.axis.add::<T, { turn::ANY }>(V3::zero(), q);
            let along = if self.pose.turn == RotationKind::None { along } else { self.pose.r.mul(&along) };
            self.pose.p = lift::<T>(&self.origin) + along;
        } else if T::DERIVATIVES || self.pose.turn == RotationKind::General {
            self.axis.turn::<T, { turn::ANY }>(q, &mut self.pose);
        } else {
            self.axis.turn::<T, { turn::X }>(q, &mut self.pose);
        }
    }
    /// Displaces the placement of the joint: `R = E R0`, `p = p0 + shift`, before any [`Link::place_displaced`].
    pub(crate) fn displace(&mut self, turn: &M3<T>, shift: &V3<T>) {
        self.pose.turn = RotationKind::General;
        self.pose.r = M3([turn.mul(&self.pose.r.0[0]), turn.mul(&self.pose.r.0[1]), turn.mul(&self.pose.r.0[2])]);
        self.pose.p += *shift;
    }
    /// [`Link::place`] of a joint with this displaced placement.
    #[inline(always)]
    pub(crate) fn place_displaced(&mut self, q: T, turn: &M3<T>, shift: &V3<T>) {
        self.place(q);
        // A turning joint has a new rotation and keeps its origin, a sliding one the reverse.
        if self.prismatic {
            self.pose.p += *shift;
        } else {
            let [x, y, z] = self.pose.r.0;
            self.pose.r = M3([turn.mul(&x), turn.mul(&y), turn.mul(&z)]);
        }
    }
    /// Joint force of a wrench on the body.
    #[inline(always)]
    pub(crate) fn joint_force<const K: u8>(&self, f: &V3<T>, n: &V3<T>) -> T {
        self.axis.along::<T, K>(if K != turn::ANY && K != turn::NONE || !self.prismatic { n } else { f })
    }
    /// [`Link::joint_force`] of a joint that was not asked what it is.
    #[inline(always)]
    pub(crate) fn force_of(&self, f: &V3<T>, n: &V3<T>) -> T {
        match self.pose.turn {
            _ if T::DERIVATIVES => self.joint_force::<{ turn::ANY }>(f, n),
            RotationKind::X => self.joint_force::<{ turn::X }>(f, n),
            RotationKind::Y => self.joint_force::<{ turn::Y }>(f, n),
            RotationKind::Z => self.joint_force::<{ turn::Z }>(f, n),
            _ => self.joint_force::<{ turn::ANY }>(f, n),
        }
    }
    /// Takes over an acceleration field of the parent that leaves velocities alone, and returns the joint force
    /// of the composite inertia in it.
    #[inline(always)]
    pub(crate) fn lean<const K: u8>(&mut self, parent: &Self) -> T {
        self.a = self.pose.down::<K>(&parent.al.cross_add(&self.pose.p, &parent.a));
        self.al = self.pose.down::<K>(&parent.al);
        let f = self.al.cross_add(&self.ic.h, &self.a.scaled(self.ic.m));
        self.joint_force::<K>(&f, &self.ic.i.mul_add(&self.al, &self.ic.h.cross(&self.a)))
    }
    /// Sets the wrench to what the motion of a body takes.
    #[inline(always)]
    pub(crate) fn exert(&mut self, body: &PackedInertia<T>) {
        (self.f, self.n) = body.wrench(&self.w, &self.al, &self.a, &self.field);
    }
    /// How the body moves.
    #[inline(always)]
    pub(crate) fn moving(&self) -> Moving<T> {
        Moving { w: self.w, al: self.al, a: self.a, field: self.field }
    }
    /// Joint screw in the body frame: linear and angular part.
    #[inline(always)]
    pub(crate) fn screw(&self) -> (V3<T>, V3<T>) {
        let u = self.axis.add::<T, { turn::ANY }>(V3::zero(), T::one());
        if self.prismatic { (u, V3::zero()) } else { (V3::zero(), u) }
    }
    /// Momentum of the composite inertia per unit joint rate: `Ic S`.
    #[inline(always)]
    pub(crate) fn axis_momentum<const K: u8>(&self) -> (V3<T>, V3<T>) {
        let (h, i) = (&self.ic.h, &self.ic.i);
        if K != turn::X && K != turn::Y && K != turn::Z && self.prismatic {
            let u = self.axis.add::<T, K>(V3::zero(), T::one());
            (u.scaled(self.ic.m), h.cross(&u))
        } else {
            self.axis.momentum::<T, K>(h, i)
        }
    }
    /// Angular velocity and accelerations from those of the parent, for joint rate and acceleration.
    #[inline(always)]
    pub(crate) fn advance<const K: u8>(&mut self, parent: &Self, qd: T, qdd: T) {
        let w = self.pose.down::<K>(&parent.w);
        let al = self.pose.down::<K>(&parent.al);
        let a = self.pose.down::<K>(&parent.field.mul_add(&self.pose.p, &parent.a));
        if K != turn::X && K != turn::Y && K != turn::Z && self.prismatic {
            let carried = self.axis.cross_add::<T, K>(&w, qd.scale(2.0), a);
            (self.w, self.al, self.a) = (w, al, self.axis.add::<T, K>(carried, qdd));
        } else {
            let carried = self.axis.cross_add::<T, K>(&w, qd, al);
            (self.w, self.al, self.a) = (self.axis.add::<T, K>(w, qd), self.axis.add::<T, K>(carried, qdd), a);
        }
        self.field = M3::field(&self.w, &self.al);
    }
}

/// The base and all bodies of a model. Allocates.
pub(crate) fn links<T: Scalar>(model: &Model) -> Vec<Link<T>> {
    let mut all: Vec<Link<T>> = std::iter::once(Link::base()).chain(model.bodies().iter().map(Link::new)).collect();
    for i in 1..all.len() {
        let parent = all[i].parent;
        all[i].sibling = std::mem::replace(&mut all[parent].child, i);
    }
    all
}
