//! `cargo xtask study thinned`: are intervals honest for logs as recorders write them?
//!
//! The servicer of `fixtures/verdict`, two flexible wings and a tank of fuel, whose records of one minute MuJoCo has computed. Every trial is a log of
//! one of them: stamps that are the true times, off the clock by up to half a sample; a tenth of the samples lost at random; one gap of 2 s
//! anywhere; torques at half the rate of the encoders; noise on all channels. It is written as CSV, read and identified as by `ffid identify` with no
//! flag. Numbers for `--only` are logs. How many of the 95 % intervals hold the truth, pooled over all parameters and logs whose fit has ended, and by what they belong to.

use super::covered::{self, percent};
use super::figures::{Op, Study};
use super::options::Options;
use super::trials::{Number, Trial, Trials};
use super::verdict::world::{Encoder, RECORDS, Readings, World};
use ff_records::file::{ReadOptions, joints_of, read};
use ffid::exit::Exit;
use ffid::workflow::identify::{State, segments};
use nalgebra::DMatrix;
use rand::RngExt;
use serde::{Deserialize, Serialize};
use std::fmt::Write;
use std::fs;

/// Logs.
const LOGS: u64 = 300;
/// Part of the samples that is lost.
const LOST: f64 = 0.1;
/// Largest distance of a stamp from the clock, in samples: below a half, so that stamps ascend.
const JITTER: f64 = 0.49;
/// The gap (s).
const GAP_S: f64 = 2.0;
/// Nearest that the gap comes to either end (s).
const ENDS_S: f64 = 3.0;
/// Samples that a polynomial between them goes through.
const THROUGH: usize = 8;

/// What the estimates belong to, and what the names of these contain.
const GROUPS: [(&str, &str); 4] = [("base", "base."), ("stiffness", ".k["), ("damping", ".d["), ("fuel", "tank.")];

/// What came of a log.
#[derive(Serialize, Deserialize)]
struct Outcome {
    exit: u8,
    contradicted: bool,
    chi2_per_dof: Number,
    parts: usize,
    /// Every parameter, and its distance from the truth in stated deviations.
    off: Vec<(String, Number)>,
    /// Why nothing was identified.
    refused: Option<String>,
}

/// Runs the study.
///
/// # Errors
/// Files that cannot be read or written.
pub fn run(options: &Options) -> anyhow::Result<Study> {
    let mut study = Study::new("thinned", options.seed);
    let trials = Trials::open("thinned", 1, options)?;
    let world = World::new("start.toml")?;
    let clean = RECORDS.iter().map(|name| world.clean(name)).collect::<anyhow::Result<Vec<_>>>()?;
    let listed = options.cases();
    let all = 0..if options.quick { 3 } else { LOGS };
    let numbers: Vec<u64> = if listed.is_empty() { all.collect() } else { listed };
    let all = trials.run("logs", numbers.iter().copied(), |t| one(&world, &clean, t))?;
    figures(&all, &numbers, options, &mut study);
    trials.note().into_iter().for_each(|n| study.note(n));
    Ok(study)
}

fn figures(all: &[Outcome], numbers: &[u64], options: &Options, study: &mut Study) {
    // A fit that has not ended says so, and that its numbers are no estimates.
    let ended = |o: &&Outcome| o.refused.is_none() && o.exit != Exit::Numerical.code();
    let fitted: Vec<&Outcome> = all.iter().filter(ended).collect();
    study.figure("logs", "", all.len() as f64);
    study.figure("refused", "", all.iter().filter(|o| o.refused.is_some()).count() as f64);
    study.judged(options.quick, "identified", "%", percent(fitted.len(), all.len()), (Op::AtLeast, 99.0));
    study.figure("contradicted", "%", percent(all.iter().filter(|o| o.contradicted).count(), all.len()));
    let chi2: f64 = fitted.iter().map(|o| o.chi2_per_dof.0).sum();
    study.figure("chi2_per_dof", "", chi2 / fitted.len().max(1) as f64);
    study.figure("parts", "", fitted.iter().map(|o| o.parts).sum::<usize>() as f64 / fitted.len().max(1) as f64);
    let errors = |of: &str| -> Vec<f64> {
        fitted.iter().flat_map(|o| &o.off).filter(|x| x.0.contains(of)).map(|x| x.1.0).collect()
    };
    for (name, of) in GROUPS {
        let (held, rms) = covered::of(&errors(of));
        study.figure(format!("{name}.covered"), "%", held);
        study.figure(format!("{name}.rms_deviations"), "", rms);
    }
    study.covered(options.quick, "", &errors(""));
    for (&k, o) in numbers.iter().zip(all).filter(|(_, o)| o.exit != Exit::Done.code()) {
        let why = o.refused.as_deref().unwrap_or("see its verdict");
        study.note(format!("log {k} ({}): exit {}, {why}", RECORDS[k as usize % RECORDS.len()], o.exit));
    }
}

fn one(world: &World, clean: &[Readings], t: Trial) -> anyhow::Result<Outcome> {
    let mut rng = t.rng();
    let exact = &clean[(t.number % clean.len() as u64) as usize];
    let (dt, last) = (1.0 / exact.rate_hz, exact.q.nrows() - 1);
    let end = last as f64 * dt;
    let gap = rng.random_range(ENDS_S..end - ENDS_S - GAP_S);
    let mut times = Vec::new();
    for i in 0..=last {
        let at = (dt * (i as f64 + rng.random_range(-JITTER..JITTER))).clamp(0.0, end);
        let kept = rng.random::<f64>() > LOST && !(gap..gap + GAP_S).contains(&at);
        if i == 0 || kept {
            times.push((i, at));
        }
    }
    let at: Vec<f64> = times.iter().map(|t| t.1 / dt).collect();
    let read_at = |m: &DMatrix<f64>| between(m, &at);
    let (q, qd) = (read_at(&exact.q), read_at(&exact.qd));
    let mut r = Readings { rate_hz: exact.rate_hz, q, qd, tau: read_at(&exact.tau), gyro: read_at(&exact.gyro) };
    world.noise(&mut r, Encoder::Noisy, &mut rng);
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("log.csv");
    fs::write(&file, csv(&world.truth.model.joint_names(), &times, &r)?)?;
    let refused = |why: String| Outcome {
        exit: Exit::Data.code(),
        contradicted: false,
        chi2_per_dof: Number(f64::NAN),
        parts: 0,
        off: Vec::new(),
        refused: Some(why),
    };
    let record =
        match read(&file, &joints_of(&world.truth.model), &ReadOptions { long_gaps: true, ..ReadOptions::default() }) {
            Ok(read) => read.record,
            Err(e) => return Ok(refused(e.to_string())),
        };
    let mut parts = match segments("log", &record) {
        Ok(s) => s.labelled("log"),
        Err(e) => return Ok(refused(e.to_string())),
    };
    let found = match world.identify_all(&world.start, &mut parts) {
        Ok(found) => found.result,
        Err(e) => return Ok(refused(e.to_string())),
    };
    let truth = world.truth.model.param_decls();
    let off = found.parameters.iter().map(|p| {
        let nominal = truth.iter().find(|d| d.name == p.name).map_or(f64::NAN, |d| d.nominal);
        (p.name.clone(), Number((p.value - nominal) / p.std.unwrap_or(f64::NAN)))
    });
    Ok(Outcome {
        exit: found.exit().code(),
        contradicted: found.state() == State::Contradicted,
        chi2_per_dof: Number(found.chi2_per_dof),
        parts: parts.len(),
        off: off.collect(),
        refused: None,
    })
}

/// Rows of samples between others, at places counted in samples: on polynomials through [`THROUGH`] of them.
fn between(m: &DMatrix<f64>, at: &[f64]) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(at.len(), m.ncols());
    for (row, u) in at.iter().enumerate() {
        let first = (u.floor() as usize).saturating_sub(THROUGH / 2 - 1).min(m.nrows() - THROUGH);
        for a in 0..THROUGH {
            let x = |k: usize| (first + k) as f64;
            let weight: f64 = (0..THROUGH).filter(|&b| b != a).map(|b| (u - x(b)) / (x(a) - x(b))).product();
            for c in 0..m.ncols() {
                out[(row, c)] += weight * m[(first + a, c)];
            }
        }
    }
    out
}

/// The log: torques of every second sample of the clock, counted before samples were lost.
fn csv(joints: &[String], times: &[(usize, f64)], r: &Readings) -> anyhow::Result<String> {
    let mut out = String::from("time[s]");
    let columns = |kind: &str, unit: &str| joints.iter().map(|j| format!(",{kind}.{j}[{unit}]")).collect::<String>();
    write!(out, "{}{}", columns("q", "rad"), columns("tau", "N m"))?;
    out.push_str(",gyro.x[rad/s],gyro.y[rad/s],gyro.z[rad/s]\n");
    for (row, (sample, time)) in times.iter().enumerate() {
        write!(out, "{time}")?;
        let cells = |out: &mut String, m: &DMatrix<f64>| -> std::fmt::Result {
            m.row(row).iter().try_for_each(|x| write!(out, ",{x}"))
        };
        cells(&mut out, &r.q)?;
        if sample % 2 == 0 {
            cells(&mut out, &r.tau)?;
        } else {
            out.push_str(&",".repeat(joints.len()));
        }
        cells(&mut out, &r.gyro)?;
        out.push('\n');
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_samples_a_polynomial_is_exact() {
        let m = DMatrix::from_fn(20, 2, |i, c| (0.1 * i as f64 - 0.7).powi(5 + c as i32) + 0.3);
        let at = [0.0, 0.37, 7.5, 12.91, 18.6, 19.0];
        let found = between(&m, &at);
        for (row, u) in at.iter().enumerate() {
            for c in 0..2 {
                let want = (0.1 * u - 0.7).powi(5 + c as i32) + 0.3;
                assert!((found[(row, c)] - want).abs() < 1e-12, "{u} {c}: {} {want}", found[(row, c)]);
            }
        }
    }

    #[test]
    fn a_log_has_torques_at_half_the_rate() {
        let row = |x: f64, n: usize| DMatrix::from_fn(2, n, |i, c| x + i as f64 + 0.1 * c as f64);
        let r = Readings { rate_hz: 50.0, q: row(2.0, 2), qd: row(0.5, 2), tau: row(5.0, 2), gyro: row(7.0, 3) };
        let text = csv(&["a".into(), "b".into()], &[(4, 0.081), (7, 0.139)], &r).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0].matches("[rad]").count() + lines[0].matches("[N m]").count(), 4);
        assert_eq!(lines[1], "0.081,2,2.1,5,5.1,7,7.1,7.2");
        assert_eq!(lines[2], "0.139,3,3.1,,,8,8.1,8.2");
    }
}
