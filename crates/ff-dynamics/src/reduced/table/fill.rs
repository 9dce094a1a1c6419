//! How the tables of a prescribed motion are filled: several instants at a time, one per lane.
//!
//! From the base outwards every link gets its pose and its rates relative to the base, from the tips inwards the moments
//! of what it carries are summed; the sums of all links are the arm's 28 numbers, those of a subtree its joint's row.

use super::{ARM, Arm, FORM, FRAME, Frame, Prescribed, ROW, Site};
use crate::motion::joint::JointMotion;
use crate::tree::links::{Link, links, place};
use ff_lanes::Kernel;
use ff_model::scalar::lanes::LaneTask;
use ff_model::scalar::{LaneScalar, ModelScalar};
use ff_model::spatial::vec3::{M3, Pose, S3, Ten, Turn, V3, turn};
use ff_model::{JointKind, Model, Params, Xform};

/// Fills the tables once.
pub(super) struct Fill<'a> {
    pub(super) table: &'a mut Prescribed,
    pub(super) model: &'a Model,
    pub(super) params: &'a Params<f64>,
    pub(super) motion: &'a dyn JointMotion,
}

impl LaneTask for Fill<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: LaneScalar>(self) {
        let Self { table, model, params, motion } = self;
        Filler::<L>::new(model, params).fill(table, motion, 0.0);
    }
}

/// What fills tables, with its buffers.
pub(crate) struct Filler<'a, L: LaneScalar> {
    model: &'a Model,
    bodies: Vec<Body<L>>,
    links: Vec<Link<L>>,
    moved: Vec<Moved<L>>,
    sums: Vec<Sums<L>>,
    q: Vec<L>,
    /// `[q | qd | qdd]` at one instant, and by lane.
    joint: Vec<f64>,
    given: Vec<[f64; 8]>,
}

/// A body that moves relative to the base.
#[derive(Clone, Copy)]
struct Moved<T> {
    r: M3<T>,
    p: V3<T>,
    dp: V3<T>,
    ddp: V3<T>,
    w: V3<T>,
    dw: V3<T>,
}

/// The sums of the module docs, with `int r r^T` in place of `J`.
#[derive(Clone, Copy)]
struct Sums<T> {
    m: T,
    h: V3<T>,
    dh: V3<T>,
    ddh: V3<T>,
    rr: S3<T>,
    k: M3<T>,
    dl: V3<T>,
}

impl<'a, L: LaneScalar> Filler<'a, L> {
    /// For the arm parameters in `params`.
    pub(crate) fn new(model: &'a Model, params: &Params<f64>) -> Self {
        let nj = model.nj();
        Self {
            model,
            bodies: (0..=nj).map(|i| Body::new(&Ten::from(params.body(i)))).collect(),
            links: links(model),
            moved: vec![Moved::at_rest(); nj + 1],
            sums: vec![Sums::<L>::zero(); nj + 1],
            q: vec![L::zero(); nj],
            joint: vec![0.0; 3 * nj],
            given: vec![[0.0; 8]; 3 * nj],
        }
    }

    /// Fills `table` for a record that begins at time `start` (s) of the motion. Does not allocate.
    ///
    /// # Panics
    /// If the motion has another number of joints than the model.
    #[inline(always)]
    pub(crate) fn fill(&mut self, table: &mut Prescribed, motion: &dyn JointMotion, start: f64) {
        assert_eq!(motion.dof(), self.model.nj(), "joint motion");
        L::enter(Filling { filler: self, table, motion, start });
    }
}

struct Filling<'a, 'b, L: LaneScalar> {
    filler: &'a mut Filler<'b, L>,
    table: &'a mut Prescribed,
    motion: &'a dyn JointMotion,
    start: f64,
}

impl<L: LaneScalar> Kernel for Filling<'_, '_, L> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { filler, table, motion, start } = self;
        let Filler { model, bodies, links, moved, sums, q, joint, given } = filler;
        let nj = model.nj();
        // Nodes of samples, which want joint rows, then the nodes between them.
        let per = 2 * table.substeps;
        let between = (table.samples - 1) * (per - 1);
        let from = table.first_node();
        let (mut first, mut rows) = (0, true);
        loop {
            let total = if rows { table.samples } else { between };
            if first >= total {
                if !rows {
                    break;
                }
                (first, rows) = (0, false);
                continue;
            }
            let count = L::N.min(total - first);
            // A group that is not full repeats its last node.
            let mut nodes = [0; 8];
            for (lane, node) in nodes.iter_mut().enumerate().take(L::N) {
                let i = first + lane.min(count - 1);
                *node = if rows { i * per } else { i / (per - 1) * per + 1 + i % (per - 1) };
                let (p, rest) = joint.split_at_mut(nj);
                let (v, a) = rest.split_at_mut(nj);
                if lane < count {
                    motion.eval(start + 0.5 * table.step * (from + *node) as f64, p, v, a);
                    if rows {
                        table.joints[3 * nj * i..3 * nj * (i + 1)].copy_from_slice(joint);
                    }
                }
                given.iter_mut().zip(&*joint).for_each(|(g, &x)| g[lane] = x);
            }
            q.iter_mut().zip(&*given).for_each(|(q, g)| *q = L::load(g));
            place(links, q);
            for i in 1..=nj {
                let l = &links[i];
                let (qd, qdd) = (L::load(&given[nj + i - 1]), L::load(&given[2 * nj + i - 1]));
                let prismatic = model.bodies()[i - 1].joint.kind == JointKind::Prismatic;
                moved[i] = moved[l.parent].step(l, qd, qdd, prismatic);
                sums[i] = moved[i].sums(&bodies[i]);
            }
            sums[0] = Sums::zero();
            let with_power = !table.power.is_empty();
            let mut power = [L::zero(); FORM];
            for i in (1..=nj).rev() {
                let own = sums[i];
                sums[links[i].parent].add(&own);
                if !(rows || with_power) {
                    continue;
                }
                let (v, w) = links[i].screw();
                let u = moved[i].r.mul(&w);
                let s = moved[i].p.cross_add(&u, &moved[i].r.mul(&v));
                let row = own.row(&s, &u);
                let qd = L::load(&given[nj + i - 1]);
                for (p, &x) in power.iter_mut().zip(&row) {
                    *p = crate::linalg::rows::fma(x, qd, *p);
                }
                if rows {
                    scatter(&row, &nodes[..count], |n| (n / per * nj + i - 1) * ROW, &mut table.rows);
                }
            }
            if with_power {
                scatter(&power, &nodes[..count], |n| n * FORM, &mut table.power);
            }
            scatter(&sums[0].arm().numbers(), &nodes[..count], |n| n * ARM, &mut table.arm);
            for site in &table.sites {
                if let Site::Body(host, x, column) = site {
                    let frame = moved[*host].frame(x);
                    let at = |n: usize| (n * table.moving + column) * FRAME;
                    scatter(&frame.numbers(), &nodes[..count], at, &mut table.frames);
                }
            }
            first += count;
        }
    }
}

/// Writes the lanes of `x` one after another, each where `at` says.
#[inline(always)]
fn scatter<L: LaneScalar, const N: usize>(x: &[L; N], nodes: &[usize], at: impl Fn(usize) -> usize, to: &mut [f64]) {
    // As many numbers as there are lanes at a time, so that those of a node are written together.
    let whole = N - N % L::N;
    for (k, group) in x[..whole].chunks_exact(L::N).enumerate() {
        for (&n, numbers) in nodes.iter().zip(&L::transpose(group, 1)) {
            numbers.store(&mut to[at(n) + k * L::N..][..L::N]);
        }
    }
    let mut lane = [0.0; 8];
    for (i, x) in x.iter().enumerate().skip(whole) {
        x.store(&mut lane);
        for (&n, &y) in nodes.iter().zip(&lane) {
            to[at(n) + i] = y;
        }
    }
}

/// A body about its own origin, with second moments in place of the inertia.
struct Body<T> {
    m: T,
    h: V3<T>,
    rr: S3<T>,
}

impl<T: ModelScalar> Body<T> {
    fn new(b: &Ten<f64>) -> Self {
        let half = 0.5 * (b.i.xx + b.i.yy + b.i.zz);
        let c = T::from_f64;
        Self {
            m: c(b.m),
            h: V3::new(c(b.h.x), c(b.h.y), c(b.h.z)),
            rr: S3 {
                xx: c(half - b.i.xx),
                xy: c(-b.i.xy),
                yy: c(half - b.i.yy),
                xz: c(-b.i.xz),
                yz: c(-b.i.yz),
                zz: c(half - b.i.zz),
            },
        }
    }
}

/// `I v` of a body with second moments `s` of this trace: `I = tr(S) 1 - S`.
#[inline(always)]
fn spin<T: ModelScalar>(s: &S3<T>, trace: T, v: &V3<T>) -> V3<T> {
    v.scaled(trace) - s.mul(v)
}

/// Element `(i, j)` of `S + p h^T + h p^T + m p p^T` from `S_ij`, `(p_i, p_j)`, `(h_i, h_j)`.
#[inline(always)]
fn second_moment<T: ModelScalar>(s: T, p: (T, T), h: (T, T), m: T) -> T {
    (p.0 * p.1).mul_add(m, p.0.mul_add(h.1, p.1.mul_add(h.0, s)))
}

impl<T: ModelScalar> Moved<T> {
    fn at_rest() -> Self {
        let (o, i, z) = (T::zero(), T::one(), V3::zero());
        let r = M3([V3::new(i, o, o), V3::new(o, i, o), V3::new(o, o, i)]);
        Self { r, p: z, dp: z, ddp: z, w: z, dw: z }
    }
    /// The body that a joint carries from this one.
    #[inline(always)]
    fn step(&self, l: &Link<T>, qd: T, qdd: T, prismatic: bool) -> Self {
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
        if prismatic {
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
            (x.turn, x.r) = (Turn::General, self.r);
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
    fn frame(&self, x: &Xform<f64>) -> Frame<T> {
        let mount = Pose::<T>::constant(x);
        let d = self.r.mul(&mount.p);
        let mut pose = Pose::identity();
        pose.turn = Turn::General;
        pose.r = if mount.turn == Turn::None {
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

impl<T: ModelScalar> Sums<T> {
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
    fn arm(&self) -> Arm<T> {
        let (s, k) = (&self.rr, &self.k.0);
        let two = T::from_f64(2.0);
        let (tr, twice) = (k[0].x + k[1].y + k[2].z, |v: V3<T>| v.scaled(two));
        let i = S3 { xx: s.yy + s.zz, xy: -s.xy, yy: s.xx + s.zz, xz: -s.xz, yz: -s.yz, zz: s.xx + s.yy };
        Arm {
            ten: Ten { m: self.m, h: self.h, i },
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
