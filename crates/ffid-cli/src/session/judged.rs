//! `ffid excite`, `ffid plan`, `ffid doctor` and `ffid validate` on what is in memory.

use super::Refused;
use super::motion::Motion;
use super::options::{another, parse};
use super::record::Given;
use crate::Command;
use crate::commands::doctor::judge_records;
use crate::commands::{excite, validate as command};
use crate::flags::fit::failed;
use crate::flags::record::judged;
use crate::results;
use ff_model::{Area, Problem, Problems};
use ffid::exit::Exit;
use ffid::open::Opened;
use ffid::workflow::doctor::Diagnosis;
use ffid::workflow::excite::{Demands, Observer as Search, Planned, demands, plan, start};
use ffid::workflow::identify::{HeldOut, IdentificationResult, Observer, Signals};
use ffid::workflow::preflight::{Preflight, Sensing, joint_limits, prove, start_pose};
use std::path::Path;
use std::sync::atomic::Ordering;

/// A plan, and what it will tell.
pub struct Planning {
    /// The plan.
    pub planned: Planned,
    /// The verdict on it.
    pub verdict: Preflight,
    /// What the verdict finds fault with.
    pub faults: Problems,
}

/// Plans a manoeuvre with the options of `ffid excite` (`--goal`, `--seed`, `--starts`); stopped from outside, it is the best so far.
///
/// # Errors
/// [`Refused`].
pub fn plan_excitation(
    file: &Path,
    opened: &Opened,
    options: &[String],
    watch: &Search<'_>,
) -> Result<Planning, Refused> {
    let words = [&[file.to_string_lossy().into_owned()], options].concat();
    let Command::Excite(args) = parse("excite", &words)? else { return Err(another("excite")) };
    let mission = results::undisturbed(opened, file)?;
    let settings = excite::settings(&args, mission);
    let demands = demands(opened, &mission.limits, &start(opened, &settings), file).map_err(|p| p.in_file(file))?;
    let found = plan(opened, &settings, &mission.limits, &demands, &Sensing::of(&mission.sensors), watch);
    let planned = found.map_err(|e| {
        let stopped = watch.stop.is_some_and(|s| s.load(Ordering::SeqCst));
        Refused { exit: if stopped { Exit::Interrupted } else { e.exit }, problems: Problems::from(e).in_file(file) }
    })?;
    let proven = prove(&planned.file.trajectory, &joint_limits(&opened.model, &mission.limits)).map_err(|e| {
        let p = Problem::error(Area::Config, "Plan::NoVerdict", e.to_string()).in_file(file).hint("check [limits]");
        Refused { exit: Exit::Numerical, problems: Problems(vec![p]) }
    })?;
    let motion = planned.file.trajectory.motion();
    let verdict = results::verdict(opened, mission, motion, Some(&proven), &demands)?;
    let faults = results::faults(&verdict);
    Ok(Planning { planned, verdict, faults })
}

/// The verdict of `ffid plan` on a motion, and what it finds fault with.
///
/// # Errors
/// [`Refused`].
pub fn preflight(file: &Path, opened: &Opened, motion: &Motion) -> Result<(Preflight, Problems), Refused> {
    let mission = results::undisturbed(opened, file)?;
    let demands: Demands = demands(opened, &mission.limits, &start_pose(motion.motion.as_ref()), file)?;
    let verdict = results::verdict(opened, mission, motion.motion.as_ref(), motion.proven.as_ref(), &demands)?;
    let faults = results::faults(&verdict);
    Ok((verdict, faults))
}

/// The judgement of a model by a record that was not fitted.
pub struct Validation {
    /// The verdict.
    pub held: HeldOut,
    /// Measured and predicted signals.
    pub signals: Signals,
    /// What was put up with, and what the verdict finds fault with.
    pub problems: Problems,
    /// The code that `ffid validate` would end with.
    pub exit: Exit,
}

/// The verdict of `ffid validate` on a record that was not fitted, with its options; `opened` is the identified robot, `file` its mission.
///
/// # Errors
/// [`Refused`]; `Data::SameData` for a record of the identification.
pub fn validate(
    file: &Path,
    opened: &Opened,
    result: &IdentificationResult,
    given: &Given,
    options: &[String],
    watch: &Observer<'_>,
) -> Result<Validation, Refused> {
    let mut words = vec![file.to_string_lossy().into_owned(), format!("--record={}", given.path.display())];
    words.extend(options.iter().cloned());
    let Command::Validate(args) = parse("validate", &words)? else { return Err(another("validate")) };
    let mission = results::undisturbed(opened, file)?;
    command::unseen(result, &given.source, &given.path, &given.record)?;
    let arm = command::arm_of(&args, result, &opened.model);
    let low_pass = arm.as_ref().map_or(args.reading.low_pass(), |a| a.low_pass_hz);
    let mut problems = opened.warnings.clone();
    problems.extend(given.warnings.clone());
    let (record, moving) = judged(&given.path, given.record.clone(), low_pass, &mut problems)?;
    let source = given.path.display().to_string();
    let found = command::predict(&args, result, opened, mission, arm.as_ref(), (&record, source, moving), watch);
    let (held, signals) = found.map_err(failed)?;
    args.input.leniency().settle(&mut problems);
    let exit = command::conclude(&held, &given.path, &mut problems);
    Ok(Validation { held, signals, problems, exit })
}

/// What `ffid doctor` finds in records, and the code that it would end with.
pub struct Diagnosed {
    /// The findings.
    pub diagnosis: Diagnosis,
    /// What was put up with, and what the findings give rise to.
    pub problems: Problems,
    /// The code that `ffid doctor` would end with.
    pub exit: Exit,
}

/// The diagnosis of records in memory, with the options of `ffid doctor`.
///
/// # Errors
/// [`Refused`]; what is wrong with a record is a finding.
pub fn doctor(file: &Path, opened: &Opened, records: &[Given], options: &[String]) -> Result<Diagnosed, Refused> {
    let mut words = vec![file.to_string_lossy().into_owned()];
    words.extend(records.iter().map(|r| format!("--record={}", r.path.display())));
    words.extend(options.iter().cloned());
    let Command::Doctor(args) = parse("doctor", &words)? else { return Err(another("doctor")) };
    let given = records.iter().map(|r| (r.path.as_path(), r.record.clone(), r.warnings.clone())).collect();
    let mission = results::undisturbed(opened, file)?;
    let (diagnosis, problems) = judge_records(&args, opened, mission, given)?;
    let exit = Diagnosis::exit(&problems);
    Ok(Diagnosed { diagnosis, problems, exit })
}
