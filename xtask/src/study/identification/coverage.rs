//! `cargo xtask study coverage`: are the intervals as wide as they should be?
//!
//! 1000 noisy records of the flexible and of the sloshing system: white noise on torques and gyro, encoders of 20 bits whose steps lie
//! anew, through which the joint motion is fitted anew each time. Every record is identified without priors, from 10 % off, and every parameter is
//! asked whether its 95 % interval holds the truth, and how far the mean of its estimates is from the truth. Parts for `--only`:
//! `flexible`, `slosh`.

use super::case::{Case, FLEXIBLE, Kind, SLOSH};
use super::settings;
use crate::study::figures::{Op, Study};
use crate::study::options::Options;
use crate::study::trials::{Number, Trial, Trials};
use ff_dynamics::sim::Channel;
use ff_dynamics::{SensorSuite, Trace, measure};
use ident::estimate::Estimate;
use ident::estimate::attempt;
use ident::parameters::offset_start;
use ident::{OutputError, Request};
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Record (s) and its sampling.
const RECORD_S: f64 = 60.0;
const SAMPLE_S: f64 = 0.01;
/// Records per system: the mean error of a parameter is then known to 0.03 of its standard deviation, and the largest of 18 or so
/// such means stays below 0.2 unless there is a bias. Of 200 records each is known to 0.07, and one draw in ten fails by chance.
const RECORDS: u64 = 1000;
/// Quantile of a normal distribution at 97.5 %.
const Z95: f64 = 1.959_963_984_540_054;

/// Runs the study.
///
/// # Errors
/// Files that cannot be read, and fits that give no estimate at all.
pub fn run(options: &Options) -> anyhow::Result<Study> {
    let mut study = Study::new("coverage", options.seed);
    let trials = Trials::open("coverage", 1, options)?;
    let flexible: &[Group] = &[("base", "base."), ("k", ".k["), ("d", ".d[")];
    let slosh: &[Group] =
        &[("base", "base."), ("slosh_mass", "tank.mass"), ("slosh_length", "tank.length"), ("k", ".k["), ("d", ".d[")];
    for (kind, groups) in [(FLEXIBLE, flexible), (SLOSH, slosh)] {
        if options.wants(kind.name) {
            system(kind, groups, options, &trials, &mut study)?;
        }
    }
    trials.note().into_iter().for_each(|n| study.note(n));
    Ok(study)
}

/// Name of a group, and what the names of its parameters contain.
type Group = (&'static str, &'static str);

/// What came of one record.
#[derive(Serialize, Deserialize)]
struct Fitted {
    chi2_per_dof: Number,
    converged: bool,
    /// Value and standard deviation of every estimated parameter.
    estimates: Vec<(Number, Option<Number>)>,
}

fn system(kind: Kind, groups: &[Group], options: &Options, trials: &Trials, study: &mut Study) -> anyhow::Result<()> {
    let case = Case::new(kind, RECORD_S, true, options.seed)?;
    let trace = case.simulate(SAMPLE_S)?;
    let records = if options.quick { 4 } else { RECORDS };
    let clock = Instant::now();
    let fits = trials.run(case.name, 0..records, |t| one(&case, &trace, t))?;
    let seconds = clock.elapsed().as_secs_f64();
    let count = fits.len() as f64;
    let name = |what: &str| format!("{}.{what}", case.name);
    study.figure(name("seconds"), "s", seconds);
    study.figure(name("chi2_per_dof"), "", fits.iter().map(|e| e.chi2_per_dof.0).sum::<f64>() / count);
    let converged = fits.iter().filter(|e| e.converged).count();
    study.judged(options.quick, name("converged"), "", converged as f64, (Op::AtLeast, count));
    for (group, pattern) in groups {
        let members: Vec<usize> =
            (0..case.selected.len()).filter(|&k| case.decls[case.selected[k]].name.contains(pattern)).collect();
        let (mut inside, mut all, mut worst, mut of) = (0.0, 0.0, 0.0f64, "");
        for &k in &members {
            let i = case.selected[k];
            let truth = case.truth.values()[i];
            // A parameter without a deviation is not covered.
            let error = |(value, std): (Number, Option<Number>)| (value.0 - truth) / std.map_or(0.0, |s| s.0);
            let errors: Vec<f64> = fits.iter().map(|e| error(e.estimates[k])).collect();
            inside += errors.iter().filter(|e| e.abs() <= Z95).count() as f64;
            all += count;
            let bias = errors.iter().sum::<f64>() / count;
            if bias.is_nan() || bias.abs() > worst.abs() {
                (worst, of) = (bias, &case.decls[i].name);
            }
        }
        let covered = 100.0 * inside / all;
        study.judged(options.quick, name(&format!("{group}.covered")), "%", covered, (Op::AtLeast, 92.0));
        if !options.quick {
            study.limited(name(&format!("{group}.covered_at_most")), "%", covered, Op::AtMost, 98.0);
        }
        study.judged(options.quick, name(&format!("{group}.bias")), "sigma", worst.abs(), (Op::AtMost, 0.2));
        study.note(format!("{}: largest bias of {group}: {of}, {worst:.3} sigma", case.name));
    }
    Ok(())
}

/// Fraction of the golden ratio: its multiples fill the unit interval evenly.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

fn one(case: &Case, trace: &Trace, trial: Trial) -> anyhow::Result<Fitted> {
    let seed = trial.own_seed();
    // Where the zero of an encoder lies within its step is chance. With the same phase in all records their positions would be the
    // same to the last bit, and what is one draw of the error of the joint motion would count as a bias.
    // No record is displaced by more than half a step, and all together by nothing.
    let phase = (seed as f64 * GOLDEN).fract() - 0.5;
    let encoder = Channel { bias: phase * case.sensors.encoder.quantum, ..case.sensors.encoder };
    let r = measure(trace, &SensorSuite { encoder, ..case.sensors }, seed);
    let record = case.record(r.dt).q(r.q).tau(r.tau).gyro(r.gyro).build()?.0;
    let start = offset_start(&case.decls, case.truth.values(), &case.selected, 0.1, seed);
    let request = Request { settings: settings(), ..Request::new(&case.decls, &case.selected, &start) };
    let o = ident::Options { substeps: 1, ..ident::Options::new(case.noise) };
    let e: Estimate = attempt(&request, &mut OutputError::new(&case.model, &record, &o)?)?;
    Ok(Fitted {
        chi2_per_dof: Number(e.chi2_per_dof),
        converged: e.status.is_converged(),
        estimates: e.parameters.iter().map(|p| (Number(p.value), p.std.map(Number))).collect(),
    })
}
