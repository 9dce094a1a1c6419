//! One file per subcommand.

pub(crate) mod check;
pub(crate) mod convert;
pub(crate) mod doctor;
pub(crate) mod excite;
pub(crate) mod identify;
pub(crate) mod init;
pub(crate) mod modes;
pub(crate) mod plan;
pub(crate) mod predict;
pub(crate) mod schema;
pub(crate) mod selfcheck;
pub(crate) mod show;
pub(crate) mod simulate;
pub(crate) mod validate;
