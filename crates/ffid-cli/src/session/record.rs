//! Records: read from a file, or made of what is in memory.

use super::Refused;
use super::options::{another, parse};
use crate::Command;
use crate::flags::record::{believed, plausible};
use crate::results;
use crate::results::io;
use ff_mission::Leniency;
use ff_model::{Model, Problems};
use ff_records::Record;
use ff_records::file::{Loaded, joints_of, read_columns as columns_of};
use ffid::files::folder::Entry;
use std::path::{Path, PathBuf};

/// A record, where it is from, and what was put up with when it was made.
#[derive(Clone, Debug)]
pub struct Given {
    /// Its file, or what else it is called; the stem is the label of its biases and initial state.
    pub path: PathBuf,
    /// The samples.
    pub record: Record,
    /// Warnings of reading.
    pub warnings: Problems,
    /// Name, size and hash of the data.
    pub source: Entry,
    /// Payloads of the mission that were not mounted, as `--without` names them.
    pub without: Vec<String>,
}

/// Reads a record of the robot with options of `ffid doctor` (`--resample`, `--gaps drop`, `--allow stuck` ...).
///
/// # Errors
/// [`Refused`] with every problem of the file.
pub fn read_record(model: &Model, path: &Path, options: &[String]) -> Result<Given, Refused> {
    let name = path.to_string_lossy().into_owned();
    let words = [&["mission".to_owned(), "--record".to_owned(), name.clone()], options].concat();
    let Command::Doctor(args) = parse("doctor", &words)? else { return Err(another("doctor")) };
    let loaded = args.reading.read(path, model, 8, None, &args.input)?;
    let source = results::inputs(&[path.to_owned()]).map_err(io)?.swap_remove(0);
    Ok(Given { path: path.to_owned(), record: loaded.record, warnings: loaded.warnings, source, without: Vec::new() })
}

/// A record of columns in memory, `(name[unit], numbers)` of equal length, with options of `ffid doctor`: read as a file of them would
/// be, but that a column without a unit is in SI. `name` is what it is called.
///
/// # Errors
/// [`Refused`] with every problem of the columns.
pub fn read_columns(
    model: &Model,
    name: &Path,
    columns: &[(String, Vec<f64>)],
    options: &[String],
) -> Result<Given, Refused> {
    let file = name.to_string_lossy().into_owned();
    let words = [&["mission".to_owned(), "--record".to_owned(), file.clone()], options].concat();
    let Command::Doctor(args) = parse("doctor", &words)? else { return Err(another("doctor")) };
    let leniency = args.input.leniency();
    let options = args.reading.options(model, 8, &leniency);
    let mut loaded = columns_of(columns, &joints_of(model), &options).map_err(|p| p.in_file(name))?;
    loaded.warnings = loaded.warnings.in_file(name);
    let Loaded { record, warnings, .. } = believed(loaded, model, name, &leniency)?;
    let slices: Vec<&[f64]> = columns.iter().map(|(_, x)| x.as_slice()).collect();
    let source = Entry::of_numbers(&slices, file);
    Ok(Given { path: name.to_owned(), record, warnings, source, without: Vec::new() })
}

/// A record that was built in memory, with the warnings that a file of its content would give: motion and torques beyond what the robot
/// can do.
///
/// # Errors
/// [`Refused`] where `leniency` is strict and there are warnings.
pub fn given(
    model: &Model,
    name: &Path,
    record: Record,
    mut warnings: Problems,
    source: Entry,
    leniency: &Leniency,
) -> Result<Given, Refused> {
    plausible(&record, model, name, &mut warnings);
    leniency.settle(&mut warnings);
    if warnings.has_errors() {
        return Err(warnings.into());
    }
    Ok(Given { path: name.to_owned(), record, warnings, source, without: Vec::new() })
}
