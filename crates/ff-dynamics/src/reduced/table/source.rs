//! Where a stage of the simulation reads the numbers of the arm: from one table for all lanes, or from one table per lane.

use super::numbers::{ARM, Arm, FRAME, Frame, JointRow, ROW};
use super::prescribed::{Prescribed, Site};
use ff_model::scalar::{LaneScalar, ModelScalar};
use ff_model::spatial::vec3::{M3, Pose, RotationKind, V3};

/// Numbers of the arm over `T`.
pub(crate) trait ArmSource<T> {
    /// Its steps, samples and sites.
    fn layout(&self) -> &Prescribed;
    /// The frame of a site that is at rest in the base, or a place for one that moves.
    fn at_rest(&self, site: usize) -> Frame<T>;
    /// The arm at a node.
    fn arm(&self, node: usize) -> Arm<T>;
    /// A frame that moves, at a node.
    fn frame(&self, column: usize, node: usize) -> Frame<T>;
    /// The row of joint `j` at a sample.
    fn row(&self, sample: usize, j: usize) -> JointRow<T>;
}

/// The same for all lanes.
impl<T: ModelScalar> ArmSource<T> for Prescribed {
    #[inline(always)]
    fn layout(&self) -> &Prescribed {
        self
    }
    fn at_rest(&self, site: usize) -> Frame<T> {
        match &self.sites[site] {
            Site::Base(x) | Site::Body(_, x, _) => Frame::fixed(x),
        }
    }
    #[inline(always)]
    fn arm(&self, node: usize) -> Arm<T> {
        self.arm(node)
    }
    #[inline(always)]
    fn frame(&self, column: usize, node: usize) -> Frame<T> {
        self.frame(column, node)
    }
    #[inline(always)]
    fn row(&self, sample: usize, j: usize) -> JointRow<T> {
        self.row(sample, j)
    }
}

/// One table per lane: all of one sampling, number of joints and hosts of the appendages. The first gives the layout.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OnePerLane<'a>(pub(crate) &'a [&'a Prescribed]);

impl OnePerLane<'_> {
    /// Numbers that lie `at` in the vector `of` a table, one table per lane.
    #[inline(always)]
    fn read<L: LaneScalar, const N: usize>(&self, of: impl Fn(&Prescribed) -> &[f64], at: usize) -> [L; N] {
        let mut lanes = [[0.0; 8]; N];
        for (lane, table) in self.0[..L::N].iter().enumerate() {
            for (x, &y) in lanes.iter_mut().zip(&of(table)[at..at + N]) {
                x[lane] = y;
            }
        }
        let mut out = [L::zero(); N];
        for (x, lanes) in out.iter_mut().zip(&lanes) {
            *x = L::load(lanes);
        }
        out
    }
}

impl<L: LaneScalar> ArmSource<L> for OnePerLane<'_> {
    #[inline(always)]
    fn layout(&self) -> &Prescribed {
        self.0[0]
    }
    fn at_rest(&self, site: usize) -> Frame<L> {
        let poses = self.0[..L::N].iter().map(|t| match &t.sites[site] {
            Site::Base(x) | Site::Body(_, x, _) => x,
        });
        let mut lanes = [[0.0; 8]; 12];
        for (lane, x) in poses.enumerate() {
            for (to, &from) in lanes.iter_mut().zip(x.rot.iter().chain(x.pos.iter())) {
                to[lane] = from;
            }
        }
        let v = |i: usize| V3::new(L::load(&lanes[i]), L::load(&lanes[i + 1]), L::load(&lanes[i + 2]));
        let mut pose = Pose::identity();
        (pose.turn, pose.r, pose.p) = (RotationKind::General, M3([v(0), v(3), v(6)]), v(9));
        Frame::at_rest(pose)
    }
    #[inline(always)]
    fn arm(&self, node: usize) -> Arm<L> {
        let x: [L; ARM] = self.read(|t| &t.arm, node * ARM);
        Arm::read(|i| x[i])
    }
    #[inline(always)]
    fn frame(&self, column: usize, node: usize) -> Frame<L> {
        let x: [L; FRAME] = self.read(|t| &t.frames, (node * self.0[0].moving + column) * FRAME);
        Frame::read(|i| x[i])
    }
    #[inline(always)]
    fn row(&self, sample: usize, j: usize) -> JointRow<L> {
        let x: [L; ROW] = self.read(|t| &t.rows, (sample * self.0[0].nj + j) * ROW);
        JointRow::read(&x, |x| x)
    }
}
