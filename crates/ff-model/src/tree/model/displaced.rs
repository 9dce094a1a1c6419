//! The same model with its joints and mounts elsewhere.

use super::Model;
use crate::tree::kinematics::{Kinematics, joint_pose};

impl Model {
    /// The model with joints and mounts displaced by the kinematic parameters: what every algorithm computes with where
    /// they are not zero. Joint offsets become part of the placements. Allocates.
    ///
    /// # Panics
    /// If the values belong to a model with other joints or appendages.
    #[must_use]
    pub fn displaced(&self, by: &Kinematics<f64>) -> Self {
        assert_eq!(by.values().len(), self.n_kinematic_params(), "number of kinematic parameters");
        let mut model = self.clone();
        for (j, b) in model.bodies.iter_mut().enumerate() {
            b.joint.placement = joint_pose(by.joint(j), &b.joint);
        }
        for (k, a) in model.appendages.iter_mut().enumerate() {
            a.mount = by.mount(k).apply(&a.mount);
        }
        model
    }
}
