//! `cargo xtask reproduce`: the paper's section III end to end, from mission files to tables and figures.
//!
//! Per case (flexible panels, fuel slosh), as in the paper:
//!
//! 1. a rigid satellite is simulated and identified: the reference model (`identify`);
//! 2. the flexible (sloshing) satellite is shaken by joints parallel to the hinges and left to ring; the natural
//!    frequencies are read from torques and gyro (`experiment`, `spectra`);
//! 3. the flexible satellite executes the identification trajectory; its record is identified once as a rigid
//!    system and once with its passive states;
//! 4. both models are compared with the reference model, and with the truth, by the end-effector error along a
//!    reference trajectory (`score`).
//!
//! Everything is done twice: without noise as in the paper, and with the sensors of the mission file.
mod checks;
mod experiment;
mod figures;
mod identify;
mod printed;
mod report;
mod score;
mod spectra;

use crate::workspace;
use experiment::Experiment;
use ffid::exit::Failure;
use ffid::files::{atomic, json};
use indicatif::{ProgressBar, ProgressStyle};
use score::Columns;
use serde::Serialize;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Arguments of `reproduce`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Directory for tables, figures, series and summary.json
    #[arg(long, value_name = "DIR", default_value = "target/reproduce")]
    pub out: PathBuf,
    /// Shorter trajectories and fewer parameters, for a first look
    #[arg(long)]
    pub quick: bool,
}

/// Both runs of one case.
#[derive(Clone, Copy, Debug, Serialize)]
struct Runs {
    /// Perfect sensors, as in the paper.
    noise_free: Columns,
    /// The sensors of the mission file.
    noisy: Columns,
}

/// `summary.json`.
#[derive(Clone, Debug, Serialize)]
struct Summary {
    quick: bool,
    table2: Runs,
    table3: Runs,
    fig5: spectra::Frequencies,
    fig7: spectra::Frequencies,
    identified: Vec<identify::Report>,
    wall_s: f64,
}

/// One finished case.
struct Case {
    runs: Runs,
    frequencies: spectra::Frequencies,
    reports: Vec<identify::Report>,
    experiment: Experiment,
    spectra: spectra::Spectra,
}

/// Runs the study.
///
/// # Errors
/// Refused mission files (exit 10, 11), numerical failures (14), results outside tolerance (15; written all the
/// same), files that cannot be written (20).
pub fn run(args: &Args) -> anyhow::Result<()> {
    let started = Instant::now();
    let out = if args.out.is_absolute() { args.out.clone() } else { std::env::current_dir()?.join(&args.out) };
    std::fs::create_dir_all(&out).map_err(|e| Failure::io("create", &out, e))?;
    let root = workspace::root()?;
    let bar = progress();
    let case = |name: &str| -> anyhow::Result<Case> {
        let x = Experiment::run(&root.join(format!("fixtures/paper/{name}.toml")), args.quick, &bar)?;
        let spectra = spectra::Spectra::of(&x)?;
        let frequencies = spectra::Frequencies::of(&x, &spectra)?;
        let (runs, reports) = std::thread::scope(|s| {
            let noise_free = s.spawn(|| score::columns(&x, None, &bar));
            let noisy = score::columns(&x, Some(x.seed), &bar);
            let join = |_| Failure::Numerical("an identification thread stopped".into());
            let (a, mut reports) = noise_free.join().map_err(join)??;
            let (b, more) = noisy?;
            reports.extend(more);
            anyhow::Ok((Runs { noise_free: a, noisy: b }, reports))
        })?;
        Ok(Case { runs, frequencies, reports, experiment: x, spectra })
    };
    // The cases share nothing; two cores do both in the time of the longer one.
    let (flex, slosh) = std::thread::scope(|s| {
        let slosh = s.spawn(|| case("slosh"));
        let flex = case("flex");
        (flex, slosh.join().unwrap_or_else(|_| Err(Failure::Numerical("the slosh case stopped".into()).into())))
    });
    let (flex, slosh) = (flex?, slosh?);
    bar.set_message("figures");
    let panels = figures::write(&out, "fig4", "fig5", &flex.experiment, &flex.spectra, &flex.frequencies)?;
    let fuel = figures::write(&out, "fig6", "fig7", &slosh.experiment, &slosh.spectra, &slosh.frequencies)?;
    bar.finish_and_clear();
    let summary = Summary {
        quick: args.quick,
        table2: flex.runs,
        table3: slosh.runs,
        fig5: flex.frequencies,
        fig7: slosh.frequencies,
        identified: flex.reports.into_iter().chain(slosh.reports).collect(),
        wall_s: started.elapsed().as_secs_f64(),
    };
    json::write(&out.join("summary.json"), &summary)?;
    atomic::write(&out.join("report.html"), report::page(&summary, &panels, &fuel)?.as_bytes())?;
    printed::all(&summary, &out);
    checks::all(&summary)
}

fn progress() -> ProgressBar {
    let bar = ProgressBar::new_spinner();
    let style = ProgressStyle::with_template("{spinner} [{elapsed}] {msg}");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner()));
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}
