//! From the table of a mission file to a modal appendage.

use super::table::MAX_BYTES;
use super::{ModalAppendage, Mode, check_modes, check_rigid, read_csv, read_f06};
use ff_model::diagnostics::text_file;
use ff_model::keys;
use ff_model::keys::Keys;
use ff_model::{Area, DynAppendage, Inertia, Problem, Problems};
use nalgebra::{Vector3, Vector6};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// Builds a [`ModalAppendage`] from its table in a mission file (a [`ff_model::registry::Factory`]). Allocates; reads
/// the file that `modes_file` names.
///
/// Keys: `mass_kg`, `com_m = [x, y, z]`, `inertia_com_kgm2 = [xx, xy, xz, yy, yz, zz]` (of the undeformed structure,
/// mount axes), and one of
///
/// * `modes`: an array of tables with `freq_hz`, `damping_ratio`, `participation = [x, y, z, rx, ry, rz]` (kg and
///   kg m at a modal mass of 1 kg, about the mount, mount axes);
/// * `modes_file`: a table with these in columns (`.csv`, see [`read_csv`]) or the output of a Nastran run (`.f06`, see
///   [`read_f06`], with `damping_ratio` for all modes beside it). `modes_used = [1, 2, 5]` picks modes by number, in
///   this order; all of the file unless given.
///
/// ```toml
/// [[appendage]]
/// kind = "modal"
/// name = "wing"
/// host = "base"
/// mass_kg = 66.0
/// com_m = [0.0, 2.15, 0.0]
/// inertia_com_kgm2 = [106.0, 0.0, 0.0, 22.0, 0.0, 106.0]
/// modes_file = "wing.f06"
/// damping_ratio = 0.005
/// modes_used = [1, 2]
/// ```
///
/// # Errors
/// Every problem of table and file: those of [`ff_model::keys::read`], [`ModalAppendage::new`], [`read_csv`] and
/// [`read_f06`]; `Config::Conflict` when both or neither of `modes` and `modes_file` are given, `Config::BadChoice` for
/// another kind of file.
pub fn from_toml(table: &toml::Table) -> Result<Arc<dyn DynAppendage>, Problems> {
    let (rigid, modes) = keys::read(table, |t| {
        let (mass, com, i_com) = (t.number("mass_kg"), t.numbers("com_m"), t.symmetric("inertia_com_kgm2"));
        let modes = match (t.has("modes"), t.has("modes_file")) {
            (true, false) => t.each("modes", "one table per mode", |_, t| mode(t)),
            (false, true) => from_file(t),
            (both, _) => {
                let what = if both { "both modes and modes_file are given" } else { "modes are missing" };
                let p = Problem::error(Area::Config, "Config::Conflict", what).on("modes");
                t.accept_unknown();
                t.problems().push(p.hint("give the modes as tables (modes) or by a file (modes_file)"));
                None
            }
        };
        // What could be read is checked even when something else is wrong, so that one run shows everything.
        let rigid = mass.zip(com).zip(i_com).map(|((m, c), i)| Inertia::from_com(m, &Vector3::from(c), &i));
        let sound = rigid.is_some_and(|r| check_rigid(&r, t.problems()));
        let modes = modes.filter(|m| check_modes(m, t.problems()));
        Some((rigid.filter(|_| sound)?, modes?))
    })?;
    Ok(ModalAppendage::new(rigid, &modes)?.into())
}

fn mode(t: &mut Keys<'_, '_>) -> Option<Mode> {
    let (f, zeta, p) = (t.number("freq_hz"), t.number("damping_ratio"), t.numbers::<6>("participation"));
    Some(Mode { frequency_hz: f?, damping_ratio: zeta?, participation: Vector6::from(p?) })
}

/// Modes of the file that `modes_file` names, as far as `modes_used` asks for them.
fn from_file(t: &mut Keys<'_, '_>) -> Option<Vec<Mode>> {
    let name = t.text("modes_file");
    let used = if t.has("modes_used") { Some(t.list("modes_used")?) } else { None };
    let file = Path::new(name?);
    let extension = file.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let found = match extension.as_str() {
        "csv" => text_file(file, MAX_BYTES).and_then(|s| read_csv(&s, file)),
        "f06" => {
            let zeta = t.number("damping_ratio")?;
            text_file(file, MAX_BYTES).and_then(|s| read_f06(&s, zeta, file))
        }
        _ => {
            let what = format!("'{}' is neither a .csv nor a .f06 file", file.display());
            let p = Problem::error(Area::Config, "Config::BadChoice", what).on(t.path_of("modes_file"));
            t.problems().push(p.hint("convert the table to .csv"));
            return None;
        }
    };
    match found {
        Ok(modes) => pick(t, modes, used),
        Err(problems) => {
            t.problems().extend(problems);
            None
        }
    }
}

fn pick(t: &mut Keys<'_, '_>, mut modes: BTreeMap<u32, Mode>, used: Option<Vec<f64>>) -> Option<Vec<Mode>> {
    let Some(used) = used else { return Some(modes.into_values().collect()) };
    let numbers: Vec<String> = modes.keys().take(20).map(u32::to_string).collect();
    let mut out = Vec::with_capacity(used.len());
    for (i, &x) in used.iter().enumerate() {
        // Taken out, so that a number asked for twice is missing the second time. A cast saturates; what is not a whole
        // number is then not equal to itself.
        let number = x as u32;
        match modes.remove(&number).filter(|_| f64::from(number) == x) {
            Some(m) => out.push(m),
            None => {
                let what = format!("{x} is no mode of the file, or is asked for twice");
                let p = Problem::error(Area::Config, "Config::UnknownMode", what)
                    .on(t.path_of(&format!("modes_used[{i}]")));
                t.problems().push(p.hint(format!("modes of the file: {}", numbers.join(", "))));
            }
        }
    }
    (out.len() == used.len()).then_some(out)
}
