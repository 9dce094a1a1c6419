//! The folder of `ffid identify`, for the commands that take one.

use crate::output::Input;
use ff_model::{Area, Problem, Problems};
use ffid::exit::Exit;
use ffid::files::{complete, format};
use ffid::open::{Opened, open};
use ffid::workflow::identify::model_files::TOML;
use ffid::workflow::identify::{Evidence, FORMAT, IdentificationResult, State, VERSION};
use std::path::{Path, PathBuf};

/// A result with the robot it describes.
pub(crate) struct Found {
    pub(crate) result: IdentificationResult,
    pub(crate) opened: Opened,
    /// The mission file in the folder.
    pub(crate) mission_file: PathBuf,
}

fn one(path: &Path, code: &'static str, what: String, hint: &str) -> Problems {
    Problems(vec![Problem::error(Area::Data, code, what).in_file(path).hint(hint)])
}

/// The result in a folder that is complete and untouched.
pub(crate) fn result(folder: &Path) -> Result<IdentificationResult, Problems> {
    complete::check(folder, "identify")?;
    let path = folder.join("result.json");
    let bytes = std::fs::read(&path).map_err(|e| {
        let p = Problem::error(Area::Io, "Io::Read", format!("cannot be read: {e}")).in_file(&path);
        Problems(vec![p.hint("check the permissions")])
    })?;
    format::check(&bytes, FORMAT, VERSION).map_err(|p| p.in_file(&path))?;
    IdentificationResult::from_json(&bytes)
        .map_err(|e| one(&path, "Data::Syntax", e, "identify again with this version"))
}

/// Reads a folder that is complete and untouched.
pub(crate) fn load(input: &Input) -> Result<Found, Problems> {
    let folder = &input.file;
    let result = result(folder)?;
    let path = folder.join("result.json");
    let one = |code, what: String, hint: &str| one(&path, code, what, hint);
    let mission_file = folder.join(TOML);
    if !mission_file.exists() {
        let what = format!("the fit {}, so that there is no identified robot", result.status);
        let remedy = result.evidence.as_ref().filter(|e| e.state == State::Contradicted).and_then(Evidence::remedy);
        let hint = remedy.map_or_else(
            || "identify again, with another start or priors".to_owned(),
            |r| format!("identify again: {r}"),
        );
        return Err(one("Data::NoSolution", what, &hint));
    }
    let mut opened = open(&mission_file, input.leniency())?;
    // Bit for bit: the file was written so.
    let same = opened
        .model
        .param_decls()
        .iter()
        .map(|d| d.nominal.to_bits())
        .eq(result.model.iter().map(|v| v.value.to_bits()));
    if !same {
        return Err(one("Data::Changed", format!("{TOML} holds other values"), "identify again, and edit copies only"));
    }
    let held = result.held_out.as_ref().filter(|h| !h.explained && result.state() != State::Contradicted);
    let tests = || result.evidence.as_ref().map_or("", |e| e.reason.as_str());
    let reason = || held.map_or_else(tests, |h| h.verdict.as_str());
    let doubt = match result.exit() {
        Exit::Done => None,
        Exit::Contradicted => {
            Some(("Fit::Misfit", format!("the record contradicts the model of this result: {}", reason())))
        }
        Exit::NotTested => Some(("Fit::NotTested", format!("the model of this result was not tested: {}", reason()))),
        _ => {
            let what = "some parameters of this result could not be told; predictions that need them are guesses";
            Some(("Fit::Unidentifiable", what.to_owned()))
        }
    };
    if let Some((code, what)) = doubt {
        let p = Problem::warning(Area::Data, code, what).in_file(&path);
        opened.warnings.push(p.hint("see its report.html"));
    }
    Ok(Found { result, opened, mission_file })
}
