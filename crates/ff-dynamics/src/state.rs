//! Position and velocity of a whole system.

use ff_model::spatial::so3::{Quat, quat_identity};
use ff_model::{BaseKind, Model, Motion, Scalar};
use nalgebra::Vector3;

/// Names of the generalised velocity, in order: `base.v_x` to `base.w_z` (none for a fixed base), the joints,
/// the passive coordinates as `appendage.coordinate`. Allocates.
pub fn dof_names(model: &Model) -> Vec<String> {
    const BASE: [&str; 6] = ["base.v_x", "base.v_y", "base.v_z", "base.w_x", "base.w_y", "base.w_z"];
    let base = BASE.iter().take(model.nb()).map(|s| (*s).to_owned());
    let passive = model.passive_coords().into_iter().map(|(name, _)| name);
    base.chain(model.joint_names()).chain(passive).collect()
}

/// State of a [`Model`]: base pose, joint positions, passive coordinates and the generalised velocity.
///
/// `v = [base twist (base frame, linear first) | joint rates | passive rates]`; a fixed base has no base part.
///
/// ```
/// use ff_dynamics::State;
/// # let robot = ff_testkit::tree::system(); // arm, two wings and a boom on springs, fuel
///
/// let mut state = State::<f64>::zero(&robot);
/// state.v[5] = 0.02; // rad/s about z of the base
/// state.qd_mut()[3] = -0.1;
/// assert_eq!((state.base_twist().ang.z, state.v[6 + 3]), (0.02, -0.1));
/// assert_eq!((state.q.len(), state.nu().len()), (robot.nj(), robot.np()));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct State<T: Scalar> {
    /// Base origin in the world (m).
    pub pos: Vector3<T>,
    /// Base attitude `[w, x, y, z]`, base to world, unit norm.
    pub att: Quat<T>,
    /// Joint positions, length `n` (rad or m).
    pub q: Vec<T>,
    /// Passive coordinates, length `m`.
    pub eta: Vec<T>,
    /// Generalised velocity, length `nv`.
    pub v: Vec<T>,
    nb: usize,
}

impl<T: Scalar> State<T> {
    /// Everything zero, attitude identity. Allocates.
    pub fn zero(model: &Model) -> Self {
        Self {
            pos: Vector3::zeros(),
            att: quat_identity(),
            q: vec![T::zero(); model.nj()],
            eta: vec![T::zero(); model.np()],
            v: vec![T::zero(); model.nv()],
            nb: if model.base_kind() == BaseKind::Floating { 6 } else { 0 },
        }
    }
    /// Base twist in base coordinates; zero for a fixed base.
    #[inline(always)]
    pub fn base_twist(&self) -> Motion<T> {
        if self.nb == 6 { Motion::from_slice(&self.v) } else { Motion::zero() }
    }
    /// Joint rates.
    #[inline(always)]
    pub fn qd(&self) -> &[T] {
        &self.v[self.nb..self.nb + self.q.len()]
    }
    /// Passive rates.
    #[inline(always)]
    pub fn nu(&self) -> &[T] {
        &self.v[self.nb + self.q.len()..]
    }
    /// Joint rates, to write.
    #[inline(always)]
    pub fn qd_mut(&mut self) -> &mut [T] {
        let (a, b) = (self.nb, self.nb + self.q.len());
        &mut self.v[a..b]
    }
    /// Passive rates, to write.
    #[inline(always)]
    pub fn nu_mut(&mut self) -> &mut [T] {
        let a = self.nb + self.q.len();
        &mut self.v[a..]
    }
    /// Copies another state of the same model without allocating.
    pub fn copy_from(&mut self, o: &Self) {
        self.pos = o.pos;
        self.att = o.att;
        self.q.copy_from_slice(&o.q);
        self.eta.copy_from_slice(&o.eta);
        self.v.copy_from_slice(&o.v);
    }
    /// True when every number is finite, in every lane.
    #[inline(always)]
    pub fn is_finite(&self) -> bool {
        // Loops: a chain of iterators is not inlined into code for lanes.
        let mut all = true;
        for part in [self.pos.as_slice(), self.att.as_slice(), &self.q, &self.eta, &self.v] {
            for x in part {
                all &= x.is_finite();
            }
        }
        all
    }
}

impl State<f64> {
    /// The same state over another scalar, with zero derivatives. Allocates.
    pub fn lift<T: Scalar>(&self) -> State<T> {
        let l = |v: &[f64]| v.iter().map(|&x| T::from_f64(x)).collect();
        State {
            pos: self.pos.map(T::from_f64),
            att: self.att.map(T::from_f64),
            q: l(&self.q),
            eta: l(&self.eta),
            v: l(&self.v),
            nb: self.nb,
        }
    }
}
