//! What to differentiate a record by.

use ff_model::Model;

/// What to differentiate, and with respect to what. Columns are those of `params`, `kinematics`, `initial`, in this order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Wanted {
    /// Indices into the parameter vector (base body, tracked links, appendages).
    pub params: Vec<usize>,
    /// Indices into the kinematic parameters ([`Model::kinematic_params`]); the table must have been made for them
    /// ([`crate::Prescribed::with_kinematics`]).
    pub kinematics: Vec<usize>,
    /// Indices into the initial state `z0 = [V 6 | eta m | nu m]`.
    pub initial: Vec<usize>,
    /// The acceleration of the base, too (`Sensitivities::accel`).
    pub accel: bool,
    /// The attitude of the base, too (`Sensitivities::attitude`).
    pub attitude: bool,
}

impl Wanted {
    /// Number of columns.
    pub fn len(&self) -> usize {
        self.forced() + self.initial.len()
    }
    /// Number of columns of parameters, inertial and kinematic; those of the initial state follow them.
    pub fn forced(&self) -> usize {
        self.params.len() + self.kinematics.len()
    }
    /// True without columns.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Bodies other than the base whose parameters are wanted: the `links` of `Prescribed::new`.
    pub fn links(&self, model: &Model) -> Vec<usize> {
        let mut l: Vec<usize> =
            self.params.iter().filter(|&&p| p >= 10 && p < 10 * model.n_bodies()).map(|p| p / 10).collect();
        l.sort_unstable();
        l.dedup();
        l
    }
}
