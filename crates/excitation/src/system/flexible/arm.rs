//! The prescribed arm as a table, over any scalar: what the base, the appendages and the joints feel of it.
//!
//! The sums are those of `docs/theory/reduced.md` (`h`, `J`, `h.`, `h..`, `C`, `L.`; forms of the joint torques), written
//! over [`Scalar`], so that dual numbers give their exact derivatives with respect to `(q, qd, qdd)`. All in base
//! axes, about the base origin.

use ff_model::scalar::Grad;
use ff_model::spatial::vec3::{M3, S3, Ten, V3};
use ff_model::{JointKind, Model, Params, Scalar, Xform};

/// Numbers of [`Arm`].
pub(super) const ARM: usize = 28;
/// Numbers of [`Frame`].
pub(super) const FRAME: usize = 24;
/// Numbers of [`Row`].
pub(super) const ROW: usize = 21;

/// What the base feels of the links: `m, h, J, 2 h., h.., C, L.`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arm<T> {
    pub(super) ten: Ten<T>,
    pub(super) dh2: V3<T>,
    pub(super) ddh: V3<T>,
    pub(super) c: M3<T>,
    pub(super) dl: V3<T>,
}

impl<T: Scalar> Arm<T> {
    fn zero() -> Self {
        let z = V3::zero();
        Self { ten: Ten::zero(), dh2: z, ddh: z, c: M3::zero(), dl: z }
    }
    pub(super) fn read(x: &[T]) -> Self {
        let v = |i: usize| V3::from_slice(&x[i..i + 3]);
        Self { ten: Ten::from_params(x), dh2: v(10), ddh: v(13), c: M3([v(16), v(19), v(22)]), dl: v(25) }
    }
    fn write(&self, out: &mut Vec<T>) {
        let (b, i) = (&self.ten, &self.ten.i);
        out.push(b.m);
        push(out, &b.h);
        out.extend([i.xx, i.xy, i.yy, i.xz, i.yz, i.zz]);
        for v in [&self.dh2, &self.ddh, &self.c.0[0], &self.c.0[1], &self.c.0[2], &self.dl] {
            push(out, v);
        }
    }
    fn add(&mut self, o: &Self) {
        self.ten.add(&o.ten);
        self.dh2 += o.dh2;
        self.ddh += o.ddh;
        self.dl += o.dl;
        for k in 0..3 {
            self.c.0[k] += o.c.0[k];
        }
    }
    /// One body that moves as `k`.
    fn body(b: &[f64; 10], k: &Frame<T>) -> Self {
        let own = Ten::from_params(&b.map(T::from_f64));
        let two = T::from_f64(2.0);
        let h = k.r.mul(&own.h);
        // R I R^T by columns.
        let half = M3([own.i.col(0), own.i.col(1), own.i.col(2)].map(|c| k.r.mul(&c)));
        let rotated = M3([0, 1, 2].map(|i| {
            V3::new(
                k.r.0[0].get(i) * half.0[0].x + k.r.0[1].get(i) * half.0[1].x + k.r.0[2].get(i) * half.0[2].x,
                k.r.0[0].get(i) * half.0[0].y + k.r.0[1].get(i) * half.0[1].y + k.r.0[2].get(i) * half.0[2].y,
                k.r.0[0].get(i) * half.0[0].z + k.r.0[1].get(i) * half.0[1].z + k.r.0[2].get(i) * half.0[2].z,
            )
        }));
        let dh_r = k.w.cross(&h);
        let dh = k.dp.scaled(own.m) + dh_r;
        let ddh = k.ddp.scaled(own.m) + k.dw.cross(&h) + k.w.cross(&dh_r);
        let total = k.p.scaled(own.m) + h;
        // J = I + [(2 p.h + m p.p) 1 - (h p^T + p h^T) - m p p^T], column by column.
        let (p, m) = (&k.p, own.m);
        let diagonal = two * p.dot(&h) + m * p.dot(p);
        let trace = rotated.0[0].x + rotated.0[1].y + rotated.0[2].z;
        let half_trace = trace.scale(0.5);
        let (mut j, mut kk) = (M3::zero(), M3::zero());
        for i in 0..3 {
            let e = unit::<T>(i);
            j.0[i] = rotated.0[i] + e.scaled(diagonal) - h.scaled(p.get(i)) - p.scaled(h.get(i) + m * p.get(i));
            // K = p h.^T + h_R dp^T - S [w]x with S = tr(I)/2 1 - I; column i of [w]x is w x e.
            let we = k.w.cross(&e);
            kk.0[i] = p.scaled(dh.get(i)) + h.scaled(k.dp.get(i)) - we.scaled(half_trace) + rotated.mul(&we);
        }
        let trace_k = kk.0[0].x + kk.0[1].y + kk.0[2].z;
        let mut c = M3::zero();
        for i in 0..3 {
            // Column i of K^T is row i of K.
            let row = V3::new(kk.0[0].get(i), kk.0[1].get(i), kk.0[2].get(i));
            c.0[i] = (unit::<T>(i).scaled(trace_k) - row).scaled(two);
        }
        let i = S3 { xx: j.0[0].x, xy: j.0[1].x, yy: j.0[1].y, xz: j.0[2].x, yz: j.0[2].y, zz: j.0[2].z };
        let dl = p.cross(&ddh) + h.cross(&k.ddp) + rotated.mul(&k.dw) + k.w.cross(&rotated.mul(&k.w));
        Self { ten: Ten { m, h: total, i }, dh2: dh.scaled(two), ddh, c, dl }
    }
    /// The form of the torque of a joint with screw `(s, u)` that carries this.
    fn form(&self, s: &V3<T>, u: &V3<T>, out: &mut Vec<T>) {
        let (h, j) = (&self.ten.h, &self.ten.i);
        push(out, &(s.scaled(self.ten.m) + u.cross(h)));
        push(out, &(h.cross(s) + j.mul(u)));
        push(out, &(self.dh2.cross(s) + self.c.tr_mul(u)));
        // w.Q w = s.(w x (w x h)) - w.(u x J w).
        let sh = s.dot(h);
        let uj = [0, 1, 2].map(|i| u.cross(&j.col(i)));
        let q = |a: usize, b: usize| {
            let mut x = s.get(a) * h.get(b) + s.get(b) * h.get(a) - uj[b].get(a) - uj[a].get(b);
            x = x.scale(0.5);
            if a == b { x - sh } else { x }
        };
        out.extend([q(0, 0), q(0, 1), q(1, 1), q(0, 2), q(1, 2), q(2, 2)]);
        push(out, s);
        push(out, u);
    }
}

/// Pose and motion of a frame relative to the base: `R, p, p., p.., w, w.`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame<T> {
    pub(super) r: M3<T>,
    pub(super) p: V3<T>,
    pub(super) dp: V3<T>,
    pub(super) ddp: V3<T>,
    pub(super) w: V3<T>,
    pub(super) dw: V3<T>,
}

impl<T: Scalar> Frame<T> {
    /// At rest in the base.
    pub(super) fn fixed(x: &Xform<f64>) -> Self {
        let z = V3::zero();
        let r = M3([0, 1, 2].map(|i| lift(&x.rot.column(i).into_owned())));
        Self { r, p: lift(&x.pos), dp: z, ddp: z, w: z, dw: z }
    }
    pub(super) fn read(x: &[T]) -> Self {
        let v = |i: usize| V3::from_slice(&x[i..i + 3]);
        Self { r: M3([v(0), v(3), v(6)]), p: v(9), dp: v(12), ddp: v(15), w: v(18), dw: v(21) }
    }
    fn write(&self, out: &mut Vec<T>) {
        let r = &self.r.0;
        for v in [&r[0], &r[1], &r[2], &self.p, &self.dp, &self.ddp, &self.w, &self.dw] {
            push(out, v);
        }
    }
    /// A frame at rest in this one.
    fn then(&self, x: &Xform<f64>) -> Self {
        let at = self.r.mul(&lift(&x.pos));
        let turning = self.w.cross(&at);
        Self {
            r: M3([0, 1, 2].map(|i| self.r.mul(&lift(&x.rot.column(i).into_owned())))),
            p: self.p + at,
            dp: self.dp + turning,
            ddp: self.ddp + self.dw.cross(&at) + self.w.cross(&turning),
            ..*self
        }
    }
}

/// What a joint feels: `tau = ga.a + gb.al + gw.w + w.Q w + ...`, and its screw `(s, u)`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    pub(super) ga: V3<f64>,
    pub(super) gb: V3<f64>,
    pub(super) gw: V3<f64>,
    pub(super) q: S3<f64>,
    pub(super) s: V3<f64>,
    pub(super) u: V3<f64>,
}

impl Row {
    pub(super) fn read(x: &[f64]) -> Self {
        let v = |i: usize| V3::from_slice(&x[i..i + 3]);
        let q = S3 { xx: x[9], xy: x[10], yy: x[11], xz: x[12], yz: x[13], zz: x[14] };
        Self { ga: v(0), gb: v(3), gw: v(6), q, s: v(15), u: v(18) }
    }
}

#[derive(Clone, Debug)]
struct Link {
    parent: usize,
    placement: Xform<f64>,
    axis: V3<f64>,
    slides: bool,
    body: [f64; 10],
}

/// The links, and frames on them that are to be followed.
#[derive(Clone, Debug)]
pub(super) struct ArmModel {
    links: Vec<Link>,
    sites: Vec<(usize, Xform<f64>)>,
    /// Joints between each body and the base.
    pub(super) above: Vec<Vec<usize>>,
}

impl ArmModel {
    pub(super) fn new(model: &Model, params: &Params<f64>, sites: Vec<(usize, Xform<f64>)>) -> Self {
        let links = model.bodies().iter().enumerate().map(|(l, b)| Link {
            parent: b.parent,
            placement: b.joint.placement,
            axis: V3::from(&b.joint.axis),
            slides: b.joint.kind == JointKind::Prismatic,
            body: params.body(l + 1).to_params(),
        });
        let mut above = vec![Vec::new(); model.n_bodies()];
        for (l, b) in model.bodies().iter().enumerate() {
            let mut path = above[b.parent].clone();
            path.push(l);
            above[l + 1] = path;
        }
        Self { links: links.collect(), sites, above }
    }
    pub(super) fn joints(&self) -> usize {
        self.links.len()
    }
    /// Numbers per node: arm, frames, and rows where there is a sample.
    pub(super) fn len(&self, rows: bool) -> usize {
        ARM + FRAME * self.sites.len() + if rows { ROW * self.links.len() } else { 0 }
    }
    /// First number of row `j`.
    pub(super) fn row_at(&self, j: usize) -> usize {
        ARM + FRAME * self.sites.len() + ROW * j
    }
    /// Fills `out` with the numbers at one instant.
    pub(super) fn numbers<T: Scalar>(&self, [q, qd, qdd]: [&[T]; 3], rows: bool, out: &mut Vec<T>) {
        let z = V3::zero();
        let base = Frame { r: M3([0, 1, 2].map(unit)), p: z, dp: z, ddp: z, w: z, dw: z };
        let n = self.links.len();
        let mut at = vec![base; n + 1];
        let mut sums = vec![Arm::zero(); n + 1];
        let mut screws = Vec::with_capacity(n);
        for (l, link) in self.links.iter().enumerate() {
            let mut x = at[link.parent].then(&link.placement);
            let axis = V3::new(link.axis.x, link.axis.y, link.axis.z);
            let axis = V3::new(T::from_f64(axis.x), T::from_f64(axis.y), T::from_f64(axis.z));
            let a = x.r.mul(&axis);
            let two = T::from_f64(2.0);
            if link.slides {
                let (r, v) = (a.scaled(q[l]), a.scaled(qd[l]));
                let turning = x.w.cross(&r);
                x.p += r;
                x.ddp += x.dw.cross(&r) + x.w.cross(&turning) + x.w.cross(&v).scaled(two) + a.scaled(qdd[l]);
                x.dp += turning + v;
                screws.push((a, V3::zero()));
            } else {
                let (sin, cos) = q[l].sin_cos();
                // Rodrigues: columns of the turn, carried to the base.
                let turned = [0, 1, 2].map(|i| {
                    let e = unit::<T>(i);
                    let along = axis.scaled(axis.get(i) * (T::one() - cos));
                    x.r.mul(&(e.scaled(cos) + axis.cross(&e).scaled(sin) + along))
                });
                x.r = M3(turned);
                x.dw += a.scaled(qdd[l]) + x.w.cross(&a).scaled(qd[l]);
                x.w += a.scaled(qd[l]);
                screws.push((x.p.cross(&a), a));
            }
            at[l + 1] = x;
            sums[l + 1] = Arm::body(&link.body, &x);
        }
        for l in (0..n).rev() {
            let own = sums[l + 1];
            sums[self.links[l].parent].add(&own);
        }
        out.clear();
        sums[0].write(out);
        for (body, x) in &self.sites {
            at[*body].then(x).write(out);
        }
        if rows {
            for (l, (s, u)) in screws.iter().enumerate() {
                sums[l + 1].form(s, u, out);
            }
        }
    }
    /// Adds to `[gq, gqd, gqdd]` the gradient of `sum weights . numbers`.
    pub(super) fn pull_back(&self, [q, qd, qdd]: [&[f64]; 3], rows: bool, weights: &[f64], g: [&mut [f64]; 3]) {
        const CHUNK: usize = ff_model::scalar::DIRECTIONS;
        let n = self.links.len();
        let mut x: Vec<Grad> = q.iter().chain(qd).chain(qdd).map(|&x| Grad::constant(x)).collect();
        let mut out = Vec::with_capacity(self.len(rows));
        for first in (0..3 * n).step_by(CHUNK) {
            let count = CHUNK.min(3 * n - first);
            for k in 0..count {
                x[first + k].eps[k] = 1.0;
            }
            self.numbers([&x[..n], &x[n..2 * n], &x[2 * n..]], rows, &mut out);
            for k in 0..count {
                x[first + k].eps[k] = 0.0;
                let slope: f64 = out.iter().zip(weights).map(|(o, w)| w * o.eps[k]).sum();
                g[(first + k) / n][(first + k) % n] += slope;
            }
        }
    }
}

fn push<T: Scalar>(out: &mut Vec<T>, v: &V3<T>) {
    out.extend([v.x, v.y, v.z]);
}

pub(super) fn unit<T: Scalar>(i: usize) -> V3<T> {
    let mut e = [T::zero(); 3];
    e[i] = T::one();
    V3::from_slice(&e)
}

fn lift<T: Scalar>(v: &nalgebra::Vector3<f64>) -> V3<T> {
    V3::new(T::from_f64(v.x), T::from_f64(v.y), T::from_f64(v.z))
}
