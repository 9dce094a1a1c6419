//! Where derivatives of inverse dynamics are written.

use ff_model::{Model, Scalar};
use nalgebra::DMatrix;

/// Derivatives of `tau = rnea(q, v, a)` at one motion, `nv x nv` each.
///
/// Columns of `dq`: base position (zero: dynamics do not depend on it) and a small rotation of the base about
/// its own axes (zero without gravity), joint positions, passive coordinates. Columns of `dv` and `da`: the
/// generalised velocity and acceleration.
#[derive(Clone, Debug, PartialEq)]
pub struct Derivatives<T: Scalar> {
    /// d tau / d q.
    pub dq: DMatrix<T>,
    /// d tau / d v.
    pub dv: DMatrix<T>,
    /// d tau / d a: the mass matrix.
    pub da: DMatrix<T>,
}

impl<T: Scalar> Derivatives<T> {
    /// Zeros for `model`. Allocates.
    pub fn new(model: &Model) -> Self {
        let z = DMatrix::from_element(model.nv(), model.nv(), T::zero());
        Self { dq: z.clone(), dv: z.clone(), da: z }
    }
}
