//! Appendages restated as ordinary tree links: a free oracle for tests (see `flex_panel::PanelChain::twin_bodies` and
//! `slosh_pendulum::SloshPendulum::twin_bodies`).

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
