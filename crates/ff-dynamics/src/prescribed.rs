//! A prescribed joint motion, condensed once into what the base and the passive coordinates feel of it.
//!
//! With the joints following a given motion, the arm is one time-varying rigid body plus a momentum. In base
//! coordinates, with `s_i` the twist of link `i` relative to the base and `J_j` the joint screws,
//!
//! ```text
//! I = sum I_i,   h = sum I_i s_i,   wrench = I A + I' V + h' + V x* (I V + h),
//! s_i = s_p + J_j qd_j,   s_i' = s_p' + J_j qdd_j + s_p x J_j qd_j,
//! ```
//!
//! where a prime is the componentwise rate in the base frame. None of it depends on the state of the base or
//! of the appendages, nor on their parameters, so it is tabulated once per record and arm; every later
//! evaluation costs the same whatever the number of joints. The same sums over the subtree of joint `j`,
//! projected on `J_j`, give its torque.

use crate::motion::JointMotion;
use crate::work::Work;
use ff_model::{Force, Inertia, JointKind, Model, Motion, Params, Xform};
use nalgebra::Vector3;

/// Motion of a frame relative to the base, in base coordinates.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Carried {
    /// Pose in the base.
    pub(crate) x: Xform<f64>,
    /// Relative twist and its rate.
    pub(crate) s: Motion<f64>,
    pub(crate) ds: Motion<f64>,
}

/// A set of links moving with the joints: inertia, relative momentum, and their rates.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Carrier {
    pub(crate) inertia: Inertia<f64>,
    pub(crate) d_inertia: Inertia<f64>,
    pub(crate) h: Force<f64>,
    pub(crate) dh: Force<f64>,
}

impl Carrier {
    fn zero() -> Self {
        Self { inertia: Inertia::zero(), d_inertia: Inertia::zero(), h: Force::zero(), dh: Force::zero() }
    }
    fn add(&mut self, o: &Self) {
        self.inertia += o.inertia;
        self.d_inertia += o.d_inertia;
        self.h += o.h;
        self.dh += o.dh;
    }
    /// A body of inertia `b` (base coordinates) moving with `s`, `ds` relative to the base.
    fn of_body(b: &Inertia<f64>, s: &Motion<f64>, ds: &Motion<f64>) -> Self {
        let d = b.rate(s);
        Self { inertia: *b, d_inertia: d, h: b.mul_motion(s), dh: d.mul_motion(s) + b.mul_motion(ds) }
    }
}

/// What a joint torque is made of at one sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JointRow {
    /// Joint screw in base coordinates.
    pub(crate) screw: Motion<f64>,
    /// The subtree it carries.
    pub(crate) carrier: Carrier,
}

/// Tables of one prescribed motion: nodes at half integration steps, joint rows at samples.
#[derive(Clone, Debug)]
pub struct Prescribed {
    /// Integration step (s); nodes lie at half steps.
    pub(crate) step: f64,
    pub(crate) substeps: usize,
    pub(crate) samples: usize,
    pub(crate) sample_s: f64,
    /// Arm per node (base body not included).
    pub(crate) arm: Vec<Carrier>,
    /// Per node: mount frames of all appendages, then frames of the tracked links.
    pub(crate) frames: Vec<Carried>,
    pub(crate) per_node: usize,
    /// Tracked links.
    pub(crate) links: Vec<usize>,
    /// Per sample, per joint.
    pub(crate) rows: Vec<JointRow>,
    /// `above[body]`: joints on the way from that body to the base (0-based joint indices).
    pub(crate) above: Vec<Vec<usize>>,
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
    /// `links` are bodies whose inertial parameters will be differentiated ([`crate::sensitivity`]). Allocates.
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
        let Sampling { samples, sample_s, substeps } = *sampling;
        assert_eq!(motion.dof(), model.nj(), "joint motion");
        assert!(samples > 0 && substeps > 0, "at least one sample and one step per sample");
        let nj = model.nj();
        let nodes = (samples - 1) * substeps * 2 + 1;
        let per_node = model.appendages().len() + links.len();
        let step = sample_s / substeps as f64;
        let mut above = vec![Vec::new(); model.n_bodies()];
        for i in 1..model.n_bodies() {
            let mut path = vec![i - 1];
            path.extend_from_slice(&above[model.bodies()[i - 1].parent]);
            above[i] = path;
        }
        let mut t = Self {
            step,
            substeps,
            samples,
            sample_s,
            arm: Vec::with_capacity(nodes),
            frames: Vec::with_capacity(nodes * per_node),
            per_node,
            links: links.to_vec(),
            rows: Vec::with_capacity(samples * nj),
            above,
        };
        let mut work = Work::<f64>::new(model);
        let (mut q, mut qd, mut qdd) = (vec![0.0; nj], vec![0.0; nj], vec![0.0; nj]);
        let at_base = Carried { x: Xform::identity(), s: Motion::zero(), ds: Motion::zero() };
        let mut bodies = vec![at_base; nj + 1];
        let mut screws = vec![Motion::zero(); nj + 1];
        let mut sub = vec![Carrier::zero(); nj + 1];
        for k in 0..nodes {
            motion.eval(0.5 * step * k as f64, &mut q, &mut qd, &mut qdd);
            work.place(model, &q);
            for (i, b) in model.bodies().iter().enumerate() {
                let parent = bodies[b.parent];
                let x = parent.x * work.x[i + 1];
                let local = match b.joint.kind {
                    JointKind::Prismatic => Motion::new(work.axis[i + 1], Vector3::zeros()),
                    _ => Motion::new(Vector3::zeros(), work.axis[i + 1]),
                };
                let screw = x.motion_to_parent(&local);
                let s = parent.s + screw.scaled(qd[i]);
                let ds = parent.ds + screw.scaled(qdd[i]) + parent.s.cross(&screw.scaled(qd[i]));
                bodies[i + 1] = Carried { x, s, ds };
                screws[i + 1] = screw;
                sub[i + 1] = Carrier::of_body(&params.body(i + 1).to_parent(&x), &s, &ds);
            }
            sub[0] = Carrier::zero();
            for i in (1..=nj).rev() {
                let c = sub[i];
                sub[model.bodies()[i - 1].parent].add(&c);
            }
            t.arm.push(sub[0]);
            for a in model.appendages() {
                let b = bodies[a.host];
                t.frames.push(Carried { x: b.x * a.mount, ..b });
            }
            for &l in links {
                t.frames.push(bodies[l]);
            }
            if k % (2 * substeps) == 0 {
                t.rows.extend((1..=nj).map(|i| JointRow { screw: screws[i], carrier: sub[i] }));
            }
        }
        t
    }
    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.samples
    }
    /// Time between samples (s).
    pub fn sample_s(&self) -> f64 {
        self.sample_s
    }
    /// Integration step (s).
    pub fn step(&self) -> f64 {
        self.step
    }
    pub(crate) fn frames_at(&self, node: usize) -> &[Carried] {
        &self.frames[node * self.per_node..(node + 1) * self.per_node]
    }
    pub(crate) fn rows_at(&self, sample: usize) -> &[JointRow] {
        let n = self.rows.len() / self.samples;
        &self.rows[sample * n..(sample + 1) * n]
    }
}
