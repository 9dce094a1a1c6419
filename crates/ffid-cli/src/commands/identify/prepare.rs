//! Mission, records, options and output folder of `ffid identify`, read before anything is computed.

use super::args::Args;
use crate::flags::fit::failed;
use crate::flags::record::filtered;
use crate::results;
use crate::results::{Refusal, io, refused};
use ff_model::{Area, Params, Problem, Problems};
use ff_records::Record;
use ffid::files::folder::{Entry, Folder};
use ffid::open::{Opened, open};
use ffid::workflow::identify::{
    FitOptions, InputFile, LabelledRecord, Method, Settings, choose_low_pass, method, on_even_clock, segments,
};
use std::io::Write;
use std::path::PathBuf;

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
    pub(crate) records: Vec<LabelledRecord>,
    pub(crate) held: Held,
    pub(crate) problems: Problems,
    pub(crate) files: Vec<PathBuf>,
    pub(crate) inputs: Vec<Entry>,
    pub(crate) folder: Folder,
    pub(crate) target: PathBuf,
}

/// Reads everything, and takes the output folder, before anything is computed.
pub(crate) fn prepare(args: &Args, err: &mut impl Write) -> Result<Ready, Refusal> {
    let input = &args.input;
    let opened = open(&input.file, input.leniency()).map_err(refused)?;
    let mission = results::undisturbed(&opened, &input.file).map_err(refused)?;
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
    let target = args.out.clone().unwrap_or_else(|| {
        let stem = input.file.file_stem().unwrap_or_default().to_string_lossy();
        PathBuf::from(format!("{stem}-identified"))
    });
    let held_out = args.held_out.clone().or_else(|| (!args.compare.is_empty()).then(|| "0.3".to_owned()));
    let mut files = results::mission_files(&input.file, mission);
    let paths = args.paths();
    files.extend(paths.iter().cloned());
    let fraction = match held_out.as_deref() {
        None => None,
        Some(word) => match word.parse::<f64>() {
            Ok(f) if f > 0.0 && f < 1.0 => Some(f),
            Ok(f) => {
                let p = Problem::error(Area::Config, "Config::OutOfRange", format!("value {f}, limit 0 < value < 1"));
                return Err(refused(Problems(vec![p.on("--held-out").hint("give 0.3 for the last 30 %, or a file")])));
            }
            Err(_) => {
                files.push(PathBuf::from(word));
                None
            }
        },
    };
    let need = 2 * opened.estimated.len().max(4);
    // Before the folder, so that a wrong path is said first.
    let mut loaded = Vec::new();
    for path in &paths {
        loaded.push(args.reading.read(path, &opened.model, need, None, input).map_err(refused)?);
    }
    let (mut options, earlier) = args.options().map_err(refused)?;
    files.extend(args.ties.iter().cloned());
    files.extend(args.prior_from.iter().map(|f| f.join("result.json")));
    let inputs = results::inputs(&files).map_err(io)?;
    same_data(&inputs[2..], paths.len(), fraction.is_none() && held_out.is_some(), &earlier).map_err(refused)?;
    let folder = results::begin(&target, &args.output, err).map_err(io)?;
    let mut problems = opened.warnings.clone();
    let (mut whole, mut labels): (Vec<Record>, Vec<String>) = (Vec::new(), Vec::new());
    for (path, l) in paths.iter().zip(loaded) {
        problems.extend(l.warnings);
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let again = labels.iter().filter(|t| **t == stem || t.starts_with(&format!("{stem}-"))).count();
        labels.push(if again == 0 { stem } else { format!("{stem}-{}", again + 1) });
        whole.push(l.record);
    }
    let last = whole.len() - 1;
    let mut held = match (fraction, held_out.as_deref()) {
        (Some(f), _) => {
            let all = whole[last].clone();
            let cut = (1.0 - f) * all.seconds();
            let first = all.window(0.0, cut).map_err(refused)?;
            let end = all.window(cut, f64::INFINITY).map_err(refused)?;
            if first.samples() < need || end.samples() < 8 {
                let what = format!("{} samples to fit and {} to judge by", first.samples(), end.samples());
                let p = Problem::error(Area::Data, "Data::TooShort", format!("{what}, at least {need} and 8 needed"));
                return Err(refused(Problems(vec![
                    p.on("--held-out").hint("record longer, or hold out another part"),
                ])));
            }
            let words = format!("the last {:.1} % of {}", 100.0 * f, paths[last].display());
            whole[last] = first;
            let end = one_part("held-out", end, &mut problems)?;
            Held::Part { record: end, words }
        }
        (None, Some(path)) => {
            let path = PathBuf::from(path);
            let other = args.reading.read_one(&path, &opened.model, None, input)?;
            problems.extend(other.warnings);
            Held::File { record: other.record, path }
        }
        (None, None) => Held::None,
    };
    let mut records: Vec<LabelledRecord> = Vec::new();
    for ((record, label), path) in whole.iter().zip(&labels).zip(&paths) {
        let found = segments(label, record).map_err(failed)?;
        problems.extend(found.warnings.clone().in_file(path));
        records.extend(found.labelled(label));
    }
    if method(&opened.model, settings.method) == Method::Ground {
        on_the_ground(&opened, &mut settings, &mut records, &mut held, &mut problems)?;
        // What no motion of an arm whose base is fixed tells is not the fault of a record.
        options.reduce = true;
    }
    options.profile.clone_from(&args.profile);
    Ok(Ready { opened, settings, options, records, held, problems, files, inputs, folder, target })
}

/// The longest part of data that judge.
fn one_part(label: &str, record: Record, problems: &mut Problems) -> Result<Record, Refusal> {
    let found = segments(label, &record).map_err(failed)?;
    problems.extend(found.warnings);
    let longest = found.parts.into_iter().max_by(|a, b| a.seconds().total_cmp(&b.seconds()));
    Ok(longest.unwrap_or(record))
}

/// Brings the records of an arm on the ground to an even clock and through the low pass, which is chosen from the longest of them unless given.
fn on_the_ground(
    opened: &Opened,
    settings: &mut Settings,
    records: &mut [LabelledRecord],
    held: &mut Held,
    problems: &mut Problems,
) -> Result<(), Refusal> {
    for r in records.iter_mut() {
        let (even, warned) = on_even_clock(&r.label, &r.record).map_err(failed)?;
        r.record = even;
        problems.extend(warned);
    }
    let longest = records.iter().max_by(|a, b| a.record.seconds().total_cmp(&b.record.seconds()));
    let nominal = Params::nominal(&opened.model);
    if let (None, Some(r)) = (settings.low_pass_hz, longest)
        && let Some(found) = choose_low_pass(&opened.model, &r.record, &opened.estimated, nominal.values())
    {
        let what = format!(
            "positions and torques pass a low pass of {:.4} Hz: fitted to one half of the log, it misses {:.2} % of the torques of the other, a low \
             pass of {:.4} Hz {:.2} % (both compared behind {:.3} Hz)",
            found.hz,
            100.0 * found.missed.0,
            found.widest_hz,
            100.0 * found.missed.1,
            found.compared_hz
        );
        let p = Problem::warning(Area::Data, "Data::Bandwidth", what).on(&r.label);
        problems.push(p.hint("give --low-pass to choose another"));
        settings.low_pass_hz = Some(found.hz);
    }
    let Some(hz) = settings.low_pass_hz else { return Ok(()) };
    for r in records.iter_mut() {
        r.record = filtered(&r.record, hz).map_err(refused)?;
    }
    if let Held::Part { record, .. } | Held::File { record, .. } = held {
        let (even, warned) = on_even_clock("held-out", record).map_err(failed)?;
        problems.extend(warned);
        *record = filtered(&even, hz).map_err(refused)?;
    }
    Ok(())
}

/// Row D39: data that were given twice. `files` are `records` records, then the one held out, if `held` is.
fn same_data(files: &[Entry], records: usize, held: bool, earlier: &[InputFile]) -> Result<(), Problems> {
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
            let hint = "its prior knows them already; fit both at once with --records, or leave --prior-from out";
            return refuse(file, format!("{} of the earlier identification", old.file), hint);
        }
    }
    Ok(())
}
