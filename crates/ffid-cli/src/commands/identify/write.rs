//! Files of an identification.

use super::args::Args;
use crate::results;
use ff_mission::Leniency;
use ff_report::identify::{all_figures, page};
use ffid::exit::Failure;
use ffid::files::folder::Folder;
use ffid::open::Opened;
use ffid::workflow::identify::{Identified, Signals, model_files};
use std::path::Path;

/// Writes everything but the manifest.
pub(crate) fn write(
    folder: &Folder,
    args: &Args,
    opened: &Opened,
    found: &Identified,
    held: Option<&Signals>,
    leniency: &Leniency,
) -> Result<(), Failure> {
    let r = &found.result;
    folder.write("result.json", &r.to_json()?)?;
    folder.write("report.txt", r.to_string().as_bytes())?;
    for (k, s) in found.signals.iter().enumerate() {
        let stem = match r.records.get(k).filter(|_| k > 0) {
            Some(record) => format!("residuals-{}", record.label),
            None => "residuals".to_owned(),
        };
        s.write(&folder.path().join(format!("{stem}.csv")))?;
        s.write_parquet(&folder.path().join(format!("{stem}.parquet")))?;
    }
    if let Some(h) = held {
        h.write(&folder.path().join("held-out.csv"))?;
    }
    let figures = all_figures(r, &found.signals, held);
    results::draw(folder, &figures, args.output.png)?;
    folder.write("report.html", page(r, &figures)?.as_bytes())?;
    // Values that are no solution are not made into a robot.
    if let (Some(mission), true) = (&opened.mission, r.status.is_solution()) {
        let file: &Path = &args.input.file;
        let files = model_files::write(file, mission, &opened.model, &found.values, &found.selected, leniency)?;
        for (name, bytes) in files {
            folder.write(&name, &bytes)?;
        }
    }
    Ok(())
}
