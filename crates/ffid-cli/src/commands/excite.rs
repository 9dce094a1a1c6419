//! `ffid excite`: plan the manoeuvre that tells most within the limits, and say beforehand what it will tell.

use crate::interrupt;
use crate::output::{Input, Outcome};
use crate::results;
use crate::results::Output;
use ff_mission::Mission;
use ff_mission::mission::{Excite, GOALS, Goal};
use ff_model::{Area, Problem, Problems};
use ffid::exit::Exit;
use ffid::open::{Opened, open};
use ffid::workflow::excite::{Demands, Observer, Planned, Progress, demands, plan, start};
use ffid::workflow::preflight::{Preflight, Sensing, joint_limits, prove};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::fmt;
use std::fmt::Display;
use std::io::Write;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// Examples for `--help`.
pub(crate) const EXAMPLES: &str = "Examples:
  ffid excite m.toml                       plan for [excite] of m.toml, write m-information/
  ffid excite m.toml --goal modal --out d  the largest response of the modes, into d/
  ffid excite m.toml --goal paper          the paper's simplified manoeuvre
  ffid plan m.toml --trajectory t.csv      judge a trajectory of your own

The folder holds report.html, trajectory.json (read back exactly), trajectory.csv (sampled), verdict.json, report.txt, figures
and manifest.toml. Ctrl-C ends the search and writes the best plan so far (exit code 130); a second one ends at once.";

/// Arguments of `ffid excite`.
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    input: Input,
    /// Folder for the results; <mission>-<goal> in the working directory unless given.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// What to plan for, instead of excite.goal: information, modal, quiet, paper or condition.
    #[arg(long, value_parser = goal)]
    goal: Option<Goal>,
    /// Seed, instead of excite.seed.
    #[arg(long)]
    seed: Option<u64>,
    /// Local searches from different random plans, instead of excite.starts.
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    starts: Option<u64>,
    #[command(flatten)]
    pub(crate) output: Output,
}

fn goal(word: &str) -> Result<Goal, String> {
    let found = GOALS.iter().find(|(n, _)| *n == word).map(|(_, g)| *g);
    found.ok_or_else(|| {
        let names: Vec<&str> = GOALS.iter().map(|(n, _)| *n).collect();
        let near = ff_model::diagnostics::nearest(word, names.iter().copied());
        let near = near.map(|n| format!("; did you mean {n}?")).unwrap_or_default();
        format!("must be one of {}{near}", names.join(", "))
    })
}

/// Results in JSON; absent when there are none.
#[derive(Default, Serialize)]
struct Results<'a> {
    plan: Option<&'a Planned>,
    verdict: Option<&'a Preflight>,
    /// The folder that was written.
    out: Option<&'a PathBuf>,
}

/// The plan in words.
struct Report<'a>(&'a Planned);

impl Display for Report<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let p = self.0;
        write!(f, "{} plan, {:.4} s, seed {}", p.goal, p.duration_s, p.seed)?;
        if let Some(c) = p.cost {
            write!(f, ": cost {c:.4} ({})", p.cost_means)?;
        }
        writeln!(f)?;
        if let Some(w) = &p.in_world {
            writeln!(
                f,
                "  with {} quantities that the mission is not sure of: cost {:.4}; the best of {} plans by that, {:.4} by the plan that \
                 would be taken were they exact",
                w.uncertain, w.cost, w.compared, w.cost_of_exact_choice
            )?;
        }
        for (i, s) in p.searches.iter().enumerate() {
            write!(f, "  {} {}: {}", s.stage, i + 1, s.status)?;
            match s.cost {
                Some(c) => writeln!(f, ", cost {c:.4} after {} iterations", s.iterations)?,
                None => writeln!(f)?,
            }
        }
        if p.interrupted {
            writeln!(f, "  interrupted; this is the best plan until then")?;
        }
        p.notes.iter().try_for_each(|n| writeln!(f, "  note: {n}"))
    }
}

/// Where the results are.
struct Written<'a>(&'a PathBuf);

impl Display for Written<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "written to {}", self.0.display())
    }
}

/// Plans, judges, writes and prints.
pub(crate) fn run(args: &Args, out: &mut impl Write, err: &mut impl Write) -> Outcome {
    let input = &args.input;
    let refuse = |exit: Exit, problems: &Problems, out: &mut dyn Write, err: &mut dyn Write| {
        input.print(exit, problems, Results::default(), &[], &mut &mut *out, &mut &mut *err)
    };
    let opened = match open(&input.file, input.leniency()) {
        Ok(o) => o,
        Err(p) => return refuse(Exit::of(&p), &p, out, err),
    };
    let mission = match results::undisturbed(&opened, &input.file) {
        Ok(m) => m,
        Err(p) => return refuse(Exit::of(&p), &p, out, err),
    };
    let settings = settings(args, mission);
    let target = args.out.clone().unwrap_or_else(|| {
        let stem = input.file.file_stem().unwrap_or_default().to_string_lossy();
        PathBuf::from(format!("{stem}-{}", settings.goal.name()))
    });
    let files = results::mission_files(&input.file, mission);
    let begun = results::inputs(&files).and_then(|i| Ok((i, results::begin(&target, &args.output, err)?)));
    let (inputs, folder) = match begun {
        Ok(b) => b,
        Err(e) => {
            let (exit, p) = results::failed(&e);
            return refuse(exit, &Problems(vec![p]), out, err);
        }
    };
    let demands = match demands(&opened, &mission.limits, &start(&opened, &settings), &input.file) {
        Ok(d) => d,
        Err(problems) => return refuse(Exit::of(&problems), &problems.in_file(&input.file), out, err),
    };
    let planned = match search(args, &opened, mission, &settings, &demands) {
        Ok(p) => p,
        Err((exit, problems)) => return refuse(exit, &problems.in_file(&input.file), out, err),
    };
    let judged = prove(&planned.file.trajectory, &joint_limits(&opened.model, &mission.limits))
        .map_err(|e| {
            let p = Problem::error(Area::Config, "Plan::NoVerdict", e.to_string()).hint("check [limits]");
            (Exit::Numerical, Problems(vec![p]))
        })
        .and_then(|proven| {
            results::verdict(&opened, mission, planned.file.trajectory.motion(), Some(&proven), &demands)
        });
    let verdict = match judged {
        Ok(v) => v,
        Err((exit, problems)) => return refuse(exit, &problems.in_file(&input.file), out, err),
    };
    let mut problems = opened.warnings.clone();
    let mut faults = results::faults(&verdict);
    if planned.interrupted {
        let what = "the search was interrupted; this is the best plan until then";
        let p = Problem::warning(Area::Config, "Plan::Interrupted", what).hint("plan again for a better one");
        faults.push(p.in_file(&input.file));
    }
    let mut exit = results::exit_of(&problems, &mut faults, &input.leniency());
    problems.extend(faults);
    let plan = Report(&planned).to_string();
    let about = results::about(
        "excite",
        settings.seed,
        &[("goal", settings.goal.name().to_owned()), ("starts", settings.starts.to_string())],
        inputs.clone(),
    );
    if let Some(p) = results::changed(&inputs, &files) {
        exit = Exit::Data;
        problems.push(p);
    }
    let trajectory = Some((&planned.file, mission.sensors.rate_hz));
    let wrote = results::write(&folder, trajectory, &verdict, Some(&plan), args.output.png)
        .and_then(|()| folder.finish(&about));
    let written = wrote.is_ok();
    if let Err(e) = wrote {
        // What was found is printed all the same.
        let (code, p) = results::failed(&e);
        exit = code;
        problems.push(p);
    } else if planned.interrupted && exit == Exit::Done {
        exit = Exit::Interrupted;
    }
    let where_to = written.then_some(&target);
    let (plan_text, written_text) = (Report(&planned), where_to.map(Written));
    let text: [Option<&dyn Display>; 3] = [Some(&plan_text), Some(&verdict), written_text.as_ref().map(|w| w as _)];
    let text = if args.output.quiet { &[][..] } else { &text[..] };
    let results = Results { plan: Some(&planned), verdict: Some(&verdict), out: where_to };
    input.print(exit, &problems, results, text, out, err)
}

/// The section with what the command line overrides.
pub(crate) fn settings(args: &Args, mission: &Mission) -> Excite {
    let mut s = mission.excite.clone();
    s.goal = args.goal.unwrap_or(s.goal);
    s.seed = args.seed.unwrap_or(s.seed);
    s.starts = args.starts.unwrap_or(s.starts);
    s
}

/// The search, with progress on a terminal and an end at Ctrl-C.
fn search(
    args: &Args,
    opened: &Opened,
    mission: &Mission,
    settings: &Excite,
    demands: &Demands,
) -> Result<Planned, (Exit, Problems)> {
    let stop = interrupt::flag(args.output.own_process)?;
    let bar = args.output.progress().then(bar);
    let best = Mutex::new(("", f64::INFINITY));
    let show = |p: &Progress| {
        let Some(bar) = &bar else { return };
        let Ok(mut best) = best.lock() else { return };
        // Costs of different stages cannot be compared.
        if best.0 != p.stage || p.cost < best.1 {
            *best = (p.stage, p.cost);
        }
        let (stage, start, cost) = (p.stage, p.start + 1, best.1);
        bar.set_message(format!("{stage}, start {start}, iteration {}, best cost {cost:.4}", p.iteration));
    };
    let watch = Observer { stop: Some(&stop), progress: Some(&show) };
    let found = plan(opened, settings, &mission.limits, demands, &Sensing::of(&mission.sensors), &watch);
    if let Some(b) = bar {
        b.finish_and_clear();
    }
    found.map_err(|e| {
        // Without a value no start has led anywhere: what was interrupted did not fail.
        let exit = if stop.load(Ordering::SeqCst) { Exit::Interrupted } else { e.exit };
        (exit, e.into())
    })
}

fn bar() -> ProgressBar {
    let bar = ProgressBar::new_spinner();
    let style = ProgressStyle::with_template("{spinner} [{elapsed}] planning: {msg}");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner()));
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}
