//! `ffid identify` on records in memory.

use super::Refused;
use super::options::{another, parse};
use super::record::Given;
use crate::Command;
use crate::commands::identify::fit::fit_observed;
use crate::commands::identify::prepare::{
    Data, Held, HoldOut, Ready, contents, cut, fewest_samples, go_on, label, not_fitted, only_on_the_ground, same_data,
    same_readings, settings,
};
use crate::commands::identify::write::write;
use crate::commands::identify::{Args, conclude};
use crate::flags::fit::failed;
use crate::result_folder;
use crate::results;
use crate::results::io;
use ff_model::{Area, Problem, Problems};
use ff_records::{Content, Record};
use ff_report::identify::{all_figures, page};
use ffid::exit::{Exit, Failure};
use ffid::files::folder::{Entry, Folder};
use ffid::open::Opened;
use ffid::workflow::identify::{Absent, IdentificationResult, Identified, LabelledRecord, Observer, Signals};
use std::path::{Path, PathBuf};

/// An identification with what its files need.
pub struct Identification {
    /// The mission, at its nominal values.
    pub opened: Opened,
    /// Result, signals and values.
    pub found: Identified,
    /// Signals of the data that were held out.
    pub held: Option<Signals>,
    /// Everything that was put up with, and what the result itself finds fault with.
    pub problems: Problems,
    /// The code that `ffid identify` would end with.
    pub exit: Exit,
    args: Args,
    records: Vec<LabelledRecord>,
    inputs: Vec<Entry>,
}

/// Identifies from records in memory, with the options of `ffid identify`; `file` is the mission file that `opened` was read from. The
/// numbers are those of the command.
///
/// # Errors
/// [`Refused`]; what cannot be told, or is contradicted, is a result ([`Identification::exit`]).
pub fn identify(
    file: &Path,
    opened: &Opened,
    records: &[Given],
    held_out: Option<&Given>,
    options: &[String],
    watch: &Observer<'_>,
) -> Result<Identification, Refused> {
    let mut words = vec![file.to_string_lossy().into_owned()];
    words.extend(records.iter().map(|r| format!("--records={}", r.path.display())));
    words.extend(held_out.map(|h| format!("--held-out={}", h.path.display())));
    words.extend(options.iter().cloned());
    let Command::Identify(args) = parse("identify", &words)? else { return Err(another("identify")) };
    let mission = results::undisturbed(opened, file)?;
    let mut settings = settings(&args, opened, mission);
    let need = fewest_samples(opened);
    let mut problems = opened.warnings.clone();
    let mut labelled: Vec<LabelledRecord> = Vec::new();
    for given in records {
        problems.extend(given.warnings.clone());
        let record = long_enough(given, need)?;
        let label = label(&given.path, &labelled);
        labelled.push(LabelledRecord { label, record, resampled: (false, false), continues: false, ago: 0 });
    }
    let (mut fit_options, earlier) = args.options(&opened.model)?;
    let truth = args.known_truth(opened)?;
    problems.extend(earlier.warnings);
    let mut files = results::mission_files(file, mission);
    let named = files.len();
    files.extend(args.ties.iter().cloned());
    files.extend(args.prior_from.iter().map(|f| f.join("result.json")));
    files.extend(earlier.files.iter().cloned());
    let mut inputs = results::inputs(&files).map_err(io)?;
    let sources = records.iter().chain(held_out).map(|g| g.source.clone());
    inputs.splice(named..named, sources);
    same_data(&inputs[named..], records.len(), held_out.is_some(), &earlier.inputs)?;
    let read: Vec<(&Path, &Record)> = records.iter().map(|g| (g.path.as_path(), &g.record)).collect();
    let whole: Vec<Content> = read.iter().map(|(_, r)| Content::of(r)).collect();
    let fitted: Vec<_> = read.into_iter().zip(&whole).collect();
    same_readings(&fitted, &earlier.inputs)?;
    if let Some(given) = held_out {
        not_fitted((&given.path, &given.record), &fitted, &earlier.inputs)?;
    }
    let mut held = match (HoldOut::of(&args)?, held_out) {
        (_, Some(given)) => {
            problems.extend(given.warnings.clone());
            Held::File { record: long_enough(given, 8)?, path: given.path.clone(), moving: false }
        }
        (HoldOut::Nothing, None) => Held::None,
        (HoldOut::Part(f), None) => {
            let path = records.last().map(|r| r.path.as_path()).unwrap_or(Path::new("the record"));
            cut(&mut labelled, f, need, path)?
        }
        (HoldOut::File(path), None) => {
            let p = Problem::error(Area::Config, "Config::HeldOut", "a fraction or a record is needed, not a path");
            return Err(Problems(vec![p.in_file(path).hint("read it as a record first")]).into());
        }
    };
    let absent = labelled.iter().zip(records).flat_map(|(l, given)| {
        given.without.iter().map(|payload| Absent { payload: payload.clone(), record: l.label.clone() })
    });
    fit_options.absent = only_on_the_ground(opened, absent.collect())?;
    fit_options.profile.clone_from(&args.profile);
    let contents = contents(records.iter().map(|g| g.source.file.clone()), &labelled);
    let refused = |(exit, problems): (Exit, Problems)| Refused { exit, problems: problems.in_file(file) };
    let mut data = Data { records: labelled, sources: records.iter().map(|g| g.path.clone()).collect(), problems };
    data.divide(&mut held).map_err(refused)?;
    go_on(&mut data.records, earlier.records);
    data.sources.extend(earlier.files);
    data.on_the_ground(opened, &mut settings, &mut fit_options, &mut held).map_err(refused)?;
    let Data { records, sources, problems } = data;
    let mut ready = Ready {
        opened: opened.clone(),
        settings,
        options: fit_options,
        records,
        sources,
        earlier: earlier.inputs,
        held,
        truth,
        problems,
        inputs,
        contents,
    };
    let (mut found, held, warnings) = fit_observed(&args, &mut ready, watch).map_err(|e| {
        let (exit, problems) = failed(e);
        Refused { exit, problems: problems.in_file(file) }
    })?;
    let Ready { opened, records, mut problems, inputs, .. } = ready;
    problems.extend(warnings);
    let exit = conclude(&args, &mut found.result, &mut problems);
    Ok(Identification { opened, records, found, held, problems, exit, args, inputs })
}

/// A record that is long enough.
fn long_enough(given: &Given, need: usize) -> Result<Record, Problems> {
    let n = given.record.samples();
    if n < need {
        let p = Problem::error(Area::Data, "Data::TooShort", format!("{n} samples, at least {need} needed"));
        return Err(Problems(vec![p.in_file(&given.path).hint("record longer, or estimate less")]));
    }
    Ok(given.record.clone())
}

impl Identification {
    /// Writes the folder of `ffid identify`: report, result, identified mission and robot, residuals, figures, manifest. Returns warnings.
    ///
    /// # Errors
    /// [`Refused`] when it exists (unless `replace`) or cannot be written.
    pub fn save(&mut self, folder: &Path, replace: bool, png: bool) -> Result<Problems, Refused> {
        let target: PathBuf = folder.to_owned();
        let to = Folder::begin(&target, replace).map_err(io)?;
        self.args.output.png = png;
        let leniency = self.args.input.leniency();
        let wrote =
            write(&to, &self.args, (&self.opened, &self.records), &mut self.found, self.held.as_ref(), &leniency);
        let settings = &self.found.result.provenance.settings;
        let settings: Vec<(&str, String)> = settings.iter().map(|(k, v)| (k.as_str(), v.clone())).collect();
        let about = results::about("identify", self.args.seed, &settings, self.inputs.clone());
        let done = wrote.and_then(|warnings| to.finish(&about).map(|()| warnings));
        Ok(done.map_err(io)?)
    }
    /// The report as one HTML page, figures included. Allocates.
    ///
    /// # Errors
    /// [`Failure::NotFinite`] with the place of a number that is not finite.
    pub fn report(&self) -> Result<String, Failure> {
        let figures = all_figures(&self.found.result, &self.found.signals, self.held.as_ref());
        page(&self.found.result, &figures, None)
    }
}

/// The result in a folder of `ffid identify` that is complete and untouched.
///
/// # Errors
/// [`Refused`] with what is wrong with it.
pub fn load_result(folder: &Path) -> Result<IdentificationResult, Refused> {
    Ok(result_folder::result(folder)?)
}
