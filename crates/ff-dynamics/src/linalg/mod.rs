//! Factorisations of small matrices in place.

pub mod ldl;
pub(crate) mod ltl;
pub(crate) mod rows;
