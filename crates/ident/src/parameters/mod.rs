//! Parameters to estimate: their selection, unconstrained coordinates, sizes and initial guesses.

pub(crate) mod affine;
pub(crate) mod initial_guess;
pub(crate) mod scale;
pub(crate) mod springs;
pub(crate) mod transform;

pub use ff_model::tree::{SelectionError, matches, select};
pub use initial_guess::{offset_start, random_start, wide_start};
pub use scale::sizes;
pub use springs::{is_damping, is_stiffness};
pub use transform::{Transform, TransformError, inertia_of, log_cholesky};
