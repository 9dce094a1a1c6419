//! Appendages restated as ordinary tree links with springs and dampers: an independent reference for tests, and what
//! programs read that know links and joints only.

use crate::spatial::inertia::Inertia;
use crate::spatial::motion::Xform;
use nalgebra::Vector3;

/// One body of the tree-link twin of an appendage, on a continuous revolute joint.
///
/// The twin tree has the coordinates of the appendage, in the same order; its springs and dampers are
/// external joint torques `-k (eta - rest) - d nu`.
#[derive(Clone, Debug, PartialEq)]
pub struct TwinBody {
    /// Index of the parent twin body; `None` hangs on the mount frame.
    pub parent: Option<usize>,
    /// Unit joint axis in the body frame.
    pub axis: Vector3<f64>,
    /// Joint frame at zero in the parent (twin body or mount) frame.
    pub placement: Xform<f64>,
    /// Inertia about the body frame; massless for the inner body of a universal joint.
    pub inertia: Inertia<f64>,
    /// Spring stiffness of the joint (N m/rad).
    pub stiffness: f64,
    /// Damper coefficient of the joint (N m s/rad).
    pub damping: f64,
    /// Angle at which the spring is relaxed (rad).
    pub rest: f64,
}

/// An appendage that is also a chain or tree of ordinary links with springs and dampers, such as
/// `flex_panel::PanelChain` and `slosh_pendulum::SloshPendulum`.
///
/// Of an appendage behind a handle it is found by [`DynAppendage::tree_twin`](crate::DynAppendage::tree_twin).
/// `validate::check_appendage` holds the equations of motion of the appendage to those of its twin.
pub trait TreeTwin {
    /// The links at parameters `p` (SI units, in the order of the declaration), link `i` moved by coordinate `i`, parents
    /// before their children. `None` where this one has no such form: a tree joint has no spring across two hinges.
    /// Allocates.
    ///
    /// # Panics
    /// If `p` is shorter than the parameters of the declaration.
    fn tree_bodies(&self, p: &[f64]) -> Option<Vec<TwinBody>>;
}
