//! The case of the tests that go from a mission to an answer: a folder with a true robot, what its builders believe, and trajectories.

use crate::common;
use crate::common::finish;
use assert_cmd::Command;
use ff_mission::Leniency;
use ffid::open::open;
use ffid::workflow::identify::IdentificationResult;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A manoeuvre that moves every joint, as samples: `t`, then one position per joint.
pub(crate) fn trajectory(seconds: f64, phase: f64) -> String {
    let start = [0.3, 0.8, -0.2, 0.8, 0.1, 0.5, -0.1];
    let mut out = String::from("time[s]");
    (1..=7).for_each(|j| out += &format!(",q.joint{j}[rad]"));
    out.push('\n');
    let n = (seconds * 20.0) as usize;
    for k in 0..=n {
        let s = k as f64 / n as f64;
        let t = s * seconds;
        // Starts and ends at rest.
        let w = (s * (1.0 - s) * 4.0).powi(3);
        out += &format!("{t}");
        for (j, q0) in start.iter().enumerate() {
            let f = 0.09 + 0.055 * j as f64;
            out += &format!(
                ",{}",
                q0 + w * (0.3 - 0.03 * j as f64) * (std::f64::consts::TAU * f * t + phase + 1.3 * j as f64).sin()
            );
        }
        out.push('\n');
    }
    out
}

/// A folder with a true robot (`truth.toml`), what its builders believe (`m.toml`) and two trajectories.
pub(crate) struct Case {
    dir: TempDir,
}

impl Case {
    /// `cad` are the wrong values of `m.toml`.
    pub(crate) fn new(fixture: &str, estimate: &str, cad: &str) -> Self {
        let folder = common::fixture("paper");
        let dir = tempfile::tempdir().unwrap();
        fs::copy(folder.join("robot.urdf"), dir.path().join("robot.urdf")).unwrap();
        let text = fs::read_to_string(folder.join(fixture)).unwrap().replace("rate_hz = 100.0", "rate_hz = 50.0");
        let (before, rest) = text.split_once("[estimate]").unwrap();
        let after = &rest[rest.find("[reproduce]").unwrap()..];
        let text = format!("{before}[estimate]\n{estimate}\n\n{after}");
        fs::write(dir.path().join("truth.toml"), &text).unwrap();
        fs::write(dir.path().join("m.toml"), format!("{text}\n[parameters]\n{cad}\n")).unwrap();
        fs::write(dir.path().join("a.csv"), trajectory(24.0, 0.2)).unwrap();
        fs::write(dir.path().join("b.csv"), trajectory(20.0, 2.1)).unwrap();
        Self { dir }
    }
    pub(crate) fn folder(&self) -> &Path {
        self.dir.path()
    }
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }
    pub(crate) fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap()
    }
    pub(crate) fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).unwrap();
    }
    /// Exit code, standard output, standard error; run in the folder of the case, under another locale (R10).
    pub(crate) fn run(&self, args: &[&str]) -> (i32, String, String) {
        let mut c = Command::cargo_bin("ffid").unwrap();
        finish(c.args(args).env("LC_ALL", "de_DE.UTF-8").current_dir(self.dir.path()))
    }
    pub(crate) fn good(&self, args: &[&str]) -> String {
        let (code, out, err) = self.run(args);
        assert_eq!(code, 0, "{args:?}\n{out}\n{err}");
        out
    }
    pub(crate) fn simulate(&self, mission: &str, trajectory: &str, out: &str, more: &[&str]) {
        self.good(&[&["simulate", mission, "--trajectory", trajectory, "--out", out, "--force"], more].concat());
    }
    pub(crate) fn result(&self, folder: &str) -> IdentificationResult {
        IdentificationResult::from_json(&fs::read(self.path(folder).join("result.json")).unwrap()).unwrap()
    }
    /// The error of a refusal, as text and as JSON: code, exit code, a next step, and the names, flags and numbers that it
    /// must give. Its sentences are not looked at.
    pub(crate) fn refused(&self, args: &[&str], exit: i32, code: &str, says: &[&str]) {
        let (found, out, err) = self.run(args);
        assert_eq!(found, exit, "{out}\n{err}");
        assert!(err.contains(&format!("error[{code}]")), "{code} in {err}");
        let (again, out, _) = self.run(&[args, &["--json"]].concat());
        let v: Value = serde_json::from_str(&out).unwrap();
        assert_eq!((again, v["exit_code"].as_i64()), (exit, Some(i64::from(exit))));
        let found = v["problems"]
            .as_array()
            .unwrap()
            .iter()
            .any(|p| p["code"] == code && p["hint"].is_string() && common::says(p, &err, says));
        assert!(found, "{says:?} in {err}\n{v}");
    }
    /// Nothing of an unfinished run is left.
    pub(crate) fn clean(&self) {
        let all = fs::read_dir(self.dir.path()).unwrap();
        let left: Vec<String> = all
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .filter(|n| n.contains("partial") || n.ends_with(".lock"))
            .collect();
        assert!(left.is_empty(), "{left:?}");
    }
}

pub(crate) fn slosh() -> Case {
    let cad = "\"base.mass\" = 571.0\n\"tank.k[0]\" = 24.5\n\"tank.k[1]\" = 16.5\n\"tank.d[0]\" = 4.1";
    Case::new("slosh.toml", "parameters = [\"base.*\", \"tank.k[*]\", \"tank.d[*]\"]", cad)
}

pub(crate) fn flex() -> Case {
    let cad = "\"base.mass\" = 620.0\n\"panel_left.k[0]\" = 231.0\n\"panel_right.k[1]\" = 171.0";
    let estimate = "parameters = [\"base.*\", \"panel_*.k[*]\", \"panel_*.d[*]\"]\nprior_relative_std = 0.3";
    Case::new("flex.toml", estimate, cad)
}

/// Every estimate is within `sigmas` of its standard deviations of the truth.
pub(crate) fn near_the_truth(c: &Case, folder: &str, sigmas: f64) -> IdentificationResult {
    let r = c.result(folder);
    let truth = open(&c.path("truth.toml"), Leniency::default()).unwrap().model.param_decls();
    for p in &r.parameters {
        let want = truth.iter().find(|d| d.name == p.name).unwrap().nominal;
        let off = (p.value - want).abs() / p.std.unwrap();
        assert!(off < sigmas, "{}: {} instead of {want}, {off:.2} standard deviations", p.name, p.value);
    }
    r
}
