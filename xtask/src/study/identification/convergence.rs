//! `cargo xtask study convergence`: does a fit end at the answer, from whatever the mission says?
//!
//! Five systems (rigid, flexible, sloshing, both, with an unknown payload), each with a noisy record of the motion that tells most of the
//! base, and a wing that is a beam in the world and three hinges in the mission, with two records (`beam`), identified by `ffid identify`'s own call with its default options. The mission's values are wrong: the base as a whole
//! (mass, first moment and inertia by one factor), every stiffness, damping, mass and length of an appendage by a factor of its own, each
//! from 1/5 to 5, evenly in its logarithm. A trial ends at the best known minimum when its chi-squared is at most 1 above the lowest that any
//! trial of its system, or the fit from the truth, has reached: along any one parameter, less than a standard deviation away. An exit code fits
//! when it is 0 at that minimum and 14 where there is none; 13 (not identifiable) fits nowhere, as the truth is identifiable.
//! Parts for `--only`: the systems; a number is one start. Times are those that the fit has computed, on one core.

use super::beam::Beam;
use super::case::{COMBINED, Case, FLEXIBLE, Kind, PAYLOAD, RIGID, SLOSH};
use crate::study::cpu::CpuTime;
use crate::study::figures::{Op, Study};
use crate::study::options::Options;
use crate::study::trials::{Number, Trial, Trials};
use ff_dynamics::measure;
use ff_model::{Model, ParamGroup, Params, Problems};
use ff_records::Record;
use ffid::exit::Exit;
use ffid::open::Opened;
use ffid::workflow::identify::{
    EXPLAINED, FitOptions, LabelledRecord, Observer, Provenance, RecordLine, Settings, identify,
};
use ident::parameters::select;
use ident::{Loss, Noise};
use rand::RngExt;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Record (s), its sampling, and that of the quick study.
const RECORD_S: f64 = 40.0;
const SAMPLE_S: f64 = 0.01;
const QUICK_SAMPLE_S: f64 = 0.05;
/// Sampling of the two records of the beam.
const BEAM_SAMPLE_S: f64 = 0.02;
/// Name of the part whose wing is a beam.
const BEAM: &str = "beam";
/// Largest factor on what the mission says.
const FACTOR: f64 = 5.0;
/// Chi-squared above the lowest known up to which an end is that minimum.
const SAME: f64 = 1.0;
/// Starts per system.
const STARTS: u64 = 200;
const QUICK_STARTS: u64 = 2;

/// What came of one start.
#[derive(Clone, Serialize, Deserialize)]
struct End {
    /// Sum of squared residuals; none without a result.
    chi2: Option<Number>,
    exit: u8,
    iterations: usize,
    seconds: f64,
    text: String,
}

/// Runs the study.
///
/// # Errors
/// Of the missions, plans and simulations. Fits that fail are counted, not errors.
pub fn run(options: &Options) -> anyhow::Result<Study> {
    let mut study = Study::new("convergence", options.seed);
    let trials = Trials::open("convergence", 2, options)?;
    // A number among the parts is a start to look at by itself, beside that at the truth.
    let listed = options.cases();
    let starts = if options.quick && listed.is_empty() { QUICK_STARTS } else { STARTS };
    let sample_s = if options.quick { QUICK_SAMPLE_S } else { SAMPLE_S };
    let wanted = |k: &u64| *k == 0 || listed.is_empty() || listed.contains(k);
    let numbers: Vec<u64> = (0..=starts).filter(wanted).collect();
    for kind in [RIGID, FLEXIBLE, SLOSH, COMBINED, PAYLOAD] {
        if options.wants(kind.name) {
            system(&System::exact(kind, sample_s, options.seed)?, &numbers, options, &trials, &mut study)?;
        }
    }
    if options.wants(BEAM) {
        let sample_s = if options.quick { QUICK_SAMPLE_S } else { BEAM_SAMPLE_S };
        system(&System::beam(sample_s, options.seed)?, &numbers, options, &trials, &mut study)?;
    }
    trials.note().into_iter().for_each(|n| study.note(n));
    study
        .note(format!("{starts} starts per system, values of the mission from 1/{FACTOR} to {FACTOR} times the truth"));
    Ok(study)
}

/// What is identified from every start.
struct System {
    name: &'static str,
    /// With the values that starts are factors of.
    model: Model,
    selected: Vec<usize>,
    noise: Noise,
    records: Vec<LabelledRecord>,
}

impl System {
    /// The mission is the world but for its values.
    fn exact(kind: Kind, sample_s: f64, seed: u64) -> anyhow::Result<Self> {
        let case = Case::new(kind, RECORD_S, false, seed)?;
        let trace = case.simulate(sample_s)?;
        let read = measure(&trace, &case.sensors, seed);
        let record = case.record(sample_s).q(trace.q.clone()).qd(trace.qd.clone()).qdd(trace.qdd.clone());
        let record = record.tau(read.tau).gyro(read.gyro).build()?.0;
        let Case { name, model, selected, noise, .. } = case;
        Ok(Self { name, model, selected, noise, records: labelled(vec![record]) })
    }
    /// A beam in the world, three hinges in the mission.
    fn beam(sample_s: f64, seed: u64) -> anyhow::Result<Self> {
        let Beam { model, noise, records } = Beam::new(sample_s, seed)?;
        let selected = select(&model.param_decls(), &["base.*", "wing.k[*]", "wing.d[*]", "tank.*"])?;
        Ok(Self { name: BEAM, model, selected, noise, records: labelled(records) })
    }
}

fn labelled(records: Vec<Record>) -> Vec<LabelledRecord> {
    let one = |(k, record)| LabelledRecord {
        label: format!("record{}", k + 1),
        record,
        resampled: (false, false),
        continues: false,
        ago: 0,
    };
    records.into_iter().enumerate().map(one).collect()
}

fn system(of: &System, numbers: &[u64], options: &Options, trials: &Trials, study: &mut Study) -> anyhow::Result<()> {
    // Trial 0 starts at the truth: what the others are measured by.
    let all: Vec<End> = trials.run(of.name, numbers.iter().copied(), |t| one(of, t))?;
    let best = all.iter().filter_map(|e| e.chi2.as_ref()).map(|c| c.0).fold(f64::INFINITY, f64::min);
    let ends = all.get(1..).unwrap_or_default();
    let there = |e: &End| e.chi2.as_ref().is_some_and(|c| c.0 <= best + SAME);
    let fits = |e: &End| if there(e) { e.exit == Exit::Done.code() } else { e.exit == Exit::Numerical.code() };
    let mut seconds: Vec<f64> = ends.iter().map(|e| e.seconds).collect();
    seconds.sort_by(f64::total_cmp);
    let share = |n: usize| n as f64 / ends.len().max(1) as f64;
    let name = |what: &str| format!("{}.{what}", of.name);
    study.figure(name("unknowns"), "", of.selected.len() as f64);
    study.figure(name("chi2_best"), "", best);
    let iterations = ends.iter().map(|e| e.iterations).sum::<usize>();
    study.figure(name("linearisations_mean"), "", share(iterations));
    let reached = share(ends.iter().filter(|e| there(e)).count());
    study.judged(options.quick, name("at_best_minimum"), "", reached, (Op::AtLeast, 0.99));
    let median = seconds.get(seconds.len() / 2).copied().unwrap_or(f64::NAN);
    study.judged(options.quick, name("seconds_median"), "s", median, (Op::AtMost, 3.0));
    let worst = seconds.last().copied().unwrap_or(f64::NAN);
    study.judged(options.quick, name("seconds_max"), "s", worst, (Op::AtMost, 30.0));
    let wrong = ends.iter().filter(|e| !fits(e)).count();
    study.judged(options.quick, name("exit_codes_wrong"), "", wrong as f64, (Op::AtMost, 0.0));
    for e in ends.iter().filter(|e| !there(e) || !fits(e)) {
        study.note(e.text.clone());
    }
    Ok(())
}

/// A mission whose values are off by up to [`FACTOR`]; the truth for trial 0.
fn start(of: &System, trial: &Trial) -> Vec<(usize, f64)> {
    let mut rng = trial.rng();
    let mut factor = || FACTOR.powf(rng.random_range(-1.0..1.0));
    let of_base = factor();
    let (decls, truth) = (of.model.param_decls(), Params::<f64>::nominal(&of.model));
    let truth = truth.values();
    if trial.number == 0 {
        return Vec::new();
    }
    let one = |&i: &usize| match &decls[i].group {
        ParamGroup::Inertial(_) if i < 10 => Some((i, truth[i] * of_base)),
        ParamGroup::Positive => Some((i, truth[i] * factor())),
        _ => None,
    };
    of.selected.iter().filter_map(one).collect()
}

fn one(of: &System, trial: Trial) -> anyhow::Result<End> {
    let mut model = of.model.clone();
    model.set_nominal(&start(of, &trial)).map_err(|p| anyhow::anyhow!("{p}"))?;
    let opened = Opened {
        model,
        mission: None,
        estimated: of.selected.clone(),
        excited: Vec::new(),
        end_effector: None,
        inputs: Vec::new(),
        warnings: Problems::default(),
    };
    // The defaults of the command.
    let settings = Settings {
        adopt: Vec::new(),
        method: None,
        noise: of.noise,
        biases: true,
        initial_state: false,
        prior: None,
        start_offset: 0.0,
        seed: 0,
        max_iterations: 100,
        limit: EXPLAINED,
        loss: Loss::Squares,
        current_noise: 0.0,
        drives: Vec::new(),
        reflected_inertia: Vec::new(),
        held_errors: Vec::new(),
        low_pass_hz: None,
    };
    let provenance = Provenance {
        program: "cargo xtask study convergence".to_owned(),
        inputs: Vec::new(),
        record: RecordLine { samples: 0, rate_hz: 0.0, seconds: 0.0, t0: 0.0, rates: true },
        noise_torque_nm: of.noise.torque,
        noise_gyro_rad_per_s: of.noise.gyro,
        settings: BTreeMap::new(),
    };
    let begun = CpuTime::begin();
    let found = identify(&opened, &of.records, &settings, &FitOptions::default(), provenance, &Observer::default());
    let seconds = begun.seconds();
    let name = format!("{} start {}", of.name, trial.number);
    let end = match found {
        Ok(found) => {
            let r = &found.result;
            let chi2 = r.chi2_per_dof * (r.residuals - r.rank.min(r.residuals)).max(1) as f64;
            let text = format!(
                "{name}: {}, chi2/dof {:.4}, {} linearisations, {seconds:.1} s, exit code {}",
                r.status,
                r.chi2_per_dof,
                r.iterations,
                r.exit().code()
            );
            End { chi2: Some(Number(chi2)), exit: r.exit().code(), iterations: r.iterations, seconds, text }
        }
        Err(e) => {
            let text = format!("{name}: {e}, {seconds:.1} s");
            End { chi2: None, exit: Exit::Numerical.code(), iterations: 0, seconds, text }
        }
    };
    eprintln!("{}", end.text);
    Ok(end)
}
