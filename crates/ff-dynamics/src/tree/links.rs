//! Kinematic passes of the fast algorithms.
//!
//! Free-floating dynamics do not depend on the velocity of the frame they are watched from (Galilean
//! invariance), so the passes work with the *classical* acceleration `a` of each body origin and never with
//! linear velocities: with `field = [al]x + [w]x^2`, a point at `p` of a body accelerates by `a + field p`.
//! Gravity enters as an acceleration of the base frame. This is the recursive Newton-Euler form of J. Luh,
//! M. Walker, R. Paul, *On-line computational scheme for mechanical manipulators*, J. Dyn. Syst. Meas. Control
//! 102(2), 1980, in body coordinates, a fifth less work than the spatial form.

use crate::state::State;
use crate::work::link::{Link, lift};
use crate::work::port_work::PortWork;
use ff_model::dispatch_rotation;
use ff_model::scalar::ModelScalar;
use ff_model::spatial::so3::quat_to_rot;
use ff_model::spatial::vec3::{M3, PackedInertia, RotationKind, V3, turn};
use ff_model::tree::Mounted;
use ff_model::{Model, Motion, Params, PortAccel, PortMatrix, PortState};

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
        dispatch_rotation!(T, l.pose.turn, K => l.advance::<K>(&inner[l.parent], qd[i - 1], qdd[i - 1]));
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
        l.v = dispatch_rotation!(T, l.pose.turn, K => l.pose.down::<K>(&carried));
        if l.prismatic {
            l.v = l.axis.add::<T, { turn::ANY }>(l.v, state.qd()[i - 1]);
        }
    }
}

/// Velocity of a mount, and the componentwise derivative of its twist from its classical acceleration.
#[inline(always)]
fn mount_twist<T: ModelScalar>(port: &PortWork<T>, host: &Link<T>, w: &V3<T>, a: &V3<T>) -> (V3<T>, V3<T>) {
    let v = host.w.cross_add(&port.pose.p, &host.v);
    let v = if !T::DERIVATIVES && port.pose.turn == RotationKind::None { v } else { port.pose.r.tr_mul(&v) };
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
            l.exert(&PackedInertia::from(params.body(i)));
        }
    } else {
        links[0].exert(&PackedInertia::from(params.body(0)));
        for i in 1..links.len() {
            let (inner, outer) = links.split_at_mut(i);
            let l = &mut outer[0];
            let body = PackedInertia::from(params.body(i));
            dispatch_rotation!(T, l.pose.turn, K => {
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
        (tau[i - 1], (f, n)) = dispatch_rotation!(T, l.pose.turn, K => (l.joint_force::<K>(&l.f, &l.n), l.pose.wrench_up::<K>(&l.f, &l.n)));
        inner[l.parent].f += f;
        inner[l.parent].n += n;
    }
}

/// Composite inertias of all bodies, ports included; needs the poses and `M` of the ports.
#[inline(always)]
pub(crate) fn compose<T: ModelScalar>(model: &Model, params: &Params<T>, links: &mut [Link<T>], ports: &[PortWork<T>]) {
    for i in (0..links.len()).rev() {
        let mut c = PackedInertia::from(params.body(i));
        for (_, p) in model.appendages().iter().zip(ports).filter(|(a, _)| a.host == i) {
            c.add(&p.hung());
        }
        let mut j = links[i].child;
        while j > 0 {
            let l = &links[j];
            dispatch_rotation!(T, l.pose.turn, K => c.add(&l.pose.body_up::<K>(&l.ic)));
            j = l.sibling;
        }
        links[i].ic = c;
    }
}

/// Motion of the mount of a port in its host: angular velocity, angular and classical acceleration.
#[inline(always)]
pub(crate) fn at_mount<T: ModelScalar>(port: &PortWork<T>, host: &Link<T>) -> (V3<T>, V3<T>, V3<T>) {
    let (x, a) = (&port.pose, host.field.mul_add(&port.pose.p, &host.a));
    if !T::DERIVATIVES && x.turn == RotationKind::None {
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
    dispatch_rotation!(T, l.pose.turn, K => l.pose.wrench_up::<K>(f, n))
}
