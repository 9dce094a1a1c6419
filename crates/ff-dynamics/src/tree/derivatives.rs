//! Derivatives of inverse dynamics with respect to positions and velocities.
//!
//! Everything is written in the axes of the base, about its origin, from a frame that moves with the base's
//! linear velocity. With `S` the screw of a joint, `v`, `a` the spatial velocity and acceleration of the body it
//! hangs on, `psi' = v x S`, `psi'' = a x S + v x psi'`, and composite quantities `I`, `f` and `B` of what it
//! carries (S. Singh, R. Russell, P. Wensing, *Efficient analytical derivatives of rigid-body dynamics using
//! spatial vector algebra*, IEEE RA-L 7(2), 2022, eqs. (22) to (26)):
//!
//! ```text
//! d tau_j / d q_i  = S_j . (2 B_i psi'_i + I_i psi''_i + S_i x* f_i)      j an ancestor of i
//! d tau_i / d q_j  = S_i . (2 B_i psi'_j + I_i psi''_j)
//! d tau_j / d qd_i = S_j . 2 (B_i S_i + I_i psi'_i)
//! d tau_i / d qd_j = S_i . 2 (B_i S_j + I_i psi'_j)
//! ```
//!
//! For a rigid body `2 B = v x* I - I v x + (I v) x~*` has no linear columns: it maps an angular velocity `x` to
//! the force `2 x x p` (`p` the linear momentum) and the moment `D x`, `D = 2 [w] I - tr(I) [w] - 2 [h][u]`, twelve
//! numbers. An appendage has the same form, with `D` from [`ff_model::PortDynamics::jacobian`]: `2 B = dh/dV - M V x`
//! and Galilean invariance, which an appendage linearised by hand (`modal`) has only at rest.
//! `docs/theory/derivatives.md` derives it.

use crate::state::State;
use crate::tree::links as tree;
use crate::work::buffers::Work;
pub use crate::work::derivative_matrices::Derivatives;
use crate::work::link::Link;
use crate::work::node::{Node, Screw};
use crate::work::port_work::PortWork;
use ff_lanes::Kernel;
use ff_model::dispatch_rotation;
use ff_model::scalar::LaneScalar;
use ff_model::spatial::vec3::{M3, PackedInertia, Pose, RotationKind, V3, turn};
use ff_model::{Model, Params, PortMatrix, Scalar};
use nalgebra::DMatrix;

/// `a x b` of motions.
#[inline(always)]
fn cross<T: Scalar>(a: &Screw<T>, b: &Screw<T>) -> Screw<T> {
    (a.1.cross_add(&b.0, &a.0.cross(&b.1)), a.1.cross(&b.1))
}

#[inline(always)]
fn dot<T: Scalar>(a: &Screw<T>, b: &Screw<T>) -> T {
    a.0.dot(&b.0) + a.1.dot(&b.1)
}

#[inline(always)]
fn unit<T: Scalar>(k: usize) -> V3<T> {
    let mut e = [T::zero(); 3];
    e[k] = T::one();
    V3::from_slice(&e)
}

/// `R R_pose` by columns.
#[inline(always)]
pub(crate) fn turned_by<T: Scalar>(r: &M3<T>, x: &Pose<T>) -> M3<T> {
    dispatch_rotation!(T, x.turn, K => turned::<T, K>(r, x))
}

#[inline(always)]
fn turned<T: Scalar, const K: u8>(r: &M3<T>, x: &Pose<T>) -> M3<T> {
    let [a, b, c] = r.0;
    let (co, s) = (x.c, x.s);
    match K {
        turn::NONE => *r,
        turn::X => {
            let (b, c) = mix(b, c, co, s);
            M3([a, b, c])
        }
        turn::Y => {
            let (c, a) = mix(c, a, co, s);
            M3([a, b, c])
        }
        turn::Z => {
            let (a, b) = mix(a, b, co, s);
            M3([a, b, c])
        }
        _ => M3([r.mul(&x.r.0[0]), r.mul(&x.r.0[1]), r.mul(&x.r.0[2])]),
    }
}

/// Two columns turned in their plane. A function, for a closure in lanes is not inlined, and each of its operations becomes a call.
#[inline(always)]
fn mix<T: Scalar>(p: V3<T>, q: V3<T>, co: T, s: T) -> (V3<T>, V3<T>) {
    (q.scale_add(s, &p.scaled(co)), q.scaled(co) - p.scaled(s))
}

/// Derivatives of [`crate::tree::rnea::rnea()`] at the motion `(state, a)`. Does not allocate.
///
/// # Panics
/// If a shape is wrong.
pub fn rnea_derivatives<T: LaneScalar>(
    model: &Model,
    params: &Params<T>,
    state: &State<T>,
    a: &[T],
    work: &mut Work<T>,
    out: &mut Derivatives<T>,
) {
    let nv = model.nv();
    assert_eq!(a.len(), nv, "acceleration length");
    for m in [&out.dq, &out.dv, &out.da] {
        assert_eq!(m.shape(), (nv, nv), "derivative shape");
    }
    let folded = work.over_tree(|work, c| {
        c.set(model, state);
        c.accelerate(a);
        rnea_derivatives(&c.tree, params, &c.state, &c.a, work, &mut c.derivatives);
        c.both(&c.derivatives.dq, &mut out.dq);
        c.both(&c.derivatives.dv, &mut out.dv);
        c.both(&c.derivatives.da, &mut out.da);
    });
    if folded.is_some() {
        return;
    }
    let Derivatives { dq, dv, da } = out;
    let (dq, dv, da) = (dq.as_mut_slice(), dv.as_mut_slice(), da.as_mut_slice());
    T::enter(Run { model, params, state, a, work, dq, dv, da });
}

struct Run<'a, T: LaneScalar> {
    model: &'a Model,
    params: &'a Params<T>,
    state: &'a State<T>,
    a: &'a [T],
    work: &'a mut Work<T>,
    dq: &'a mut [T],
    dv: &'a mut [T],
    da: &'a mut [T],
}

/// What a degree of freedom exerts and feels: `t1 = I S`, the columns for its own position and rate, and the row
/// `t4` with which it feels angular velocities.
struct Own<T> {
    t1: Screw<T>,
    t2: Screw<T>,
    t3: Screw<T>,
    t4: V3<T>,
}

impl<T: LaneScalar> Kernel for Run<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { model, params, state, a, work, dq, dv, da } = self;
        let (nb, nj, nv) = (model.nb(), model.nj(), model.nv());
        for m in [&mut *dq, &mut *dv, &mut *da] {
            for x in m.iter_mut() {
                *x = T::zero();
            }
        }
        let links = &mut work.links[..];
        let nodes = &mut work.nodes[..];
        tree::place(links, &state.q);
        tree::move_all(model, state, a, links);
        outwards(state.qd(), &a[nb..nb + nj], links, nodes);
        bodies(params, nodes, work.has_external.then_some(&work.external[..]));
        for (k, (ap, port)) in model.appendages().iter().zip(&mut work.ports).enumerate() {
            let (mut m, mut r, mut d) = (take(&mut port.m), take(&mut port.r), take(&mut port.d));
            tree::port_motion(model, state, a, ap, port, &links[ap.host], true, |s, acc| {
                let p = params.appendage(model, k);
                let mut mass = PortMatrix::over(port.n, &mut m);
                T::port(&*ap.appendage).terms(p, s, &mut mass, &mut r);
                ff_model::port::add_inertial(&mass, acc, &mut r);
                T::tangent(&*ap.appendage).jacobian(p, s, acc, &mut d);
            });
            (port.m, port.r, port.d) = (m, r, d);
            let (w, nu) = (tree::at_mount(port, &links[ap.host]).0, state.nu());
            hang(port, &w, &nu[ap.coord_offset..ap.coord_offset + port.n], &mut nodes[ap.host]);
        }
        for i in (1..links.len()).rev() {
            let (inner, outer) = nodes.split_at_mut(i);
            inner[links[i].parent].add(&outer[0]);
        }
        let ground = Ground {
            w: links[0].w,
            v: if nb == 6 { V3::from_slice(&state.v) } else { V3::zero() },
            g: tree::minus_gravity(model, state),
        };
        let mut out = Out { nb, nv, dq, dv, da };
        if nb == 6 {
            out.base(&nodes[0], &ground);
        }
        for i in 1..links.len() {
            let x = &nodes[i];
            let (t1, i1) = (x.ic.momentum(&x.s.0, &x.s.1), x.ic.momentum(&x.psi.0, &x.psi.1));
            let (b0, b1) = (x.turning(&x.s.1), x.turning(&x.psi.1));
            let i2 = x.ic.momentum(&x.psi2.0, &x.psi2.1);
            let two = T::from_f64(2.0);
            let own = Own {
                t1,
                t2: (i1.0.scale_add(two, &b0.0), i1.1.scale_add(two, &b0.1)),
                t3: (b1.0 + i2.0 + x.s.1.cross(&x.f), b1.1 + i2.1 + x.s.1.cross_add(&x.n, &x.s.0.cross(&x.f))),
                t4: x.d.tr_mul(&x.s.1) + x.p.cross(&x.s.0).scaled(two),
            };
            let dof = nb + i - 1;
            out.set(dof, dof, dot(&x.s, &own.t3), dot(&x.s, &own.t2), dot(&x.s, &own.t1));
            out.column(dof, &own);
            out.row(dof, &own.t1, &own.t4, &ground);
            let mut j = links[i].parent;
            while j > 0 {
                out.pair(nb + j - 1, dof, &nodes[j], &own);
                j = links[j].parent;
            }
        }
        for (ap, port) in model.appendages().iter().zip(&work.ports) {
            let (n, dim) = (port.n, 6 + port.n);
            let first = nb + nj + ap.coord_offset;
            let host = &nodes[ap.host];
            let mount = mounted(port, &host.pose);
            let u = host.w.cross_add(&mount.p, &host.u);
            let w = tree::at_mount(port, &links[ap.host]).0;
            for k in 0..n {
                let (pull, row) = (port.mass().coupling(k), 6 + k);
                let feel = V3::new(port.d[row], port.d[dim + row], port.d[2 * dim + row]) - pull.1.cross(&w);
                let t1 = mount.wrench_up::<{ turn::ANY }>(&pull.0, &pull.1);
                let t4 = mount.r.mul(&feel) + u.cross(&t1.0).scaled(T::from_f64(2.0));
                let eta = &port.d[(3 + k) * dim..][..dim];
                let nu = &port.d[(3 + n + k) * dim..][..dim];
                let own = Own { t1, t2: up(&mount, nu), t3: up(&mount, eta), t4 };
                for l in 0..n {
                    out.set(first + l, first + k, eta[6 + l], nu[6 + l], port.mass().own(l, k));
                }
                out.column(first + k, &own);
                out.row(first + k, &own.t1, &own.t4, &ground);
                let mut j = ap.host;
                while j > 0 {
                    out.pair(nb + j - 1, first + k, &nodes[j], &own);
                    j = links[j].parent;
                }
            }
        }
    }
}

fn take<T>(v: &mut Vec<T>) -> Vec<T> {
    std::mem::take(v)
}

/// The first six numbers of `c`, a wrench of the mount frame, in the base.
#[inline(always)]
fn up<T: Scalar>(mount: &Pose<T>, c: &[T]) -> Screw<T> {
    mount.wrench_up::<{ turn::ANY }>(&V3::from_slice(c), &V3::from_slice(&c[3..]))
}

/// Velocity and gravity of the base, which enter after the rest.
struct Ground<T> {
    w: V3<T>,
    v: V3<T>,
    g: V3<T>,
}

/// The three matrices by columns.
struct Out<'a, T> {
    nb: usize,
    nv: usize,
    dq: &'a mut [T],
    dv: &'a mut [T],
    da: &'a mut [T],
}

impl<T: Scalar> Out<'_, T> {
    #[inline(always)]
    fn set(&mut self, i: usize, j: usize, q: T, v: T, a: T) {
        let at = j * self.nv + i;
        (self.dq[at], self.dv[at], self.da[at]) = (q, v, a);
    }
    /// Base rows of a column.
    #[inline(always)]
    fn column(&mut self, j: usize, own: &Own<T>) {
        if self.nb == 6 {
            let at = j * self.nv..j * self.nv + 6;
            for (m, t) in [(&mut *self.dq, &own.t3), (&mut *self.dv, &own.t2), (&mut *self.da, &own.t1)] {
                let m = &mut m[at.clone()];
                t.0.write_to(m);
                t.1.write_to(&mut m[3..]);
            }
        }
    }
    /// Base columns of a row: the base turns with `w` and is carried along with `v`, gravity turns against it.
    #[inline(always)]
    fn row(&mut self, i: usize, t1: &Screw<T>, t4: &V3<T>, g: &Ground<T>) {
        if self.nb == 6 {
            let drift = t1.0.cross(&g.w);
            let spin = *t4 + t1.1.cross_add(&g.w, &g.v.cross(&t1.0));
            let lean = t1.0.cross(&g.g);
            for k in 0..3 {
                let (lin, ang) = (k * self.nv + i, (3 + k) * self.nv + i);
                (self.dv[lin], self.dv[ang], self.dq[ang]) = (drift.get(k), spin.get(k), lean.get(k));
                (self.da[lin], self.da[ang]) = (t1.0.get(k), t1.1.get(k));
            }
        }
    }
    /// Joint `j`, at `node`, and a degree of freedom `i` further out.
    #[inline(always)]
    fn pair(&mut self, j: usize, i: usize, node: &Node<T>, own: &Own<T>) {
        let (s, psi, psi2) = (&node.s, &node.psi, &node.psi2);
        let inertia = dot(s, &own.t1);
        self.set(j, i, dot(s, &own.t3), dot(s, &own.t2), inertia);
        let q = own.t4.dot(&psi.1) + dot(&own.t1, psi2);
        let v = own.t4.dot(&s.1) + dot(&own.t1, psi).scale(2.0);
        self.set(i, j, q, v, inertia);
    }
    /// Base rows of base columns.
    #[inline(always)]
    fn base(&mut self, x: &Node<T>, g: &Ground<T>) {
        let PackedInertia { m, h, i } = &x.ic;
        for k in 0..3 {
            let e = unit::<T>(k);
            let (carried, turned) = (g.w.cross(&e), e.cross(&g.v));
            let drift = shifted(*m, h, &carried);
            let with = shifted(*m, h, &turned);
            let spin = (
                e.cross(&x.p).scaled(T::from_f64(2.0)) + carried.cross(h) + with.0,
                x.d.0[k] + i.mul(&carried) + with.1,
            );
            let lean = shifted(*m, h, &g.g.cross(&e));
            let (lin, ang) = (shifted(*m, h, &e), (e.cross(h), i.mul(&e)));
            write(&mut self.dv[k * self.nv..], &drift);
            write(&mut self.dv[(3 + k) * self.nv..], &spin);
            write(&mut self.dq[(3 + k) * self.nv..], &lean);
            write(&mut self.da[k * self.nv..], &lin);
            write(&mut self.da[(3 + k) * self.nv..], &ang);
        }
    }
}

/// Force and moment of a mass `m` with first moment `h` that accelerates by `a` everywhere.
#[inline(always)]
fn shifted<T: Scalar>(m: T, h: &V3<T>, a: &V3<T>) -> Screw<T> {
    (a.scaled(m), h.cross(a))
}

#[inline(always)]
fn write<T: Scalar>(m: &mut [T], t: &Screw<T>) {
    t.0.write_to(m);
    t.1.write_to(&mut m[3..]);
}

/// Poses, velocities, accelerations and screws in base axes.
#[inline(always)]
fn outwards<T: LaneScalar>(qd: &[T], qdd: &[T], links: &[Link<T>], nodes: &mut [Node<T>]) {
    let base = &mut nodes[0];
    base.pose.r = M3([unit(0), unit(1), unit(2)]);
    (base.u, base.w, base.al, base.aw) = (V3::zero(), links[0].w, links[0].a, links[0].al);
    for i in 1..links.len() {
        let (inner, outer) = nodes.split_at_mut(i);
        let (l, x) = (&links[i], &mut outer[0]);
        let parent = &inner[l.parent];
        x.pose.p = parent.pose.r.mul_add(&l.pose.p, &parent.pose.p);
        x.pose.r = dispatch_rotation!(T, l.pose.turn, K => turned::<T, K>(&parent.pose.r, &l.pose));
        let (sv, sw) = l.screw();
        let z = x.pose.r.mul(&sw);
        x.s = (x.pose.p.cross_add(&z, &x.pose.r.mul(&sv)), z);
        let (v, a) = ((parent.u, parent.w), (parent.al, parent.aw));
        x.psi = cross(&v, &x.s);
        let (turn, further) = (cross(&a, &x.s), cross(&v, &x.psi));
        x.psi2 = (turn.0 + further.0, turn.1 + further.1);
        let (rate, acc) = (qd[i - 1], qdd[i - 1]);
        (x.u, x.w) = (x.s.0.scale_add(rate, &v.0), x.s.1.scale_add(rate, &v.1));
        x.al = x.psi.0.scale_add(rate, &x.s.0.scale_add(acc, &a.0));
        x.aw = x.psi.1.scale_add(rate, &x.s.1.scale_add(acc, &a.1));
    }
}

/// Own inertia, momentum, `D` and wrench of every body.
#[inline(always)]
fn bodies<T: LaneScalar>(params: &Params<T>, nodes: &mut [Node<T>], external: Option<&[ff_model::Force<T>]>) {
    for (b, x) in nodes.iter_mut().enumerate() {
        x.ic = x.pose.body_up::<{ turn::ANY }>(&PackedInertia::from(params.body(b)));
        let i = &x.ic.i;
        let (p, l) = x.ic.momentum(&x.u, &x.w);
        let (f, n) = x.ic.momentum(&x.al, &x.aw);
        x.p = p;
        x.f = x.w.cross_add(&p, &f);
        x.n = x.w.cross_add(&l, &x.u.cross_add(&p, &n));
        let trace = i.xx + i.yy + i.zz;
        for k in 0..3 {
            let e = unit::<T>(k);
            let turning = x.w.cross(&(i.col(k).scaled(T::from_f64(2.0)) - e.scaled(trace)));
            x.d.0[k] = turning - x.ic.h.cross(&x.u.cross(&e)).scaled(T::from_f64(2.0));
        }
        if let Some(wrenches) = external {
            let (f, n) = (V3::from(&wrenches[b].lin), V3::from(&wrenches[b].ang));
            let (f, n) = x.pose.wrench_up::<{ turn::ANY }>(&f, &n);
            x.f -= f;
            x.n -= n;
        }
    }
}

/// Pose of a mount in the base.
#[inline(always)]
fn mounted<T: LaneScalar>(port: &PortWork<T>, host: &Pose<T>) -> Pose<T> {
    let mut x = *host;
    x.p = host.r.mul_add(&port.pose.p, &host.p);
    if port.pose.turn != RotationKind::None {
        x.r = turned::<T, { turn::ANY }>(&host.r, &port.pose);
    }
    x
}

/// Adds a port to its host: needs `M`, the residual and the Jacobian of the port. `w` is the angular velocity in
/// the mount frame.
#[inline(always)]
fn hang<T: LaneScalar>(port: &PortWork<T>, w: &V3<T>, nu: &[T], host: &mut Node<T>) {
    let dim = 6 + port.n;
    let x = mounted(port, &host.pose);
    let u = host.w.cross_add(&x.p, &host.u);
    let own = port.mass().host();
    let mut p = w.cross(&own.h);
    for (k, &nu) in nu.iter().enumerate() {
        p = port.mass().coupling(k).0.scale_add(nu, &p);
    }
    let p = own_momentum(&x, &p, &u, own.m);
    // D in mount axes, by columns.
    let mut d = M3::zero();
    for k in 0..3 {
        d.0[k] = V3::from_slice(&port.d[k * dim + 3..]) - own.i.mul(&w.cross(&unit::<T>(k)));
    }
    let h = x.r.mul(&own.h);
    let two = T::from_f64(2.0);
    for k in 0..3 {
        let e = unit::<T>(k);
        let turned = x.r.mul(&d.mul(&x.r.tr_mul(&e)));
        let moved = h.cross(&u.cross(&e)) + x.p.cross(&p.cross(&e));
        host.d.0[k] += turned - moved.scaled(two);
    }
    host.p += p;
    host.ic.add(&x.body_up::<{ turn::ANY }>(&own));
    let (f, n) = x.wrench_up::<{ turn::ANY }>(&V3::from_slice(&port.r), &V3::from_slice(&port.r[3..]));
    host.f += f;
    host.n += n;
}

/// Linear momentum in base axes from that in a frame moving with the mount.
#[inline(always)]
fn own_momentum<T: Scalar>(x: &Pose<T>, p: &V3<T>, u: &V3<T>, m: T) -> V3<T> {
    u.scale_add(m, &x.r.mul(p))
}

/// Derivatives of [`crate::tree::forward::hybrid_dynamics`]: with the unknowns `x = [base acceleration | passive accelerations]`
/// and their rows `u` of the equations of motion, `H_uu dx = -(d tau_u)`, and the joint torques follow,
/// `d tau_m = (d tau)_m + H_mu dx`, for any columns `d tau` at fixed accelerations: those of
/// [`Derivatives`], or of the regressor for parameters.
///
/// `columns` is `nv x k`; on return its joint rows hold the derivatives of the joint torques and its other rows
/// those of the accelerations. `da` is the mass matrix. Allocates a factorisation.
///
/// # Errors
/// [`crate::tree::aba::SingularInertia`] if the mass matrix of the unknowns is not positive definite.
///
/// # Panics
/// If a shape is wrong.
pub fn hybrid_columns(
    model: &Model,
    da: &DMatrix<f64>,
    columns: &mut DMatrix<f64>,
) -> Result<(), crate::tree::aba::SingularInertia> {
    let (nb, nj, nv) = (model.nb(), model.nj(), model.nv());
    assert_eq!(da.shape(), (nv, nv), "mass matrix shape");
    assert_eq!(columns.nrows(), nv, "column length");
    let free: Vec<usize> = (0..nb).chain(nb + nj..nv).collect();
    let n = free.len();
    let mut l: Vec<f64> = free.iter().flat_map(|&i| free.iter().map(move |&j| (i, j))).map(|e| da[e]).collect();
    if !crate::linalg::ldl::factor(&mut l, n) {
        return Err(crate::tree::aba::SingularInertia { at: format!("base {} or an appendage", model.body_name(0)) });
    }
    let mut x = vec![0.0; n];
    for mut col in columns.column_iter_mut() {
        for (x, &i) in x.iter_mut().zip(&free) {
            *x = -col[i];
        }
        crate::linalg::ldl::solve(&l, n, &mut x);
        for (&x, &i) in x.iter().zip(&free) {
            for j in nb..nb + nj {
                col[j] += da[(j, i)] * x;
            }
            col[i] = x;
        }
    }
    Ok(())
}
