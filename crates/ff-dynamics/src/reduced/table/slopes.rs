//! Derivatives of the tables with respect to kinematic parameters, in closed form (`sweep/displacement.rs`), and to sizes of disturbances
//! of the motion, by forward dual numbers.
//!
//! A parameter of a joint changes the arm, the frames on what the joint carries, and the rows of joints; one of a mount
//! changes the frame of that mount alone, the same at all times where the host is the base. A disturbance of the motion changes arm,
//! rows and all frames that move; a wrench on the base is a part of two numbers of the arm.

use super::disturbance::{Disturbance, Disturbed, push};
use super::instants::{Instants, scatter};
use super::numbers::{ARM, Arm, FRAME, Frame, JointRow, ROW, columns};
use super::pool::Pool;
use super::sampling::Sampling;
use super::sweep::{Sweep, Twist, placement};
use crate::motion::joint::JointMotion;
use core::ops::Range;
use ff_lanes::WIDEST;
use ff_model::scalar::lanes::{Isa, LaneTask, dispatch};
use ff_model::scalar::{D1, Dual, LaneScalar};
use ff_model::spatial::vec3::{M3, Pose, V3};
use ff_model::tree::Placed;
use ff_model::{Kinematics, Model, Params, Xform};
use nalgebra::Vector3;

/// Derivatives of the tables, one per kinematic parameter, then one per disturbance.
#[derive(Clone, Debug, Default)]
pub(crate) struct Slopes {
    /// Indices of the kinematic parameters.
    pub(crate) of: Vec<usize>,
    /// Indices of the disturbances.
    pub(crate) disturbances: Vec<usize>,
    /// In the same order.
    pub(crate) all: Vec<Slope>,
}

/// Derivatives of the tables with respect to one kinematic parameter or disturbance.
#[derive(Clone, Debug, Default)]
pub(crate) struct Slope {
    nj: usize,
    /// Of the arm, per node, and of the rows, per sample and joint; empty for a mount.
    arm: Vec<f64>,
    rows: Vec<f64>,
    /// Of the frames of appendages, those that it moves.
    pub(crate) frames: Vec<FrameSlope>,
}

/// Derivative of the frame of an appendage.
#[derive(Clone, Debug)]
pub(crate) struct FrameSlope {
    /// The appendage.
    pub(crate) port: usize,
    /// Per node, or once where the frame is at rest in the base.
    numbers: Vec<f64>,
    at_rest: bool,
}

impl Slopes {
    /// With respect to the kinematic parameters `of`, at the values `kinematics`, for the samples `span`.
    ///
    /// # Panics
    /// If a parameter does not exist or the motion has another number of joints.
    pub(crate) fn new(
        pool: &mut Pool,
        (sampling, span): (&Sampling, Range<usize>),
        model: &Model,
        params: &Params<f64>,
        kinematics: &Kinematics<f64>,
        motion: &dyn JointMotion,
        of: &[usize],
    ) -> Self {
        let first = span.start * sampling.nodes_per_sample();
        let sampling = &Sampling { samples: span.len(), ..*sampling };
        let (decls, nj, nodes) = (model.kinematic_params(), model.nj(), sampling.nodes());
        assert!(of.iter().all(|&i| i < decls.len()), "kinematic parameters: there are {}", decls.len());
        let moves = |by: Placed, port: usize| match by {
            Placed::Joint(j) => carries(model, j, model.appendages()[port].host),
            Placed::Mount(k) => k == port,
        };
        let empty = |&i: &usize| {
            let by = decls[i].of;
            let joint = matches!(by, Placed::Joint(_));
            let (arm, rows) = if joint { (ARM * nodes, ROW * nj * sampling.samples) } else { (0, 0) };
            let (arm, rows) = (pool.zeros(arm), pool.zeros(rows));
            let frames = (0..model.appendages().len()).filter(|&port| moves(by, port)).map(|port| {
                let at_rest = model.appendages()[port].host == 0;
                FrameSlope { port, numbers: pool.zeros(FRAME * if at_rest { 1 } else { nodes }), at_rest }
            });
            let frames = frames.collect();
            Slope { nj, arm, rows, frames }
        };
        let all = of.iter().map(empty).collect();
        let mut out = Self { of: of.to_vec(), disturbances: Vec::new(), all };
        if !of.is_empty() {
            let twists: Vec<Twist> = of.iter().map(|&i| twist(model, kinematics, &decls[i].of, i)).collect();
            let displaced = model.displaced(kinematics);
            let slopes = out.all.iter_mut().zip(&twists).zip(of.iter().map(|&i| decls[i].of)).collect();
            dispatch(Isa::detect(), Displace { model: &displaced, params, motion, sampling, first, slopes });
        }
        out
    }

    /// Their memory, in the order in which [`Slopes::new`] takes it.
    pub(crate) fn into_vectors(self) -> impl DoubleEndedIterator<Item = Vec<f64>> {
        let of = |s: Slope| [s.arm, s.rows].into_iter().chain(s.frames.into_iter().map(|f| f.numbers));
        self.all.into_iter().flat_map(of)
    }

    /// With respect to the sizes of the disturbances `of` as well, behind the others.
    ///
    /// # Panics
    /// If a disturbance does not exist or has another number of joints.
    pub(crate) fn disturb(
        &mut self,
        (sampling, span): (&Sampling, Range<usize>),
        model: &Model,
        params: &Params<f64>,
        kinematics: &Kinematics<f64>,
        motion: &Disturbed<'_>,
        of: &[usize],
    ) {
        let all = motion.by.all();
        assert!(of.iter().all(|&i| i < all.len()), "disturbances: there are {}", all.len());
        let first = span.start * sampling.nodes_per_sample();
        let sampling = &Sampling { samples: span.len(), ..*sampling };
        let (nj, nodes) = (model.nj(), sampling.nodes());
        let empty = |&i: &usize| {
            let hosts = model.appendages().iter().enumerate().filter(|(_, a)| a.host > 0);
            let numbers = || vec![0.0; FRAME * nodes];
            let frames = hosts.map(|(port, _)| FrameSlope { port, numbers: numbers(), at_rest: false });
            let moves = matches!(all[i], Disturbance::Motion(_));
            let frames = if moves { frames.collect() } else { Vec::new() };
            Slope { nj, arm: vec![0.0; ARM * nodes], rows: vec![0.0; ROW * nj * sampling.samples], frames }
        };
        let behind = self.all.len();
        self.disturbances.extend_from_slice(of);
        self.all.extend(of.iter().map(empty));
        let mut motions = Vec::new();
        for (slope, &i) in self.all[behind..].iter_mut().zip(of) {
            match &all[i] {
                Disturbance::Motion(m) => {
                    assert_eq!(m.dof(), nj, "joints of a disturbance");
                    motions.push((&**m as &dyn JointMotion, slope));
                }
                Disturbance::Wrench(w) => {
                    for (node, numbers) in slope.arm.chunks_exact_mut(ARM).enumerate() {
                        push(numbers, &w(sampling.time_of(first + node)), 1.0);
                    }
                }
            }
        }
        if motions.is_empty() {
            return;
        }
        let model = &model.displaced(kinematics);
        dispatch(Isa::detect(), Disturb { model, params, motion, sampling, first, motions });
    }
}

/// What hangs on a joint or mount moves by this twist per unit of its kinematic parameter `i`, at the displacements `kinematics`: the rate of
/// the displaced pose times its inverse. A joint's position turns or slides what it carries behind its placement and changes nothing in it.
fn twist(model: &Model, kinematics: &Kinematics<f64>, of: &Placed, i: usize) -> Twist {
    let values = kinematics.values().iter().enumerate();
    let values = values.map(|(k, &x)| D1::new(x, if k == i { 1.0 } else { 0.0 })).collect();
    let kinematics = Kinematics::from_values(model, values);
    let (body, pose) = match *of {
        Placed::Joint(j) => (model.bodies()[j].parent, placement(model, &kinematics, j)),
        Placed::Mount(k) => {
            let mounted = &model.appendages()[k];
            let x: Xform<D1> = kinematics.mount(k).apply(&mounted.mount);
            (mounted.host, (M3::from(&x.rot), V3::from(&x.pos)))
        }
    };
    let at = |x: &V3<D1>| Vector3::new(x.x.re, x.y.re, x.z.re);
    let rate = |x: &V3<D1>| Vector3::new(x.x.eps[0], x.y.eps[0], x.z.eps[0]);
    // Columns c of a rotation have the rates a x c, and the sum of c x (a x c) over three of them is 2 a.
    let angular: Vector3<f64> = pose.0.0.iter().map(|c| at(c).cross(&rate(c))).sum::<Vector3<f64>>() * 0.5;
    let linear = rate(&pose.1) - angular.cross(&at(&pose.1));
    Twist { body, angular: angular.into(), linear: linear.into() }
}

/// Derivatives of the tables with respect to displacements, several instants at a time, one per lane.
struct Displace<'a, 's> {
    /// The displaced one.
    model: &'a Model,
    params: &'a Params<f64>,
    motion: &'a dyn JointMotion,
    sampling: &'a Sampling,
    /// First node of the table among those of the motion.
    first: usize,
    slopes: Vec<((&'s mut Slope, &'a Twist), Placed)>,
}

impl LaneTask for Displace<'_, '_> {
    type Output = ();
    #[inline(always)]
    fn run<L: LaneScalar>(self) {
        let Self { model, params, motion, sampling, first, mut slopes } = self;
        let (nj, nodes, per_sample) = (model.nj(), sampling.nodes(), sampling.nodes_per_sample());
        let mut sweep = Sweep::<L>::new(model, &params.lift(model));
        let mounts: Vec<Pose<L>> = model.appendages().iter().map(|a| Pose::constant(&a.mount)).collect();
        let mut instants = Instants::<L>::new(nj);
        let time = |node: usize| sampling.time_of(first + node);
        for (rows, all) in [(true, sampling.samples), (false, nodes - sampling.samples)] {
            for from in (0..all).step_by(L::N) {
                let (group, count) = instants.read(motion, (rows, per_sample), from..all, time, |_, _| {});
                let group = &group[..count];
                let [q, qd, qdd] = &instants.moving;
                sweep.outwards(q, qd, qdd);
                (1..=nj).rev().for_each(|i| sweep.inwards(i));
                for ((slope, twist), of) in &mut slopes {
                    let by = sweep.displacement(twist);
                    if let Placed::Joint(j) = *of {
                        let change = sweep.sums_slope(j + 1, &by);
                        scatter(&change.arm().numbers(), group, |n| n * ARM, &mut slope.arm);
                        for i in (1..=nj).filter(|_| rows) {
                            let row = if carries(model, j, i) {
                                sweep.row_slope_within(i, &by)
                            } else if carries(model, i - 1, j + 1) {
                                sweep.row_slope_below(i, &change)
                            } else {
                                continue;
                            };
                            scatter(&row, group, |n| (n / per_sample * nj + i - 1) * ROW, &mut slope.rows);
                        }
                    }
                    for f in &mut slope.frames {
                        let host = model.appendages()[f.port].host;
                        let frame = sweep.frame_slope(host, &mounts[f.port], &by);
                        if !f.at_rest {
                            scatter(&frame.numbers(), group, |n| n * FRAME, &mut f.numbers);
                        } else if rows && from == 0 {
                            scatter(&frame.numbers(), &group[..1], |_| 0, &mut f.numbers);
                        }
                    }
                }
            }
        }
    }
}

/// Derivatives of the tables with respect to the sizes of disturbances of the motion, several instants at a time, one per lane.
struct Disturb<'a, 's> {
    /// The displaced one.
    model: &'a Model,
    params: &'a Params<f64>,
    motion: &'a Disturbed<'a>,
    sampling: &'a Sampling,
    /// First node of the table among those of the motion.
    first: usize,
    motions: Vec<(&'a dyn JointMotion, &'s mut Slope)>,
}

impl LaneTask for Disturb<'_, '_> {
    type Output = ();
    #[inline(always)]
    fn run<L: LaneScalar>(self) {
        let Self { model, params, motion, sampling, first, mut motions } = self;
        let (nj, nodes, per_sample) = (model.nj(), sampling.nodes(), sampling.nodes_per_sample());
        let mut sweep = Sweep::<Dual<L, 1>>::new(model, &params.lift(model));
        let mounts: Vec<Pose<Dual<L, 1>>> = model.appendages().iter().map(|a| Pose::constant(&a.mount)).collect();
        let (mut instants, mut change) = (Instants::<L>::new(nj), Instants::<L>::new(nj));
        let mut joints: [Vec<Dual<L, 1>>; 3] = core::array::from_fn(|_| vec![Dual::constant(L::zero()); nj]);
        let time = |node: usize| sampling.time_of(first + node);
        for (rows, all) in [(true, sampling.samples), (false, nodes - sampling.samples)] {
            for from in (0..all).step_by(L::N) {
                let (group, count) = instants.read(motion, (rows, per_sample), from..all, time, |_, _| {});
                let group = &group[..count];
                for (by, slope) in &mut motions {
                    change.read(*by, (rows, per_sample), from..all, time, |_, _| {});
                    for (to, (at, by)) in joints.iter_mut().zip(instants.moving.iter().zip(&change.moving)) {
                        for (to, (at, by)) in to.iter_mut().zip(at.iter().zip(by)) {
                            *to = Dual { re: *at, eps: [*by] };
                        }
                    }
                    let [q, qd, qdd] = &joints;
                    sweep.outwards(q, qd, qdd);
                    (1..=nj).rev().for_each(|i| sweep.inwards(i));
                    scatter(&slope_of(&sweep.arm().numbers()), group, |n| n * ARM, &mut slope.arm);
                    for i in (1..=nj).filter(|_| rows) {
                        let at = |n: usize| (n / per_sample * nj + i - 1) * ROW;
                        scatter(&slope_of(&sweep.row(i)), group, at, &mut slope.rows);
                    }
                    for f in &mut slope.frames {
                        let frame = sweep.frame(model.appendages()[f.port].host, &mounts[f.port]);
                        scatter(&slope_of(&frame.numbers()), group, |n| n * FRAME, &mut f.numbers);
                    }
                }
            }
        }
    }
}

/// The derivatives of numbers.
#[inline(always)]
fn slope_of<L: LaneScalar, const N: usize>(x: &[Dual<L, 1>; N]) -> [L; N] {
    let mut out = [L::zero(); N];
    for (out, x) in out.iter_mut().zip(x) {
        *out = x.eps[0];
    }
    out
}

/// Whether joint `j` lies between a body and the base.
fn carries(model: &Model, j: usize, mut body: usize) -> bool {
    while body > j + 1 {
        body = model.bodies()[body - 1].parent;
    }
    body == j + 1
}

impl Slope {
    /// Whether arm and rows depend on the parameter.
    pub(crate) fn has_arm(&self) -> bool {
        !self.arm.is_empty()
    }
    /// Of the arm at nodes, one per lane.
    #[inline(always)]
    pub(crate) fn arm<L: LaneScalar>(&self, nodes: &[usize]) -> Arm<L> {
        let all: [L; ARM] = columns(&self.arm, nodes);
        Arm::read(|i| all[i])
    }
    /// Of the row of joint `j` at a sample.
    pub(crate) fn row(&self, sample: usize, j: usize) -> JointRow<f64> {
        JointRow::from_slice(&self.rows[(sample * self.nj + j) * ROW..])
    }
}

impl FrameSlope {
    /// At nodes, one per lane: `R` and `p` of the pose are derivatives, too.
    #[inline(always)]
    pub(crate) fn at<L: LaneScalar>(&self, nodes: &[usize]) -> Frame<L> {
        let mut here = [0; WIDEST];
        if !self.at_rest {
            here[..L::N].copy_from_slice(&nodes[..L::N]);
        }
        let all: [L; FRAME] = columns(&self.numbers, &here);
        Frame::read(|i| all[i])
    }
}
