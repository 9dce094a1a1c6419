//! TODO-FOLDER ff-dynamics tree

pub(crate) mod aba;
pub(crate) mod blocks;
pub(crate) mod condense;
pub(crate) mod crba;
pub(crate) mod derivatives;
pub(crate) mod forward;
pub(crate) mod frames;
pub(crate) mod links;
pub(crate) mod regressor;
pub(crate) mod rnea;

pub use aba::{SingularInertia, aba};
pub use blocks::MassBlocks;
pub use crba::{mass_matrix, mass_matrix_lower};
pub use derivatives::{Derivatives, hybrid_columns, rnea_derivatives};
pub use forward::{DEEP, by_mass_matrix, forward_dynamics, hybrid_dynamics};
pub use frames::{frame_jacobian, frame_pose};
pub use regressor::{Regressor, body_regressor, regressor};
pub use rnea::{bias, rnea};
