//! Joints that follow others, in tables and records of the prescribed arm.
//!
//! Tables are those of the tree with every joint moving by itself, `theta = G q + o`; a record has the torques of the coordinates,
//! `tau = G^T tau_tree`, and so have its derivatives ([`ff_model::tree::Coordinates`]).

use crate::motion::joint::JointMotion;
use ff_model::tree::Coordinates;
use ff_model::{Model, Scalar};
use nalgebra::DMatrix;
use std::sync::Arc;

/// The motion of all joints of the tree that a motion of the coordinates is.
pub(crate) struct OfTree<'a> {
    pub(crate) map: &'a Coordinates,
    pub(crate) motion: &'a dyn JointMotion,
}

impl JointMotion for OfTree<'_> {
    fn dof(&self) -> usize {
        dof(self.map, self.motion)
    }
    fn duration(&self) -> f64 {
        self.motion.duration()
    }
    /// Allocates.
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        expand(self.map, self.motion, t, [q, qd, qdd]);
        q.iter_mut().zip(self.map.joints()).for_each(|(q, c)| *q += c.offset);
    }
    fn breaks(&self) -> Vec<f64> {
        self.motion.breaks()
    }
}

/// The change of the motion of all joints of the tree that a change of the motion of the coordinates is: offsets play no part.
pub(crate) struct ChangeOfTree {
    pub(crate) map: Coordinates,
    pub(crate) motion: Arc<dyn JointMotion>,
}

impl JointMotion for ChangeOfTree {
    fn dof(&self) -> usize {
        dof(&self.map, &self.motion)
    }
    fn duration(&self) -> f64 {
        self.motion.duration()
    }
    /// Allocates.
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        expand(&self.map, &self.motion, t, [q, qd, qdd]);
    }
    fn breaks(&self) -> Vec<f64> {
        self.motion.breaks()
    }
}

/// Joints of the tree; a motion of something else stays one of something else, so that it is refused where it is used.
fn dof(map: &Coordinates, motion: &dyn JointMotion) -> usize {
    if motion.dof() == map.len() { map.joints().len() } else { usize::MAX }
}

/// `G q`, `G q'`, `G q''`.
fn expand(map: &Coordinates, motion: &dyn JointMotion, t: f64, to: [&mut [f64]; 3]) {
    let n = map.len();
    let mut own = vec![0.0; 3 * n];
    let (q, rest) = own.split_at_mut(n);
    let (qd, qdd) = rest.split_at_mut(n);
    motion.eval(t, q, qd, qdd);
    for (from, to) in [q, qd, qdd].into_iter().zip(to) {
        map.rates(from, to);
    }
}

/// Runs `f` with the tree where joints of `model` follow others, and folds what it gives; `None` where none does.
pub(crate) fn over_tree<R, E>(
    model: &Model,
    f: impl FnOnce(&Model) -> Result<R, E>,
    fold: impl FnOnce(&Coordinates, R) -> R,
) -> Option<Result<R, E>> {
    let map = model.coordinates()?;
    Some(f(&model.spanning()).map(|r| fold(map, r)))
}

/// Torques of the coordinates from those of the tree, a joint per column.
pub(crate) fn columns<T: Scalar>(map: &Coordinates, of_tree: &DMatrix<T>) -> DMatrix<T> {
    let mut out = DMatrix::from_element(of_tree.nrows(), map.len(), T::zero());
    for (from, c) in of_tree.column_iter().zip(map.joints()) {
        out.column_mut(c.index).iter_mut().zip(&from).for_each(|(to, x)| *to += x.scale(c.multiplier));
    }
    out
}

/// Derivatives of torques of the coordinates from those of the tree: row `i n + j` is joint `j` of `n` at sample `i`.
pub(crate) fn rows(map: &Coordinates, of_tree: &DMatrix<f64>) -> DMatrix<f64> {
    let (tree, n) = (map.joints().len(), map.len());
    let mut out = DMatrix::zeros(of_tree.nrows() / tree * n, of_tree.ncols());
    // Columns stand one behind the other, and each is made of whole samples.
    for (from, to) in of_tree.as_slice().chunks_exact(tree).zip(out.as_mut_slice().chunks_exact_mut(n)) {
        map.torques(from, to);
    }
    out
}
