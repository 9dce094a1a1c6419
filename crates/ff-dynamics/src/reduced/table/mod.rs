//! A prescribed joint motion, condensed once into what the base and the passive coordinates feel of it.
//!
//! With the joints following a given motion, the arm is one time-varying rigid body plus a momentum. Let `r` be the
//! position of a mass element in base coordinates and a dot its rate seen from the base. At base angular velocity `w`,
//! angular acceleration `al` and classical acceleration `a` of the origin, the wrench about the base origin that keeps
//! the arm moving is `f = int a(r) dm`, `n = int r x a(r) dm` with
//! `a(r) = a + al x r + w x (w x r) + 2 w x r. + r..`, that is
//!
//! ```text
//! f = m a + al x h + w x (w x h + 2 h.) + h..
//! n = J al + h x a + w x J w + C w + L.
//! h = int r dm,  J = int (r.r) 1 - r r^T dm,  L. = int r x r.. dm,
//! C = 2 (tr(K) 1 - K^T),  K = int r r.^T dm      (Coriolis: C w = 2 int r x (w x r.) dm).
//! ```
//!
//! None of it depends on the state of the base or of the appendages, nor on their parameters: 28 numbers per instant,
//! tabulated once per record and arm, and every later evaluation costs the same whatever the number of joints. The same
//! sums over the subtree of joint `j`, contracted with its screw `(s, u)` about the base origin, give its torque
//!
//! ```text
//! tau_j = ga.a + gb.al + gw.w + w^T Q w + c,
//! ga = m s + u x h,  gb = h x s + J u,  gw = 2 h. x s + C^T u,  c = s.h.. + u.L.,
//! w^T Q w = s.(w x (w x h)) + u.(w x J w).
//! ```
//!
//! The tables are filled for several instants at a time, one per lane (`fill.rs`).
pub(crate) mod fill;

pub(crate) use fill::Filler;

use crate::motion::joint::JointMotion;
use ff_model::scalar::lanes::{Isa, dispatch};
use ff_model::scalar::{LaneScalar, ModelScalar};
use ff_model::spatial::vec3::{M3, Pose, S3, Ten, Turn, V3, turn};
use ff_model::{Model, Params, Xform};
use fill::Fill;

/// The wrench on a set of links as a function of the base's motion (module docs).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Arm<T> {
    /// `m`, `h`, `J`.
    pub(crate) ten: Ten<T>,
    /// `2 h.` and `h..`.
    pub(crate) dh2: V3<T>,
    pub(crate) ddh: V3<T>,
    /// `C`.
    pub(crate) c: M3<T>,
    /// `L.`.
    pub(crate) dl: V3<T>,
}

/// Numbers of an [`Arm`].
const ARM: usize = 28;

impl<T: ModelScalar> Arm<T> {
    /// From its numbers.
    #[inline(always)]
    fn read(from: impl Fn(usize) -> T) -> Self {
        // One call of `from`, so that it is inlined.
        let mut all = [T::zero(); ARM];
        for (i, x) in all.iter_mut().enumerate() {
            *x = from(i);
        }
        let (x, v) = (|i: usize| all[i], |i: usize| V3::from_slice(&all[i..i + 3]));
        Self {
            ten: Ten { m: x(0), h: v(1), i: S3 { xx: x(4), xy: x(5), yy: x(6), xz: x(7), yz: x(8), zz: x(9) } },
            dh2: v(10),
            ddh: v(13),
            c: M3([v(16), v(19), v(22)]),
            dl: v(25),
        }
    }
    #[inline(always)]
    fn numbers(&self) -> [T; ARM] {
        let (b, c) = (&self.ten, &self.c.0);
        let mut x = [b.m; ARM];
        b.h.write_to(&mut x[1..]);
        x[4..10].copy_from_slice(&[b.i.xx, b.i.xy, b.i.yy, b.i.xz, b.i.yz, b.i.zz]);
        let rest = [&self.dh2, &self.ddh, &c[0], &c[1], &c[2], &self.dl];
        for (i, v) in rest.into_iter().enumerate() {
            v.write_to(&mut x[10 + 3 * i..]);
        }
        x
    }
}

/// Pose and motion of a frame relative to the base, in base coordinates.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame<T> {
    pub(crate) pose: Pose<T>,
    /// Whether it moves at all; what follows is zero otherwise.
    pub(crate) moving: bool,
    /// Rates of the origin, angular velocity and its componentwise rate.
    pub(crate) dp: V3<T>,
    pub(crate) ddp: V3<T>,
    pub(crate) w: V3<T>,
    pub(crate) dw: V3<T>,
}

/// Numbers of a [`Frame`].
const FRAME: usize = 24;

/// Motion of a frame that is carried by the base, in its own axes: angular velocity, angular acceleration, classical
/// acceleration of the origin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Carried<T> {
    pub(crate) w: V3<T>,
    pub(crate) al: V3<T>,
    pub(crate) a: V3<T>,
}

impl<T: ModelScalar> Frame<T> {
    /// At rest in the base.
    pub(crate) fn fixed(x: &Xform<f64>) -> Self {
        let z = V3::zero();
        Self { pose: Pose::constant(x), moving: false, dp: z, ddp: z, w: z, dw: z }
    }
    #[inline(always)]
    fn read(from: impl Fn(usize) -> T) -> Self {
        let mut all = [T::zero(); FRAME];
        for (i, x) in all.iter_mut().enumerate() {
            *x = from(i);
        }
        let v = |i: usize| V3::from_slice(&all[i..i + 3]);
        let mut pose = Pose::identity();
        (pose.turn, pose.r, pose.p) = (Turn::General, M3([v(0), v(3), v(6)]), v(9));
        Self { pose, moving: true, dp: v(12), ddp: v(15), w: v(18), dw: v(21) }
    }
    #[inline(always)]
    fn numbers(&self) -> [T; FRAME] {
        let (r, mut x) = (&self.pose.r.0, [T::zero(); FRAME]);
        let all = [&r[0], &r[1], &r[2], &self.pose.p, &self.dp, &self.ddp, &self.w, &self.dw];
        for (i, v) in all.into_iter().enumerate() {
            v.write_to(&mut x[3 * i..]);
        }
        x
    }
    /// A vector of the base in the frame.
    #[inline(always)]
    pub(crate) fn down(&self, v: &V3<T>) -> V3<T> {
        if self.pose.turn == Turn::None { *v } else { self.pose.down::<{ turn::ANY }>(v) }
    }
    /// A wrench of the frame in the base.
    #[inline(always)]
    pub(crate) fn up(&self, f: &V3<T>, n: &V3<T>) -> (V3<T>, V3<T>) {
        if self.pose.turn == Turn::None {
            self.pose.wrench_up::<{ turn::NONE }>(f, n)
        } else {
            self.pose.wrench_up::<{ turn::ANY }>(f, n)
        }
    }
    /// Motion for a base that turns with `w`, `al` and whose origin accelerates by `a`; `field` is that of `w`, `al`.
    #[inline(always)]
    pub(crate) fn carried(&self, w: &V3<T>, al: &V3<T>, a: &V3<T>, field: &M3<T>) -> Carried<T> {
        let mut at = field.mul_add(&self.pose.p, a);
        let (mut w_at, mut al_at) = (*w, *al);
        if self.moving {
            let two = T::from_f64(2.0);
            at += self.ddp + w.cross(&self.dp).scaled(two);
            al_at += w.cross_add(&self.w, &self.dw);
            w_at += self.w;
        }
        Carried { w: self.down(&w_at), al: self.down(&al_at), a: self.down(&at) }
    }
    /// Velocity of the origin in the axes of the frame, for a base that moves with `v`, `w`.
    #[inline(always)]
    pub(crate) fn velocity(&self, v: &V3<T>, w: &V3<T>) -> V3<T> {
        self.down(&(w.cross_add(&self.pose.p, v) + self.dp))
    }
}

/// A joint torque, or a sum of them, as a function of the base's motion (module docs).
#[derive(Clone, Copy, Debug)]
pub(crate) struct TorqueForm {
    pub(crate) ga: V3<f64>,
    pub(crate) gb: V3<f64>,
    pub(crate) gw: V3<f64>,
    pub(crate) q: S3<f64>,
    pub(crate) c: f64,
}

/// Numbers of a [`TorqueForm`].
const FORM: usize = 16;

impl TorqueForm {
    #[inline(always)]
    fn read(x: &[f64]) -> Self {
        Self {
            ga: V3::from_slice(x),
            gb: V3::from_slice(&x[3..]),
            gw: V3::from_slice(&x[6..]),
            q: S3 { xx: x[9], xy: x[10], yy: x[11], xz: x[12], yz: x[13], zz: x[14] },
            c: x[15],
        }
    }
    /// Its value for base acceleration `a`, `al` and the products of the components of the angular velocity `w`.
    #[inline(always)]
    pub(crate) fn value<T: ModelScalar>(&self, a: &V3<T>, al: &V3<T>, w: &V3<T>, ww: &S3<T>) -> T {
        let dot = |k: &V3<f64>, x: &V3<T>, s: T| {
            let z = T::from_f64(k.z).mul_add(x.z, s);
            T::from_f64(k.x).mul_add(x.x, T::from_f64(k.y).mul_add(x.y, z))
        };
        let s = dot(&self.ga, a, dot(&self.gb, al, dot(&self.gw, w, T::from_f64(self.c))));
        let diagonal = V3::new(ww.xx, ww.yy, ww.zz);
        let twice = V3::new(ww.xy, ww.xz, ww.yz);
        let s = dot(&V3::new(self.q.xx, self.q.yy, self.q.zz), &diagonal, s);
        dot(&V3::new(2.0 * self.q.xy, 2.0 * self.q.xz, 2.0 * self.q.yz), &twice, s)
    }
}

/// `w w^T`.
#[inline(always)]
pub(crate) fn products<T: ModelScalar>(w: &V3<T>) -> S3<T> {
    S3 { xx: w.x * w.x, xy: w.x * w.y, yy: w.y * w.y, xz: w.x * w.z, yz: w.y * w.z, zz: w.z * w.z }
}

/// What a joint torque is made of at one sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JointRow {
    pub(crate) form: TorqueForm,
    /// Screw of the joint about the base origin: velocity there, angular velocity.
    pub(crate) s: V3<f64>,
    pub(crate) u: V3<f64>,
}

impl JointRow {
    /// Torque of a wrench about the base origin.
    pub(crate) fn of(&self, f: &V3<f64>, n: &V3<f64>) -> f64 {
        self.s.dot(f) + self.u.dot(n)
    }
}

/// Numbers of a [`JointRow`].
const ROW: usize = FORM + 6;

/// Tables of one prescribed motion: nodes at half integration steps, joint rows at samples.
#[derive(Clone, Debug)]
pub struct Prescribed {
    /// Integration step (s); nodes lie at half steps.
    pub(crate) step: f64,
    pub(crate) substeps: usize,
    pub(crate) samples: usize,
    pub(crate) sample_s: f64,
    /// Sample of the motion that is the first of the table.
    first: usize,
    nj: usize,
    /// [`ARM`] numbers per node (base body not included).
    arm: Vec<f64>,
    /// [`FRAME`] numbers per moving frame and node.
    frames: Vec<f64>,
    /// Frames of the appendages' mounts, then of the tracked links: column among the moving ones, or at rest.
    pub(crate) sites: Vec<Site>,
    moving: usize,
    /// Tracked links.
    pub(crate) links: Vec<usize>,
    /// [`ROW`] numbers per joint and sample.
    rows: Vec<f64>,
    /// `[q | qd | qdd]` per sample.
    joints: Vec<f64>,
    /// [`FORM`] numbers per node: the power of the joint torques, `sum_j qd_j tau_j`, where it was asked for.
    power: Vec<f64>,
    /// `above[body]`: joints on the way from that body to the base (0-based joint indices).
    pub(crate) above: Vec<Vec<usize>>,
}

/// Where a frame is.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Site {
    /// At rest in the base.
    Base(Xform<f64>),
    /// Moving with the body of this index, here in it: column of the table.
    Body(usize, Xform<f64>, usize),
}

/// Sampling of a prescribed motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Number of samples, the first at time zero.
    pub samples: usize,
    /// Time between samples (s).
    pub sample_s: f64,
    /// Integration steps per sample, at least 1.
    pub substeps: usize,
}

impl Prescribed {
    /// Tabulates `motion` for the arm parameters in `params` (links only; base and appendages play no part).
    ///
    /// `links` are bodies whose inertial parameters will be differentiated ([`crate::reduced::sensitivity::driver`]). Allocates.
    ///
    /// # Panics
    /// If the motion has another number of joints than the model, or there are no samples or substeps.
    pub fn new(
        model: &Model,
        params: &Params<f64>,
        motion: &dyn JointMotion,
        sampling: &Sampling,
        links: &[usize],
    ) -> Self {
        let mut t = Self::empty(model, sampling, links);
        dispatch(Isa::detect(), Fill { table: &mut t, model, params, motion });
        t
    }

    /// The part of [`Prescribed::new`] for the samples `span`, bit for bit: what a long record is integrated over piece by piece
    /// ([`crate::reduced::sensitivity::driver::sensitivities_span`]). Neighbouring parts share a sample. Allocates as many numbers as the part has.
    ///
    /// # Panics
    /// As [`Prescribed::new`], and if the span is empty or ends beyond the samples.
    pub fn span(
        model: &Model,
        params: &Params<f64>,
        motion: &dyn JointMotion,
        sampling: &Sampling,
        span: core::ops::Range<usize>,
        links: &[usize],
    ) -> Self {
        assert!(span.start < span.end && span.end <= sampling.samples, "samples of a span");
        let mut t = Self::empty(model, &Sampling { samples: span.len(), ..*sampling }, links);
        t.first = span.start;
        dispatch(Isa::detect(), Fill { table: &mut t, model, params, motion });
        t
    }

    /// Tables of the right size, to be filled.
    pub(crate) fn empty(model: &Model, sampling: &Sampling, links: &[usize]) -> Self {
        let Sampling { samples, sample_s, substeps } = *sampling;
        assert!(samples > 0 && substeps > 0, "at least one sample and one step per sample");
        let nj = model.nj();
        let nodes = (samples - 1) * substeps * 2 + 1;
        let mut above = vec![Vec::new(); model.n_bodies()];
        for i in 1..model.n_bodies() {
            let mut path = vec![i - 1];
            path.extend_from_slice(&above[model.bodies()[i - 1].parent]);
            above[i] = path;
        }
        let mut moving = 0;
        let mut site = |host: usize, x: Xform<f64>| {
            if host == 0 {
                return Site::Base(x);
            }
            moving += 1;
            Site::Body(host, x, moving - 1)
        };
        let mut sites: Vec<Site> = model.appendages().iter().map(|a| site(a.host, a.mount)).collect();
        sites.extend(links.iter().map(|&l| site(l, Xform::identity())));
        Self {
            step: sample_s / substeps as f64,
            substeps,
            samples,
            sample_s,
            first: 0,
            nj,
            arm: vec![0.0; nodes * ARM],
            frames: vec![0.0; nodes * moving * FRAME],
            sites,
            moving,
            links: links.to_vec(),
            rows: vec![0.0; samples * nj * ROW],
            joints: vec![0.0; samples * 3 * nj],
            power: Vec::new(),
            above,
        }
    }

    /// With the power of the joint torques at every node, once filled.
    pub(crate) fn with_power(mut self) -> Self {
        self.power = vec![0.0; self.arm.len() / ARM * FORM];
        self
    }

    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.samples
    }
    /// Time between samples (s).
    pub fn sample_s(&self) -> f64 {
        self.sample_s
    }
    /// Time of the first sample of the table since the beginning of the motion (s).
    pub fn start_s(&self) -> f64 {
        self.first as f64 * self.sample_s
    }
    /// Node of the motion that is the first of the table.
    pub(crate) fn first_node(&self) -> usize {
        self.node_of(self.first)
    }
    /// Integration step (s).
    pub fn step(&self) -> f64 {
        self.step
    }
    /// The arm at a node, the same in every lane.
    #[inline(always)]
    pub(crate) fn arm<T: ModelScalar>(&self, node: usize) -> Arm<T> {
        let x = &self.arm[node * ARM..(node + 1) * ARM];
        Arm::read(|i| T::from_f64(x[i]))
    }
    /// The arm at several nodes, one per lane.
    #[inline(always)]
    pub(crate) fn arms<L: LaneScalar>(&self, nodes: &[usize]) -> Arm<L> {
        Arm::read(|i| lanes(nodes, |n| self.arm[n * ARM + i]))
    }
    /// A frame that moves, at a node.
    #[inline(always)]
    pub(crate) fn frame<T: ModelScalar>(&self, column: usize, node: usize) -> Frame<T> {
        let x = &self.frames[(node * self.moving + column) * FRAME..][..FRAME];
        Frame::read(|i| T::from_f64(x[i]))
    }
    /// A frame that moves, at several nodes, one per lane.
    #[inline(always)]
    pub(crate) fn frames_at<L: LaneScalar>(&self, column: usize, nodes: &[usize]) -> Frame<L> {
        Frame::read(|i| lanes(nodes, |n| self.frames[(n * self.moving + column) * FRAME + i]))
    }
    /// The row of joint `j` at a sample.
    #[inline(always)]
    pub(crate) fn row(&self, sample: usize, j: usize) -> JointRow {
        let x = &self.rows[(sample * self.nj + j) * ROW..][..ROW];
        JointRow { form: TorqueForm::read(x), s: V3::from_slice(&x[FORM..]), u: V3::from_slice(&x[FORM + 3..]) }
    }
    /// Whether the power of the joint torques is tabulated.
    #[inline(always)]
    pub(crate) fn has_power(&self) -> bool {
        !self.power.is_empty()
    }
    /// `[q | qd | qdd]` at a sample.
    #[inline(always)]
    pub(crate) fn joints(&self, sample: usize) -> &[f64] {
        &self.joints[sample * 3 * self.nj..(sample + 1) * 3 * self.nj]
    }
    /// The power of the joint torques at a node, appendages on links left out.
    #[inline(always)]
    pub(crate) fn power(&self, node: usize) -> TorqueForm {
        TorqueForm::read(&self.power[node * FORM..(node + 1) * FORM])
    }
    /// Node of a sample.
    pub(crate) fn node_of(&self, sample: usize) -> usize {
        sample * 2 * self.substeps
    }
}

/// One number per lane.
#[inline(always)]
fn lanes<L: LaneScalar>(nodes: &[usize], x: impl Fn(usize) -> f64) -> L {
    let mut a = [0.0; 8];
    for (a, &n) in a.iter_mut().zip(&nodes[..L::N]) {
        *a = x(n);
    }
    L::load(&a)
}
