//! `ffid validate`: does the identified model explain a record it has not seen?

use crate::commands::identify::prepare::{fitted_earlier, same as same_readings};
use crate::flags::fit::{FitFlags, watched};
use crate::flags::record::RecordFlags;
use crate::output::{Input, Outcome};
use crate::result_folder;
use crate::results;
use crate::results::{Output, Refusal, io, refused};
use ff_mission::Mission;
use ff_model::{Area, Model, Problem, Problems};
use ff_records::Record;
use ff_report::identify::{figures, validation};
use ffid::exit::{Exit, Failure};
use ffid::files::folder::{Entry, Folder};
use ffid::files::json;
use ffid::open::Opened;
use ffid::workflow::identify::{
    Arm, HeldOut, IdentificationResult, IdentifyError, Known, Observer, Settings, Signals, State,
    adopted_sensor_errors, axes, held_errors, judge_held_out, of_model,
};
use ident::Noise;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Display;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Examples for `--help`.
pub(crate) const EXAMPLES: &str = "Examples:
  ffid validate m-identified --record other.csv
  ffid validate m-identified --record other.csv --out verdict

Parameters stay as they were estimated; biases (and, when asked for, the initial state) belong to the record and are fitted.
A model that does not explain the record ends with exit code 16.";

/// Arguments of `ffid validate`.
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    pub(crate) input: Input,
    /// A record that was not used to identify (.csv).
    #[arg(long, value_name = "FILE")]
    record: PathBuf,
    /// Folder for report, residuals and figures; printed only unless given.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) fit: FitFlags,
    #[command(flatten)]
    pub(crate) reading: RecordFlags,
    #[command(flatten)]
    pub(crate) output: Output,
}

/// Results in JSON; absent when there are none.
#[derive(Default, Serialize)]
struct Results<'a> {
    verdict: Option<&'a HeldOut>,
    /// The folder that was written.
    out: Option<&'a PathBuf>,
}

/// What was found.
struct Found {
    robot: String,
    held: HeldOut,
    signals: Signals,
    modes: Vec<ffid::workflow::identify::ModeLine>,
    problems: Problems,
    files: Vec<PathBuf>,
    inputs: Vec<Entry>,
    folder: Option<Folder>,
}

/// Predicts, judges, writes when asked to, and prints.
pub(crate) fn run(args: &Args, out: &mut impl Write, err: &mut impl Write) -> Outcome {
    let input = &args.input;
    let found = match judge(args, err) {
        Ok(f) => f,
        Err((exit, p)) => return input.print(exit, &p.in_file(&args.record), Results::default(), &[], out, err),
    };
    let Found { robot, held, signals, modes, mut problems, files, inputs, folder } = found;
    let mut exit = conclude(&held, &args.record, &mut problems);
    if let Some(p) = results::changed(&inputs, &files) {
        exit = Exit::Data;
        problems.push(p);
    }
    let mut written = None;
    if let Some(folder) = folder {
        let wrote = write(&folder, args, &robot, &held, &signals, &modes).and_then(|()| {
            let settings = [("max_chi2", held.limit.to_string())];
            folder.finish(&results::about("validate", 0, &settings, inputs))
        });
        match wrote {
            Ok(()) => written = args.out.as_ref(),
            Err(e) => {
                let (code, p) = results::failed(&e);
                exit = code;
                problems.push(p);
            }
        }
    }
    let text: [Option<&dyn Display>; 1] = [Some(&held)];
    let text = if args.output.quiet { &[][..] } else { &text[..] };
    input.print(exit, &problems, Results { verdict: Some(&held), out: written }, text, out, err)
}

/// The code of a verdict, and the problem of a model that does not explain the record at `path`.
pub(crate) fn conclude(held: &HeldOut, path: &Path, problems: &mut Problems) -> Exit {
    let exit = Exit::of(problems);
    if held.explained {
        return exit;
    }
    let chi2 = format!("chi-squared per degree of freedom {:.3}, limit {}", held.chi2_per_dof, held.limit);
    let what = match held.evidence.as_ref().filter(|e| e.state == State::Contradicted) {
        Some(e) => format!("{}; {chi2}", e.reason),
        None => chi2,
    };
    let p = Problem::error(Area::Data, "Fit::NotExplained", what).in_file(path);
    problems.push(p.hint("another robot, other fuel, or something moves that the model does not have"));
    Exit::Contradicted
}

fn judge(args: &Args, err: &mut impl Write) -> Result<Found, Refusal> {
    let input = &args.input;
    let found = result_folder::load(input).map_err(refused)?;
    let mission = results::undisturbed(&found.opened, &found.mission_file).map_err(refused)?;
    let model = &found.opened.model;
    // The noise of a calibration is that behind its filter.
    let arm = arm_of(args, &found.result, model);
    let low_pass = arm.as_ref().map_or(args.reading.low_pass(), |a| a.low_pass_hz);
    let files = vec![found.mission_file.clone(), args.record.clone()];
    let inputs = results::inputs(&files).map_err(io)?;
    let unseen = |record: &Record| unseen(&found.result, &inputs[1], &args.record, record);
    let (loaded, moving) = args.reading.read_one(&args.record, model, low_pass, input, unseen)?;
    let folder = args.out.as_ref().map(|o| results::begin(o, &args.output, err)).transpose().map_err(io)?;
    let source = args.record.display().to_string();
    let (held, signals) = watched(&args.output, false, |watch| {
        predict(args, &found.result, &found.opened, mission, arm.as_ref(), (&loaded.record, source, moving), watch)
    })?;
    let mut problems = found.opened.warnings.clone();
    problems.extend(loaded.warnings);
    input.leniency().settle(&mut problems);
    let (robot, modes) = (found.result.robot, found.result.modes);
    Ok(Found { robot, held, signals, modes, problems, files, inputs, folder })
}

/// Refuses data that were used to identify: the same file, or its readings in another one.
pub(crate) fn unseen(
    result: &IdentificationResult,
    source: &Entry,
    path: &Path,
    record: &Record,
) -> Result<(), Problems> {
    let hint = "judge the model by a record that it has not seen";
    let inputs = &result.provenance.inputs;
    let Some(same) = inputs.iter().find(|i| i.sha256 == source.sha256) else {
        return match fitted_earlier(record, inputs) {
            Some(old) => Err(same_readings(path, &format!("{} of the identification", old.file), hint)),
            None => Ok(()),
        };
    };
    let what = format!("the same data as {} of the identification (SHA-256 {})", same.file, same.sha256);
    let p = Problem::error(Area::Data, "Data::SameData", what).in_file(path);
    Err(Problems(vec![p.hint(hint)]))
}

/// Predicts a record with the parameters of a result; axes that are turned are refused. The record comes with where it is from, and whether it
/// begins in the middle of a motion.
pub(crate) fn predict(
    args: &Args,
    result: &IdentificationResult,
    opened: &Opened,
    mission: &Mission,
    arm: Option<&Arm>,
    (record, source, moving): (&Record, String, bool),
    watch: &Observer<'_>,
) -> Result<(HeldOut, Signals), IdentifyError> {
    let p = &result.provenance;
    let asked = args.fit.settings(mission);
    let given = args.fit.noise();
    let noise = Noise { torque: given.0.unwrap_or(p.noise_torque_nm), gyro: given.1.unwrap_or(p.noise_gyro_rad_per_s) };
    let held_errors = held_errors(result);
    let model = &opened.model;
    // What is not known of an identified robot is about its estimates.
    let about_estimates = |m: &Mission| Mission { prior_means: BTreeMap::new(), ..m.clone() };
    let opened = &Opened { mission: opened.mission.as_ref().map(about_estimates), ..opened.clone() };
    // Masses that were adopted are in the model by now.
    let adopted: Vec<String> =
        p.settings.get("adopt").map_or_else(Vec::new, |a| a.split(", ").map(str::to_owned).collect());
    let adopt = adopted_sensor_errors(model, &adopted);
    let initial_state = asked.initial_state || moving;
    let s = Settings { method: Some(result.method), noise, held_errors, adopt, initial_state, ..asked };
    let values: Vec<f64> = result.model.iter().map(|v| v.value).collect();
    let learnt = result.posterior.as_ref().filter(|_| result.status.is_solution());
    let posterior = learnt.and_then(|p| of_model(p, model));
    let known = Known { opened, posterior: posterior.as_ref(), ties: &[] };
    let found = judge_held_out(known, &values, arm, record, &s, source, watch)?;
    if found.0.chi2_per_dof > s.limit && arm.is_none() {
        let turned = axes::mismatch(model, &values, record, &s)?;
        if turned.has_errors() {
            return Err(IdentifyError::Refused(turned));
        }
    }
    Ok(found)
}

/// Friction and noise of a calibration on the ground, behind the low pass that the flags or else the calibration name.
pub(crate) fn arm_of(args: &Args, result: &IdentificationResult, model: &Model) -> Option<Arm> {
    let low_pass = args.reading.low_pass();
    Arm::of(result, &model.joint_names()).map(|a| Arm { low_pass_hz: low_pass.or(a.low_pass_hz), ..a })
}

fn write(
    folder: &Folder,
    args: &Args,
    robot: &str,
    held: &HeldOut,
    signals: &Signals,
    modes: &[ffid::workflow::identify::ModeLine],
) -> Result<(), Failure> {
    json::write(&folder.path().join("verdict.json"), held)?;
    folder.write("report.txt", held.to_string().as_bytes())?;
    signals.write(&folder.path().join("residuals.csv"))?;
    let mut all = vec![
        ("signals", figures::signals(signals, &format!("{robot}: measured and predicted"))),
        ("residuals", figures::residuals(signals, &format!("{robot}: residuals, measured minus predicted"))),
    ];
    let spectra = figures::spectra(signals, modes, &format!("{robot}: spectra of signals and residuals"));
    all.extend(spectra.map(|f| ("spectra", f)));
    results::draw(folder, &all, args.output.png)?;
    folder.write("report.html", validation(robot, held, &all)?.as_bytes())
}
