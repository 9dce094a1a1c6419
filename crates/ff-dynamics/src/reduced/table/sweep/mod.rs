//! The arm at one instant, over any scalar: motion of every link from the base outwards, moments of what it carries from
//! the tips inwards.
//!
//! The one form of the equations of [`crate::reduced::table`]. Lanes fill the tables of a record with it, one instant per lane
//! (`fill.rs`); [`ArmModel`](crate::reduced::table::ArmModel) evaluates it over any scalar, one set of links per lane or with
//! derivatives.

mod displacement;

use super::numbers::{Arm, Frame, ROW};
use crate::work::link::{Link, links};
pub(crate) use displacement::Twist;
use ff_model::spatial::so3::{exp_so3, quat_to_rot};
use ff_model::spatial::vec3::{M3, PackedInertia, Pose, RotationKind, S3, V3, turn};
use ff_model::{Kinematics, Model, Params, Scalar};

/// The links of an arm with their buffers.
#[derive(Clone, Debug)]
pub(crate) struct Sweep<T: Scalar> {
    bodies: Vec<Body<T>>,
    links: Vec<Link<T>>,
    moved: Vec<Moved<T>>,
    sums: Vec<Sums<T>>,
    /// By joint, where placements are displaced at all.
    displaced: Vec<Displaced<T>>,
}

/// Displacement of a joint's placement: rotation and shift in the parent, offset of the joint position.
#[derive(Clone, Copy, Debug)]
struct Displaced<T> {
    turn: M3<T>,
    shift: V3<T>,
    offset: T,
}

impl<T: Scalar> Displaced<T> {
    fn of(by: &Kinematics<T>, j: usize) -> Self {
        let d = by.joint(j);
        Self { turn: M3::from(&quat_to_rot(&exp_so3(&d.rotation))), shift: V3::from(&d.shift), offset: d.offset }
    }
}

impl<T: Scalar> Sweep<T> {
    /// For the links' parameters in `params`. Allocates.
    pub(crate) fn new(model: &Model, params: &Params<T>) -> Self {
        let nj = model.n_joints();
        Self {
            bodies: (0..=nj).map(|i| Body::new(&PackedInertia::from(params.body(i)))).collect(),
            links: links(model),
            moved: vec![Moved::at_rest(); nj + 1],
            sums: vec![Sums::zero(); nj + 1],
            displaced: Vec::new(),
        }
    }
    /// With displaced joints.
    pub(crate) fn displaced(mut self, by: &Kinematics<T>) -> Self {
        for (j, l) in self.links[1..].iter_mut().enumerate() {
            let d = Displaced::of(by, j);
            l.displace(&d.turn, &d.shift);
            self.displaced.push(d);
        }
        self
    }
    /// Number of joints of the tree.
    pub(crate) fn joints(&self) -> usize {
        self.links.len() - 1
    }
    /// Moves all links, and puts the moments of each into its own sums.
    #[inline(always)]
    pub(crate) fn outwards(&mut self, q: &[T], qd: &[T], qdd: &[T]) {
        let nj = self.links.len() - 1;
        let (q, qd, qdd) = (&q[..nj], &qd[..nj], &qdd[..nj]);
        if self.displaced.is_empty() {
            for (l, &q) in self.links[1..].iter_mut().zip(q) {
                l.place(q);
            }
        } else {
            for ((l, &q), d) in self.links[1..].iter_mut().zip(q).zip(&self.displaced) {
                l.place_displaced(q + d.offset, &d.turn, &d.shift);
            }
        }
        for i in 1..=nj {
            let l = &self.links[i];
            self.moved[i] = self.moved[l.parent].step(l, qd[i - 1], qdd[i - 1]);
            self.sums[i] = self.moved[i].sums(&self.bodies[i]);
        }
        self.sums[0] = Sums::zero();
    }
    /// Adds what body `i` carries to its parent. To be called for all bodies, the last first.
    #[inline(always)]
    pub(crate) fn inwards(&mut self, i: usize) {
        let own = self.sums[i];
        self.sums[self.links[i].parent].add(&own);
    }
    /// Numbers of the row of the joint that carries body `i`, once all that it carries has been added.
    #[inline(always)]
    pub(crate) fn row(&self, i: usize) -> [T; ROW] {
        let (s, u) = self.screw(i);
        self.sums[i].row(&s, &u)
    }
    /// Screw about the base origin of the joint that carries body `i`: velocity there, and angular velocity.
    #[inline(always)]
    fn screw(&self, i: usize) -> (V3<T>, V3<T>) {
        let (v, w) = self.links[i].screw();
        let m = &self.moved[i];
        let u = m.r.mul(&w);
        (m.p.cross_add(&u, &m.r.mul(&v)), u)
    }
    /// All links together, once everything has been added to the base.
    #[inline(always)]
    pub(crate) fn arm(&self) -> Arm<T> {
        self.sums[0].arm()
    }
    /// A frame fixed in body `host`.
    #[inline(always)]
    pub(crate) fn frame(&self, host: usize, mount: &Pose<T>) -> Frame<T> {
        self.moved[host].frame(mount)
    }
}

/// Rotation and position in the parent of what joint `j` carries at position zero, with the joint displaced.
pub(crate) fn placement<T: Scalar>(model: &Model, by: &Kinematics<T>, j: usize) -> (M3<T>, V3<T>) {
    let (mut l, d) = (Link::new(&model.bodies()[j]), Displaced::of(by, j));
    l.displace(&d.turn, &d.shift);
    l.place_displaced(d.offset, &d.turn, &d.shift);
    (l.pose.r, l.pose.p)
}

/// A body that moves relative to the base.
#[derive(Clone, Copy, Debug)]
struct Moved<T> {
    r: M3<T>,
    p: V3<T>,
    dp: V3<T>,
    ddp: V3<T>,
    w: V3<T>,
    dw: V3<T>,
}

/// The sums of [`crate::reduced::table`], with `int r r^T` in place of `J`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sums<T> {
    m: T,
    h: V3<T>,
    dh: V3<T>,
    ddh: V3<T>,
    rr: S3<T>,
    k: M3<T>,
    dl: V3<T>,
}

/// A body about its own origin, with second moments in place of the inertia.
#[derive(Clone, Debug)]
struct Body<T> {
    m: T,
    h: V3<T>,
    rr: S3<T>,
}

impl<T: Scalar> Body<T> {
    fn new(b: &PackedInertia<T>) -> Self {
        let half = (b.i.xx + b.i.yy + b.i.zz).scale(0.5);
        Self {
            m: b.m,
            h: b.h,
            rr: S3 { xx: half - b.i.xx, xy: -b.i.xy, yy: half - b.i.yy, xz: -b.i.xz, yz: -b.i.yz, zz: half - b.i.zz },
        }
    }
}

/// `I v` of a body with second moments `s` of this trace: `I = tr(S) 1 - S`.
#[inline(always)]
fn spin<T: Scalar>(s: &S3<T>, trace: T, v: &V3<T>) -> V3<T> {
    v.scaled(trace) - s.mul(v)
}

/// Element `(i, j)` of `S + p h^T + h p^T + m p p^T` from `S_ij`, `(p_i, p_j)`, `(h_i, h_j)`.
#[inline(always)]
fn second_moment<T: Scalar>(s: T, p: (T, T), h: (T, T), m: T) -> T {
    (p.0 * p.1).mul_add(m, p.0.mul_add(h.1, p.1.mul_add(h.0, s)))
}

impl<T: Scalar> Moved<T> {
    fn at_rest() -> Self {
        let (o, i, z) = (T::zero(), T::one(), V3::zero());
        let r = M3([V3::new(i, o, o), V3::new(o, i, o), V3::new(o, o, i)]);
        Self { r, p: z, dp: z, ddp: z, w: z, dw: z }
    }
    /// The body that a joint carries from this one.
    #[inline(always)]
    fn step(&self, l: &Link<T>, qd: T, qdd: T) -> Self {
        let r = crate::tree::derivatives::turned_by(&self.r, &l.pose);
        let d = self.r.mul(&l.pose.p);
        let (v, w) = l.screw();
        let two = T::from_f64(2.0);
        let mut next = Self {
            r,
            p: self.p + d,
            dp: self.w.cross_add(&d, &self.dp),
            ddp: self.w.cross_add(&self.w.cross(&d), &self.dw.cross_add(&d, &self.ddp)),
            w: self.w,
            dw: self.dw,
        };
        if l.prismatic {
            let u = r.mul(&v);
            next.dp = u.scale_add(qd, &next.dp);
            next.ddp = u.scale_add(qdd, &next.ddp) + self.w.cross(&u.scaled(qd * two));
        } else {
            let u = r.mul(&w);
            next.w = u.scale_add(qd, &self.w);
            next.dw = u.scale_add(qdd, &self.w.cross_add(&u.scaled(qd), &self.dw));
        }
        next
    }
    /// Contribution of a body to the sums.
    #[inline(always)]
    fn sums(&self, b: &Body<T>) -> Sums<T> {
        let hr = self.r.mul(&b.h);
        let turned = {
            let mut x = Pose::identity();
            (x.turn, x.r) = (RotationKind::General, self.r);
            x.up_sym::<{ turn::ANY }>(&b.rr)
        };
        let dhr = self.w.cross(&hr);
        let dh = self.dp.scale_add(b.m, &dhr);
        let h = self.p.scale_add(b.m, &hr);
        let ddh = self.ddp.scale_add(b.m, &self.w.cross_add(&dhr, &self.dw.cross(&hr)));
        // int rho (w x rho)^T has columns w x (column of the second moments), transposed.
        let w = &self.w;
        let (x, y, z) = (w.cross(&turned.col(0)), w.cross(&turned.col(1)), w.cross(&turned.col(2)));
        let (p, dp) = (&self.p, &self.dp);
        let k = M3([
            p.scale_add(dh.x, &hr.scale_add(dp.x, &V3::new(x.x, y.x, z.x))),
            p.scale_add(dh.y, &hr.scale_add(dp.y, &V3::new(x.y, y.y, z.y))),
            p.scale_add(dh.z, &hr.scale_add(dp.z, &V3::new(x.z, y.z, z.z))),
        ]);
        // int rho x (dw x rho + w x (w x rho)): I dw + w x I w with I = tr(S) 1 - S.
        let trace = turned.xx + turned.yy + turned.zz;
        let dl_own = w.cross_add(&spin(&turned, trace, w), &spin(&turned, trace, &self.dw));
        Sums {
            m: b.m,
            h,
            dh,
            ddh,
            rr: S3 {
                xx: second_moment(turned.xx, (p.x, p.x), (hr.x, hr.x), b.m),
                xy: second_moment(turned.xy, (p.x, p.y), (hr.x, hr.y), b.m),
                yy: second_moment(turned.yy, (p.y, p.y), (hr.y, hr.y), b.m),
                xz: second_moment(turned.xz, (p.x, p.z), (hr.x, hr.z), b.m),
                yz: second_moment(turned.yz, (p.y, p.z), (hr.y, hr.z), b.m),
                zz: second_moment(turned.zz, (p.z, p.z), (hr.z, hr.z), b.m),
            },
            k,
            dl: p.cross_add(&ddh, &hr.cross_add(&self.ddp, &dl_own)),
        }
    }
    /// A frame fixed in the body.
    #[inline(always)]
    fn frame(&self, mount: &Pose<T>) -> Frame<T> {
        let d = self.r.mul(&mount.p);
        let mut pose = Pose::identity();
        pose.turn = RotationKind::General;
        pose.r = if mount.turn == RotationKind::None {
            self.r
        } else {
            M3([self.r.mul(&mount.r.0[0]), self.r.mul(&mount.r.0[1]), self.r.mul(&mount.r.0[2])])
        };
        pose.p = self.p + d;
        let swing = self.w.cross(&d);
        Frame {
            pose,
            moving: true,
            dp: self.dp + swing,
            ddp: self.w.cross_add(&swing, &self.dw.cross_add(&d, &self.ddp)),
            w: self.w,
            dw: self.dw,
        }
    }
}

impl<T: Scalar> Sums<T> {
    #[inline(always)]
    fn zero() -> Self {
        let z = V3::zero();
        Self { m: T::zero(), h: z, dh: z, ddh: z, rr: S3::zero(), k: M3::zero(), dl: z }
    }
    #[inline(always)]
    fn add(&mut self, o: &Self) {
        self.m += o.m;
        self.h += o.h;
        self.dh += o.dh;
        self.ddh += o.ddh;
        let (a, b) = (&mut self.rr, &o.rr);
        a.xx += b.xx;
        a.xy += b.xy;
        a.yy += b.yy;
        a.xz += b.xz;
        a.yz += b.yz;
        a.zz += b.zz;
        for (a, b) in self.k.0.iter_mut().zip(&o.k.0) {
            *a += *b;
        }
        self.dl += o.dl;
    }
    /// `J v = tr(S) v - S v`.
    #[inline(always)]
    fn inertia(&self, v: &V3<T>) -> V3<T> {
        v.scaled(self.rr.xx + self.rr.yy + self.rr.zz) - self.rr.mul(v)
    }
    #[inline(always)]
    pub(crate) fn arm(&self) -> Arm<T> {
        let (s, k) = (&self.rr, &self.k.0);
        let two = T::from_f64(2.0);
        let (tr, twice) = (k[0].x + k[1].y + k[2].z, |v: V3<T>| v.scaled(two));
        let i = S3 { xx: s.yy + s.zz, xy: -s.xy, yy: s.xx + s.zz, xz: -s.xz, yz: -s.yz, zz: s.xx + s.yy };
        Arm {
            ten: PackedInertia { m: self.m, h: self.h, i },
            dh2: twice(self.dh),
            ddh: self.ddh,
            // Column j of 2 (tr K 1 - K^T) is made of row j of K.
            c: M3([
                twice(V3::new(tr - k[0].x, -k[1].x, -k[2].x)),
                twice(V3::new(-k[0].y, tr - k[1].y, -k[2].y)),
                twice(V3::new(-k[0].z, -k[1].z, tr - k[2].z)),
            ]),
            dl: self.dl,
        }
    }
    /// The row of a joint with screw `(s, u)` that carries this subtree.
    #[inline(always)]
    fn row(&self, s: &V3<T>, u: &V3<T>) -> [T; ROW] {
        let (h, k) = (&self.h, &self.k.0);
        let two = T::from_f64(2.0);
        let ga = s.scale_add(self.m, &u.cross(h));
        let gb = h.cross_add(s, &self.inertia(u));
        // C^T u = 2 (tr K u - K u).
        let gw = self.dh.cross_add(s, &(u.scaled(k[0].x + k[1].y + k[2].z) - self.k.mul(u))).scaled(two);
        // u.(w x J w) = (u x r).w (r.w) summed: [u]x S, made symmetric; s.(w x (w x h)) = s.w h.w - s.h w.w.
        let x = [u.cross(&self.rr.col(0)), u.cross(&self.rr.col(1)), u.cross(&self.rr.col(2))];
        let sh = s.dot(h);
        let half = |a: T, b: T| (a + b).scale(0.5);
        let q = [
            s.x * h.x - sh + x[0].x,
            half(s.x * h.y + x[0].y, s.y * h.x + x[1].x),
            s.y * h.y - sh + x[1].y,
            half(s.x * h.z + x[0].z, s.z * h.x + x[2].x),
            half(s.y * h.z + x[1].z, s.z * h.y + x[2].y),
            s.z * h.z - sh + x[2].z,
        ];
        let mut row = [s.dot(&self.ddh) + u.dot(&self.dl); ROW];
        ga.write_to(&mut row);
        gb.write_to(&mut row[3..]);
        gw.write_to(&mut row[6..]);
        row[9..15].copy_from_slice(&q);
        s.write_to(&mut row[16..]);
        u.write_to(&mut row[19..]);
        row
    }
}
