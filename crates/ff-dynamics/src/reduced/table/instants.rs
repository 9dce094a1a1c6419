//! A prescribed motion at several instants at once, one per lane, and how what was computed there is written to tables.

use crate::motion::joint::JointMotion;
use core::ops::Range;
use ff_lanes::WIDEST;
use ff_model::scalar::LaneScalar;

/// The joints at several nodes, one per lane.
pub(super) struct Instants<L> {
    /// `q`, `qd` and `qdd`.
    pub(super) moving: [Vec<L>; 3],
    /// `[q | qd | qdd]` at one instant, and by lane.
    joint: Vec<f64>,
    given: Vec<[f64; WIDEST]>,
}

impl<L: LaneScalar> Instants<L> {
    /// Of so many joints. Allocates.
    pub(super) fn new(nj: usize) -> Self {
        Self {
            moving: core::array::from_fn(|_| vec![L::zero(); nj]),
            joint: vec![0.0; 3 * nj],
            given: vec![[0.0; WIDEST]; 3 * nj],
        }
    }
    /// Reads the motion at the first of the nodes `of`, which are counted among those of samples (`rows`) or those between them, of `per` nodes a
    /// sample; `time` says when a node is. Returns the nodes, and how many they are: a group that is not full repeats its last one. `sample` is
    /// told the joints at samples, with their index. Does not allocate.
    #[inline(always)]
    pub(super) fn read(
        &mut self,
        motion: &dyn JointMotion,
        (rows, per): (bool, usize),
        of: Range<usize>,
        time: impl Fn(usize) -> f64,
        mut sample: impl FnMut(usize, &[f64]),
    ) -> ([usize; WIDEST], usize) {
        let Self { moving, joint, given } = self;
        let (count, nj) = (L::N.min(of.len()), joint.len() / 3);
        let mut nodes = [0; WIDEST];
        for (lane, node) in nodes.iter_mut().enumerate().take(L::N) {
            let i = of.start + lane.min(count - 1);
            *node = if rows { i * per } else { i / (per - 1) * per + 1 + i % (per - 1) };
            if lane < count {
                let (q, rest) = joint.split_at_mut(nj);
                let (qd, qdd) = rest.split_at_mut(nj);
                motion.eval(time(*node), q, qd, qdd);
                if rows {
                    sample(i, joint);
                }
            }
            given.iter_mut().zip(&*joint).for_each(|(g, &x)| g[lane] = x);
        }
        let [q, qd, qdd] = moving;
        let all = q.iter_mut().chain(qd).chain(qdd);
        all.zip(&*given).for_each(|(x, g)| *x = L::load(g));
        (nodes, count)
    }
}

/// Writes the lanes of `x` one after another, each where `at` says.
#[inline(always)]
pub(super) fn scatter<L: LaneScalar, const N: usize>(
    x: &[L; N],
    nodes: &[usize],
    at: impl Fn(usize) -> usize,
    to: &mut [f64],
) {
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
