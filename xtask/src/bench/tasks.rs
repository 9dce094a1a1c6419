//! Whole tasks: a minute of simulation beside the peers' programs, sensitivities beside the plain simulation.

use super::aggregate::Spread;
use super::build::Target;
use super::options::Effort;
use super::programs::Programs;
use super::run;
use ffid::exit::Failure;
use serde_json::Value;
use std::path::Path;

/// A minute of one model by one of our simulators (s).
#[derive(Clone, Debug, PartialEq)]
pub struct Simulation {
    /// `flex` or `slosh`.
    pub model: &'static str,
    /// `full` (position and attitude, as the peers), `reduced`; with lanes such as `full.x8` per trajectory.
    pub via: &'static str,
    /// For which processor we were compiled.
    pub target: Target,
    /// Ours.
    pub ours: Spread,
    /// The faster of the peers' programs, with its name.
    pub peer: Option<(&'static str, Spread)>,
    /// Largest difference of the end state from Pinocchio's at the same step.
    pub agreement: Option<f64>,
    /// Largest error of the end state at a step of 10 ms, against 0.5 ms: ours, and the peer's.
    pub error: (f64, Option<f64>),
}

/// Sensitivities of all parameters but the arm's (s).
#[derive(Clone, Debug, PartialEq)]
pub struct Sensitivity {
    /// For which processor we were compiled.
    pub target: Target,
    /// Number of parameters.
    pub parameters: u64,
    /// The plain simulation.
    pub plain: Spread,
    /// With sensitivities.
    pub exact: Spread,
}

/// A whole identification or regression (s).
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// `identify15`, `identify58`, `identify58_uncertain` or `least_squares`.
    pub name: &'static str,
    /// For which processor we were compiled.
    pub target: Target,
    /// Ours.
    pub ours: Spread,
    /// The peer's: measured in this run, or (NumPy) as `run_peers.sh` recorded it on this machine.
    pub peer: Option<(&'static str, f64)>,
}

/// All whole tasks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tasks {
    /// Simulations.
    pub simulations: Vec<Simulation>,
    /// Sensitivities.
    pub sensitivities: Vec<Sensitivity>,
    /// Identifications and regressions.
    pub fits: Vec<Fit>,
}

impl Tasks {
    /// A fit of the portable build over the peer's.
    pub fn fit_ratio(&self, name: &str) -> Option<f64> {
        let f = self.fits.iter().find(|f| f.name == name && f.target == Target::Portable)?;
        Some(f.ours.median / f.peer?.1)
    }
    /// Seconds that a fit of the portable build takes.
    pub fn fit_seconds(&self, name: &str) -> Option<f64> {
        self.fits.iter().find(|f| f.name == name && f.target == Target::Portable).map(|f| f.ours.median)
    }
    /// A minute of the flexible system, portable build, everything the peers compute: ours over the best peer.
    pub fn simulation_ratio(&self, batched: bool) -> Option<f64> {
        let counts = |s: &&Simulation| {
            let (via, lanes) = super::cell::split_lanes(s.via);
            s.model == "flex" && s.target == Target::Portable && via == "full" && lanes == batched
        };
        let ratios = self.simulations.iter().filter(counts).filter_map(|s| Some(s.ours.median / s.peer?.1.median));
        ratios.min_by(f64::total_cmp)
    }
    /// Sensitivities of the portable build over its plain simulation.
    pub fn sensitivities_ratio(&self) -> Option<f64> {
        let s = self.sensitivities.iter().find(|s| s.target == Target::Portable)?;
        Some(s.exact.median / s.plain.median)
    }
}

/// Our simulators.
const VIA: [&str; 3] = ["full", "full.x8", "reduced"];
/// Equal to a peer's end state means this, after 60,000 steps.
const AGREEMENT: f64 = 1e-9;
/// Greatest error at 10 ms on the flexible model (issue 3); Pinocchio's is 5.7e-7.
const ERROR_FLEX: f64 = 6e-7;
/// Ours may exceed the peer's error at 10 ms by this factor.
const ERROR_FACTOR: f64 = 1.1;

/// Runs every program in every round, by turns.
///
/// # Errors
/// As [`run::lines`]; [`Failure::Tolerance`] when an end state is wrong: then nothing is compared.
pub fn measure(p: &Programs<'_>, effort: Effort, only: &str) -> Result<Tasks, Failure> {
    let mut tasks = Tasks::default();
    for model in ["flex", "slosh"] {
        let vias: Vec<&str> = VIA.into_iter().filter(|v| format!("{model}.simulate_60s.{v}").contains(only)).collect();
        if !vias.is_empty() {
            simulations(p, model, &vias, effort, &mut tasks)?;
        }
    }
    if "flex.sensitivities58.reduced".contains(only) {
        for (target, program) in [(Target::Portable, p.portable), (Target::Native, p.native)] {
            tasks.sensitivities.push(sensitivities(p, target, program, effort)?);
        }
    }
    for (name, args) in FITS {
        if format!("flex.{name}").contains(only) {
            fits(p, name, args, effort, &mut tasks)?;
        }
    }
    Ok(tasks)
}

/// Identifications and regressions with the arguments of `ff-bench`.
const FITS: [(&str, &[&str]); 4] = [
    ("identify15", &["identify", "--task", "peers"]),
    ("identify58", &["identify", "--task", "all"]),
    ("identify58_uncertain", &["identify", "--task", "uncertain"]),
    ("least_squares", &["linear"]),
];
/// What NumPy's line says of its task and configuration.
const NUMPY: (&str, &str) =
    ("regressor+base parameters+LS, 10000 samples", "free-flying rigid 13 x 80, pivoted QR + lstsq");

fn fits(p: &Programs<'_>, name: &'static str, args: &[&str], effort: Effort, tasks: &mut Tasks) -> Result<(), Failure> {
    let (mut portable, mut native) = (Runs::default(), Runs::default());
    let args: Vec<String> = args.iter().map(|a| (*a).to_owned()).chain(["--reps".into(), "3".into()]).collect();
    for round in 1..=effort.rounds {
        eprintln!("{name}, round {round} of {}", effort.rounds);
        portable.take(&one(run::lines(p.root, p.portable, &args, &p.pin)?, "ff-bench")?)?;
        native.take(&one(run::lines(p.root, p.native, &args, &p.pin)?, "ff-bench")?)?;
    }
    let peer = match (p.peers, name) {
        (Some(peers), "identify15") => match &peers.pin_id {
            // Ten seconds a fit: one is enough.
            Some(program) => {
                let args = ["clang", "1", "0.3"].map(str::to_owned);
                let line = one(run::lines(p.root, program, &args, &p.pin)?, "pin_id")?;
                line["median_s"].as_f64().map(|s| ("Pinocchio, C++", s))
            }
            None => None,
        },
        (Some(peers), "least_squares") => recorded(&peers.recorded).map(|s| ("NumPy, recorded", s)),
        _ => None,
    };
    for (target, runs) in [(Target::Portable, portable), (Target::Native, native)] {
        if let Some(ours) = Spread::of(&runs.rounds) {
            tasks.fits.push(Fit { name, target, ours, peer });
        }
    }
    Ok(())
}

/// NumPy's seconds, if `run_peers.sh` has run it here.
fn recorded(path: &Path) -> Option<f64> {
    let text = std::fs::read_to_string(path).ok()?;
    let mut lines = text.lines().filter_map(|l| serde_json::from_str::<Value>(l).ok());
    lines.find(|l| l["task"] == NUMPY.0 && l["config"] == NUMPY.1)?["median_s"].as_f64()
}

/// Times of one program over the rounds, and the end state of the last.
#[derive(Default)]
struct Runs {
    rounds: Vec<(f64, f64, f64)>,
    end: Vec<f64>,
}

impl Runs {
    fn take(&mut self, line: &Value) -> Result<(), Failure> {
        let number = |k: &str| line[k].as_f64().filter(|x| x.is_finite() && *x > 0.0);
        let figures = || Some((number("median_s")?, number("min_s")?, number("max_s")?));
        let wrong = || Failure::Numerical(format!("a simulation printed no figures in: {line}"));
        self.rounds.push(figures().ok_or_else(wrong)?);
        let end = line["x_end"].as_array().map(|x| x.iter().filter_map(Value::as_f64).collect());
        self.end = end.unwrap_or_default();
        Ok(())
    }
}

fn simulations(
    p: &Programs<'_>,
    model: &'static str,
    vias: &[&'static str],
    effort: Effort,
    tasks: &mut Tasks,
) -> Result<(), Failure> {
    let builds = [(Target::Portable, p.portable), (Target::Native, p.native)];
    let mut ours: Vec<(Target, &'static str, Runs)> =
        builds.iter().flat_map(|b| vias.iter().map(|v| (b.0, *v, Runs::default()))).collect();
    let (mut pin, mut mj) = (Runs::default(), Runs::default());
    for round in 1..=effort.rounds {
        eprintln!("simulation of {model}, round {round} of {}", effort.rounds);
        for (target, via, runs) in &mut ours {
            let program = if *target == Target::Portable { p.portable } else { p.native };
            runs.take(&simulate(p, program, model, via, "0.001", effort.task_reps)?)?;
        }
        if let Some(peers) = p.peers {
            pin.take(&pinocchio(p, &peers.pin_sim, model, "0.001", effort.task_reps)?)?;
            let args = [peers.model.display().to_string(), model.into(), "60".into(), "0.001".into()];
            let args = [args.as_slice(), &[effort.task_reps.to_string()]].concat();
            mj.take(&one(run::lines(p.root, &peers.mj_sim, &args, &p.pin)?, "mj_sim")?)?;
        }
    }
    // Error at ten times the step: equal accuracy is part of the comparison.
    let end = |line: Value| -> Result<Vec<f64>, Failure> {
        let mut r = Runs::default();
        r.take(&line)?;
        Ok(r.end)
    };
    let (reference, peer_error) = match p.peers {
        Some(peers) => {
            let fine = end(pinocchio(p, &peers.pin_sim, model, "0.0005", 1)?)?;
            let coarse = end(pinocchio(p, &peers.pin_sim, model, "0.01", 1)?)?;
            let error = difference(&coarse, &fine);
            (fine, Some(error))
        }
        None => (end(simulate(p, p.portable, model, "full", "0.0005", 1)?)?, None),
    };
    for (target, via, runs) in ours {
        let program = if target == Target::Portable { p.portable } else { p.native };
        let coarse = end(simulate(p, program, model, via, "0.01", 1)?)?;
        let error = difference(&coarse, &reference);
        let agreement = p.peers.map(|_| difference(&runs.end, &pin.end));
        accept(model, via, agreement, error, peer_error)?;
        let faster = |a: &(&str, Spread), b: &(&str, Spread)| a.1.median.total_cmp(&b.1.median);
        let peers = [("Pinocchio", &pin), ("MuJoCo", &mj)];
        let peer = peers.into_iter().filter_map(|(n, r)| Some((n, Spread::of(&r.rounds)?))).min_by(faster);
        if let Some(ours) = Spread::of(&runs.rounds) {
            tasks.simulations.push(Simulation {
                model,
                via,
                target,
                ours,
                peer,
                agreement,
                error: (error, peer_error),
            });
        }
    }
    Ok(())
}

/// Refuses a simulation that is faster because it is wrong.
fn accept(model: &str, via: &str, agreement: Option<f64>, error: f64, peer_error: Option<f64>) -> Result<(), Failure> {
    if let Some(a) = agreement.filter(|a| *a > AGREEMENT || a.is_nan()) {
        let text = format!("{model} {via}: end state differs from Pinocchio's by {a:.1e}, limit {AGREEMENT:.0e}");
        return Err(Failure::Tolerance(text));
    }
    let fixed = if model == "flex" { ERROR_FLEX } else { f64::INFINITY };
    let limit = peer_error.map_or(fixed, |p| fixed.min(ERROR_FACTOR * p));
    if error <= limit {
        return Ok(());
    }
    Err(Failure::Tolerance(format!("{model} {via}: error {error:.1e} at a step of 10 ms, limit {limit:.1e}")))
}

/// Largest difference; the shorter state is the tail of the longer one. Infinite for anything not finite.
fn difference(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    let (a, b) = (&a[a.len() - n..], &b[b.len() - n..]);
    let worst = a.iter().zip(b).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
    if n == 0 || a.iter().chain(b).any(|x| !x.is_finite()) { f64::INFINITY } else { worst }
}

fn simulate(p: &Programs<'_>, ours: &Path, model: &str, via: &str, step: &str, reps: u32) -> Result<Value, Failure> {
    let args = ["sim", "--model", model, "--via", via, "--step", step, "--reps", &reps.to_string()].map(str::to_owned);
    one(run::lines(p.root, ours, &args, &p.pin)?, "ff-bench sim")
}

fn pinocchio(p: &Programs<'_>, program: &Path, model: &str, step: &str, reps: u32) -> Result<Value, Failure> {
    let args = ["clang", model, "60", step, &reps.to_string()].map(str::to_owned);
    one(run::lines(p.root, program, &args, &p.pin)?, "pin_sim")
}

fn one(lines: Vec<Value>, what: &str) -> Result<Value, Failure> {
    lines.into_iter().next().ok_or_else(|| Failure::Numerical(format!("{what} printed no JSON line")))
}

fn sensitivities(p: &Programs<'_>, target: Target, program: &Path, effort: Effort) -> Result<Sensitivity, Failure> {
    eprintln!("sensitivities, {}", target.text());
    let (mut plain, mut exact, mut parameters) = (Vec::new(), Vec::new(), 0);
    for _ in 0..effort.rounds {
        let args = ["sensitivities", "--model", "flex", "--reps", &effort.task_reps.to_string()].map(str::to_owned);
        let line = one(run::lines(p.root, program, &args, &p.pin)?, "ff-bench sensitivities")?;
        let number = |k: &str| line[k].as_f64().filter(|x| x.is_finite() && *x > 0.0);
        let figures = || Some((number("plain_s")?, number("sensitivities_s")?, line["parameters"].as_u64()?));
        let (a, b, n) = figures()
            .ok_or_else(|| Failure::Numerical(format!("ff-bench sensitivities printed no figures: {line}")))?;
        plain.push((a, a, a));
        exact.push((b, b, b));
        parameters = n;
    }
    let none = || Failure::Numerical("no round of sensitivities was run".into());
    Ok(Sensitivity {
        target,
        parameters,
        plain: Spread::of(&plain).ok_or_else(none)?,
        exact: Spread::of(&exact).ok_or_else(none)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_end_state_is_refused() {
        assert!(accept("flex", "full", Some(3e-13), 5.7e-7, Some(5.7e-7)).is_ok());
        assert!(accept("flex", "full", Some(2e-9), 5.7e-7, Some(5.7e-7)).is_err());
        assert!(accept("flex", "full", Some(f64::NAN), 5.7e-7, Some(5.7e-7)).is_err());
        assert!(accept("flex", "full", None, 6.1e-7, None).is_err());
        assert!(accept("slosh", "full", Some(1e-12), 3e-8, Some(2e-8)).is_err());
    }

    #[test]
    fn what_numpy_took_is_read_from_the_line_of_its_pivoted_qr() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("tasks.jsonl");
        assert_eq!(recorded(&path), None);
        let gram =
            format!(r#"{{"config": "free-flying rigid 13 x 80, Gram", "task": "{}", "median_s": 0.08}}"#, NUMPY.0);
        let qr = format!(r#"{{"config": "{}", "task": "{}", "median_s": 0.81}}"#, NUMPY.1, NUMPY.0);
        std::fs::write(&path, format!("{gram}\n\nnot JSON\n{qr}\n")).unwrap();
        assert_eq!(recorded(&path), Some(0.81));
    }

    #[test]
    fn the_reduced_state_is_compared_with_the_tail() {
        let full = [9.0, 8.0, 1.0, 2.0, 3.0];
        assert_eq!(difference(&[1.0, 2.5, 3.0], &full), 0.5);
        assert_eq!(difference(&[1.0, f64::NAN, 3.0], &full), f64::INFINITY);
        assert_eq!(difference(&[], &full), f64::INFINITY);
    }
}
