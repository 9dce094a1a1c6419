//! Tables of a prescribed motion over any scalar.

use super::arm_model::ArmModel;
use super::numbers::{Arm, Frame, JointRow};
use super::prescribed::{Prescribed, Site};
use super::sampling::Sampling;
use super::source::ArmSource;
use crate::motion::joint::JointMotion;
use crate::reduced::coupled::OfTree;
use ff_model::spatial::vec3::{M3, Pose, RotationKind, V3};
use ff_model::{Kinematics, Model, Params, Scalar, Xform};

/// What [`Prescribed`] holds, over any scalar: links' parameters, placements of joints and mounts, or both may carry
/// derivatives, and so does then the record that `crate::simulate_reduced_over` makes of it.
#[derive(Clone, Debug)]
pub struct ArmTable<T: Scalar> {
    layout: Prescribed,
    model: ArmModel<T>,
    /// [`ArmModel::numbers`] per node, with rows where there is a sample.
    nodes: Vec<Vec<T>>,
    /// Frames of the sites, and where those that move stand among the sites.
    at_rest: Vec<Frame<T>>,
    moving: Vec<usize>,
}

impl<T: Scalar> ArmTable<T> {
    /// Tabulates `motion` for the links' parameters in `params` and joints and mounts displaced by `kinematics`. Allocates.
    ///
    /// # Panics
    /// If the motion has another number of joints than the model, `params` or `kinematics` belong to another model, or there
    /// are no samples or substeps.
    pub fn new(
        model: &Model,
        params: &Params<T>,
        kinematics: &Kinematics<T>,
        motion: &dyn JointMotion,
        sampling: &Sampling,
    ) -> Self {
        if let Some(map) = model.coordinates() {
            let motion = OfTree { map, motion };
            return Self::new(&model.spanning(), params, kinematics, &motion, sampling);
        }
        assert_eq!(motion.dof(), model.nj(), "joint motion");
        let layout = Prescribed::layout(model, sampling, &[]);
        let mounts = model.appendages().iter().enumerate();
        let sites: Vec<(usize, Xform<T>)> =
            mounts.map(|(k, a)| (a.host, kinematics.mount(k).apply(&a.mount))).collect();
        let rest = |(_, x): &(usize, Xform<T>)| {
            let mut pose = Pose::identity();
            (pose.turn, pose.r, pose.p) = (RotationKind::General, M3::from(&x.rot), V3::from(&x.pos));
            Frame::at_rest(pose)
        };
        let at_rest = sites.iter().map(rest).collect();
        let moving = (0..sites.len()).filter(|&i| matches!(layout.sites[i], Site::Body(..))).collect();
        let mut arm = ArmModel::new(model, params, &sites).displaced(kinematics);
        let nj = model.nj();
        let mut joints = vec![0.0; 3 * nj];
        let mut x = vec![T::zero(); 3 * nj];
        let mut node = |i: usize| {
            let (q, rest) = joints.split_at_mut(nj);
            let (qd, qdd) = rest.split_at_mut(nj);
            motion.eval(sampling.time_of(i), q, qd, qdd);
            x.iter_mut().zip(&joints).for_each(|(x, &j)| *x = T::from_f64(j));
            let mut out = Vec::new();
            arm.numbers(
                [&x[..nj], &x[nj..2 * nj], &x[2 * nj..]],
                i.is_multiple_of(sampling.nodes_per_sample()),
                &mut out,
            );
            out
        };
        let nodes = (0..sampling.nodes()).map(&mut node).collect();
        Self { layout, model: arm, nodes, at_rest, moving }
    }
}

impl<T: Scalar> ArmSource<T> for ArmTable<T> {
    fn layout(&self) -> &Prescribed {
        &self.layout
    }
    fn at_rest(&self, site: usize) -> Frame<T> {
        self.at_rest[site]
    }
    fn arm(&self, node: usize) -> Arm<T> {
        Arm::from_slice(&self.nodes[node])
    }
    fn frame(&self, column: usize, node: usize) -> Frame<T> {
        Frame::from_slice(&self.nodes[node][self.model.frame_at(self.moving[column])..])
    }
    fn row(&self, sample: usize, j: usize) -> JointRow<T> {
        JointRow::from_slice(&self.nodes[self.layout.node_of(sample)][self.model.row_at(j)..])
    }
}
