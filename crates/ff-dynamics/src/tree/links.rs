//! Kinematic passes of the fast algorithms.
//!
//! Free-floating dynamics do not depend on the velocity of the frame they are watched from (Galilean
//! invariance), so the passes work with the *classical* acceleration `a` of each body origin and never with
//! linear velocities: with `field = [al]x + [w]x^2`, a point at `p` of a body accelerates by `a + field p`.
//! Gravity enters as an acceleration of the base frame. This is the recursive Newton-Euler form of J. Luh,
//! M. Walker, R. Paul, *On-line computational scheme for mechanical manipulators*, J. Dyn. Syst. Meas. Control
//! 102(2), 1980, in body coordinates, a fifth less work than the spatial form.

use crate::state::State;
use crate::work::buffers::PortWork;
use ff_model::by_turn;
use ff_model::scalar::ModelScalar;
use ff_model::spatial::Axis;
use ff_model::spatial::so3::quat_to_rot;
use ff_model::spatial::vec3::{M3, Moving, Pose, Ten, Turn, V3, turn};
use ff_model::tree::Mounted;
use ff_model::{Body, JointKind, Model, Motion, Params, PortAccel, PortMatrix, PortState, Scalar};
use nalgebra::{Matrix3, Vector3};

/// One body with the joint that carries it; body 0 is the base.
#[derive(Clone, Debug)]
pub(crate) struct Link<T: Scalar> {
    pub(crate) parent: usize,
    /// Last of the bodies that it carries, and the one before it that has the same parent; zero if there is none.
    pub(crate) child: usize,
    pub(crate) sibling: usize,
    prismatic: bool,
    axis: Axis,
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
    pub(crate) ic: Ten<T>,
}

fn lift<T: Scalar>(v: &[f64; 3]) -> V3<T> {
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
            ic: Ten::zero(),
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
            (true, true) => Turn::None,
            (false, true) => l.axis.about(),
            _ => Turn::General,
        };
        l.pose.turn = l.pose.turn.of::<T>();
        l.pose.p = lift(&l.origin);
        let fixed: Matrix3<T> = r.map(T::from_f64);
        l.pose.r = M3::from(&fixed);
        l
    }
    /// Pose at joint position `q`.
    #[inline(always)]
    fn place(&mut self, q: T) {
        if self.prismatic {
            let along = self.axis.add::<T, { turn::ANY }>(V3::zero(), q);
            let along = if self.pose.turn == Turn::None { along } else { self.pose.r.mul(&along) };
            self.pose.p = lift::<T>(&self.origin) + along;
        } else if T::DERIVATIVES || self.pose.turn == Turn::General {
            self.axis.turn::<T, { turn::ANY }>(q, &mut self.pose);
        } else {
            self.axis.turn::<T, { turn::X }>(q, &mut self.pose);
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
            Turn::X => self.joint_force::<{ turn::X }>(f, n),
            Turn::Y => self.joint_force::<{ turn::Y }>(f, n),
            Turn::Z => self.joint_force::<{ turn::Z }>(f, n),
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
    fn exert(&mut self, body: &Ten<T>) {
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
    fn advance<const K: u8>(&mut self, parent: &Self, qd: T, qdd: T) {
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
pub(crate) fn links<T: ModelScalar>(model: &Model) -> Vec<Link<T>> {
    let mut all: Vec<Link<T>> = std::iter::once(Link::base()).chain(model.bodies().iter().map(Link::new)).collect();
    for i in 1..all.len() {
        let parent = all[i].parent;
        all[i].sibling = std::mem::replace(&mut all[parent].child, i);
    }
    all
}

/// Poses of all bodies.
#[inline(always)]
pub(crate) fn place<T: ModelScalar>(links: &mut [Link<T>], q: &[T]) {
    for (l, &q) in links[1..].iter_mut().zip(q) {
        l.place(q);
    }
}

/// Sets the base's motion: angular velocity from the state, angular acceleration `al`, and classical
/// acceleration `a` of its origin on top of the gravity field.
#[inline(always)]
pub(crate) fn move_base<T: ModelScalar>(model: &Model, state: &State<T>, links: &mut [Link<T>], a: V3<T>, al: V3<T>) {
    let b = &mut links[0];
    b.w = if model.nb() == 6 { V3::from_slice(&state.v[3..6]) } else { V3::zero() };
    b.al = al;
    b.a = a + minus_gravity(model, state);
    b.field = M3::field(&b.w, &b.al);
}

/// Minus gravity in base coordinates.
#[inline(always)]
pub(crate) fn minus_gravity<T: ModelScalar>(model: &Model, state: &State<T>) -> V3<T> {
    let g = &model.gravity().data.0[0];
    if *g == [0.0; 3] {
        return V3::zero();
    }
    -M3::from(&quat_to_rot(&state.att)).tr_mul(&lift(g))
}

/// The part of the base's classical acceleration that its velocity makes: `w x v`, zero for a fixed base.
#[inline(always)]
pub(crate) fn transport<T: ModelScalar>(model: &Model, state: &State<T>) -> V3<T> {
    if model.nb() == 0 {
        return V3::zero();
    }
    V3::from_slice(&state.v[3..6]).cross(&V3::from_slice(&state.v[..3]))
}

/// Motion of all bodies for the generalised accelerations `a`; needs the poses.
#[inline(always)]
pub(crate) fn move_all<T: ModelScalar>(model: &Model, state: &State<T>, a: &[T], links: &mut [Link<T>]) {
    let (nb, nj) = (model.nb(), model.nj());
    accelerate_base(model, state, a, links);
    advance(links, state.qd(), &a[nb..nb + nj]);
    carry_velocities(model, state, links);
}

/// Sets the base's motion for the generalised accelerations `a`.
#[inline(always)]
pub(crate) fn accelerate_base<T: ModelScalar>(model: &Model, state: &State<T>, a: &[T], links: &mut [Link<T>]) {
    let (lin, al) = if model.nb() == 6 {
        (V3::from_slice(a) + transport(model, state), V3::from_slice(&a[3..]))
    } else {
        (V3::zero(), V3::zero())
    };
    move_base(model, state, links, lin, al);
}

/// Hands the state and the accelerations of a port to `f`; `comoving`: watched from a frame that moves with
/// the mount.
#[inline(always)]
#[allow(clippy::too_many_arguments)] // what a port is told, and by whom
pub(crate) fn port_motion<T: ModelScalar>(
    model: &Model,
    state: &State<T>,
    a: &[T],
    mounted: &Mounted,
    port: &PortWork<T>,
    host: &Link<T>,
    comoving: bool,
    f: impl FnOnce(&PortState<'_, T>, &PortAccel<'_, T>),
) {
    let c = mounted.coord_offset..mounted.coord_offset + port.n;
    let passive = model.nb() + model.nj() + c.start..model.nb() + model.nj() + c.end;
    let (w, al, acc) = at_mount(port, host);
    let (v, acc) = if comoving { (V3::zero(), acc) } else { mount_twist(port, host, &w, &acc) };
    let s =
        PortState { host: Motion { lin: v.into(), ang: w.into() }, eta: &state.eta[c], nu: &state.v[passive.clone()] };
    f(&s, &PortAccel { host: Motion { lin: acc.into(), ang: al.into() }, nu: &a[passive] });
}

/// Motion of all bodies but the base, outwards.
#[inline(always)]
pub(crate) fn advance<T: ModelScalar>(links: &mut [Link<T>], qd: &[T], qdd: &[T]) {
    for i in 1..links.len() {
        let (inner, outer) = links.split_at_mut(i);
        let l = &mut outer[0];
        by_turn!(T, l.pose.turn, K => l.advance::<K>(&inner[l.parent], qd[i - 1], qdd[i - 1]));
    }
}

/// Velocities of the body origins, as far as appendages need them: an appendage sees the true velocity of its
/// mount, because one linearised by hand (a modal appendage) may not be Galilean invariant. Needs the motion.
#[inline(always)]
pub(crate) fn carry_velocities<T: ModelScalar>(model: &Model, state: &State<T>, links: &mut [Link<T>]) {
    links[0].v = if model.nb() == 6 { V3::from_slice(&state.v[..3]) } else { V3::zero() };
    if model.appendages().iter().all(|a| a.host == 0) {
        return;
    }
    for i in 1..links.len() {
        let (inner, outer) = links.split_at_mut(i);
        let l = &mut outer[0];
        let p = &inner[l.parent];
        let carried = p.w.cross_add(&l.pose.p, &p.v);
        l.v = by_turn!(T, l.pose.turn, K => l.pose.down::<K>(&carried));
        if l.prismatic {
            l.v = l.axis.add::<T, { turn::ANY }>(l.v, state.qd()[i - 1]);
        }
    }
}

/// Velocity of a mount, and the componentwise derivative of its twist from its classical acceleration.
#[inline(always)]
fn mount_twist<T: ModelScalar>(port: &PortWork<T>, host: &Link<T>, w: &V3<T>, a: &V3<T>) -> (V3<T>, V3<T>) {
    let v = host.w.cross_add(&port.pose.p, &host.v);
    let v = if !T::DERIVATIVES && port.pose.turn == Turn::None { v } else { port.pose.r.tr_mul(&v) };
    (v, *a - w.cross(&v))
}

/// As [`advance`], and inertial wrenches of all bodies, wrenches from outside subtracted.
#[inline(always)]
pub(crate) fn drive<T: ModelScalar>(
    params: &Params<T>,
    links: &mut [Link<T>],
    qd: &[T],
    qdd: &[T],
    external: Option<&[ff_model::Force<T>]>,
) {
    // Thirty-two registers (eight lanes) hold a motion while its wrench is computed, sixteen do not: eight lanes gain 5 % by one
    // pass, four lose 7 %.
    if size_of::<T>() < 8 * size_of::<f64>() {
        advance(links, qd, qdd);
        for (i, l) in links.iter_mut().enumerate() {
            l.exert(&Ten::from(params.body(i)));
        }
    } else {
        links[0].exert(&Ten::from(params.body(0)));
        for i in 1..links.len() {
            let (inner, outer) = links.split_at_mut(i);
            let l = &mut outer[0];
            let body = Ten::from(params.body(i));
            by_turn!(T, l.pose.turn, K => {
                l.advance::<K>(&inner[l.parent], qd[i - 1], qdd[i - 1]);
                l.exert(&body);
            });
        }
    }
    for (l, x) in links.iter_mut().zip(external.unwrap_or_default()) {
        l.f -= V3::from(&x.lin);
        l.n -= V3::from(&x.ang);
    }
}

/// Carries wrenches inwards; `tau` gets the joint forces.
#[inline(always)]
pub(crate) fn gather<T: ModelScalar>(links: &mut [Link<T>], tau: &mut [T]) {
    for i in (1..links.len()).rev() {
        let (inner, outer) = links.split_at_mut(i);
        let l = &outer[0];
        let (f, n);
        (tau[i - 1], (f, n)) =
            by_turn!(T, l.pose.turn, K => (l.joint_force::<K>(&l.f, &l.n), l.pose.wrench_up::<K>(&l.f, &l.n)));
        inner[l.parent].f += f;
        inner[l.parent].n += n;
    }
}

/// Composite inertias of all bodies, ports included; needs the poses and `M` of the ports.
#[inline(always)]
pub(crate) fn compose<T: ModelScalar>(model: &Model, params: &Params<T>, links: &mut [Link<T>], ports: &[PortWork<T>]) {
    for i in (0..links.len()).rev() {
        let mut c = Ten::from(params.body(i));
        for (_, p) in model.appendages().iter().zip(ports).filter(|(a, _)| a.host == i) {
            c.add(&p.hung());
        }
        let mut j = links[i].child;
        while j > 0 {
            let l = &links[j];
            by_turn!(T, l.pose.turn, K => c.add(&l.pose.body_up::<K>(&l.ic)));
            j = l.sibling;
        }
        links[i].ic = c;
    }
}

/// Motion of the mount of a port in its host: angular velocity, angular and classical acceleration.
#[inline(always)]
pub(crate) fn at_mount<T: ModelScalar>(port: &PortWork<T>, host: &Link<T>) -> (V3<T>, V3<T>, V3<T>) {
    let (x, a) = (&port.pose, host.field.mul_add(&port.pose.p, &host.a));
    if !T::DERIVATIVES && x.turn == Turn::None {
        (host.w, host.al, a)
    } else {
        (x.r.tr_mul(&host.w), x.r.tr_mul(&host.al), x.r.tr_mul(&a))
    }
}

/// `M` and `h` of every port, and the residual
/// `r = h + M [A; 0]` at the present host accelerations; host wrenches are added to the hosts.
#[inline(always)]
pub(crate) fn port_terms<T: ModelScalar>(
    model: &Model,
    params: &Params<T>,
    state: &State<T>,
    links: &mut [Link<T>],
    ports: &mut [PortWork<T>],
) {
    for (k, (ap, p)) in model.appendages().iter().zip(ports).enumerate() {
        let n = p.n;
        let c = ap.coord_offset..ap.coord_offset + n;
        let (w, al, a) = at_mount(p, &links[ap.host]);
        let (v, a) = mount_twist(p, &links[ap.host], &w, &a);
        let s =
            PortState { host: Motion { lin: v.into(), ang: w.into() }, eta: &state.eta[c.clone()], nu: &state.nu()[c] };
        let mut m = PortMatrix::over(n, &mut p.m);
        T::port(&*ap.appendage).terms(params.appendage(model, k), &s, &mut m, &mut p.h);
        p.rest(&a, &al);
        p.press(&mut links[ap.host]);
    }
}

/// One step of a wrench towards the base: from body `i` to its parent.
#[inline(always)]
pub(crate) fn inwards<T: ModelScalar>(l: &Link<T>, f: &V3<T>, n: &V3<T>) -> (V3<T>, V3<T>) {
    by_turn!(T, l.pose.turn, K => l.pose.wrench_up::<K>(f, n))
}
