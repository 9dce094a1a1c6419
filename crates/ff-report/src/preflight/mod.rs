//! TODO-FOLDER ff-report preflight

pub(crate) mod figures;
pub mod page;
