//! `cargo xtask study combined`: panels and fuel at once, with what real sensors add.
//!
//! 60 s of the system of `fixtures/paper/combined.toml` at its joint limits: torque and gyro noise, encoders of 20 bits, biases of
//! all torque sensors and the gyro, and torques that arrive 3 ms late; none of it known. Identified from 20 % off under the
//! mission's prior of 30 %, with biases, delay and initial state among the unknowns, from `--seed` on three records with other noise,
//! starts and biases. The figures are the worst of the three.

use super::case::{COMBINED, Case};
use super::{fit, settings};
use crate::delayed::delayed;
use crate::study::figures::{Op, Study};
use crate::study::options::Options;
use crate::study::trials::{Number, Trial, Trials};
use anyhow::Context;
use ff_dynamics::{Boundary, Trace, measure, modes};
use ff_model::{Inertia, Params};
use ident::Request;
use ident::estimate::Estimate;
use ident::parameters::offset_start;
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Record (s), its sampling, and that of the simulation it is cut from.
const RECORD_S: f64 = 60.0;
const SAMPLE_S: f64 = 0.01;
const FINE_S: f64 = 1e-3;
/// Delay of the torques, in fine samples.
const DELAY: usize = 3;
/// Biases are drawn from `-B .. B` (N m, rad/s).
const TORQUE_BIAS: f64 = 0.3;
const GYRO_BIAS: f64 = 5e-4;

/// What came of one record.
#[derive(Serialize, Deserialize)]
struct Outcome {
    /// Errors by name, relative but for delay and biases.
    errors: Vec<(String, Number)>,
    converged: bool,
    chi2_per_dof: Number,
    iterations: usize,
    seconds: f64,
    /// Every unknown, in words.
    notes: Vec<String>,
}

/// Runs the study.
///
/// # Errors
/// Files that cannot be read, and fits that give no estimate at all.
pub fn run(options: &Options) -> anyhow::Result<Study> {
    let mut study = Study::new("combined", options.seed);
    let trials = Trials::open("combined", 1, options)?;
    let case = Case::new(COMBINED, RECORD_S, true, options.seed)?;
    let fine = case.simulate(FINE_S)?;
    let count = if options.quick { 1 } else { 3 };
    let all = trials.run("all", 0..count, |t| one(&case, &fine, t))?;
    let error = |e: &Outcome, name: &str| e.errors.iter().find(|n| n.0 == name).map_or(f64::NAN, |n| n.1.0);
    let limits =
        [("mass", 2.0), ("com", 2.0), ("inertia", 2.0), ("stiffness", 1.0), ("damping", 10.0), ("frequency", 0.5)];
    for (name, limit) in limits {
        let of = |e: &Outcome| 100.0 * error(e, name);
        // NaN must not be lost in the largest.
        let worst = all.iter().map(of).fold(0.0, |m: f64, x| if x.is_nan() { x } else { m.max(x) });
        study.judged(false, format!("{name}.error"), "%", worst, (Op::AtMost, limit));
    }
    for name in ["delay", "torque_bias", "gyro_bias", "slosh_mass", "slosh_length"] {
        let unit = match name {
            "delay" => "s",
            "torque_bias" => "N m",
            "gyro_bias" => "rad/s",
            _ => "",
        };
        study.figure(format!("{name}.error"), unit, all.iter().map(|e| error(e, name)).fold(0.0, f64::max));
    }
    let converged = all.iter().filter(|e| e.converged).count();
    study.judged(false, "converged", "", converged as f64, (Op::AtLeast, count as f64));
    study.figure("chi2_per_dof", "", all[0].chi2_per_dof.0);
    study.figure("iterations", "", all.iter().map(|e| e.iterations).max().unwrap_or(0) as f64);
    study.figure("seconds", "s", all.iter().map(|e| e.seconds).fold(0.0, f64::max));
    all[0].notes.iter().for_each(|n| study.note(n));
    trials.note().into_iter().for_each(|n| study.note(n));
    Ok(study)
}

/// Every unknown of an estimate, a line each.
fn notes(case: &Case, e: &Estimate) -> Vec<String> {
    let deviation = |std: Option<f64>| std.map_or_else(|| "untold".to_owned(), |s| format!("{s:.2e}"));
    let nuisance = e.nuisance.iter().map(|p| format!("{:28} {:12.5e} +- {}", p.name, p.value, deviation(p.std)));
    let parameters = e.parameters.iter().map(|p| {
        let (truth, std) = (case.true_value(&p.name), deviation(p.std));
        format!("{:24} truth {truth:10.4}, found {:10.4} +- {std} {}", p.name, p.value, p.unit)
    });
    nuisance.chain(parameters).collect()
}

fn one(case: &Case, fine: &Trace, trial: Trial) -> anyhow::Result<Outcome> {
    let seed = trial.own_seed();
    let n = case.model.nj();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let torque_bias: Vec<f64> = (0..n).map(|_| TORQUE_BIAS * rng.random_range(-1.0..1.0)).collect();
    let gyro_bias: Vec<f64> = (0..3).map(|_| GYRO_BIAS * rng.random_range(-1.0..1.0)).collect();
    // What the sensors sample: torques of 3 ms ago. It was quiet before the start.
    let per = (SAMPLE_S / FINE_S).round() as usize;
    let sampled = delayed(fine, per, DELAY);
    let mut r = measure(&sampled, &case.sensors, seed);
    r.tau.column_iter_mut().zip(&torque_bias).for_each(|(mut c, b)| c.add_scalar_mut(*b));
    r.gyro.column_iter_mut().zip(&gyro_bias).for_each(|(mut c, b)| c.add_scalar_mut(*b));
    let record = case.record(SAMPLE_S).q(r.q).tau(r.tau).gyro(r.gyro).build()?.0;
    let options = ident::Options {
        substeps: 1,
        gyro_bias: true,
        torque_bias: true,
        initial_state: true,
        torque_delay: true,
        ..ffid::ident::Options::new(case.noise)
    };
    let start = offset_start(&case.decls, case.truth.values(), &case.selected, 0.2, seed);
    let request =
        Request { prior_width: Some(0.3), settings: settings(), ..Request::new(&case.decls, &case.selected, &start) };
    let clock = Instant::now();
    let estimate = fit(case, &record, &options, &request)?;
    let seconds = clock.elapsed().as_secs_f64();
    let errors = errors(case, &estimate, &torque_bias, &gyro_bias)?;
    Ok(Outcome {
        errors: errors.into_iter().map(|(name, e)| (name.to_owned(), Number(e))).collect(),
        converged: estimate.status.is_converged(),
        chi2_per_dof: Number(estimate.chi2_per_dof),
        iterations: estimate.iterations,
        seconds,
        notes: notes(case, &estimate),
    })
}

fn errors(
    case: &Case,
    e: &Estimate,
    torque_bias: &[f64],
    gyro_bias: &[f64],
) -> anyhow::Result<Vec<(&'static str, f64)>> {
    let found = Inertia::from_params(&e.values[..10]);
    let truth = Inertia::from_params(&case.truth.values()[..10]);
    let com = |b: &Inertia<f64>| -> anyhow::Result<Vector3<f64>> { b.com().context("a base without mass") };
    let (c, c0) = (com(&found)?, com(&truth)?);
    let (i, i0) = (found.about_com(), truth.about_com());
    // Each in its own measure: the centre of mass against its distance from the base frame, the inertia against its norm.
    let mut out = vec![
        ("mass", (found.mass / truth.mass - 1.0).abs()),
        ("com", (c - c0).norm() / c0.norm()),
        ("inertia", (i - i0).norm() / i0.norm()),
    ];
    let worst = |pattern: &str| {
        let of = |p: &ident::Estimated| (p.value / case.true_value(&p.name) - 1.0).abs();
        e.parameters.iter().filter(|p| p.name.contains(pattern)).map(of).fold(0.0, f64::max)
    };
    out.extend([("stiffness", worst(".k[")), ("damping", worst(".d["))]);
    out.extend([("slosh_mass", worst("tank.mass")), ("slosh_length", worst("tank.length"))]);
    let q = {
        let mut q = vec![0.0; case.model.nj()];
        let (mut qd, mut qdd) = (q.clone(), q.clone());
        ff_dynamics::motion::JointMotion::eval(&*case.motion, 0.0, &mut q, &mut qd, &mut qdd);
        q
    };
    let at = |p: &Params<f64>| -> anyhow::Result<Vec<f64>> {
        let rest = case.model.rest_position(p);
        Ok(modes(&case.model, p, &q, &rest, Boundary::JointsHeld)?.iter().map(|m| m.frequency_hz).collect())
    };
    let (f, f0) = (at(&Params::from_values(&case.model, e.values.clone()))?, at(&case.truth)?);
    out.push(("frequency", f.iter().zip(&f0).map(|(f, f0)| (f / f0 - 1.0).abs()).fold(0.0, f64::max)));
    let unknown = |name: &str| e.nuisance.iter().find(|u| u.name == name).map_or(f64::NAN, |u| u.value);
    out.push(("delay", (unknown("torque.delay") - DELAY as f64 * FINE_S).abs()));
    let joints = case.model.joint_names();
    let torque = joints.iter().zip(torque_bias).map(|(j, b)| (unknown(&format!("torque.bias.{j}")) - b).abs());
    out.push(("torque_bias", torque.fold(0.0, f64::max)));
    let gyro = ["x", "y", "z"].iter().zip(gyro_bias).map(|(a, b)| (unknown(&format!("gyro.bias.{a}")) - b).abs());
    out.push(("gyro_bias", gyro.fold(0.0, f64::max)));
    Ok(out)
}
