//! TODO-FOLDER ffid workflow

pub mod excite;
pub mod identify;
pub mod preflight;
