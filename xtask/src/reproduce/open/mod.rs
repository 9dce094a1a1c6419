//! What each choice that the paper leaves open does to the result, and how much one trajectory says.
//!
//! A *trial* is one run of the study with noise: a trajectory for the rigid identification, one for the identification, one for the
//! comparison, each of its own seed, noise and start of the fits of its own, too. The missions as they are get several trials; every
//! setting of a choice gets the first of the same trajectories, so that it is compared with them in pairs.

mod choices;
mod conclusions;

pub(super) use conclusions::{Conclusion, conclusions};

use super::experiment::{Experiment, turning_hz};
use super::score::{Columns, Flown, columns};
use super::system::System;
use crate::interval::Interval;
use choices::{Choice, Setting};
use excitation::planning::Planned;
use ff_dynamics::Boundary;
use indicatif::ProgressBar;
use rayon::prelude::*;
use serde::Serialize;
use validate::PathError;

/// Trials of the missions as they are.
const TRIALS: usize = 4;

/// One run of the study.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Trial {
    pub(super) columns: Columns,
    /// Chi-squared per degree of freedom of the rigid and the extended fit.
    pub(super) chi2_per_dof: [f64; 2],
    /// Whether the extended fit has converged.
    pub(super) converged: bool,
}

/// What came of one setting.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Outcome {
    pub(super) case: &'static str,
    /// The choice; empty for the mission as it is.
    pub(super) choice: &'static str,
    pub(super) setting: String,
    /// Free-floating natural frequencies at the pose in which the joints hold (Hz), ascending, and that of the mode which turns the base most.
    pub(super) model_hz: Vec<f64>,
    pub(super) turning_hz: f64,
    pub(super) trials: Vec<Trial>,
    /// Why trials gave nothing.
    pub(super) failures: Vec<String>,
}

/// The sweep.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct Sweep {
    /// Trials at each setting.
    pub(super) per_setting: usize,
    pub(super) outcomes: Vec<Outcome>,
}

impl Outcome {
    /// A positive quantity over the trials whose extended fit has converged.
    pub(super) fn interval(&self, pick: impl Fn(&Columns) -> f64) -> Option<Interval> {
        Interval::of(self.ended().map(|t| pick(&t.columns)))
    }
    /// Trials whose extended fit has converged.
    pub(super) fn ended(&self) -> impl Iterator<Item = &Trial> {
        self.trials.iter().filter(|t| t.converged)
    }
    /// In how many of them something holds.
    pub(super) fn count(&self, holds: impl Fn(&Columns) -> bool) -> usize {
        self.ended().filter(|t| holds(&t.columns)).count()
    }
}

impl Sweep {
    /// The outcome of the mission as it is.
    pub(super) fn nominal(&self, case: &str) -> Option<&Outcome> {
        self.outcomes.iter().find(|o| o.case == case && o.choice.is_empty())
    }
}

/// Rigid over extended error against the truth.
pub(super) fn gain(c: &Columns, pick: fn(&PathError) -> f64) -> f64 {
    pick(&c.rigid_id_vs_truth) / pick(&c.extended_id_vs_truth)
}

/// Trajectories of a trial.
struct Motions {
    quiet: Planned,
    loud: Planned,
}

/// What a thread does: a trial of a setting, or of the mission as it is.
struct Job<'a> {
    x: &'a Experiment,
    setting: Option<(&'a Choice, &'a Setting)>,
    trial: usize,
}

/// Runs `per_setting` trials of every setting and at least [`TRIALS`] of the missions as they are, on all cores.
///
/// # Errors
/// Missions that cannot be loaded or planned for. A trial that fails for another reason is kept as a failure.
pub(super) fn run(cases: [&Experiment; 2], per_setting: usize, bar: &ProgressBar) -> anyhow::Result<Sweep> {
    if per_setting == 0 {
        return Ok(Sweep::default());
    }
    bar.set_message("what the paper leaves open: trajectories");
    let count = TRIALS.max(per_setting);
    let wanted: Vec<(&Experiment, usize)> = cases.iter().flat_map(|x| (0..count).map(move |k| (*x, k))).collect();
    let planned = wanted.par_iter().map(|(x, k)| motions(&x.system, *k));
    let planned: Vec<Motions> = planned.collect::<anyhow::Result<_>>()?;
    let choices = choices::all();
    let mut jobs: Vec<Job<'_>> = wanted.iter().map(|&(x, trial)| Job { x, setting: None, trial }).collect();
    for choice in &choices {
        let x = cases.iter().find(|x| x.system.name == choice.case);
        for (x, setting) in x.into_iter().flat_map(|x| choice.settings.iter().map(move |s| (x, s))) {
            jobs.extend((0..per_setting).map(|trial| Job { x, setting: Some((choice, setting)), trial }));
        }
    }
    let done = std::sync::atomic::AtomicUsize::new(0);
    let results: Vec<(Outcome, usize)> = jobs
        .par_iter()
        .map(|job| {
            let own = cases.iter().position(|x| x.system.name == job.x.system.name).unwrap_or(0);
            let out = one(job, &planned[own * count + job.trial]);
            let n = 1 + done.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            bar.set_message(format!("what the paper leaves open: {n} of {} runs", jobs.len()));
            out.map(|o| (o, job.trial))
        })
        .collect::<anyhow::Result<_>>()?;
    let mut outcomes: Vec<Outcome> = Vec::new();
    for (o, trial) in results {
        match outcomes.last_mut().filter(|_| trial > 0) {
            Some(last) => {
                last.trials.extend(o.trials);
                last.failures.extend(o.failures);
            }
            None => outcomes.push(o),
        }
    }
    Ok(Sweep { per_setting, outcomes })
}

/// Trajectories of trial `k`.
fn motions(s: &System, k: usize) -> anyhow::Result<Motions> {
    let seed = s.seed() + 100 + k as u64;
    Ok(Motions { quiet: s.plan_quiet(seed, 1)?, loud: s.plan(seed, 1)? })
}

fn one(job: &Job<'_>, planned: &Motions) -> anyhow::Result<Outcome> {
    let changed = match job.setting {
        Some((_, setting)) => Some(job.x.source.with(job.x.system.quick, |m| (setting.change)(m))?),
        None => None,
    };
    let s = changed.as_ref().unwrap_or(&job.x.system);
    let modes = s.modes(Boundary::JointsHeld)?;
    let anew = match job.setting {
        Some((_, setting)) if setting.replan => Some(motions(s, job.trial)?),
        _ => None,
    };
    let tried = trial(s, anew.as_ref().unwrap_or(planned), job.trial);
    let (trials, failures) = match tried {
        Ok(t) => (vec![t], vec![]),
        Err(e) => (vec![], vec![format!("{e:#}")]),
    };
    Ok(Outcome {
        case: if job.x.system.name == "flex" { "flex" } else { "slosh" },
        choice: job.setting.map_or("", |(c, _)| c.what),
        setting: job.setting.map_or_else(|| "as in the mission".to_owned(), |(_, s)| s.label.clone()),
        turning_hz: turning_hz(&modes),
        model_hz: modes.iter().map(|m| m.frequency_hz).collect(),
        trials,
        failures,
    })
}

/// Trial `k` of a satellite.
fn trial(s: &System, planned: &Motions, k: usize) -> anyhow::Result<Trial> {
    let seed = s.seed() + 100 + k as u64;
    let (reference, options) = s.reference(seed)?;
    let (rigid, extended) = (s.fly_rigid(&planned.quiet.motion)?, s.fly(&planned.loud.motion)?);
    let flown = Flown { rigid: &rigid, extended: &extended, reference: &reference, options: &options };
    let (columns, fits) = columns(s, &flown, Some(seed), seed, &ProgressBar::hidden())?;
    Ok(Trial {
        columns,
        chi2_per_dof: [fits.rigid.report.chi2_per_dof(), fits.extended.report.chi2_per_dof()],
        converged: fits.extended.report.ended().is_ok(),
    })
}
