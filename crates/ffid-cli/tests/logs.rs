//! Logs as recorders write them: lost, late and jittered samples, gaps, channels at rates of their own, spikes, noisy stamps.

use crate::common::{ffid, fixture};
use ffid::workflow::identify::{IdentificationResult, State};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::fmt::Write;
use std::fs;
use std::path::Path;

/// Noise of the torques (N m), the gyro (rad/s) and the encoders (rad) of the mission.
const NOISE: [(&str, f64); 3] = [("tau.", 0.06), ("gyro.", 1e-4), ("q.", 1e-5)];

/// The exact world of `fixtures/verdict`, of which recorders of many kinds take samples.
struct World {
    dir: tempfile::TempDir,
    names: Vec<String>,
    dt: f64,
    rows: Vec<Vec<f64>>,
    rng: ChaCha8Rng,
}

impl World {
    fn new(seed: u64) -> Self {
        let (dir, here) = (tempfile::tempdir().unwrap(), fixture("verdict"));
        let csv = dir.path().join("m1.csv");
        let (code, _, err) =
            ffid(dir.path(), &["convert", here.join("m1.parquet").to_str().unwrap(), csv.to_str().unwrap()]);
        assert_eq!(code, 0, "{err}");
        let mut file = csv::Reader::from_path(&csv).unwrap();
        let head: Vec<String> = file.headers().unwrap().iter().map(str::to_owned).collect();
        let taken: Vec<usize> = (0..head.len()).filter(|&i| NOISE.iter().any(|n| head[i].starts_with(n.0))).collect();
        let all: Vec<Vec<f64>> =
            file.records().map(|r| r.unwrap().iter().map(|x| x.parse().unwrap()).collect()).collect();
        let rows = all.iter().map(|r| taken.iter().map(|&i| r[i]).collect()).collect();
        let names = taken.iter().map(|&i| head[i].clone()).collect();
        let dt = all[1][0] - all[0][0];
        for file in ["robot.urdf", "start.toml", "truth.toml"] {
            fs::copy(here.join(file), dir.path().join(file)).unwrap();
        }
        Self { dir, names, dt, rows, rng: ChaCha8Rng::seed_from_u64(seed) }
    }
    fn end(&self) -> f64 {
        (self.rows.len() - 1) as f64 * self.dt
    }
    /// What the sensors read at a time: a polynomial through eight samples of the exact world, and noise.
    fn read(&mut self, t: f64) -> Vec<f64> {
        let u = t / self.dt;
        let first = (u.floor() as usize).saturating_sub(3).min(self.rows.len() - 8);
        let weight = |a: usize| -> f64 {
            let at = |k: usize| (first + k) as f64;
            (0..8).filter(|&b| b != a).map(|b| (u - at(b)) / (at(a) - at(b))).product()
        };
        let weights: Vec<f64> = (0..8).map(weight).collect();
        (0..self.names.len())
            .map(|c| {
                let exact: f64 = (0..8).map(|a| weights[a] * self.rows[first + a][c]).sum();
                let noise = NOISE.iter().find(|n| self.names[c].starts_with(n.0)).unwrap().1;
                let normal: f64 = StandardNormal.sample(&mut self.rng);
                exact + noise * normal
            })
            .collect()
    }
    /// Samples at these times, stamped with others.
    fn log(&mut self, file: &str, times: &[(f64, f64)], empty: impl Fn(usize, &str) -> bool) {
        let mut text = format!("time[s],{}\n", self.names.join(","));
        for (i, &(at, stamp)) in times.iter().enumerate() {
            write!(text, "{stamp}").unwrap();
            for (x, name) in self.read(at).into_iter().zip(self.names.clone()) {
                if empty(i, &name) { text.push(',') } else { write!(text, ",{x}").unwrap() }
            }
            text.push('\n');
        }
        fs::write(self.path().join(file), text).unwrap();
    }
    fn path(&self) -> &Path {
        self.dir.path()
    }
    /// Identifies with no flag; the result and what was said.
    fn identify(&self, file: &str) -> (IdentificationResult, String) {
        let (code, out, err) =
            ffid(self.path(), &["identify", "start.toml", "--record", file, "--out", "res", "--force"]);
        assert_eq!(code, 0, "{file}\n{out}\n{err}");
        (IdentificationResult::from_json(&fs::read(self.path().join("res/result.json")).unwrap()).unwrap(), err)
    }
}

/// Root mean square and largest of the errors of all parameters in their deviations.
fn off(r: &IdentificationResult) -> (f64, f64) {
    let truth = ffid::open::open(&fixture("verdict").join("truth.toml"), ff_mission::Leniency::default()).unwrap();
    let params = ff_model::Params::<f64>::nominal(&truth.model);
    let decls = truth.model.param_decls();
    let z: Vec<f64> = r
        .parameters
        .iter()
        .map(|p| (p.value - params.values()[decls.iter().position(|d| d.name == p.name).unwrap()]) / p.std.unwrap())
        .collect();
    ((z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64).sqrt(), z.iter().fold(0.0, |m, z| z.abs().max(m)))
}

/// With 17 parameters in their intervals: the mean of their squares is 1 +- 0.34.
fn within_intervals(r: &IdentificationResult) {
    let (rms, most) = off(r);
    assert!(rms < 1.5 && most < 3.5, "{rms} {most}");
    assert_eq!(r.state(), State::Explained, "{:?}", r.verdict);
    assert!((r.chi2_per_dof - 1.0).abs() < 0.05, "{}", r.chi2_per_dof);
}

#[test]
#[ignore = "full tier: 4 s"]
fn lost_samples_and_spikes_need_no_flag() {
    let mut w = World::new(1);
    let all = (w.end() / w.dt).round() as usize;
    let times: Vec<(f64, f64)> = (0..=all)
        .filter(|i| *i == 0 || *i == all || w.rng.random::<f64>() > 0.026)
        .map(|i| (w.dt * i as f64, w.dt * i as f64))
        .collect();
    w.log("lost.csv", &times, |_, _| false);
    // Every 700th torque of one joint is 40 deviations off.
    let text = fs::read_to_string(w.path().join("lost.csv")).unwrap();
    let column = 1 + w.names.iter().position(|n| n.starts_with("tau.elbow")).unwrap();
    let spiked: Vec<String> = text
        .lines()
        .enumerate()
        .map(|(i, l)| {
            let mut cells: Vec<String> = l.split(',').map(str::to_owned).collect();
            if i % 700 == 350 {
                cells[column] = (cells[column].parse::<f64>().unwrap() + 2.4).to_string();
            }
            cells.join(",")
        })
        .collect();
    fs::write(w.path().join("lost.csv"), spiked.join("\n") + "\n").unwrap();
    let (r, said) = w.identify("lost.csv");
    assert!(said.contains("Data::Gap") && said.contains("tau.elbow: 4 single samples"), "{said}");
    within_intervals(&r);
}

#[test]
#[ignore = "full tier: 15 s"]
fn thinned_jittered_with_a_gap_and_torques_at_half_the_rate() {
    let mut w = World::new(2);
    let all = (w.end() / w.dt).round() as usize;
    let mut times: Vec<(f64, f64)> = Vec::new();
    for i in 0..=all {
        let t = (w.dt * (i as f64 + w.rng.random_range(-0.49..0.49))).clamp(0.0, w.end());
        let keep = w.rng.random::<f64>() > 0.1 && !(20.0..22.0).contains(&t);
        if i == 0 || keep {
            times.push((t, t));
        }
    }
    w.log("log.csv", &times, |i, name| i % 2 == 1 && name.starts_with("tau."));
    let (r, said) = w.identify("log.csv");
    assert!(said.contains("Data::SampledApart") && said.contains("Data::Segments"), "{said}");
    // A joint that moves on while nothing is read is no faster for it.
    assert!(!said.contains("Data::LooksLikeDegrees"), "{said}");
    assert_eq!(r.records.len(), 2);
    within_intervals(&r);
    // The part behind the gap has an initial state of its own, the first begins at rest.
    let initial = |part: &str| r.nuisance.iter().any(|p| p.name.starts_with(part) && p.name.contains("initial"));
    assert!(
        initial("log-part2.") && !initial("log.initial"),
        "{:?}",
        r.nuisance.iter().map(|p| &p.name).collect::<Vec<_>>()
    );
}

#[test]
#[ignore = "full tier: 5 s"]
fn noisy_stamps_of_an_even_clock_are_not_times() {
    let mut w = World::new(3);
    let all = (w.end() / w.dt).round() as usize;
    let times: Vec<(f64, f64)> =
        (0..=all).map(|i| (w.dt * i as f64, w.dt * (i as f64 + w.rng.random_range(-0.45..0.45)))).collect();
    w.log("stamps.csv", &times, |_, _| false);
    let (r, said) = w.identify("stamps.csv");
    assert!(said.contains("the stamps are noisy"), "{said}");
    within_intervals(&r);
}

#[test]
fn what_stays_refused_names_the_flag() {
    let mut w = World::new(4);
    let times: Vec<(f64, f64)> = (0..200).map(|i| (w.dt * f64::from(i), w.dt * f64::from(i))).collect();
    w.log("nan.csv", &times, |i, name| i == 100 && name.starts_with("q.elbow"));
    let refused = |w: &World, file: &str, code: &str, place: &str, flag: &str| {
        let (exit, _, err) = ffid(w.path(), &["identify", "start.toml", "--record", file, "--out", "res", "--force"]);
        assert!(exit == 12 && err.contains(code) && err.contains(place) && err.contains(flag), "{exit} {err}");
    };
    refused(&w, "nan.csv", "Data::NotFinite", "nan.csv:102:", "--gaps drop");
    let mut twice = times.clone();
    twice[80].1 = twice[79].1;
    w.log("twice.csv", &twice, |_, _| false);
    // Readings differ, so that leaving out rows that repeat the one before would not help.
    refused(&w, "twice.csv", "Data::NonMonotone", "twice.csv:82:", "stamps repeat and readings do not");
}
