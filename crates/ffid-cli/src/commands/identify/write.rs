//! Files of an identification.

use super::args::Args;
use crate::replay;
use crate::results;
use ff_mission::{Leniency, Mission};
use ff_model::Problems;
use ff_report::identify::{all_figures, corner_figure, page};
use ffid::exit::Failure;
use ffid::files::folder::Folder;
use ffid::open::Opened;
use ffid::workflow::identify::{
    Identified, LOW_PASS, LabelledRecord, Sampled, Signals, Warning, draws, keep, model_files,
};
use std::path::Path;

/// Writes everything but the manifest. What is wrong with the files of the robot is added to the warnings of the result, and returned.
pub(crate) fn write(
    folder: &Folder,
    args: &Args,
    (opened, records): (&Opened, &[LabelledRecord]),
    found: &mut Identified,
    held: Option<&Signals>,
    leniency: &Leniency,
) -> Result<Problems, Failure> {
    let (mut files, mut problems) = (Vec::new(), Problems::default());
    // Values that are no solution are not made into a robot.
    if let (Some(mission), true) = (&opened.mission, found.result.status.is_solution()) {
        let (file, model): (&Path, _) = (&args.input.file, &opened.model);
        let prior_means = model_files::prior_means(mission, found.result.had_prior(), model, &found.values);
        let mission = Mission { prior_means, ..mission.clone() };
        (files, problems) = model_files::write(file, &mission, model, &found.values, &found.selected, leniency)?;
        found.result.warnings.extend(Warning::all(&problems));
    }
    // A filtered motion is no record: it would be filtered again.
    if !found.result.provenance.settings.contains_key(LOW_PASS) {
        found.result.kept_records = keep(folder, &opened.model, records)?;
    }
    // What is no solution does not move.
    let solved = found.result.status.is_solution();
    let replayed = match records.first().filter(|_| solved) {
        Some(first) => replay::identified(opened, &args.input.file, found, &first.record),
        None => (None, Problems::default()),
    };
    found.result.warnings.extend(Warning::all(&replayed.1));
    problems.extend(replayed.1.clone());
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
    let mut figures = all_figures(r, &found.signals, held);
    if let Some(d) = &found.draws {
        draws::write_parquet(d, &folder.path().join(Sampled::FILE))?;
        figures.extend(corner_figure(r, d));
    }
    results::draw(folder, &figures, args.output.png)?;
    if let (Some(html), _) = &replayed {
        folder.write(replay::FILE, html.as_bytes())?;
    }
    let link = replayed.0.as_ref().map(|_| replay::FILE);
    folder.write("report.html", page(r, &figures, link)?.as_bytes())?;
    for (name, bytes) in files {
        folder.write(&name, &bytes)?;
    }
    Ok(problems)
}
