//! Mission, records, options and output folder of `ffid identify`, read before anything is computed.

use super::args::Args;
use crate::flags::fit::failed;
use crate::flags::record::{begins_later, filtered};
use crate::results;
use crate::results::{Refusal, io, refused};
use ff_mission::Mission;
use ff_model::diagnostics::clip;
use ff_model::{Area, BaseKind, Params, Problem, Problems};
use ff_records::{Content, Record};
use ffid::files::folder::{Entry, Folder};
use ffid::open::{Opened, open};
use ffid::workflow::doctor::standing_still;
use ffid::workflow::identify::{
    Absent, Bandwidth, FitOptions, InputFile, LabelledRecord, Method, NoBandwidth, Settings, choose_low_pass, method,
    on_even_clock, segments,
};
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
        /// It is the part behind a gap, and begins in the middle of a motion.
        moving: bool,
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
    /// What is true of a simulated record, by name of the parameter.
    pub(crate) truth: Vec<(String, f64)>,
    pub(crate) problems: Problems,
    pub(crate) inputs: Vec<Entry>,
    /// What the readings of the records are known by, with the names of their files.
    pub(crate) contents: Vec<(String, Content)>,
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
            Err(_) if Path::new(&word).exists() => Ok(Self::File(PathBuf::from(word))),
            Err(_) => {
                let what = format!("'{}' is neither a fraction nor a file that is there", clip(&word));
                let p = Problem::error(Area::Config, "Config::BadChoice", what);
                Err(Problems(vec![p.on("--held-out").hint("give 0.3 for the last 30 %, or the path of a record")]))
            }
        }
    }
}

/// Cuts the fraction `f` off the end of the last record, which was read from `path`; both parts must have enough samples.
pub(crate) fn cut(records: &mut [LabelledRecord], f: f64, need: usize, path: &Path) -> Result<Held, Problems> {
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
    // The manifest has the whole path; in sentences it hides what they say.
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
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

/// Payloads that were not mounted in some of the records, which only the ground method tells from those that were.
pub(crate) fn only_on_the_ground(opened: &Opened, absent: Vec<Absent>) -> Result<Vec<Absent>, Problems> {
    if absent.is_empty() || opened.model.base_kind() == BaseKind::Fixed {
        return Ok(absent);
    }
    let what = "a payload that is mounted in some records alone is for an arm on the ground";
    let p = Problem::error(Area::Config, "Config::Method", what).on("--without");
    let hint =
        "give base = \"fixed\" in [robot]; in orbit identify each record, the second with --prior-from the first";
    Err(Problems(vec![p.hint(hint)]))
}

/// Reads everything, and takes the output folder, before anything is computed.
pub(crate) fn prepare(args: &Args, err: &mut impl Write) -> Result<(Ready, Destination), Refusal> {
    let input = &args.input;
    let opened = open(&input.file, input.leniency()).map_err(refused)?;
    let mission = results::undisturbed(&opened, &input.file).map_err(refused)?;
    let mut settings = settings(args, &opened, mission);
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
        loaded.push(args.reading.read(path, &opened.model, need, None, input).map_err(refused)?);
    }
    let (mut options, earlier) = args.options(&opened.model).map_err(refused)?;
    let truth = args.known_truth(&opened).map_err(refused)?;
    files.extend(args.ties.iter().cloned());
    files.extend(args.prior_from.iter().map(|f| f.join("result.json")));
    files.extend(earlier.files.iter().cloned());
    let inputs = results::inputs(&files).map_err(io)?;
    same_data(&inputs[2..], paths.len(), matches!(hold_out, HoldOut::File(_)), &earlier.inputs).map_err(refused)?;
    let read: Vec<(&Path, &Record)> =
        paths.iter().map(PathBuf::as_path).zip(loaded.iter().map(|l| &l.record)).collect();
    let whole: Vec<Content> = loaded.iter().map(|l| Content::of(&l.record)).collect();
    same_readings(&read.into_iter().zip(&whole).collect::<Vec<_>>(), &earlier.inputs).map_err(refused)?;
    let folder = results::begin(&target, &args.output, err).map_err(io)?;
    let mut problems = opened.warnings.clone();
    problems.extend(earlier.warnings);
    let mut records: Vec<LabelledRecord> = Vec::new();
    for (path, l) in paths.iter().zip(loaded) {
        problems.extend(l.warnings);
        let label = label(path, &records);
        records.push(LabelledRecord { label, record: l.record, resampled: (false, false), continues: false, ago: 0 });
    }
    let mut absent = Vec::new();
    for (payload, file) in &args.without {
        let Some(k) = paths.iter().position(|p| p == file) else {
            let what = format!("{} is none of the records that are fitted", file.display());
            let p = Problem::error(Area::Config, "Config::Records", what).on("--without");
            return Err(refused(Problems(vec![p.hint("name a file of --record or --records")])));
        };
        absent.push(Absent { payload: payload.clone(), record: records[k].label.clone() });
    }
    options.absent = only_on_the_ground(&opened, absent).map_err(refused)?;
    let mut held = match hold_out {
        HoldOut::Nothing => Held::None,
        HoldOut::Part(f) => cut(&mut records, f, need, &paths[paths.len() - 1]).map_err(refused)?,
        HoldOut::File(path) => {
            let (other, moving) = args.reading.read_one(&path, &opened.model, None, input, |held| {
                let fitted = paths.iter().map(PathBuf::as_path).zip(&records).map(|(p, r)| (p, &r.record));
                not_fitted((&path, held), &fitted.zip(&whole).collect::<Vec<_>>(), &earlier.inputs)
            })?;
            problems.extend(other.warnings);
            Held::File { record: other.record, path, moving }
        }
    };
    let contents = contents(paths.iter().map(|p| p.to_string_lossy().into_owned()), &records);
    let mut data = Data { records, sources: paths, problems };
    data.divide(&mut held)?;
    go_on(&mut data.records, earlier.records);
    data.sources.extend(earlier.files);
    data.on_the_ground(&opened, &mut settings, &mut options, &mut held)?;
    options.profile.clone_from(&args.profile);
    let Data { records, sources, problems } = data;
    let earlier = earlier.inputs;
    let ready = Ready { opened, settings, options, records, sources, earlier, held, truth, problems, inputs, contents };
    Ok((ready, Destination { files, folder, target }))
}

/// Records on their way to the fit, where they come from, and what was found on the way.
pub(crate) struct Data {
    pub(crate) records: Vec<LabelledRecord>,
    pub(crate) sources: Vec<PathBuf>,
    pub(crate) problems: Problems,
}

impl Data {
    /// Cuts every record where its motion cannot be told, and what judges to its longest part.
    pub(crate) fn divide(&mut self, held: &mut Held) -> Result<(), Refusal> {
        let (mut records, mut sources) = (Vec::new(), Vec::new());
        for (of, path) in self.records.drain(..).zip(self.sources.drain(..)) {
            let found = segments(&of.label, &of.record).map_err(failed)?;
            self.problems.extend(found.warnings.clone().in_file(&path));
            let parts = found.labelled(&of.label);
            sources.extend(std::iter::repeat_n(path, parts.len()));
            records.extend(parts);
        }
        (self.records, self.sources) = (records, sources);
        if let Held::Part { record, .. } | Held::File { record, .. } = held {
            let found = segments("held-out", record).map_err(failed)?;
            self.problems.extend(found.warnings.clone());
            if let Some(part) = found.longest() {
                let later = begins_later(&part, record);
                *record = part;
                if let Held::File { moving, .. } = held {
                    *moving |= later;
                }
            }
        }
        Ok(())
    }
    /// Brings the records of an arm on the ground to an even clock and through the low pass, which is chosen from the longest of them unless
    /// given.
    pub(crate) fn on_the_ground(
        &mut self,
        opened: &Opened,
        settings: &mut Settings,
        options: &mut FitOptions,
        held: &mut Held,
    ) -> Result<(), Refusal> {
        if method(&opened.model, settings.method) != Method::Ground {
            if let Some(hz) = settings.low_pass_hz {
                for r in &mut self.records {
                    r.record = filtered(&r.record, hz).map_err(refused)?;
                }
            }
            return Ok(());
        }
        // What no motion of an arm whose base is fixed tells is not the fault of a record.
        options.reduce = true;
        let Self { records, sources, problems } = self;
        for (k, r) in records.iter_mut().enumerate() {
            let (even, warned) = on_even_clock(&r.label, &r.record).map_err(failed)?;
            r.record = even;
            problems.extend(warned);
            // Records of an earlier identification have been judged there.
            if r.ago == 0 && !r.continues {
                let of_file = |p: Problems| sources.get(k).map_or(p.clone(), |file| p.in_file(file));
                let found = standing_still(opened, r, settings).map_err(failed);
                problems.extend(of_file(found.map_err(|(exit, p)| (exit, of_file(p)))?));
            }
        }
        let longest = records.iter().max_by(|a, b| a.record.seconds().total_cmp(&b.record.seconds()));
        let nominal = Params::nominal(&opened.model);
        if let (None, Some(r)) = (settings.low_pass_hz, longest) {
            let found = choose_low_pass(&opened.model, &r.record, &opened.estimated, nominal.values());
            settings.low_pass_hz = found.ok().map(|b| b.hz);
            if let Some(p) = bandwidth(found) {
                problems.push(p.on(&r.label));
            }
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
}

/// What is said of the low pass that was chosen, or why there is none; nothing of set points, which need none.
fn bandwidth(found: Result<Bandwidth, NoBandwidth>) -> Option<Problem> {
    let (what, hint) = match found {
        Err(NoBandwidth::SetPoints) => return None,
        Err(why) => (
            format!("no low pass was chosen: {why}; accelerations are those of a spline through the positions"),
            "give --low-pass HZ, twice the frequency of the fastest motion",
        ),
        Ok(Bandwidth { hz, compared_hz, missed, widest }) => {
            let compared = |widest: Option<(f64, f64)>| {
                let (hz, missed) = widest.filter(|w| w.0 > hz)?;
                Some(format!(", a low pass of {hz:.4} Hz {:.2} %", 100.0 * missed))
            };
            let told = missed.map_or_else(
                || "that of the motion, since no part of the log is predicted by the others".to_owned(),
                |m| {
                    let wider = compared(widest).unwrap_or_default();
                    let m = 100.0 * m;
                    format!(
                        "it misses {m:.2} % of the torques of parts that were not fitted{wider} (compared behind {compared_hz:.3} Hz)"
                    )
                },
            );
            (
                format!("positions and torques pass a low pass of {hz:.4} Hz: {told}"),
                "give --low-pass to choose another",
            )
        }
    };
    Some(Problem::warning(Area::Data, "Data::Bandwidth", what).hint(hint))
}

/// What the readings of records are known by, with the names of their files: the part of each that is fitted.
pub(crate) fn contents(names: impl Iterator<Item = String>, records: &[LabelledRecord]) -> Vec<(String, Content)> {
    names.zip(records).map(|(name, r)| (name, Content::of(&r.record))).collect()
}

/// A record with its file, and what its readings are known by.
pub(crate) type Known<'a> = ((&'a Path, &'a Record), &'a Content);

/// Row D39 by readings: a record whose readings stand in another file as well, in whatever format or unit.
pub(crate) fn same_readings(records: &[Known<'_>], earlier: &[InputFile]) -> Result<(), Problems> {
    for (k, ((path, record), own)) in records.iter().enumerate() {
        let twice = |((_, other), of): &&Known<'_>| own.is_in(other) || of.is_in(record);
        if let Some(((first, _), _)) = records[..k].iter().find(twice) {
            return Err(same(path, &first.display().to_string(), "give each record once"));
        }
        if let Some(old) = fitted_earlier(record, earlier) {
            let hint =
                "it has been fitted there already: leave it out, or leave --prior-from out and give all with --records";
            return Err(same(path, &format!("{} of the earlier identification", old.file), hint));
        }
    }
    Ok(())
}

/// Row D39 by readings, of a record to judge by: none of those that are fitted, each with what it is known by.
pub(crate) fn not_fitted(held: (&Path, &Record), fitted: &[Known<'_>], earlier: &[InputFile]) -> Result<(), Problems> {
    let (path, record) = held;
    let own = Content::of(record);
    let hint = "judge the model by data that were not fitted, or give a fraction";
    if let Some(((file, _), _)) = fitted.iter().find(|((_, r), c)| c.is_in(record) || own.is_in(r)) {
        return Err(same(path, &file.display().to_string(), hint));
    }
    match fitted_earlier(record, earlier) {
        Some(old) => Err(same(path, &format!("{} of the earlier identification", old.file), hint)),
        None => Ok(()),
    }
}

/// The file of an identification whose readings a record holds.
pub(crate) fn fitted_earlier<'f>(record: &Record, files: &'f [InputFile]) -> Option<&'f InputFile> {
    files.iter().find(|f| f.content.as_ref().is_some_and(|c| Content::from_words(c).is_in(record)))
}

/// What is said of readings that two files hold.
pub(crate) fn same(path: &Path, as_what: &str, hint: &str) -> Problems {
    let what = format!("the same readings as {as_what}, in another file");
    Problems(vec![Problem::error(Area::Data, "Data::SameData", what).in_file(path).hint(hint)])
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
