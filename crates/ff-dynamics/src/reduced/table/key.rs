//! What a table depends on.

use super::sampling::Sampling;
use crate::reduced::sensitivity::wanted::Wanted;
use ff_model::{JointKind, Kinematics, Model, Params};

/// Everything that a table ([`crate::reduced::table::Prescribed`]) depends on besides the joint motion: inertial parameters of the links,
/// placements and axes of joints, hosts and placements of mounts, kinematic parameters, sampling, and what its derivatives
/// were prepared for. Base and appendages' own parameters play no part.
///
/// A cache keeps the key beside the table and asks [`TableKey::serves`] before it uses the table again.
#[derive(Clone, Debug, PartialEq)]
pub struct TableKey {
    sampling: Sampling,
    /// Parents, kinds of joints, coordinates that they follow, hosts.
    tree: Vec<usize>,
    /// Links' parameters, placements, ratios of joints that follow others, kinematic parameters.
    numbers: Vec<f64>,
    links: Vec<usize>,
    kinematics: Vec<usize>,
    disturbances: Vec<usize>,
}

impl TableKey {
    /// For a table of [`crate::reduced::table::Prescribed::with_kinematics`] with these arguments. Allocates.
    ///
    /// # Panics
    /// If `params` belong to another model.
    pub fn new(
        model: &Model,
        params: &Params<f64>,
        kinematics: &Kinematics<f64>,
        sampling: &Sampling,
        wanted: &Wanted,
    ) -> Self {
        let mut tree = Vec::new();
        let mut numbers = params.values()[10..10 * model.n_bodies()].to_vec();
        for b in model.bodies() {
            let (j, slides) = (&b.joint, usize::from(b.joint.kind == JointKind::Prismatic));
            tree.extend([b.parent, slides]);
            numbers.extend(j.placement.rot.iter().chain(j.placement.pos.iter()).chain(j.axis.iter()));
        }
        for c in model.coordinates().iter().flat_map(|c| c.joints()) {
            tree.push(c.index);
            numbers.extend([c.multiplier, c.offset]);
        }
        for a in model.appendages() {
            tree.push(a.host);
            numbers.extend(a.mount.rot.iter().chain(a.mount.pos.iter()));
        }
        numbers.extend(kinematics.values());
        let (links, kinematics) = (wanted.links(model), wanted.kinematics.clone());
        Self { sampling: *sampling, tree, numbers, links, kinematics, disturbances: wanted.disturbances.clone() }
    }
    /// For a table of [`crate::reduced::table::Prescribed::disturbed`] by disturbances of these sizes; which they are, a cache knows.
    pub fn disturbed(mut self, sizes: &[f64]) -> Self {
        self.numbers.extend(sizes);
        self
    }
    /// Whether a table with this key does where one with the key `wanted` is needed: the same numbers, and at least the same
    /// derivatives.
    pub fn serves(&self, wanted: &Self) -> bool {
        let within = |few: &[usize], all: &[usize]| few.iter().all(|x| all.contains(x));
        self.sampling == wanted.sampling
            && self.tree == wanted.tree
            && self.numbers == wanted.numbers
            && within(&wanted.links, &self.links)
            && within(&wanted.kinematics, &self.kinematics)
            && within(&wanted.disturbances, &self.disturbances)
    }
}
