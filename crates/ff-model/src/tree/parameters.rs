//! Parameter values of a model, over any scalar.

use crate::scalar::traits::Scalar;
use crate::spatial::inertia::Inertia;
use crate::tree::model::Model;

/// Values of all parameters of a [`Model`]: `[10 per body | parameters of each appendage in order]`.
///
/// The model holds structure and nominal values; algorithms read the values from here, so that several
/// parameter sets, or parameters that carry derivatives, can be run through one immutable model.
///
/// ```
/// use ff_model::Params;
/// # let arm = ff_testkit::tree::peers_arm(ff_model::BaseKind::Floating);
///
/// let mut params = Params::<f64>::nominal(&arm);
/// let set = params.set_matching(&arm, "*.mass", 4.25)?; // all bodies, the base too
/// assert_eq!((set, params.body(2).mass), (arm.n_bodies(), 4.25));
/// assert_eq!(params.get(&arm, "base.mass")?, 4.25);
/// # Ok::<(), ff_model::tree::SelectionError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Params<T: Scalar> {
    values: Vec<T>,
    bodies: Vec<Inertia<T>>,
}

impl<T: Scalar> Params<T> {
    /// The nominal values of the model. Allocates.
    pub fn nominal(model: &Model) -> Self {
        let v: Vec<T> = model.param_decls().iter().map(|p| T::from_f64(p.nominal)).collect();
        Self::from_values(model, v)
    }
    /// From a full parameter vector.
    ///
    /// # Panics
    /// If the length is not [`Model::n_params`].
    pub fn from_values(model: &Model, values: Vec<T>) -> Self {
        assert_eq!(values.len(), model.n_params(), "parameter vector length");
        let mut p = Self { values, bodies: vec![Inertia::zero(); model.n_bodies()] };
        p.refresh();
        p
    }
    /// Overwrites all values without allocating.
    ///
    /// # Panics
    /// If the length differs.
    pub fn set(&mut self, values: &[T]) {
        self.values.copy_from_slice(values);
        self.refresh();
    }
    fn refresh(&mut self) {
        for (i, b) in self.bodies.iter_mut().enumerate() {
            *b = Inertia::from_params(&self.values[10 * i..10 * i + 10]);
        }
    }
    /// The full vector.
    pub fn values(&self) -> &[T] {
        &self.values
    }
    /// Inertia of body `i` (0 is the base).
    ///
    /// # Panics
    /// If the body does not exist.
    #[inline(always)]
    pub fn body(&self, i: usize) -> &Inertia<T> {
        &self.bodies[i]
    }
    /// Parameters of appendage `k`.
    ///
    /// # Panics
    /// If the appendage does not exist.
    #[inline(always)]
    pub fn appendage(&self, model: &Model, k: usize) -> &[T] {
        let a = &model.appendages()[k];
        &self.values[a.param_offset..a.param_offset + a.nominal.len()]
    }
}

impl Params<f64> {
    /// The same values over another scalar: in every lane, without derivatives. Allocates.
    ///
    /// # Panics
    /// If they belong to another model.
    pub fn lift<T: Scalar>(&self, model: &Model) -> Params<T> {
        Params::from_values(model, self.values.iter().map(|&x| T::from_f64(x)).collect())
    }
}
