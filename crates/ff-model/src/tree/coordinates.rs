//! Joint coordinates: joints that follow another one at a fixed ratio have none of their own.
//!
//! Joint `i` of the tree stands at
//!
//! ```text
//! theta_i = m_i q_c(i) + o_i,      theta' = G q',      tau = G^T tau_tree,      H = G^T H_tree G
//! ```
//!
//! with the coordinate `c(i)` of the joint that it follows, multiplier `m_i` and offset `o_i`; of a joint that moves by itself `c(i)`
//! is its own coordinate, `m_i = 1` and `o_i = 0`. `G` is constant, and the coupling is ideal: it takes no power, so that the torque of
//! a coordinate is that of its own joint plus `m_i` times those of its followers (principle of virtual power; R. Featherstone, *Rigid
//! Body Dynamics Algorithms*, 2008, sec. 8.3, with gears as explicit constraints).

use crate::scalar::traits::Scalar;

/// Where a joint of the tree stands: `multiplier q[index] + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointCoordinate {
    /// Index of the coordinate in `q`.
    pub index: usize,
    /// Motion per motion of the coordinate (1, rad/m, m/rad).
    pub multiplier: f64,
    /// Position at coordinate zero (rad or m).
    pub offset: f64,
}

/// The map `theta = G q + o` from joint coordinates to the joints of the tree, where some joints follow others.
#[derive(Clone, Debug, PartialEq)]
pub struct Coordinates {
    /// Of every joint of the tree.
    pub(crate) of: Vec<JointCoordinate>,
    /// The joint that moves by itself, of every coordinate; ascending.
    pub(crate) own: Vec<usize>,
}

impl Coordinates {
    /// Every joint by itself.
    pub(crate) fn independent(joints: usize) -> Self {
        let own = |index| JointCoordinate { index, multiplier: 1.0, offset: 0.0 };
        Self { of: (0..joints).map(own).collect(), own: (0..joints).collect() }
    }
    /// Number of coordinates `n`.
    pub fn len(&self) -> usize {
        self.own.len()
    }
    /// True without coordinates.
    pub fn is_empty(&self) -> bool {
        self.own.is_empty()
    }
    /// The coordinate of every joint of the tree, followers included.
    pub fn joints(&self) -> &[JointCoordinate] {
        &self.of
    }
    /// The joint of the tree that each coordinate belongs to, ascending.
    pub fn own(&self) -> &[usize] {
        &self.own
    }
    /// Positions of all joints of the tree from the coordinates: `theta = G q + o` (rad or m). Does not allocate.
    ///
    /// # Panics
    /// If `q` is shorter than the coordinates.
    #[inline]
    pub fn positions<T: Scalar>(&self, q: &[T], theta: &mut [T]) {
        for (t, c) in theta.iter_mut().zip(&self.of) {
            *t = q[c.index].scale(c.multiplier) + T::from_f64(c.offset);
        }
    }
    /// Rates or accelerations of all joints of the tree from those of the coordinates: `theta' = G q'`. Does not allocate.
    ///
    /// # Panics
    /// If `rates` is shorter than the coordinates.
    #[inline]
    pub fn rates<T: Scalar>(&self, rates: &[T], theta: &mut [T]) {
        for (t, c) in theta.iter_mut().zip(&self.of) {
            *t = rates[c.index].scale(c.multiplier);
        }
    }
    /// Torques of the coordinates from those of all joints of the tree: `tau = G^T tau_tree` (N m or N). Does not allocate.
    ///
    /// # Panics
    /// If `tau` is shorter than the coordinates.
    #[inline]
    pub fn torques<T: Scalar>(&self, of_tree: &[T], tau: &mut [T]) {
        tau[..self.len()].fill(T::zero());
        for (&x, c) in of_tree.iter().zip(&self.of) {
            tau[c.index] += x.scale(c.multiplier);
        }
    }
}
