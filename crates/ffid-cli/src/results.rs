//! What `ffid excite` and `ffid plan` share: the verdict asked for, the problems it raises, the folder it goes to.

use excitation::TrajectoryFile;
use excitation::plan::LimitReport;
use excitation::trajectory::{Samples, write_csv};
use ff_dynamics::motion::JointMotion;
use ff_mission::Leniency;
use ff_mission::Mission;
use ff_model::{Area, Params, Problem, Problems};
use ff_report::plot::Figure;
use ff_report::preflight::{figures, page};
use ffid::exit::{Exit, Failure};
use ffid::files::folder::{About, Entry, Folder};
use ffid::files::json;
use ffid::open::Opened;
use ffid::workflow::excite::Demands;
use ffid::workflow::identify::UncertainItems;
use ffid::workflow::preflight::{Determination, Preflight, PreflightError, Question, Seen, Sensing, judge};
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};

/// Units of what names none: the control points of a trajectory.
const UNITS: &str = "SI; control points, start and angles of a trajectory in the unit of their joint";

/// How results are written.
#[derive(clap::Args)]
pub(crate) struct Output {
    /// Replace an existing output folder; the old one is kept as DIR.bak.
    #[arg(long)]
    pub(crate) force: bool,
    /// Write figures as PNG beside the SVG.
    #[arg(long)]
    pub(crate) png: bool,
    /// Print problems only: no report, no progress.
    #[arg(long)]
    pub(crate) quiet: bool,
    /// Set by [`crate::main`]: the streams are those of the process, and Ctrl-C is the command's to catch.
    #[arg(skip)]
    pub(crate) own_process: bool,
}

impl Output {
    /// Whether a progress bar may be drawn: on the standard error of the command's own process, if that is a terminal.
    pub(crate) fn progress(&self) -> bool {
        self.own_process && !self.quiet && std::io::stderr().is_terminal()
    }
}

/// Takes the folder for results. What killed runs left of it is removed, which is said at once: the rest may take long, or fail.
///
/// # Errors
/// Those of [`Folder::begin`].
pub(crate) fn begin(target: &Path, output: &Output, err: &mut impl Write) -> Result<Folder, Failure> {
    let folder = Folder::begin(target, output.force)?;
    for left in folder.left_behind() {
        let p = Problem::warning(Area::Io, "Io::LeftBehind", "removed what a run that was killed had left");
        // Nothing can be done where standard error is closed.
        let _ = writeln!(err, "{}", p.in_file(left));
    }
    Ok(folder)
}

/// The mission of what was opened; a URDF alone has none.
pub(crate) fn mission<'a>(opened: &'a Opened, file: &Path) -> Result<&'a Mission, Problems> {
    opened.mission.as_ref().ok_or_else(|| {
        let p = Problem::error(
            Area::Config,
            "Config::NoMission",
            "a URDF has no sensors, limits or parameters to plan for",
        );
        Problems(vec![p.in_file(file).hint("give a mission file that names this URDF")])
    })
}

/// The [`mission`] of a robot that floats freely: what is planned, identified and judged with has no external inputs, and does not
/// ignore those of the mission.
pub(crate) fn undisturbed<'a>(opened: &'a Opened, file: &Path) -> Result<&'a Mission, Problems> {
    let mission = mission(opened, file)?;
    let n = mission.inputs.len();
    if n == 0 {
        return Ok(mission);
    }
    let what =
        format!("{n} [[input]], limit 0: only `ffid simulate` and `ffid predict` reckon with what acts from outside");
    let p = Problem::error(Area::Config, "Config::ExternalInput", what).on("input").in_file(file);
    let hint = "use a copy of the mission without [[input]], and records of times at which nothing acts";
    Err(Problems(vec![p.hint(hint)]))
}

/// The verdict on a motion at the mission's nominal parameters.
pub(crate) fn verdict(
    opened: &Opened,
    mission: &Mission,
    motion: &dyn JointMotion,
    proven: Option<&LimitReport>,
    demands: &Demands,
) -> Result<Preflight, (Exit, Problems)> {
    let constraints = demands.list();
    let uncertain = UncertainItems::beside(opened, &opened.excited);
    let small = UncertainItems::small(opened, &opened.excited);
    let question = Question {
        model: &opened.model,
        params: &Params::nominal(&opened.model),
        selected: &opened.excited,
        motion,
        sensing: Sensing::of(&mission.sensors),
        weak: mission.excite.weak_relative_std,
        proven,
        limits: &mission.limits,
        constraints: &constraints,
        end_effector: opened.end_effector,
        uncertain: Some(&uncertain),
        small: (!small.is_empty()).then_some(&small),
    };
    judge(&question).map_err(|e| {
        let (exit, hint) = match &e {
            PreflightError::Noise { .. } => (Exit::Config, "give noise_std or lsb of this sensor in [sensors]"),
            PreflightError::NoParameters => (Exit::Config, "name parameters in [excite] or [estimate]"),
            PreflightError::NotFreeFloating => (Exit::Config, "remove gravity, or base = \"fixed\", from [robot]"),
            PreflightError::TooShort { .. } => (Exit::IllPosed, "take longer, or sample faster"),
            PreflightError::Simulation(_) => (Exit::Numerical, "excite less: slower, or with tighter limits"),
            _ => (Exit::Numerical, "check the parameters of the mission file"),
        };
        let code = if exit == Exit::Config { "Config::Verdict" } else { "Plan::NoVerdict" };
        (exit, Problems(vec![Problem::error(Area::Config, code, e.to_string()).hint(hint)]))
    })
}

/// What the verdict itself finds fault with.
pub(crate) fn faults(v: &Preflight) -> Problems {
    let mut out = Problems::default();
    let (worst, broken) = v.limits.iter().filter(|m| !m.holds).fold((None, 0), |(worst, n), m| match worst {
        Some(w) if ffid::workflow::preflight::LimitMargin::relative(w) <= m.relative() => (worst, n + 1),
        _ => (Some(m), n + 1),
    });
    if let Some(m) = worst {
        let more = if broken > 1 { format!(", and {} more limits are broken", broken - 1) } else { String::new() };
        let what =
            format!("{}: {} {}, limit {} {}, about {:.2} s{more}", m.what, m.bound, m.unit, m.limit, m.unit, m.time_s);
        let p = Problem::error(Area::Config, "Plan::LimitBroken", what).on(&m.item);
        out.push(p.hint("plan again within the limits, or loosen them"));
    }
    let silent: Vec<&str> =
        v.parameters.iter().filter(|p| p.told == Determination::NotAtAll).map(|p| p.name.as_str()).collect();
    if !silent.is_empty() {
        let what =
            format!("the record is silent on {} ({} null directions)", silent.join(", "), v.null_directions.len());
        let p = Problem::warning(Area::Config, "Plan::Unidentifiable", what).on(&v.robot);
        out.push(p.hint("estimate fewer parameters, give priors, or excite otherwise"));
    }
    for m in v.modes.iter().filter(|m| m.torque.seen == Seen::Not && m.gyro.seen == Seen::Not) {
        let what = format!("no sensor sees the mode at {:.4} Hz on this trajectory", m.frequency_hz);
        let p = Problem::warning(Area::Config, "Plan::UnseenMode", what).on(&v.robot);
        out.push(p.hint("excite it at its frequency, or do without it"));
    }
    out
}

/// The code of a verdict: 13 for what it finds fault with, else that of the problems.
pub(crate) fn exit_of(problems: &Problems, faults: &mut Problems, leniency: &Leniency) -> Exit {
    leniency.settle(faults);
    match Exit::of(problems) {
        Exit::Done if faults.has_errors() => Exit::IllPosed,
        e => e,
    }
}

/// A failure of the output as a problem.
pub(crate) fn failed(e: &Failure) -> (Exit, Problem) {
    let exit = [Exit::Io, Exit::Locked, Exit::Numerical].into_iter().find(|x| x.code() == e.code()).unwrap_or(Exit::Io);
    let (code, path) = match e {
        Failure::Exists { path } => ("Io::Exists", Some(path)),
        Failure::Locked { path, .. } => ("Io::Locked", Some(path)),
        Failure::Io { path, .. } => ("Io::Write", Some(path)),
        _ => ("Plan::NotFinite", None),
    };
    let (what, hint) = match e {
        Failure::Exists { .. } => ("exists already".to_owned(), "give another --out, or --force to replace it"),
        Failure::Locked { by, .. } => (format!("locked by another run ({by})"), "wait for it, or give another --out"),
        Failure::Io { action, source, .. } => {
            (format!("cannot {action}: {source}"), "check permissions and free space, or give another --out")
        }
        other => (other.to_string(), "please report this"),
    };
    let p = Problem::error(Area::Io, code, what).hint(hint);
    (
        exit,
        match path {
            Some(f) => p.in_file(f),
            None => p,
        },
    )
}

/// Why a command ends early: its code, and what it says.
pub(crate) type Refusal = (Exit, Problems);

/// What was read is refused.
pub(crate) fn refused(p: Problems) -> Refusal {
    (Exit::of(&p), p)
}

/// The output cannot be had.
#[allow(clippy::needless_pass_by_value, reason = "handed to map_err")]
pub(crate) fn io(e: Failure) -> Refusal {
    let (exit, p) = failed(&e);
    (exit, Problems(vec![p]))
}

/// [`io`] for one file, which is named by `argument`.
pub(crate) fn io_hint(e: Failure, argument: &str) -> Refusal {
    match &e {
        Failure::Exists { .. } => {
            let (exit, p) = failed(&e);
            (exit, Problems(vec![p.hint(format!("give another {argument}, or --force to replace it"))]))
        }
        _ => io(e),
    }
}

/// Writes figures under their stems, as SVG and, when asked for, PNG.
pub(crate) fn draw(folder: &Folder, figures: &[(impl AsRef<Path>, Figure)], png: bool) -> Result<(), Failure> {
    for (stem, figure) in figures {
        let stem = folder.path().join(stem);
        if png {
            figure.write(&stem)?;
        } else {
            figure.write_svg(&stem)?;
        }
    }
    Ok(())
}

/// Hashes the files a result comes from, as they were named.
pub(crate) fn inputs(files: &[PathBuf]) -> Result<Vec<Entry>, Failure> {
    files.iter().map(|f| Entry::of(f, f.to_string_lossy())).collect()
}

/// The mission file and the URDF it names.
pub(crate) fn mission_files(file: &Path, mission: &Mission) -> Vec<PathBuf> {
    let folder = file.parent().unwrap_or(Path::new(""));
    vec![file.to_owned(), folder.join(&mission.robot.urdf)]
}

/// R09: what has changed since it was hashed.
pub(crate) fn changed(before: &[Entry], files: &[PathBuf]) -> Option<Problem> {
    let after = inputs(files).ok();
    let same = after.as_ref().is_some_and(|a| a == before);
    let name = || {
        let other = after.iter().flatten().zip(before).find(|(a, b)| a != b);
        other.map_or_else(|| "an input".to_owned(), |(a, _)| a.file.clone())
    };
    (!same).then(|| {
        let what = format!("{} changed during the run; the results belong to the old one", name());
        Problem::error(Area::Data, "Data::InputChanged", what).hint("run again")
    })
}

/// Writes trajectory (if given), verdict, reports and figures into a folder; `plan` is how the trajectory was found, in words.
pub(crate) fn write(
    folder: &Folder,
    trajectory: Option<(&TrajectoryFile, f64)>,
    verdict: &Preflight,
    plan: Option<&str>,
    png: bool,
) -> Result<(), Failure> {
    if let Some((file, rate)) = trajectory {
        folder.write("trajectory.json", file.to_json().as_bytes())?;
        let samples = Samples::of(file.trajectory.motion(), &file.joints, 1.0 / rate)
            .map_err(|e| Failure::Numerical(e.to_string()))?;
        folder.write("trajectory.csv", write_csv(&samples).as_bytes())?;
    }
    json::write(&folder.path().join("verdict.json"), verdict)?;
    let report = plan.map_or_else(|| verdict.to_string(), |p| format!("{p}\n{verdict}"));
    folder.write("report.txt", report.as_bytes())?;
    let all = figures(verdict);
    draw(folder, &all, png)?;
    folder.write("report.html", page(verdict, plan, &all)?.as_bytes())
}

/// The manifest of a result.
pub(crate) fn about(command: &str, seed: u64, settings: &[(&str, String)], input: Vec<Entry>) -> About {
    About {
        program: concat!("ffid ", env!("CARGO_PKG_VERSION")).to_owned(),
        command: command.to_owned(),
        seed,
        settings: settings.iter().map(|(k, v)| ((*k).to_owned(), v.clone())).collect(),
        units: UNITS.to_owned(),
        input,
    }
}
