//! `cargo xtask study recovery`: noise-free data give the truth back.
//!
//! Five systems (rigid, flexible, sloshing, both, and with an unknown payload), each identified from `--seeds` starts 20 % off
//! (every parameter up or down by a coin toss; bodies stay bodies). The record is simulated at 1 ms by the full dynamics, the
//! estimator integrates the reduced one at 10 ms. A start counts as recovered when every combination of parameters that the
//! sensors would determine to 10 % comes back to 1e-6 of the size of its parameters. Stiffness, mass and length off by 20 % each put
//! a frequency off by half, so beginnings of the record are fitted first. Parts for `--only`: the systems.

use super::case::{COMBINED, Case, FLEXIBLE, PAYLOAD, RIGID, SLOSH};
use super::{fit, settings};
use crate::study::figures::{Op, Study};
use crate::study::options::Options;
use crate::study::trials::{Number, Trial, Trials};
use ff_records::Record;
use ident::estimate::Estimate;
use ident::estimate::attempt;
use ident::parameters::offset_start;
use ident::{Rda, Request};
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Record (s) and its sampling.
const RECORD_S: f64 = 40.0;
const SAMPLE_S: f64 = 0.01;
/// Distance of the starts.
const OFFSET: f64 = 0.2;
/// Relative deviation up to which a combination counts as identifiable.
const IDENTIFIABLE: f64 = 0.1;
/// Error up to which it counts as recovered.
const RECOVERED: f64 = 1e-6;
/// Starts per system.
const SEEDS: u64 = 100;

/// Runs the study.
///
/// # Errors
/// Files that cannot be read, and fits that give no estimate at all.
pub fn run(options: &Options) -> anyhow::Result<Study> {
    let mut study = Study::new("recovery", options.seed);
    let trials = Trials::open("recovery", 1, options)?;
    let seeds =
        if options.quick { 2 } else { std::env::var("SEEDS").ok().and_then(|s| s.parse().ok()).unwrap_or(SEEDS) };
    for kind in [RIGID, FLEXIBLE, SLOSH, COMBINED, PAYLOAD] {
        if !options.wants(kind.name) {
            continue;
        }
        let case = Case::new(kind, RECORD_S, false, options.seed)?;
        let record = case.exact(&case.simulate(SAMPLE_S)?)?;
        let clock = Instant::now();
        let all = trials.run(case.name, 0..seeds, |t| one(&case, &record, t))?;
        let seconds = clock.elapsed().as_secs_f64();
        let recovered = all.iter().filter(|x| x.error.0 <= RECOVERED).count();
        let name = |what: &str| format!("{}.{what}", case.name);
        study.figure(name("parameters"), "", case.selected.len() as f64);
        study.figure(name("identifiable"), "", all.iter().map(|x| x.identifiable).min().unwrap_or(0) as f64);
        study.figure(name("worst_error"), "", all.iter().map(|x| x.error.0).fold(0.0, f64::max));
        study.figure(name("iterations"), "", all.iter().map(|x| x.iterations).sum::<usize>() as f64 / seeds as f64);
        study.figure(name("seconds"), "s", seconds);
        study.judged(false, name("recovered"), "", recovered as f64, (Op::AtLeast, seeds as f64));
    }
    trials.note().into_iter().for_each(|n| study.note(n));
    study.note(format!("{seeds} starts per system, {:.0} % off; recovered: to {RECOVERED:e}", 100.0 * OFFSET));
    Ok(study)
}

/// What came of one start.
#[derive(Serialize, Deserialize)]
struct Recovery {
    /// Identifiable combinations of parameters.
    identifiable: usize,
    /// Their largest error, relative.
    error: Number,
    iterations: usize,
}

fn one(case: &Case, record: &Record, trial: Trial) -> anyhow::Result<Recovery> {
    let seed = trial.own_seed();
    let truth = case.truth.values();
    let start = offset_start(&case.decls, truth, &case.selected, OFFSET, seed);
    let request = Request {
        // What the data leave open is held where it is; it biases nothing else.
        anchor: Some(10.0),
        settings: settings(),
        ..Request::new(&case.decls, &case.selected, &start)
    };
    let e: Estimate = if case.model.np() == 0 {
        attempt(&request, &mut Rda::new(&case.model, record, &case.noise)?)?
    } else {
        let o = ident::Options { substeps: 1, ..ffid::ident::Options::new(case.noise) };
        fit(case, record, &o, &request)?
    };
    let errors: Vec<f64> = case.selected.iter().map(|&i| e.values[i] - truth[i]).collect();
    let (known, worst) = e.data_only.worst_combination(&errors, IDENTIFIABLE);
    if worst > RECOVERED {
        for p in &e.parameters {
            eprintln!("   {:16} {:10.4} -> {:10.4} truth {:10.4}", p.name, p.start, p.value, case.true_value(&p.name));
        }
        eprintln!(
            "{} from start {seed}: {:?} after {} iterations, chi2/dof {:.2e}",
            case.name, e.status, e.iterations, e.chi2_per_dof
        );
    }
    Ok(Recovery { identifiable: known, error: Number(worst), iterations: e.iterations })
}
