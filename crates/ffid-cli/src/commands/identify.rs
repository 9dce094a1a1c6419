//! `ffid identify`: from a mission and a record to parameters, a report, and files of the identified robot.

use crate::flags::fit::{FitFlags, MethodFlag, positive, watched};
use crate::flags::record::RecordFlags;
use crate::output::{Input, Outcome};
use crate::result_folder;
use crate::results;
use crate::results::{Output, Refusal, io, refused};
use ff_mission::Leniency;
use ff_model::{Area, Params, Problem, Problems};
use ff_records::Record;
use ff_report::identify::{all_figures, page};
use ffid::exit::{Exit, Failure};
use ffid::files::folder::{Entry, Folder};
use ffid::open::{Opened, open};
use ffid::workflow::identify::{Arm, LOW_PASS};
use ffid::workflow::identify::{
    Asked, Identified, IdentifyError, Method, Settings, Signals, Take, TieSpec, axes, explain, model_files,
};
use ffid::workflow::identify::{Combination, InputFile, Provenance, RecordLine, Warning};
use ffid::workflow::identify::{Doubts, Watches, careful};
use ffid::workflow::identify::{IdentificationResult, method};
use ffid::workflow::identify::{Kind, Trial, judge};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;
use std::fmt::Display;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Examples for `--help`.
pub(crate) const EXAMPLES: &str = "Examples:
  ffid identify m.toml --record rec.csv                     into m-identified/
  ffid identify m.toml --record rec.csv --held-out 0.3      the last 30 % judge the model
  ffid identify m.toml --record a.csv --held-out b.csv --out result
  ffid identify m.toml --record exact.csv --torque-noise 0.1 --gyro-noise 1e-4
  ffid identify m.toml --records a.csv b.csv c.csv          one robot, biases of each record
  ffid identify m.toml --record rec.csv --reduce            where the record is silent, what it can tell
  ffid identify m.toml --record rec.csv --profile 'tank.*'  intervals from the likelihood itself
  ffid identify m.toml --record new.csv --prior-from m-identified
  ffid identify m.toml --record rec.csv --compare           rigid, flexible, sloshing or both?
  ffid identify arm.toml --record log.csv --reduce --held-out 0.33   an arm on the ground, friction included
  ffid identify m.toml --record rec.csv --ties ties.toml    one stiffness for all hinges, one filling level

A record has columns time[s], q.<joint>[rad], tau.<joint>[N m], gyro.x[rad/s], gyro.y[..], gyro.z[..]; dq., ddq., acc. and
att. are optional, units are converted (docs/records.md). The folder holds report.html, result.json, identified.toml,
identified.urdf, residuals.csv and .parquet, report.txt, figures and manifest.toml (docs/results.md). Parameters that the record cannot
tell end with exit code 13 and are named; a fit that found no solution ends with 14.";

/// Arguments of `ffid identify`.
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    input: Input,
    /// The record: CSV, Parquet or MCAP (a ROS 2 bag).
    #[arg(long, value_name = "FILE", required_unless_present = "records")]
    record: Option<PathBuf>,
    /// Several records of the robot, instead of --record: parameters are shared, biases and initial state are those of each.
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with = "record")]
    records: Vec<PathBuf>,
    /// Folder for the results; <mission>-identified in the working directory unless given.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Data that judge the model and are not fitted: a fraction (the end of the last record) or another record.
    #[arg(long, value_name = "FRACTION|FILE")]
    held_out: Option<String>,
    /// How the record is predicted.
    #[arg(long, value_enum, default_value_t = MethodFlag::Auto)]
    method: MethodFlag,
    /// Relative standard deviation of a prior on every parameter, instead of estimate.prior_relative_std.
    #[arg(long, value_name = "RELATIVE", value_parser = positive, conflicts_with = "no_prior")]
    prior: Option<f64>,
    /// The data alone, whatever the mission says.
    #[arg(long)]
    no_prior: bool,
    /// Take what an earlier identification has learnt as prior: the folder that it wrote.
    #[arg(long, value_name = "DIR")]
    prior_from: Option<PathBuf>,
    /// Parameters that are functions of fewer unknowns: a file of [[tie]] tables (docs/results.md).
    #[arg(long, value_name = "FILE")]
    ties: Option<PathBuf>,
    /// Where the record is silent, estimate the parameters that it can tell, and hold the others where they are.
    #[arg(long)]
    reduce: bool,
    /// Profile the likelihood of these parameters (names, `*` for any): intervals that assume no parabola. Many fits.
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    profile: Vec<String>,
    /// Fit from this many starts, drawn around the first, and say whether they agree.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
    starts: u32,
    /// Fit models with and without panels and fuel as well, and say which to use; the last 30 % judge unless --held-out does.
    #[arg(long, value_name = "MODEL", value_enum, value_delimiter = ',', num_args = 0.., default_missing_value = "rigid,flexible,slosh,both")]
    compare: Vec<Kind>,
    /// What becomes of clocks of torques and gyro that disagree with that of the encoders.
    #[arg(long, value_enum, default_value_t = Watches::Correct)]
    clocks: Watches,
    /// Thrusters or other external torques acted during the record: do not refuse it for its momentum.
    #[arg(long)]
    external_torque: bool,
    /// The modes of the free decay must be told: refuse a record in which they cannot.
    #[arg(long)]
    modes: bool,
    /// Start at the values of the mission: leave out estimate.start_offset, which is for studies.
    #[arg(long)]
    no_start_offset: bool,
    /// Seed of the directions of estimate.start_offset, and of other starts.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    fit: FitFlags,
    #[command(flatten)]
    reading: RecordFlags,
    #[command(flatten)]
    output: Output,
}

/// Results in JSON; absent when there are none.
#[derive(Default, Serialize)]
struct Results<'a> {
    result: Option<&'a IdentificationResult>,
    /// The folder that was written.
    out: Option<&'a PathBuf>,
}

/// Where the results are.
struct Written<'a>(&'a PathBuf);

impl Display for Written<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "written to {}: report.html, result.json, identified.toml", self.0.display())
    }
}

/// Data that judge.
enum Held {
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

impl Args {
    /// The records that are fitted.
    fn paths(&self) -> Vec<PathBuf> {
        self.record.iter().chain(&self.records).cloned().collect()
    }
    /// What is asked beside the fit, and the files of an earlier identification.
    fn asked(&self) -> Result<(Asked, Vec<InputFile>), Problems> {
        let mut asked = Asked { reduce: self.reduce, more_starts: self.starts as usize - 1, ..Asked::default() };
        if let Some(path) = &self.ties {
            let text = ff_model::diagnostics::text_file(path, MAX_TIES)?;
            asked.ties = TieSpec::read(&text).map_err(|p| p.in_file(path))?;
        }
        let mut earlier = Vec::new();
        if let Some(folder) = &self.prior_from {
            let result = result_folder::result(folder)?;
            earlier = result.provenance.inputs;
            asked.posterior = Some(result.posterior.ok_or_else(|| {
                let what = "the result holds no posterior";
                let p = Problem::error(Area::Data, "Data::NoPosterior", what).in_file(folder.join("result.json"));
                Problems(vec![p.hint("identify again with this version")])
            })?);
        }
        Ok((asked, earlier))
    }
}

/// Row D39: data that were given twice. `files` are `records` records, then the one held out, if `held` is.
fn same_data(files: &[Entry], records: usize, held: bool, earlier: &[InputFile]) -> Result<(), Problems> {
    let said = |of: &Entry, as_what: String, hint: &str| {
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
            return said(file, first.file.clone(), hint);
        }
        if let Some(old) = earlier.iter().find(|f| f.sha256 == file.sha256) {
            let hint = "its prior knows them already; fit both at once with --records, or leave --prior-from out";
            return said(file, format!("{} of the earlier identification", old.file), hint);
        }
    }
    Ok(())
}

/// Longest file of ties (bytes).
const MAX_TIES: usize = 1 << 20;

/// Everything read and ready.
struct Ready {
    opened: Opened,
    settings: Settings,
    asked: Asked,
    takes: Vec<Take>,
    held: Held,
    problems: Problems,
    files: Vec<PathBuf>,
    inputs: Vec<Entry>,
    folder: Folder,
    target: PathBuf,
}

/// Identifies, writes and prints.
pub(crate) fn run(args: &Args, out: &mut impl Write, err: &mut impl Write) -> Outcome {
    let input = &args.input;
    let mut ready = match prepare(args) {
        Ok(r) => r,
        Err((exit, p)) => return input.print(exit, &p, Results::default(), &[], out, err),
    };
    let found = fit(args, &mut ready);
    let (mut found, held, said) = match found {
        Ok(f) => f,
        Err((exit, p)) => return input.print(exit, &p.in_file(&input.file), Results::default(), &[], out, err),
    };
    let Ready { opened, problems, files, inputs, folder, target, .. } = ready;
    let mut problems = problems;
    problems.extend(said);
    input.leniency().settle(&mut problems);
    let mut faults = faults(&found.result, args);
    let mut exit = results::exit_of(&problems, &mut faults, &input.leniency());
    if found.result.exit() != Exit::Done {
        exit = found.result.exit();
    }
    problems.extend(faults);
    found.result.warnings = Warning::all(&problems);
    if let Some(p) = results::changed(&inputs, &files) {
        exit = Exit::Data;
        problems.push(p);
    }
    let leniency = input.leniency();
    let wrote = write(&folder, args, &opened, &found, held.as_ref(), &leniency).and_then(|()| {
        let r = &found.result;
        let settings: Vec<(&str, String)> =
            r.provenance.settings.iter().map(|(k, v)| (k.as_str(), v.clone())).collect();
        folder.finish(&results::about("identify", args.seed, &settings, inputs))
    });
    let written = wrote.is_ok();
    if let Err(e) = wrote {
        // What was found is printed all the same.
        let (code, p) = results::failed(&e);
        exit = code;
        problems.push(p);
    }
    let where_to = written.then_some(&target);
    let line = where_to.map(Written);
    let text: [Option<&dyn Display>; 2] = [Some(&found.result), line.as_ref().map(|w| w as _)];
    let text = if args.output.quiet { &[][..] } else { &text[..] };
    input.print(exit, &problems, Results { result: Some(&found.result), out: where_to }, text, out, err)
}

/// Reads everything, and takes the folder, before anything is computed.
fn prepare(args: &Args) -> Result<Ready, Refusal> {
    let input = &args.input;
    let opened = open(&input.file, input.leniency()).map_err(refused)?;
    let mission = results::undisturbed(&opened, &input.file).map_err(refused)?;
    let mut settings = args.fit.settings(mission);
    settings.method = args.method.method();
    settings.prior = args.prior.or(mission.estimate.prior_relative_std).filter(|_| !args.no_prior);
    settings.start_offset = if args.no_start_offset { 0.0 } else { mission.estimate.start_offset };
    settings.seed = args.seed;
    settings.low_pass_hz = args.reading.low_pass();
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
        loaded.push(args.reading.read(path, &opened.model, need, settings.low_pass_hz, input).map_err(refused)?);
    }
    let (mut asked, earlier) = args.asked().map_err(refused)?;
    files.extend(args.ties.iter().cloned());
    files.extend(args.prior_from.iter().map(|f| f.join("result.json")));
    let inputs = results::inputs(&files).map_err(io)?;
    same_data(&inputs[2..], paths.len(), fraction.is_none() && held_out.is_some(), &earlier).map_err(refused)?;
    let folder = results::begin(&target, &args.output).map_err(io)?;
    let mut problems = opened.warnings.clone();
    let mut takes: Vec<Take> = Vec::new();
    for (path, l) in paths.iter().zip(loaded) {
        problems.extend(l.warnings);
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let again = takes.iter().filter(|t| t.label == stem || t.label.starts_with(&format!("{stem}-"))).count();
        let label = if again == 0 { stem } else { format!("{stem}-{}", again + 1) };
        takes.push(Take { label, record: l.record });
    }
    let last_take = takes.len() - 1;
    let held = match (fraction, held_out.as_deref()) {
        (Some(f), _) => {
            let whole = takes[last_take].record.clone();
            let seconds = whole.seconds();
            let cut = (1.0 - f) * seconds;
            let first = whole.window(0.0, cut).map_err(refused)?;
            let last = whole.window(cut, f64::INFINITY).map_err(refused)?;
            if first.samples() < need || last.samples() < 8 {
                let what = format!("{} samples to fit and {} to judge by", first.samples(), last.samples());
                let p = Problem::error(Area::Data, "Data::TooShort", format!("{what}, at least {need} and 8 needed"));
                return Err(refused(Problems(vec![
                    p.on("--held-out").hint("record longer, or hold out another part"),
                ])));
            }
            let words = format!("the last {:.1} % of {}", 100.0 * f, paths[last_take].display());
            takes[last_take].record = first;
            Held::Part { record: last, words }
        }
        (None, Some(path)) => {
            let path = PathBuf::from(path);
            let other = args.reading.read(&path, &opened.model, 8, settings.low_pass_hz, input).map_err(refused)?;
            problems.extend(other.warnings);
            Held::File { record: other.record, path }
        }
        (None, None) => Held::None,
    };
    asked.profile.clone_from(&args.profile);
    Ok(Ready { opened, settings, asked, takes, held, problems, files, inputs, folder, target })
}

/// The fit, and the judgement of what was held out.
fn fit(args: &Args, r: &mut Ready) -> Result<(Identified, Option<Signals>, Problems), Refusal> {
    let settings_words = words(args, r);
    let Ready { opened, settings: s, asked, takes, held, inputs, .. } = r;
    let model = &opened.model;
    let provenance = Provenance {
        program: concat!("ffid ", env!("CARGO_PKG_VERSION")).to_owned(),
        inputs: inputs
            .iter()
            .map(|e| InputFile { file: e.file.clone(), bytes: e.bytes, sha256: e.sha256.clone() })
            .collect(),
        record: RecordLine { samples: 0, rate_hz: 0.0, seconds: 0.0, t0: 0.0, rates: false },
        noise_torque_nm: s.noise.torque,
        noise_gyro_rad_per_s: s.noise.gyro,
        settings: settings_words,
    };
    watched(args.output.quiet, |watch| {
        let doubts = Doubts { clocks: args.clocks, external: args.external_torque, modes: args.modes };
        // A wrong axis explains a bad fit; asked only then, because it is only then that it can be.
        let turned = |takes: &[Take], s: &Settings| -> Result<(), IdentifyError> {
            let nominal = Params::nominal(model);
            for (take, path) in takes.iter().zip(args.paths()) {
                let turned = axes::mismatch(model, nominal.values(), &take.record, s)?;
                if turned.has_errors() {
                    return Err(IdentifyError::Refused(turned.in_file(path)));
                }
            }
            Ok(())
        };
        let (mut found, s, said) = careful(opened, takes, s, asked, doubts, &turned, &provenance, watch)?;
        let s = &s;
        let arm = Arm::of(&found.result, &model.joint_names());
        let mut signals = None;
        let judged = match held {
            Held::None => None,
            // A part of a record begins in the middle of a motion.
            Held::Part { record, words } => {
                let s = Settings { initial_state: true, ..s.clone() };
                Some(explain(model, &found.values, arm.as_ref(), record, &s, words.clone(), watch)?)
            }
            Held::File { record, path } => {
                Some(explain(model, &found.values, arm.as_ref(), record, s, path.display().to_string(), watch)?)
            }
        };
        if let Some((held, of)) = judged {
            found.result.held_out = Some(held);
            signals = Some(of);
        }
        if !args.compare.is_empty() {
            let (record, source, moving) = match held {
                Held::Part { record, words } => (&*record, words.clone(), true),
                Held::File { record, path } => (&*record, path.display().to_string(), false),
                // Not reached: comparing holds something out.
                Held::None => return Ok((found, signals, said)),
            };
            let trial = Trial { opened, takes: takes.as_slice(), held: record, source: &source, moving, settings: s };
            found.result.comparison = Some(judge(&trial, &args.compare, &provenance, watch)?);
        }
        found.result.verdict = ffid::workflow::identify::verdict(&found.result, s.limit);
        Ok((found, signals, said))
    })
}

/// Settings by name, for result and manifest.
fn words(args: &Args, r: &Ready) -> BTreeMap<String, String> {
    let s = &r.settings;
    let how = method(&r.opened.model, s.method);
    let passive = how == Method::OutputError;
    let name = match how {
        Method::Rda => "rda",
        Method::OutputError => "output_error",
        Method::Ground => "ground",
    };
    let yes = |b: bool| if b { "estimated" } else { "none" }.to_owned();
    let mut all = vec![
        ("method", name.to_owned()),
        ("biases", yes(s.biases && passive)),
        ("initial_state", if s.initial_state && passive { "estimated" } else { "at rest" }.to_owned()),
        ("prior_relative_std", s.prior.map_or_else(|| "none".to_owned(), |p| p.to_string())),
        ("start_offset", s.start_offset.to_string()),
        ("max_chi2", s.limit.to_string()),
    ];
    all.extend(args.reduce.then(|| ("reduce", "yes".to_owned())));
    all.extend(s.low_pass_hz.map(|hz| (LOW_PASS, hz.to_string())));
    all.extend((args.starts > 1).then(|| ("starts", args.starts.to_string())));
    all.extend((!args.profile.is_empty()).then(|| ("profile", args.profile.join(", "))));
    all.extend(args.prior_from.iter().map(|p| ("prior_from", p.display().to_string())));
    all.extend(args.ties.iter().map(|p| ("ties", p.display().to_string())));
    let kinds: Vec<&str> = args.compare.iter().map(|k| k.name()).collect();
    all.extend((!kinds.is_empty()).then(|| ("compare", kinds.join(", "))));
    all.extend(args.external_torque.then(|| ("external_torque", "declared".to_owned())));
    all.extend((args.clocks == Watches::Trust).then(|| ("clocks", "trusted".to_owned())));
    all.extend(args.held_out.iter().map(|h| ("held_out", h.clone())));
    all.into_iter().map(|(k, v)| (k.to_owned(), v)).collect()
}

/// What a result finds fault with. A solution that is not one, and what nothing can tell, are errors.
fn faults(r: &IdentificationResult, args: &Args) -> Problems {
    let mut out = Problems::default();
    let file = args.paths().swap_remove(0);
    let mut add = |p: Problem, hint: &str| out.push(p.in_file(&file).hint(hint));
    if !r.status.is_solution() {
        let p = Problem::error(Area::Data, "Fit::NoSolution", format!("the fit {}", r.status));
        add(p, "start nearer, give priors, or raise --max-iterations");
    }
    let silent: Vec<(&Combination, &str)> = match &r.silent {
        None => r.null_directions.iter().map(|d| (d, "")).collect(),
        Some(s) => {
            let structural = s.structural.iter().map(|d| (d, ", as any record of this robot is"));
            structural.chain(s.unexcited.iter().map(|d| (d, ", which another motion might tell"))).collect()
        }
    };
    for (d, why) in silent {
        let what = format!("the record is silent on {}{why}", d.text);
        let (make, hint): (fn(_, _, String) -> Problem, _) = if r.reduced.is_some() {
            (|a, c, m| Problem::warning(a, c, m), "what it can tell was estimated, and the rest held; see the report")
        } else if r.priors_cover {
            (|a, c, m| Problem::warning(a, c, m), "its prior holds it; excite it, or estimate less")
        } else {
            (|a, c, m| Problem::error(a, c, m), "give --reduce or --prior, estimate less, or excite otherwise")
        };
        add(make(Area::Data, "Fit::Unidentifiable", what), hint);
    }
    if let Some(m) = r.minima.as_ref().filter(|m| m.objectives.len() > 1) {
        let costs: Vec<String> = m.objectives.iter().map(|o| format!("{o:.4e}")).collect();
        let what = format!("{} starts led to {} minima, of cost {}", m.starts, costs.len(), costs.join(", "));
        let hint = format!("{}; start nearer, or excite more", m.taken());
        add(Problem::warning(Area::Data, "Fit::MultipleMinima", what), &hint);
    }
    if r.chi2_per_dof > args.fit.limit() {
        let what = format!("chi-squared per degree of freedom {:.3}, limit {}", r.chi2_per_dof, args.fit.limit());
        let p = Problem::warning(Area::Data, "Fit::Misfit", what);
        add(p, "look at the spectra of the residuals: something moves that the model does not have");
    }
    if let Some(h) = r.held_out.as_ref().filter(|h| !h.explained) {
        let what = format!("held-out data: chi-squared per degree of freedom {:.3}, limit {}", h.chi2_per_dof, h.limit);
        add(Problem::warning(Area::Data, "Fit::HeldOut", what), "the model does not predict what it has not seen");
    }
    out
}

/// Writes everything but the manifest.
fn write(
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
