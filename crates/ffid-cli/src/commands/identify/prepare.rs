//! Mission, records, options and output folder of `ffid identify`, read before anything is computed.

use super::args::Args;
use crate::results;
use crate::results::{Refusal, io, refused};
use ff_mission::Mission;
use ff_model::{Area, Problem, Problems};
use ff_records::Record;
use ffid::files::folder::{Entry, Folder};
use ffid::open::{Opened, open};
use ffid::workflow::identify::{FitOptions, InputFile, LabelledRecord, Method, Settings, method};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Data that are held out of the fit.
pub(crate) enum Held {
    None,
    /// From here to the end of the record, whose part before is fitted.
    Part {
        record: Record,
        words: String,
    },
    File {
        record: Record,
        path: PathBuf,
    },
}

/// Everything read and ready.
pub(crate) struct Ready {
    pub(crate) opened: Opened,
    pub(crate) settings: Settings,
    pub(crate) options: FitOptions,
    /// Those of an earlier identification last.
    pub(crate) records: Vec<LabelledRecord>,
    /// Where they come from.
    pub(crate) sources: Vec<PathBuf>,
    /// Files that an earlier identification has read.
    pub(crate) earlier: Vec<InputFile>,
    pub(crate) held: Held,
    pub(crate) problems: Problems,
    pub(crate) inputs: Vec<Entry>,
}

/// Where the results go, and the files whose contents they belong to.
pub(crate) struct Destination {
    pub(crate) files: Vec<PathBuf>,
    pub(crate) folder: Folder,
    pub(crate) target: PathBuf,
}

/// Settings of the fit: those of the mission, and what the flags say otherwise.
pub(crate) fn settings(args: &Args, opened: &Opened, mission: &Mission) -> Settings {
    let mut settings = args.fit.settings(mission);
    settings.method = args.method.method().or(settings.method);
    settings.prior = args.prior.or(mission.estimate.prior_relative_std).filter(|_| !args.no_prior);
    settings.start_offset = if args.no_start_offset { 0.0 } else { mission.estimate.start_offset };
    settings.seed = args.seed;
    settings.loss = args.loss.into();
    settings.low_pass_hz = args.reading.low_pass();
    settings.adopt.clone_from(&args.adopt);
    if !args.adopt.is_empty() && method(&opened.model, settings.method) == Method::Rda {
        // Torques predicted from the gyro know none of its errors.
        settings.method = Some(Method::OutputError);
    }
    settings
}

/// What `--held-out` says: nothing, a part of the last record, or a file.
pub(crate) enum HoldOut {
    Nothing,
    Part(f64),
    File(PathBuf),
}

impl HoldOut {
    pub(crate) fn of(args: &Args) -> Result<Self, Problems> {
        let held_out = args.held_out.clone().or_else(|| (!args.compare.is_empty()).then(|| "0.3".to_owned()));
        let Some(word) = held_out else { return Ok(Self::Nothing) };
        match word.parse::<f64>() {
            Ok(f) if f > 0.0 && f < 1.0 => Ok(Self::Part(f)),
            Ok(f) => {
                let p = Problem::error(Area::Config, "Config::OutOfRange", format!("value {f}, limit 0 < value < 1"));
                Err(Problems(vec![p.on("--held-out").hint("give 0.3 for the last 30 %, or a file")]))
            }
            Err(_) => Ok(Self::File(PathBuf::from(word))),
        }
    }
}

/// Cuts the fraction `f` off the end of the last record, which was called `name`; both parts must have enough samples.
pub(crate) fn cut(records: &mut [LabelledRecord], f: f64, need: usize, name: &str) -> Result<Held, Problems> {
    let last = records.len() - 1;
    let whole = &records[last].record;
    let at = (1.0 - f) * whole.seconds();
    let first = whole.window(0.0, at)?;
    let end = whole.window(at, f64::INFINITY)?;
    if first.samples() < need || end.samples() < 8 {
        let what = format!("{} samples to fit and {} to judge by", first.samples(), end.samples());
        let p = Problem::error(Area::Data, "Data::TooShort", format!("{what}, at least {need} and 8 needed"));
        return Err(Problems(vec![p.on("--held-out").hint("record longer, or hold out another part")]));
    }
    records[last].record = first;
    Ok(Held::Part { record: end, words: format!("the last {:.1} % of {name}", 100.0 * f) })
}

/// Fewest samples that make sense for what is to be estimated.
pub(crate) fn fewest_samples(opened: &Opened) -> usize {
    2 * opened.estimated.len().max(4)
}

/// A label for one more record: the stem of its file, numbered when there is one of this name.
pub(crate) fn label(path: &Path, records: &[LabelledRecord]) -> String {
    unlike(records, path.file_stem().unwrap_or_default().to_string_lossy().into_owned())
}

/// This label, or one that no record has.
fn unlike(records: &[LabelledRecord], label: String) -> String {
    let again = records.iter().filter(|t| t.label == label || t.label.starts_with(&format!("{label}-"))).count();
    if again == 0 { label } else { format!("{label}-{}", again + 1) }
}

/// The records of an earlier identification, behind those at hand.
pub(crate) fn go_on(records: &mut Vec<LabelledRecord>, earlier: Vec<LabelledRecord>) {
    for of in earlier {
        let label = unlike(records, of.label.clone());
        records.push(LabelledRecord { label, ..of });
    }
}

/// Reads everything, and takes the output folder, before anything is computed.
pub(crate) fn prepare(args: &Args, err: &mut impl Write) -> Result<(Ready, Destination), Refusal> {
    let input = &args.input;
    let opened = open(&input.file, input.leniency()).map_err(refused)?;
    let mission = results::undisturbed(&opened, &input.file).map_err(refused)?;
    let settings = settings(args, &opened, mission);
    let target = args.out.clone().unwrap_or_else(|| {
        let stem = input.file.file_stem().unwrap_or_default().to_string_lossy();
        PathBuf::from(format!("{stem}-identified"))
    });
    let mut files = results::mission_files(&input.file, mission);
    let paths = args.paths();
    files.extend(paths.iter().cloned());
    let hold_out = HoldOut::of(args).map_err(refused)?;
    if let HoldOut::File(path) = &hold_out {
        files.push(path.clone());
    }
    let need = fewest_samples(&opened);
    // Before the folder, so that a wrong path is said first.
    let mut loaded = Vec::new();
    for path in &paths {
        loaded.push(args.reading.read(path, &opened.model, need, settings.low_pass_hz, input).map_err(refused)?);
    }
    let (mut options, earlier) = args.options(&opened.model).map_err(refused)?;
    files.extend(args.ties.iter().cloned());
    files.extend(args.prior_from.iter().map(|f| f.join("result.json")));
    files.extend(earlier.files.iter().cloned());
    let inputs = results::inputs(&files).map_err(io)?;
    same_data(&inputs[2..], paths.len(), matches!(hold_out, HoldOut::File(_)), &earlier.inputs).map_err(refused)?;
    let folder = results::begin(&target, &args.output, err).map_err(io)?;
    let mut problems = opened.warnings.clone();
    problems.extend(earlier.warnings);
    let mut records: Vec<LabelledRecord> = Vec::new();
    for (path, l) in paths.iter().zip(loaded) {
        problems.extend(l.warnings);
        let label = label(path, &records);
        records.push(LabelledRecord { label, record: l.record, resampled: (false, false) });
    }
    let held = match hold_out {
        HoldOut::Nothing => Held::None,
        HoldOut::Part(f) => {
            let name = paths[paths.len() - 1].display().to_string();
            cut(&mut records, f, need, &name).map_err(refused)?
        }
        HoldOut::File(path) => {
            let other = args.reading.read(&path, &opened.model, 8, settings.low_pass_hz, input).map_err(refused)?;
            problems.extend(other.warnings);
            Held::File { record: other.record, path }
        }
    };
    go_on(&mut records, earlier.records);
    let sources = paths.into_iter().chain(earlier.files).collect();
    options.profile.clone_from(&args.profile);
    let ready =
        Ready { opened, settings, options, records, sources, earlier: earlier.inputs, held, problems, inputs };
    Ok((ready, Destination { files, folder, target }))
}

/// Row D39: data that were given twice. `files` are `records` records, then the one held out, if `held` is.
pub(crate) fn same_data(files: &[Entry], records: usize, held: bool, earlier: &[InputFile]) -> Result<(), Problems> {
    let refuse = |of: &Entry, as_what: String, hint: &str| {
        let what = format!("the same data as {as_what} (SHA-256 {})", of.sha256);
        let p = Problem::error(Area::Data, "Data::SameData", what).in_file(&of.file);
        Err(Problems(vec![p.hint(hint)]))
    };
    for (k, file) in files.iter().take(records + usize::from(held)).enumerate() {
        if let Some(first) = files[..k.min(records)].iter().find(|f| f.sha256 == file.sha256) {
            let hint = if k < records {
                "give each record once"
            } else {
                "judge the model by data that were not fitted, or give a fraction"
            };
            return refuse(file, first.file.clone(), hint);
        }
        if let Some(old) = earlier.iter().find(|f| f.sha256 == file.sha256) {
            let hint =
                "it has been fitted there already: leave it out, or leave --prior-from out and give all with --records";
            return refuse(file, format!("{} of the earlier identification", old.file), hint);
        }
    }
    Ok(())
}
