//! Derivatives of the chain's port equations in closed form, `O(n^2)`.
//!
//! S. Singh, R. Russell, P. Wensing, *Efficient analytical derivatives of rigid-body dynamics using spatial vector
//! algebra*, IEEE RA-L 7(2), 2022, eqs. (22) to (26), in classical accelerations and segment frames. Watched from a
//! point `o` that the motion may take along, every direction of the state changes the acceleration of the mass at `r`
//! with velocity `r'` (both relative to `o`) by
//!
//! ```text
//! da = g + b x r + 2 x x r'
//! ```
//!
//! with a triple `(x, b, g)` for each direction. With `wc`, `alc` the angular velocity and acceleration that segment `i`
//! is carried with, `a` the acceleration of its hinge, `u` the axis, `v`, `w` the twist of the mount, `o` the hinge or
//! the mount:
//!
//! ```text
//! coordinate i:  x = wc x u     b = alc x u + wc x (wc x u)     g = a x u
//! rate i:        x = u          b = 2 wc x u                    g = 0
//! w_k:           x = e_k        b = w x e_k                     g = e_k x v
//! ```
//!
//! What hangs on hinge `i` answers as a whole, with its mass `m`, first moment `h`, inertia `I`, momentum
//! `q = sum m r'` and `N = sum m r' r^T` about the hinge:
//!
//! ```text
//! df = m g + b x h + 2 x x q         dn = h x g + I b + 2 (tr(N) 1 - N) x
//! ```
//!
//! and a coordinate turns the wrench as well, by `u x f`, `u x n`. These columns are carried inwards. Rows of hinges
//! further out are the same products read from the other side: `u . dn = (u x h) . g + (I u) . b + 2 (tr(N) 1 - N^T) u . x`,
//! three covectors that are carried inwards and meet the triples there.

use crate::chain::PanelChain;
use ff_model::spatial::vec3::{M3, PackedInertia, Pose, V3};
use ff_model::{PortAccel, PortState, Scalar};

/// A segment as the outward pass leaves it, in its own frame.
#[derive(Clone, Copy)]
struct Carried<T> {
    pose: Pose<T>,
    u: V3<T>,
    /// Triple of the coordinate: `wc x u`, and so on.
    x: V3<T>,
    b: V3<T>,
    g: V3<T>,
    /// Velocity of the hinge relative to the hinge before, in the frame of the latter.
    v: V3<T>,
    w: V3<T>,
    force: (V3<T>, V3<T>),
}

/// What hangs on a hinge.
#[derive(Clone, Copy)]
struct Whole<T> {
    body: PackedInertia<T>,
    q: V3<T>,
    n: M3<T>,
    force: (V3<T>, V3<T>),
}

impl<T: Scalar> Whole<T> {
    #[inline(always)]
    fn of(body: PackedInertia<T>, at: &Carried<T>) -> Self {
        // N = [w]x J with J = tr(I)/2 - I.
        let (w, i) = (&at.w, &body.i);
        let half = (i.xx + i.yy + i.zz).scale(0.5);
        let n = M3([
            w.cross(&V3::new(half - i.xx, -i.xy, -i.xz)),
            w.cross(&V3::new(-i.xy, half - i.yy, -i.yz)),
            w.cross(&V3::new(-i.xz, -i.yz, half - i.zz)),
        ]);
        Self { q: w.cross(&body.h), n, force: at.force, body }
    }
    /// The same seen from the parent, about the parent's hinge.
    #[inline(always)]
    fn up<const K: u8>(&self, at: &Carried<T>) -> Self {
        let (pose, v) = (&at.pose, &at.v);
        let body = pose.body_up::<K>(&self.body);
        let q = pose.up::<K>(&self.q);
        let [n0, n1, n2] = &self.n.0;
        let (c0, c1, c2) = (pose.up::<K>(n0), pose.up::<K>(n1), pose.up::<K>(n2));
        // Methods and loops: closures of some size are not inlined into code for lanes.
        let rx = pose.up::<K>(&V3::new(c0.x, c1.x, c2.x));
        let ry = pose.up::<K>(&V3::new(c0.y, c1.y, c2.y));
        let rz = pose.up::<K>(&V3::new(c0.z, c1.z, c2.z));
        let n = M3([
            q.scale_add(pose.p.x, &v.scale_add(body.h.x, &V3::new(rx.x, ry.x, rz.x))),
            q.scale_add(pose.p.y, &v.scale_add(body.h.y, &V3::new(rx.y, ry.y, rz.y))),
            q.scale_add(pose.p.z, &v.scale_add(body.h.z, &V3::new(rx.z, ry.z, rz.z))),
        ]);
        Self { n, q: v.scale_add(body.m, &q), force: pose.wrench_up::<K>(&self.force.0, &self.force.1), body }
    }
    #[inline(always)]
    fn add(&mut self, o: &Self) {
        self.body.add(&o.body);
        self.q += o.q;
        for k in 0..3 {
            self.n.0[k] += o.n.0[k];
        }
        self.force = (self.force.0 + o.force.0, self.force.1 + o.force.1);
    }
    #[inline(always)]
    fn trace(&self) -> T {
        self.n.0[0].x + self.n.0[1].y + self.n.0[2].z
    }
    /// Column of the coordinate.
    #[inline(always)]
    fn by_coordinate(&self, at: &Carried<T>) -> (V3<T>, V3<T>) {
        let (PackedInertia { m, h, i }, x2) = (&self.body, at.x.scaled(T::from_f64(2.0)));
        let f = at.b.cross_add(h, &x2.cross_add(&self.q, &at.g.scaled(*m)));
        let n = i.mul_add(&at.b, &h.cross_add(&at.g, &x2.scaled(self.trace()))) - self.n.mul(&x2);
        (at.u.cross_add(&self.force.0, &f), at.u.cross_add(&self.force.1, &n))
    }
    /// Column of the rate.
    #[inline(always)]
    fn by_rate(&self, at: &Carried<T>) -> (V3<T>, V3<T>) {
        let two = T::from_f64(2.0);
        let f = at.x.cross_add(&self.body.h, &at.u.cross(&self.q));
        let n = self.body.i.mul_add(&at.x, &at.u.scaled(self.trace())) - self.n.mul(&at.u);
        (f.scaled(two), n.scaled(two))
    }
    /// Columns of the angular velocity of the mount, where `self` is the whole chain about the mount.
    #[inline(always)]
    fn by_spin(&self, w: &V3<T>, v: &V3<T>) -> [(V3<T>, V3<T>); 3] {
        let (PackedInertia { m, h, i }, two) = (&self.body, T::from_f64(2.0));
        let (c, wh) = (self.q.scale_add(two, &v.scaled(*m)), w.dot(h));
        let d = self.trace().mul_add(two, h.dot(v));
        let o = T::zero();
        // e_k x c + e_k (w.h) - w h_k, and e_k (h.v + 2 tr N) - v h_k + I (w x e_k) - 2 N e_k.
        let f = [V3::new(wh, -c.z, c.y), V3::new(c.z, wh, -c.x), V3::new(-c.y, c.x, wh)];
        let e = [V3::new(d, o, o), V3::new(o, d, o), V3::new(o, o, d)];
        let across = [V3::new(o, w.z, -w.y), V3::new(-w.z, o, w.x), V3::new(w.y, -w.x, o)];
        let hs = [-h.x, -h.y, -h.z];
        let mut out = [(V3::zero(), V3::zero()); 3];
        for k in 0..3 {
            let n = i.mul_add(&across[k], &v.scale_add(hs[k], &e[k]));
            out[k] = (w.scale_add(hs[k], &f[k]), self.n.0[k].scale_add(-two, &n));
        }
        out
    }
}

/// See [`ff_model::PortDynamics::jacobian`]. Does not allocate.
#[inline(always)]
pub(crate) fn jacobian<T: Scalar, const N: usize, const K: u8>(
    c: &PanelChain,
    p: &[T],
    s: &PortState<'_, T>,
    acc: &PortAccel<'_, T>,
    j: &mut [T],
) {
    let n = if N <= 3 { N } else { c.count() };
    let dim = 6 + n;
    let (j, hinges) = (&mut j[..(3 + 2 * n) * dim], &c.hinges[..n]);
    let (v, w) = (V3::from(&s.host.lin), V3::from(&s.host.ang));
    let at = outwards::<T, N, K>(c, p, s, acc);
    let mut whole: Option<Whole<T>> = None;
    for i in (0..n).rev() {
        let (own, hinge) = (&at[i], &hinges[i]);
        let body = PackedInertia::from_params(&p[c.inertial_offset(i)..]);
        let mut here = Whole::of(body, own);
        if let Some(outer) = &whole {
            here.add(outer);
        }
        let (mut by_eta, mut by_nu) = (here.by_coordinate(own), here.by_rate(own));
        let u = &own.u;
        let (mut cg, mut cb) = hinge.axis.momentum::<T, K>(&here.body.h, &here.body.i);
        let mut cx = (u.scaled(here.trace()) - here.n.tr_mul(u)).scaled(T::from_f64(2.0));
        for k in (0..=i).rev() {
            let to = &at[k];
            // Row k of the columns, and for k < i row i of the columns of hinge k.
            if k < i {
                j[(3 + k) * dim + 6 + i] = cg.dot(&to.g) + (cb.dot(&to.b) + cx.dot(&to.x));
                j[(3 + n + k) * dim + 6 + i] = cb.dot(&to.x).mul_add(T::from_f64(2.0), cx.dot(&to.u));
            }
            let (x, axis) = (&to.pose, &hinges[k].axis);
            j[(3 + i) * dim + 6 + k] = axis.along::<T, K>(&by_eta.1);
            j[(3 + n + i) * dim + 6 + k] = axis.along::<T, K>(&by_nu.1);
            by_eta = x.wrench_up::<K>(&by_eta.0, &by_eta.1);
            by_nu = x.wrench_up::<K>(&by_nu.0, &by_nu.1);
            (cg, cb) = x.wrench_up::<K>(&cg, &cb);
            cx = to.v.scaled(T::from_f64(2.0)).cross_add(&cg, &x.up::<K>(&cx));
        }
        write(&by_eta, &mut j[(3 + i) * dim..]);
        write(&by_nu, &mut j[(3 + n + i) * dim..]);
        let spin = v.cross_add(&cg, &cb.cross_add(&w, &cx));
        for (k, x) in [spin.x, spin.y, spin.z].into_iter().enumerate() {
            j[k * dim + 6 + i] = x;
        }
        j[(3 + i) * dim + 6 + i] += p[c.stiffness_index(i)];
        j[(3 + n + i) * dim + 6 + i] += p[c.damping_index(i)];
        whole = Some(here.up::<K>(own));
    }
    if let Some(all) = &whole {
        for (k, column) in all.by_spin(&w, &v).iter().enumerate() {
            write(column, &mut j[k * dim..]);
        }
    }
    for (&(a, b), &k) in c.k_pairs.pairs.iter().zip(&p[c.k_pair_offset()..]) {
        j[(3 + b) * dim + 6 + a] += k;
        j[(3 + a) * dim + 6 + b] += k;
    }
    for (&(a, b), &d) in c.d_pairs.pairs.iter().zip(&p[c.d_pair_offset()..]) {
        j[(3 + n + b) * dim + 6 + a] += d;
        j[(3 + n + a) * dim + 6 + b] += d;
    }
}

#[inline(always)]
fn write<T: Scalar>((f, n): &(V3<T>, V3<T>), column: &mut [T]) {
    let column = &mut column[..6];
    f.write_to(column);
    n.write_to(&mut column[3..]);
}

/// Motion and wrench of every segment, and the triples of its coordinate.
#[inline(always)]
fn outwards<T: Scalar, const N: usize, const K: u8>(
    c: &PanelChain,
    p: &[T],
    s: &PortState<'_, T>,
    acc: &PortAccel<'_, T>,
) -> [Carried<T>; N] {
    let n = if N <= 3 { N } else { c.count() };
    let o = V3::zero();
    let mut at = [Carried { pose: Pose::identity(), u: o, x: o, b: o, g: o, v: o, w: o, force: (o, o) }; N];
    let mut w = V3::from(&s.host.ang);
    let mut al = V3::from(&acc.host.ang);
    let mut a = w.cross_add(&V3::from(&s.host.lin), &V3::from(&acc.host.lin));
    let mut field = M3::field(&w, &al);
    for i in 0..n {
        let (mut pose, axis, nu, one) = (Pose::identity(), &c.hinges[i].axis, s.nu[i], T::one());
        c.hinges[i].place::<T, K>(s.eta[i], &mut pose);
        let at_hinge = field.mul_add(&pose.p, &a);
        let v = w.cross(&pose.p);
        (w, al, a) = (pose.down::<K>(&w), pose.down::<K>(&al), pose.down::<K>(&at_hinge));
        let x = axis.cross_add::<T, K>(&w, one, V3::zero());
        let b = axis.cross_add::<T, K>(&al, one, w.cross(&x));
        let g = axis.cross_add::<T, K>(&a, one, V3::zero());
        let u = axis.add::<T, K>(V3::zero(), one);
        (w, al) = (axis.add::<T, K>(w, nu), axis.add::<T, K>(x.scale_add(nu, &al), acc.nu[i]));
        field = M3::field(&w, &al);
        let force = PackedInertia::from_params(&p[c.inertial_offset(i)..]).wrench(&w, &al, &a, &field);
        at[i] = Carried { pose, u, x, b, g, v, w, force };
    }
    at
}
