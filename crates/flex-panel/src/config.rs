//! From the table of a mission file to a chain.

use crate::chain::PanelChain;
use crate::segment::Segment;
use ff_model::{Area, DynAppendage, Problem, Problems};
use nalgebra::{Matrix3, Vector3};
use serde::de::DeserializeOwned;
use std::sync::Arc;

const KEYS: [&str; 8] = [
    "mass_kg",
    "com_m",
    "inertia_com_kgm2",
    "hinge_m",
    "hinge_axis",
    "stiffness_nm_per_rad",
    "damping_nms_per_rad",
    "rest_rad",
];

/// Builds a [`PanelChain`] from its table in a mission file (a [`ff_model::registry::Factory`]). Allocates.
///
/// One key, `segments`: an array of tables from the host outwards, each with `mass_kg`, `com_m = [x, y, z]` and
/// `inertia_com_kgm2 = [xx, xy, xz, yy, yz, zz]` (centre of mass and inertia about it, segment frame),
/// `hinge_m = [x, y, z]` and `hinge_axis = [x, y, z]` (parent frame; any length but zero),
/// `stiffness_nm_per_rad`, `damping_nms_per_rad`, and optionally `rest_rad` (default 0).
///
/// # Errors
/// Every problem of the table: `Config::UnknownKey`, `Config::MissingKey`, `Config::Type`, and those of
/// [`PanelChain::new`]. `Problem::object` holds the key, such as `segments[1].hinge_axis`.
pub fn from_toml(table: &toml::Table) -> Result<Arc<dyn DynAppendage>, Problems> {
    let mut problems = Problems::default();
    unknown_keys(table, "", &["segments"], &mut problems);
    let segments = match table.get("segments") {
        None => {
            problems.push(missing("segments", "one table per rigid segment, from the host outwards"));
            Vec::new()
        }
        Some(toml::Value::Array(rows)) => {
            rows.iter().enumerate().filter_map(|(i, r)| read(i, r, &mut problems)).collect()
        }
        Some(other) => {
            problems.push(wrong_type("segments", other, "an array of tables"));
            Vec::new()
        }
    };
    // Segments that could be read were checked on the way, so that one run shows everything.
    if problems.has_errors() {
        return Err(problems);
    }
    Ok(Arc::new(PanelChain::new(segments)?))
}

/// Segment number `i`; its problems go to the list, the physical ones too when every key could be read.
fn read(i: usize, value: &toml::Value, problems: &mut Problems) -> Option<Segment> {
    let at = format!("segments[{i}].");
    let Some(t) = value.as_table() else {
        problems.push(wrong_type(at.trim_end_matches('.'), value, "a table"));
        return None;
    };
    unknown_keys(t, &at, &KEYS, problems);
    let mass: Option<f64> = key(t, &at, "mass_kg", "a number (kg)", None, problems);
    let com: Option<[f64; 3]> = key(t, &at, "com_m", "three numbers (m)", None, problems);
    let rot: Option<[f64; 6]> =
        key(t, &at, "inertia_com_kgm2", "six numbers xx, xy, xz, yy, yz, zz (kg m^2)", None, problems);
    let hinge: Option<[f64; 3]> = key(t, &at, "hinge_m", "three numbers (m)", None, problems);
    let axis: Option<[f64; 3]> = key(t, &at, "hinge_axis", "three numbers (a direction)", None, problems);
    let k: Option<f64> = key(t, &at, "stiffness_nm_per_rad", "a number (N m/rad)", None, problems);
    let d: Option<f64> = key(t, &at, "damping_nms_per_rad", "a number (N m s/rad)", None, problems);
    let rest: Option<f64> = key(t, &at, "rest_rad", "a number (rad)", Some(0.0), problems);
    let [xx, xy, xz, yy, yz, zz] = rot?;
    let i_com = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    let v = |x: [f64; 3]| Vector3::from(x);
    let segment = Segment::new(mass?, v(com?), &i_com, v(hinge?), v(axis?)).with_spring(k?, d?).with_rest(rest?);
    segment.check(i, problems);
    Some(segment)
}

/// The value of one key, or a problem that names it.
fn key<V: DeserializeOwned>(
    t: &toml::Table,
    at: &str,
    name: &str,
    want: &str,
    default: Option<V>,
    problems: &mut Problems,
) -> Option<V> {
    match t.get(name) {
        None if default.is_some() => default,
        None => {
            problems.push(missing(&format!("{at}{name}"), want));
            None
        }
        Some(v) => match v.clone().try_into() {
            Ok(x) => Some(x),
            Err(_) => {
                problems.push(wrong_type(&format!("{at}{name}"), v, want));
                None
            }
        },
    }
}

fn missing(object: &str, want: &str) -> Problem {
    Problem::error(Area::Config, "Config::MissingKey", "required key is missing").on(object).hint(format!("add {want}"))
}

fn wrong_type(object: &str, value: &toml::Value, want: &str) -> Problem {
    Problem::error(Area::Config, "Config::Type", format!("{value} ({}) where {want} must stand", value.type_str()))
        .on(object)
        .hint("numbers are written without quotes and with a decimal point")
}

fn unknown_keys(t: &toml::Table, at: &str, known: &[&str], problems: &mut Problems) {
    for name in t.keys().filter(|k| !known.contains(&k.as_str())) {
        problems.push(
            Problem::error(Area::Config, "Config::UnknownKey", "no such key; it would have no effect")
                .on(format!("{at}{name}"))
                .hint(format!("known keys: {}", known.join(", "))),
        );
    }
}
