//! TODO-FOLDER ff-dynamics linalg

pub mod ldl;
pub(crate) mod ltl;
pub(crate) mod rows;
