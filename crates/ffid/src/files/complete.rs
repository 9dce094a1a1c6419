//! Reading a folder of results: complete and untouched, or refused.

use super::folder::{Entry, MANIFEST};
use ff_model::{Area, Problem, Problems};
use serde::Deserialize;
use std::path::Path;

/// Largest manifest that is read (bytes).
const MAX_BYTES: usize = 16 << 20;

/// What of a manifest is needed to check a folder; the rest is for people.
#[derive(Deserialize)]
struct Listed {
    command: String,
    file: Vec<Line>,
}

#[derive(Deserialize)]
struct Line {
    file: String,
    bytes: u64,
    sha256: String,
}

/// Checks that `folder` was written to its end by `command`, and that none of its files has changed.
///
/// # Errors
/// `Io::Read` (exit code 20) when it is not there; `Data::Incomplete` without a manifest, `Data::Changed` for a file that
/// is missing or another one, `Data::WrongResult` for a folder of another command (exit code 12).
pub fn check(folder: &Path, command: &str) -> Result<(), Problems> {
    let one = |p: Problem| Problems(vec![p.in_file(folder)]);
    if !folder.is_dir() {
        let p = Problem::error(Area::Io, "Io::Read", "there is no such folder");
        return Err(one(p.hint(format!("give the folder that `ffid {command}` wrote"))));
    }
    let data = |code, what: String, hint: &str| one(Problem::error(Area::Data, code, what).hint(hint));
    let path = folder.join(MANIFEST);
    if !path.exists() {
        let what = format!("incomplete: it has no {MANIFEST}");
        return Err(data(
            "Data::Incomplete",
            what,
            "run the command again; a run that was killed leaves such a folder",
        ));
    }
    let text = ff_model::diagnostics::text_file(&path, MAX_BYTES)?;
    let listed: Listed = ff_model::toml::from_str(&text)
        .map_err(|e| data("Data::Incomplete", format!("{MANIFEST}: {}", e.message()), "run the command again"))?;
    if listed.command != command {
        let what = format!("holds results of `ffid {}`, not of `ffid {command}`", listed.command);
        return Err(data("Data::WrongResult", what, "give another folder"));
    }
    for want in &listed.file {
        let found = Entry::of(&folder.join(&want.file), want.file.as_str()).ok();
        if !found.is_some_and(|f| f.bytes == want.bytes && f.sha256 == want.sha256) {
            let what = format!("{} is missing or has changed since it was written", want.file);
            return Err(data("Data::Changed", what, "run the command again, and edit copies only"));
        }
    }
    Ok(())
}
