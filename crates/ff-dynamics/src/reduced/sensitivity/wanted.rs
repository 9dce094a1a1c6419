//! What to differentiate a record by.

use ff_model::Model;

/// What to differentiate, and with respect to what. Columns are those of `params`, `combined`, `kinematics`, `disturbances`, `initial`, in
/// this order.
///
/// ```
/// use ff_dynamics::Wanted;
/// # let robot = ff_testkit::tree::system(); // arm, two wings and a boom on springs, fuel
///
/// // Stiffnesses, and the base rate at the start: 3, 4 and 5 of [V 6 | eta m | nu m].
/// let wanted = Wanted { params: robot.parameter_indices("*.k[*]")?, initial: vec![3, 4, 5], ..Wanted::default() };
/// assert_eq!(wanted.len(), 5 + 2 + 3);
/// # Ok::<(), ff_model::tree::SelectionError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Wanted {
    /// Indices into the parameter vector (base body, tracked links, appendages).
    pub params: Vec<usize>,
    /// Sums of parameters, index and factor each: one column for all ten numbers of a body that is heavier than was thought. It costs what
    /// the column of one parameter costs.
    pub combined: Vec<Vec<(usize, f64)>>,
    /// Indices into the kinematic parameters ([`Model::kinematic_params`]); the table must have been made for them
    /// ([`crate::Prescribed::with_kinematics`]).
    pub kinematics: Vec<usize>,
    /// Indices into the disturbances of the table ([`crate::Prescribed::disturbed`]): derivatives with respect to their sizes.
    pub disturbances: Vec<usize>,
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
    /// Number of columns of parameters, inertial and kinematic, and of disturbances; those of the initial state follow them.
    pub fn forced(&self) -> usize {
        self.inertial() + self.kinematics.len() + self.disturbances.len()
    }
    /// Number of columns of parameters, alone and combined: the first ones.
    pub fn inertial(&self) -> usize {
        self.params.len() + self.combined.len()
    }
    /// True without columns.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Bodies other than the base whose parameters are wanted: the `links` of `Prescribed::new`.
    pub fn links(&self, model: &Model) -> Vec<usize> {
        let combined = self.combined.iter().flatten().map(|(p, _)| p);
        let all = self.params.iter().chain(combined);
        let mut l: Vec<usize> = all.filter(|&&p| p >= 10 && p < 10 * model.n_bodies()).map(|p| p / 10).collect();
        l.sort_unstable();
        l.dedup();
        l
    }
}
