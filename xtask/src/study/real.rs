//! `cargo xtask study real`: measured logs of arms, held-out torques against least squares on Pinocchio's regressor.
//!
//! The logs are not part of this repository and are not downloaded: `--logs` names a checkout of
//! `dfki-ric-underactuated-lab/double_pendulum` (BSD-3-Clause), whose measured positions and torques are written as records of two
//! joints. Every case is one log to fit and another to judge by. `ffid identify` runs as a user has it, with no flag but these two; ordinary,
//! weighted and instrumental-variable least squares run in `xtask/real/least_squares.py` with `--python`, which needs numpy, scipy and pin.
//! All are scored on the log that was held out behind the same low pass of 10 Hz. A case whose logs are not there, or for which the
//! Python packages are missing, is not measured, and then the study does not pass.

use super::figures::{Op, Study};
use super::options::Options;
use crate::workspace;
use anyhow::Context;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Most by which held-out torques may be missed by more than the best of the others miss them.
const WITHIN: f64 = 1.05;

/// Arguments of `study real`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Those of every study
    #[command(flatten)]
    pub options: Options,
    /// Folder with the logs; target/real/double_pendulum unless given
    #[arg(long, value_name = "DIR")]
    logs: Option<PathBuf>,
    /// Python with numpy, scipy and pin
    #[arg(long, value_name = "PROGRAM", default_value = "python3")]
    python: PathBuf,
}

/// A log to fit and one to judge by, of a design of the pendulum.
struct Case {
    name: &'static str,
    train: &'static str,
    held_out: &'static str,
}

const DESIGN_A: &str = "data/experiment_records/design_A.0/20220815/sys_id";
const DESIGN_C: &str = "data/experiment_records/design_C.0/20220914/sys_id";
const DESIGN_C1: &str = "data/experiment_records/design_C.1/sys_id/20230629";

/// Other designs, motions of one joint and of both, rates of 200, 500 and 600 Hz.
const CASES: [(Case, &str); 8] = [
    (Case { name: "A-04", train: "trajectory_04.csv", held_out: "trajectory_05.csv" }, DESIGN_A),
    (Case { name: "A-00", train: "trajectory_00.csv", held_out: "trajectory_03.csv" }, DESIGN_A),
    (Case { name: "A-12", train: "trajectory_12.csv", held_out: "trajectory_13.csv" }, DESIGN_A),
    (Case { name: "C-00", train: "trajectory_00.csv", held_out: "trajectory_02.csv" }, DESIGN_C),
    (Case { name: "C-02", train: "trajectory_02.csv", held_out: "trajectory_01.csv" }, DESIGN_C),
    (Case { name: "C-12", train: "trajectory_12.csv", held_out: "trajectory_13.csv" }, DESIGN_C),
    (
        Case { name: "C1-143601", train: "20230629-143601/trajectory.csv", held_out: "20230629-143339/trajectory.csv" },
        DESIGN_C1,
    ),
    (
        Case { name: "C1-154220", train: "20230629-154220/trajectory.csv", held_out: "20230629-154548/trajectory.csv" },
        DESIGN_C1,
    ),
];

/// What `least_squares.py` prints.
#[derive(Deserialize)]
struct Scores {
    torque_rms: Vec<f64>,
    methods: BTreeMap<String, Score>,
}

#[derive(Deserialize)]
struct Score {
    rms: Vec<f64>,
}

/// Runs the study.
///
/// # Errors
/// Files that cannot be read or written.
pub fn run(args: &Args) -> anyhow::Result<Study> {
    let mut study = Study::new("real", args.options.seed);
    let root = workspace::root()?;
    let logs = args.logs.clone().unwrap_or_else(|| root.join("target/real/double_pendulum"));
    let work = tempfile::tempdir()?;
    let (mut measured, mut wanted) = (0, 0);
    for (case, folder) in CASES.iter().filter(|c| args.options.wants(c.0.name)) {
        if args.options.quick && wanted == 2 {
            break;
        }
        wanted += 1;
        match one(case, &logs.join(folder), &root.join("xtask/real"), work.path(), &args.python) {
            Ok((scores, exit)) => {
                measured += 1;
                score(&mut study, case.name, &scores, exit);
            }
            Err(e) => study.note(format!("{} is not measured: {e:#}", case.name)),
        }
    }
    study.limited("measured", "cases", f64::from(measured), Op::AtLeast, f64::from(wanted));
    Ok(study)
}

/// Figures of a case: what is missed of the torques of the held-out log, relative to them, over all joints.
fn score(study: &mut Study, name: &str, scores: &Scores, exit: u8) {
    let norm = |x: &[f64]| x.iter().map(|v| v * v).sum::<f64>().sqrt();
    let size = norm(&scores.torque_rms);
    let mut best = f64::INFINITY;
    for (method, s) in scores.methods.iter().filter(|(m, _)| *m != "ffid") {
        let missed = norm(&s.rms) / size;
        best = best.min(missed);
        study.figure(format!("{name}.{method}"), "of the torques", missed);
    }
    let own = scores.methods.get("ffid").map_or(f64::INFINITY, |s| norm(&s.rms) / size);
    study.figure(format!("{name}.ffid"), "of the torques", own);
    study.figure(format!("{name}.exit"), "", f64::from(exit));
    study.limited(format!("{name}.over_best"), "", own / best, Op::AtMost, WITHIN);
}

fn one(case: &Case, logs: &Path, real: &Path, work: &Path, python: &Path) -> anyhow::Result<(Scores, u8)> {
    let folder = work.join(case.name);
    fs::create_dir_all(&folder)?;
    for name in ["double_pendulum.urdf", "double_pendulum.toml"] {
        fs::copy(real.join(name), folder.join(name))?;
    }
    let (train, held) = (folder.join("train.csv"), folder.join("held-out-log.csv"));
    for (from, to) in [(case.train, &train), (case.held_out, &held)] {
        let from = logs.join(from);
        let text = fs::read_to_string(&from).with_context(|| format!("{} is not there", from.display()))?;
        fs::write(to, record(&text).with_context(|| format!("{} is no log of the pendulum", from.display()))?)?;
    }
    let text = |p: &Path| p.display().to_string();
    let result = folder.join("result");
    let command = [
        "ffid".to_owned(),
        "identify".to_owned(),
        text(&folder.join("double_pendulum.toml")),
        "--record".to_owned(),
        text(&train),
        "--held-out".to_owned(),
        text(&held),
        "--out".to_owned(),
        text(&result),
    ];
    let (mut out, mut err) = (Vec::new(), Vec::new());
    let exit = ffid_cli::run(command, &mut out, &mut err);
    let found = result.join("result.json");
    anyhow::ensure!(found.is_file(), "ffid identifies nothing: {}", String::from_utf8_lossy(&err));
    let run = Command::new(python)
        .arg(real.join("least_squares.py"))
        .args([&folder.join("double_pendulum.urdf"), &train, &held, &found])
        .output()
        .with_context(|| format!("{} does not start", python.display()))?;
    anyhow::ensure!(run.status.success(), "least_squares.py: {}", last_line(&run.stderr));
    Ok((serde_json::from_slice(&run.stdout)?, exit.code()))
}

fn last_line(text: &[u8]) -> String {
    String::from_utf8_lossy(text).lines().last().unwrap_or("no output").to_owned()
}

/// A log of the pendulum, `time, pos_meas1, ... tau_meas2`, as a record of `j1` and `j2`; `None` where columns are missing.
fn record(text: &str) -> Option<String> {
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next()?.split(',').map(str::trim).collect();
    let of = |names: [&str; 2]| names.iter().find_map(|n| head.iter().position(|h| h == n));
    let columns = [
        of(["time", "time"])?,
        of(["pos_meas1", "pos1"])?,
        of(["pos_meas2", "pos2"])?,
        of(["tau_meas1", "tau1"])?,
        of(["tau_meas2", "tau2"])?,
    ];
    let mut out = String::from("time[s],q.j1[rad],q.j2[rad],tau.j1[N m],tau.j2[N m]\n");
    for line in lines.filter(|l| !l.trim().is_empty()) {
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        let row: Option<Vec<&str>> = columns.iter().map(|&c| cells.get(c).copied()).collect();
        out.push_str(&row?.join(","));
        out.push('\n');
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_of_the_pendulum_becomes_a_record() {
        let log = "time,pos_meas1,pos_meas2,vel_meas1,vel_meas2,tau_con1,tau_meas1,tau_meas2\n0.0,1,2,3,4,5,6,7\n0.002,8,9,1,2,3,4,5\n";
        let want = "time[s],q.j1[rad],q.j2[rad],tau.j1[N m],tau.j2[N m]\n0.0,1,2,6,7\n0.002,8,9,4,5\n";
        assert_eq!(record(log).as_deref(), Some(want));
        assert!(record("time,pos1\n0,1\n").is_none());
    }

    #[test]
    fn what_is_not_on_the_machine_does_not_pass() {
        let dir = tempfile::tempdir().unwrap();
        let args = Args {
            options: Options { seed: 1, ..Options::default() },
            logs: Some(dir.path().to_owned()),
            python: "python3".into(),
        };
        let study = run(&args).unwrap();
        assert!(!study.pass() && study.get("measured") == Some(0.0));
        let table = study.table().to_string();
        assert!(
            table.contains("C-00 is not measured") && table.contains("trajectory_02.csv")
                || table.contains("trajectory_00.csv"),
            "{table}"
        );
    }
}
