//! TODO-FOLDER ffid-cli flags

pub(crate) mod fit;
pub(crate) mod record;
