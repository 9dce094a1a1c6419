//! Flags that several commands share.

pub(crate) mod choice;
pub(crate) mod fit;
pub(crate) mod record;
