//! From the table of a mission file to a pendulum.

use crate::pendulum::{SloshPendulum, check};
use ff_model::{Area, DynAppendage, Problem, Problems};
use serde::de::DeserializeOwned;
use std::sync::Arc;

const KEYS: [&str; 4] = ["mass_kg", "length_m", "stiffness_nm_per_rad", "damping_nms_per_rad"];

/// Builds a [`SloshPendulum`] from its table in a mission file (a [`ff_model::registry::Factory`]). Allocates.
///
/// Keys, all required: `mass_kg`, `length_m`, `stiffness_nm_per_rad = [k_0, k_1]`,
/// `damping_nms_per_rad = [d_0, d_1]`.
///
/// # Errors
/// Every problem of the table: `Config::UnknownKey`, `Config::MissingKey`, `Config::Type`, and those of
/// [`SloshPendulum::new`]. `Problem::object` holds the key.
pub fn from_toml(table: &toml::Table) -> Result<Arc<dyn DynAppendage>, Problems> {
    let mut problems = Problems::default();
    for name in table.keys().filter(|k| !KEYS.contains(&k.as_str())) {
        problems.push(
            Problem::error(Area::Config, "Config::UnknownKey", "no such key; it would have no effect")
                .on(name.as_str())
                .hint(format!("known keys: {}", KEYS.join(", "))),
        );
    }
    let mass: Option<f64> = key(table, KEYS[0], "a number (kg)", &mut problems);
    let length: Option<f64> = key(table, KEYS[1], "a number (m)", &mut problems);
    let k: Option<[f64; 2]> = key(table, KEYS[2], "two numbers (N m/rad)", &mut problems);
    let d: Option<[f64; 2]> = key(table, KEYS[3], "two numbers (N m s/rad)", &mut problems);
    // What could be read is checked even when something else is missing, so that one run shows everything.
    check(mass.unwrap_or(1.0), length.unwrap_or(1.0), k.unwrap_or_default(), d.unwrap_or_default(), &mut problems);
    match (mass, length, k, d) {
        (Some(mass), Some(length), Some(k), Some(d)) if !problems.has_errors() => {
            Ok(Arc::new(SloshPendulum::new(mass, length, k, d)?))
        }
        _ => Err(problems),
    }
}

/// The value of one key, or a problem that names it.
fn key<V: DeserializeOwned>(t: &toml::Table, name: &str, want: &str, problems: &mut Problems) -> Option<V> {
    let problem = match t.get(name) {
        None => {
            Problem::error(Area::Config, "Config::MissingKey", "required key is missing").hint(format!("add {want}"))
        }
        Some(v) => match v.clone().try_into() {
            Ok(x) => return Some(x),
            Err(_) => {
                let why = format!("{v} ({}) where {want} must stand", v.type_str());
                Problem::error(Area::Config, "Config::Type", why)
                    .hint("numbers are written without quotes and with a decimal point")
            }
        },
    };
    problems.push(problem.on(name));
    None
}
