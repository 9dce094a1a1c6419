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
//!
//! Beside that: what the paper's misprints do (`errata`), what the choices that it leaves open do (`open`), and three experiments that it
//! does not do (`beyond`). `report` puts all of it into one page.
mod beyond;
mod checks;
mod errata;
mod excitation;
mod experiment;
mod figures;
mod identify;
mod open;
mod printed;
mod report;
mod score;
mod spectra;
mod summary;
mod system;

use crate::workspace;
use beyond::Beyond;
use errata::Errata;
use experiment::Experiment;
use ffid::exit::Failure;
use ffid::files::{atomic, json};
use indicatif::{ProgressBar, ProgressStyle};
use score::Fits;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use summary::{REPORT, Runs, Summary};

/// Arguments of `reproduce`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Directory for report.html, summary.json, figures and series
    #[arg(long, value_name = "DIR", default_value = "target/reproduce")]
    pub out: PathBuf,
    /// Shorter trajectories and fewer parameters, for a first look
    #[arg(long)]
    pub quick: bool,
    /// Trials of every setting that the paper leaves open; 0 for none [default: 1, with --quick 0]
    #[arg(long, value_name = "N")]
    pub sweep: Option<usize>,
}

/// One finished case.
struct Case {
    runs: Runs,
    frequencies: spectra::Frequencies,
    reports: Vec<identify::Report>,
    /// Whitened residuals of the noisy rigid fit.
    rigid_residuals: Vec<f64>,
    experiment: Experiment,
    spectra: spectra::Spectra,
}

impl Case {
    fn run(mission: &Path, quick: bool, bar: &ProgressBar) -> anyhow::Result<Self> {
        let x = Experiment::run(mission, quick, bar)?;
        let spectra = spectra::Spectra::of(&x)?;
        let frequencies = spectra::Frequencies::of(&x, &spectra)?;
        let (free, noisy) = std::thread::scope(|s| {
            let free = s.spawn(|| score::of(&x, None, bar));
            let noisy = score::of(&x, Some(x.system.seed()), bar);
            let join = |_| Failure::Numerical("an identification thread stopped".into());
            anyhow::Ok((free.join().map_err(join)??, noisy?))
        })?;
        let reports = |f: &Fits| [&f.reference, &f.rigid, &f.extended].map(|f| f.report.clone());
        Ok(Self {
            runs: Runs { noise_free: free.0, noisy: noisy.0 },
            frequencies,
            reports: reports(&free.1).into_iter().chain(reports(&noisy.1)).collect(),
            rigid_residuals: noisy.1.rigid.estimate.residuals,
            spectra,
            experiment: x,
        })
    }
    /// Excitation, response and spectra.
    fn figures(&self, out: &Path, stems: [&str; 3]) -> anyhow::Result<[ff_report::plot::Figure; 3]> {
        let excitation = figures::excitation(out, stems[0], &self.experiment)?;
        let [response, spectra] =
            figures::write(out, stems[1], stems[2], &self.experiment, &self.spectra, &self.frequencies)?;
        Ok([excitation, response, spectra])
    }
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
    let missions = workspace::root()?.join("fixtures/paper");
    let bar = progress();
    let case = |name: &str| Case::run(&missions.join(format!("{name}.toml")), args.quick, &bar);
    // The cases share nothing; two cores do both in the time of the longer one.
    let (flex, slosh) = std::thread::scope(|s| {
        let slosh = s.spawn(|| case("slosh"));
        let flex = case("flex");
        (flex, slosh.join().unwrap_or_else(|_| Err(Failure::Numerical("the slosh case stopped".into()).into())))
    });
    let (flex, slosh) = (flex?, slosh?);
    let (panels, fuel) = (&flex.experiment, &slosh.experiment);
    bar.set_message("what the misprints do");
    let columns = [&flex.runs.noise_free, &slosh.runs.noise_free];
    let errata = Errata::of(panels, fuel, columns, &flex.rigid_residuals)?;
    let trials = args.sweep.unwrap_or(usize::from(!args.quick));
    let (beyond, sweep) =
        rayon::join(|| Beyond::run(&missions, args.quick, &bar), || open::run([panels, fuel], trials, &bar));
    let (beyond, sweep) = (beyond?, sweep?);
    bar.set_message("figures");
    let panel_figures = flex.figures(&out, ["excitation_panels", "fig4", "fig5"])?;
    let fuel_figures = slosh.figures(&out, ["excitation_fuel", "fig6", "fig7"])?;
    errata.forces.write(&out.join("fig3"))?;
    errata.runaway.write(&out.join("fig4_as_printed"))?;
    bar.finish_and_clear();
    let summary = Summary {
        quick: args.quick,
        table2: flex.runs,
        table3: slosh.runs,
        fig5: flex.frequencies,
        fig7: slosh.frequencies,
        identified: flex.reports.into_iter().chain(slosh.reports).collect(),
        errata: errata.effects.clone(),
        conclusions: if sweep.outcomes.is_empty() { Vec::new() } else { open::conclusions(&sweep) },
        sweep,
        beyond,
        wall_s: started.elapsed().as_secs_f64(),
    };
    json::write(&out.join("summary.json"), &summary)?;
    let shown =
        report::Shown { flex: panels, slosh: fuel, panels: &panel_figures, fuel: &fuel_figures, errata: &errata };
    atomic::write(&out.join(REPORT), report::page(&summary, &shown)?.as_bytes())?;
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
