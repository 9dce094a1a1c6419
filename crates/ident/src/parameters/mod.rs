//! TODO-FOLDER ident parameters

pub(crate) mod affine;
pub(crate) mod initial_guess;
pub(crate) mod scale;
pub(crate) mod selection;
pub(crate) mod transform;

pub use initial_guess::{offset_start, random_start};
pub use scale::sizes;
pub use selection::{SelectionError, matches, select};
pub use transform::{Transform, TransformError, inertia_of, log_cholesky};
