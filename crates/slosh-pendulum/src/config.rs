//! From the table of a mission file to a pendulum.

use crate::pendulum::{SloshPendulum, check};
use ff_model::{Problems, SharedAppendage, keys};

/// Builds a [`SloshPendulum`] from its table in a mission file (a [`ff_model::registry::Factory`]). Allocates.
///
/// Keys, all required: `mass_kg`, `length_m`, `stiffness_nm_per_rad = [k_0, k_1]`,
/// `damping_nms_per_rad = [d_0, d_1]`.
///
/// # Errors
/// Every problem of the table: those of [`ff_model::keys::read`] and of [`SloshPendulum::new`].
/// `Problem::object` holds the key.
pub fn from_toml(table: &toml::Table) -> Result<SharedAppendage, Problems> {
    let (mass, length, k, d) = keys::read(table, |t| {
        let (mass, length) = (t.number("mass_kg"), t.number("length_m"));
        let (k, d) = (t.numbers::<2>("stiffness_nm_per_rad"), t.numbers::<2>("damping_nms_per_rad"));
        // What could be read is checked even when something else is missing, so that one run shows everything.
        check(mass.unwrap_or(1.0), length.unwrap_or(1.0), k.unwrap_or_default(), d.unwrap_or_default(), t.problems());
        Some((mass?, length?, k?, d?))
    })?;
    Ok(SloshPendulum::new(mass, length, k, d)?.into())
}
