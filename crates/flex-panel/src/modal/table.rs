//! Modes from a table in CSV.

use super::Mode;
use ff_model::{Area, Problem, Problems};
use nalgebra::Vector6;
use std::collections::BTreeMap;
use std::path::Path;

/// Largest table read (bytes).
pub(super) const MAX_BYTES: usize = 16 << 20;

/// Columns of a CSV table of modes, in this order: number, Hz, no unit, three of translation, three of rotation about
/// the mount. Participation is for a modal mass of 1 kg, in mount axes.
pub const CSV_COLUMNS: [&str; 9] =
    ["mode", "freq_hz", "damping_ratio", "px_kg", "py_kg", "pz_kg", "prx_kgm", "pry_kgm", "prz_kgm"];

/// A problem with a line of a file.
pub(super) fn fault(file: &Path, line: usize, code: &'static str, what: impl Into<String>, hint: &str) -> Problem {
    Problem::error(Area::Data, code, what).in_file(file).at_line(line).on("modes").hint(hint)
}

/// A finite number with a decimal point, or why not.
pub(super) fn number(text: &str) -> Result<f64, String> {
    // Rust reads "nan" and "inf" as numbers; a table of modes has none of these.
    match text.parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        Ok(x) => Err(format!("{x} is not a finite number")),
        Err(_) => Err(format!("'{}' is not a number", text.chars().take(40).collect::<String>())),
    }
}

/// Modes by number from the text of a CSV file whose first line is [`CSV_COLUMNS`]. Lines that are blank or start with
/// `#` are skipped. `file` is for messages. Allocates.
///
/// # Errors
/// Every line that is wrong, all of [`Area::Data`]: `Data::Columns` (header or count of columns), `Data::BadNumber`,
/// `Data::Duplicate` (a mode number given twice), `Data::Missing` (no modes).
pub fn read_csv(text: &str, file: &Path) -> Result<BTreeMap<u32, Mode>, Problems> {
    let mut out = Problems::default();
    let mut modes = BTreeMap::new();
    let mut lines = (1..).zip(text.lines()).filter(|(_, l)| !l.trim().is_empty() && !l.trim_start().starts_with('#'));
    let header = CSV_COLUMNS.join(",");
    match lines.next() {
        Some((_, l)) if l.split(',').map(str::trim).eq(CSV_COLUMNS) => {}
        Some((n, _)) => {
            let hint = format!("the first line must be {header}");
            out.push(fault(file, n, "Data::Columns", "is not the header of a table of modes", &hint));
            return Err(out);
        }
        None => {
            out.push(fault(file, 1, "Data::Missing", "holds no table", &format!("the first line must be {header}")));
            return Err(out);
        }
    }
    for (line, text) in lines {
        let fields: Vec<&str> = text.split(',').map(str::trim).collect();
        if fields.len() != CSV_COLUMNS.len() {
            let what = format!("{} columns, expected {}", fields.len(), CSV_COLUMNS.len());
            out.push(fault(file, line, "Data::Columns", what, "separate by commas; numbers have a decimal point"));
            continue;
        }
        let mut x = [0.0; 8];
        let mut good = true;
        for (k, field) in fields.iter().enumerate().skip(1) {
            match number(field) {
                Ok(v) => x[k - 1] = v,
                Err(why) => {
                    let what = format!("column {}: {why}", CSV_COLUMNS[k]);
                    out.push(fault(file, line, "Data::BadNumber", what, "give a finite number"));
                    good = false;
                }
            }
        }
        let Ok(mode) = fields[0].parse::<u32>() else {
            let what =
                format!("column mode: '{}' is not a mode number", fields[0].chars().take(40).collect::<String>());
            out.push(fault(file, line, "Data::BadNumber", what, "number the modes 1, 2, 3, ..."));
            continue;
        };
        let [freq, zeta, p @ ..] = x;
        let m = Mode { frequency_hz: freq, damping_ratio: zeta, participation: Vector6::from(p) };
        if good && modes.insert(mode, m).is_some() {
            out.push(fault(
                file,
                line,
                "Data::Duplicate",
                format!("mode {mode} is given twice"),
                "keep one of the two",
            ));
        }
    }
    if modes.is_empty() && !out.has_errors() {
        out.push(fault(file, 1, "Data::Missing", "the table has no modes", "give one line per mode"));
    }
    if out.has_errors() { Err(out) } else { Ok(modes) }
}
