//! `cargo xtask study starts`: does the fit find the truth, wherever within 70 % of the prior it is?
//!
//! The paper's robot with panels. A truth moves the base (mass, each principal second moment, the centre of mass by the
//! gyration radius), each hinge stiffness and each damping by its own even draw from -70 % to 70 %; the prior is the mission
//! file. The record is the paper's manoeuvre, the free decay after it, and the information plan of the prior, sensed at
//! 100 Hz. The fit knows the prior and the record:
//!
//! 1. modes of the decay (`ff_spectral::modal::fit`),
//! 2. all parameters from them, under the prior (`ident::modal::estimate`): the first start. Others, tried until three
//!    agree on the lowest end (without noise: until one explains the record): stiffness and damping alone from the modes; the prior; draws around it;
//! 3. output error for base, stiffness and damping over the beginning of the record, then over every tenth sample of it, then
//!    over the whole (`ident::compose::continuation`).
//!
//! Parts for `--only`: `exact` (noise-free; found means every combination that the sensors would tell to 10 % is right to
//! 1e-6 of its size), `noisy` (found means that the fit explains the record better than the truth does, and by no more than chance
//! does but once in a million: the truth lies in the likelihood region of the answer), `prior` (noise-free, from the prior itself, without the modal step: what the step is worth). A number, such as 1028, is one truth alone.

use super::cpu::CpuTime;
use super::figures::{Op, Study};
use super::options::Options;
use super::trials::{Number, Trial, Trials};
use crate::workspace;
use anyhow::Context;
use excitation::plan::{Extent, Shape};
use excitation::plan_information;
use excitation::planning::InformationRequest;
use excitation::{End, JointCommand, Manoeuvre, ManoeuvreSpec, SensorNoise};
use ff_dynamics::motion::JointMotion;
use ff_dynamics::sim::Channel;
use ff_dynamics::{Boundary, SensorSuite, SimOptions, Trace, measure, modes};
use ff_least_squares::Settings;
use ff_mission::{LoadOptions, Loaded, Mission};
use ff_model::{Model, ParamDecl, Params};
use ff_records::{Record, RecordBuilder};
use ff_spectral::{ModalSettings, fit_modes};
use ffid::sense::from_rest;
use ident;
use ident::compose::{Accept, Pass, estimate_staged};
use ident::estimate::attempt;
use ident::modal::HeldPose;
use ident::modal::{ModalRequest, estimate_modal};
use ident::parameters::random_start;
use ident::parameters::select;
use ident::{Estimator, Noise, OutputError, Request};
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// How far truths lie from the prior.
const WIDTH: f64 = 0.7;
/// Step (s) of the simulated truth.
const STEP: f64 = 2e-3;
/// Free decay and information plan (s).
const DECAY_S: f64 = 32.0;
const PLAN_S: f64 = 30.0;
/// Highest frequency looked at (Hz).
const F_MAX: f64 = 2.0;
/// Relative deviation up to which a combination counts as known.
const KNOWN: f64 = 0.1;

/// One motion after the other.
struct Sequence {
    parts: Vec<(f64, Box<dyn JointMotion>)>,
}

impl JointMotion for Sequence {
    fn dof(&self) -> usize {
        self.parts.first().map_or(0, |p| p.1.dof())
    }
    fn duration(&self) -> f64 {
        self.parts.last().map_or(0.0, |p| p.0 + p.1.duration())
    }
    fn eval(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        if let Some((from, part)) = self.parts.iter().rev().find(|p| p.0 <= t).or(self.parts.first()) {
            part.eval((t - from).clamp(0.0, part.duration()), q, qd, qdd);
        }
    }
    fn breaks(&self) -> Vec<f64> {
        self.parts
            .iter()
            .flat_map(|(from, p)| [vec![*from], p.breaks().iter().map(|t| from + t).collect()].concat())
            .collect()
    }
}

/// What all truths share.
struct Setup {
    loaded: Loaded,
    decls: Vec<ParamDecl>,
    prior: Vec<f64>,
    selected: Vec<usize>,
    hinges: Vec<usize>,
    motion: Sequence,
    /// The decay lies between these times (s), with the joints here.
    decay: (f64, f64),
    pose: Vec<f64>,
    noise: Noise,
    sensors: SensorSuite,
    rate: f64,
}

impl Setup {
    fn new(options: &Options) -> anyhow::Result<Self> {
        let file = workspace::root()?.join("fixtures/paper/flex.toml");
        let loaded = Mission::load(&file, &ffid::default_registry(), &LoadOptions::default())?;
        let (m, s) = (&loaded.model, &loaded.mission.sensors);
        let r = loaded.mission.reproduce.as_ref().context("section [reproduce]")?;
        let limits = ffid::workflow::preflight::joint_limits(m, &loaded.mission.limits);
        let prior = Params::<f64>::nominal(m);
        let rest = m.rest_position(&prior);
        let known = modes(m, &prior, &r.hold_rad, &rest, Boundary::JointsHeld)?;
        let turning = |m: &ff_dynamics::Mode| m.base.fixed_rows::<3>(3).norm();
        let frequency = known.iter().max_by(|a, b| turning(a).total_cmp(&turning(b))).context("no mode")?.frequency_hz;
        let commands = r.manoeuvre_joints.iter().map(|n| {
            let joint = m.joint_names().iter().position(|x| x == n).context("manoeuvre joint")?;
            Ok(JointCommand {
                joint,
                shape: Shape::Doublet,
                extent: Extent::HalfPeriod { frequency, negative: false },
                velocity: limits[joint].velocity,
                acceleration: limits[joint].acceleration,
            })
        });
        let manoeuvre = Manoeuvre::new(&ManoeuvreSpec {
            start: r.hold_rad.clone(),
            commands: commands.collect::<anyhow::Result<_>>()?,
            ramp: 0.1,
            lead: 1.0,
            hold: DECAY_S,
            grid: Some(1.0 / s.rate_hz),
        })?;
        let mut pose = vec![0.0; m.nj()];
        let (mut qd, mut qdd) = (pose.clone(), pose.clone());
        manoeuvre.eval(manoeuvre.duration(), &mut pose, &mut qd, &mut qdd);
        let noise = Noise { torque: s.torque.noise_std_nm, gyro: s.gyro.noise_std_rad_per_s };
        let plan = plan_information(
            m,
            &prior,
            &(0..10).collect::<Vec<_>>(),
            &InformationRequest {
                start: pose.clone(),
                end: End::Free,
                limits,
                duration: PLAN_S,
                control_points: 10,
                seed: options.seed,
                starts: 1,
                noise: SensorNoise { torque: noise.torque, gyro: Some(noise.gyro), rate: s.rate_hz },
                options: Default::default(),
            },
        )?;
        let decls = m.param_decls();
        let plain = |noise_std: f64| Channel { noise_std, ..Channel::default() };
        let sensors = SensorSuite { torque: plain(noise.torque), gyro: plain(noise.gyro), encoder: Channel::default() };
        // On the sampling grid, so that the record has a sample at every kink of the manoeuvre.
        let after = (manoeuvre.duration() * s.rate_hz).round() / s.rate_hz;
        Ok(Self {
            selected: select(&decls, &["base.*", "panel_*.k[*]", "panel_*.d[*]"])?,
            hinges: select(&decls, &["panel_*.k[*]", "panel_*.d[*]"])?,
            decay: (manoeuvre.ringing().0, after),
            motion: Sequence { parts: vec![(0.0, Box::new(manoeuvre)), (after, Box::new(plan.motion))] },
            pose,
            decls,
            prior: prior.values().to_vec(),
            noise,
            sensors,
            rate: s.rate_hz,
            loaded,
        })
    }
    fn model(&self) -> &Model {
        &self.loaded.model
    }
    fn fly(&self, truth: &[f64]) -> anyhow::Result<Trace> {
        let m = self.model();
        let p = Params::from_values(m, truth.to_vec());
        let o = SimOptions { duration_s: self.motion.duration(), step_s: STEP, sample_s: 1.0 / self.rate };
        Ok(from_rest(m, &p, &self.motion, &o)?)
    }
    /// What the sensors read; the controller logs the motion it commands.
    fn record(&self, t: &Trace, noise: Option<u64>) -> anyhow::Result<Record> {
        let b = RecordBuilder::new(self.model().joint_names()).uniform(0.0, self.rate).allow("Data::Stuck");
        let b = b.q(t.q.clone()).qd(t.qd.clone()).qdd(t.qdd.clone());
        let b = match noise {
            None => b.tau(t.tau.clone()).gyro(t.gyro()),
            Some(seed) => {
                let r = measure(t, &self.sensors, seed);
                b.tau(r.tau).gyro(r.gyro)
            }
        };
        Ok(b.build()?.0)
    }
    /// Start values, best first, and the number of modes matched: everything from the modes of the decay under the prior,
    /// stiffness and damping from them with the base of the prior, the prior; then as many draws around the prior.
    fn starts(&self, record: &Record, seed: u64) -> anyhow::Result<(Vec<Vec<f64>>, usize)> {
        let m = self.model();
        let sigma: Vec<f64> =
            std::iter::repeat_n(self.noise.torque, m.nj()).chain(std::iter::repeat_n(self.noise.gyro, 3)).collect();
        let decay = record.window(self.decay.0, self.decay.1)?;
        let fit = fit_modes(&decay.responses(), &sigma, self.rate, &ModalSettings::up_to(F_MAX))?;
        let eta = m.rest_position(&Params::from_values(m, self.prior.clone()));
        let pose = HeldPose { q: &self.pose, eta: &eta, boundary: Boundary::JointsHeld };
        let of = |selected: &[usize], floor: f64| {
            let request = ModalRequest {
                prior_width: Some(0.5 * WIDTH),
                // The decay is not quite linear, and the rest of the model not known.
                floor: (floor, floor),
                shapes: Some(5.0 * floor),
                ..ModalRequest::new(m, pose, (&self.decls, selected, &self.prior), &sigma, F_MAX)
            };
            estimate_modal(&request, &fit)
        };
        let (mut out, mut matched) = (Vec::new(), 0);
        for (selected, floor) in [(&self.selected, 0.01), (&self.hinges, 0.05)] {
            if let Ok(e) = of(selected, floor) {
                matched = matched.max(e.matching.pairs.len());
                let mut v = e.estimate.values;
                // A body at the edge of what can exist is no start: half way back to the prior it is well inside.
                for i in 0..10 {
                    v[i] = 0.5 * (v[i] + self.prior[i]);
                }
                out.push(v);
            }
        }
        out.push(self.prior.clone());
        let draw = |k| random_start(&self.decls, &self.prior, &self.selected, WIDTH, seed.wrapping_mul(31) + 7 + k);
        out.extend((0..DRAWS).map(draw));
        Ok((out, matched))
    }
}

/// Samples thinned to for the first pass: 10 Hz, ten per period of a mode at 1 Hz.
const THIN: usize = 10;
/// The first pass ends this long (s) after the manoeuvre, about a period of the slowest mode.
const SHORT_S: f64 = 9.0;
/// `chi^2` per degree of freedom up to which a noise-free record is explained, thinned and whole: what integrating with
/// coarser steps than the truth leaves is a thousandth of it.
const EXACT: Accept = Accept { coarse: 1e-4, fine: 1e-8, agree: 1 };
/// Draws around the prior that are tried when modes and prior have led nowhere.
const DRAWS: u64 = 20;

/// What came of one truth.
#[derive(Serialize, Deserialize)]
struct Outcome {
    found: bool,
    /// Largest error of a known combination, relative (exact), or what chi squared is below that of the truth, per parameter (noisy).
    error: Number,
    iterations: usize,
    /// Starts tried, and steps on the thinned record.
    starts: usize,
    coarse: usize,
    seconds: f64,
    matched: usize,
    text: String,
}

#[derive(Clone, Copy, PartialEq)]
enum Part {
    Exact,
    Noisy,
    Prior,
}

fn one(x: &Setup, trial: Trial, part: Part) -> anyhow::Result<Outcome> {
    let seed = trial.own_seed();
    let truth = random_start(&x.decls, &x.prior, &x.selected, WIDTH, seed);
    let record = x.record(&x.fly(&truth)?, (part == Part::Noisy).then_some(seed))?;
    let begun = CpuTime::begin();
    let whole = ident::Options { substeps: 1, ..ident::Options::new(x.noise) };
    let mut output_error = OutputError::new(x.model(), &record, &whole)?;
    let request = Request {
        anchor: if part == Part::Noisy { None } else { Some(10.0) },
        settings: Settings {
            max_iterations: 100,
            cost_floor: 1e-13,
            decrement_tolerance: 1e-10,
            ..Settings::default()
        },
        ..Request::new(&x.decls, &x.selected, &x.prior)
    };
    let (e, matched, trials) = if part == Part::Prior {
        (attempt(&request, &mut output_error)?, 0, Vec::new())
    } else {
        let (starts, matched) = x.starts(&record, seed)?;
        let thin = record.thinned(THIN)?;
        let short = thin.window(0.0, x.decay.0 + SHORT_S)?;
        let rough = ident::Options { substeps: 2, ..whole.clone() };
        let mut on_short = OutputError::new(x.model(), &short, &rough)?;
        let mut on_thin = OutputError::new(x.model(), &thin, &rough)?;
        let accept = if part == Part::Noisy { Accept::noise(on_thin.rows(), output_error.rows()) } else { EXACT };
        let settings = Settings { max_iterations: 50, decrement_tolerance: 1e-3, ..Settings::default() };
        let first = Request { anchor: None, settings, ..request.clone() };
        // The short record does not tell everything; what it leaves open stays near the prior.
        let beginning = Request { prior_width: Some(WIDTH), ..first.clone() };
        let mut passes =
            [Pass { request: beginning, estimator: &mut on_short }, Pass { request: first, estimator: &mut on_thin }];
        let mut last = Pass { request: request.clone(), estimator: &mut output_error };
        let s = estimate_staged(&mut passes, &mut last, &starts, accept)?;
        (s.estimate, matched, s.trials)
    };
    let seconds = begun.seconds();
    let errors: Vec<f64> = x.selected.iter().map(|&i| e.values[i] - truth[i]).collect();
    let (known, worst) = e.data_only.worst_combination(&errors, KNOWN);
    // What the truth itself leaves. The best fit leaves less, by chi squared with one degree of freedom per parameter (Wilks 1938),
    // however bent the valley is. That exceeds n + 2 sqrt(n t) + 2 t with a probability below exp(-t) (Laurent and Massart, 2000,
    // lemma 1). A fit that leaves more than the truth has ended elsewhere.
    let mut left = vec![0.0; output_error.rows()];
    output_error.residuals(&truth, &[], &mut left)?;
    let square = |r: &[f64]| r.iter().map(|r| r * r).sum::<f64>();
    let below = square(&left) - square(&e.residuals);
    let (found, error) = if part == Part::Noisy {
        let (n, t) = (errors.len() as f64, 1e6f64.ln());
        let likely = (0.0..n + 2.0 * (n * t).sqrt() + 2.0 * t).contains(&below);
        (e.status.is_converged() && likely, below / n)
    } else {
        (worst < 1e-6, worst)
    };
    let worst_of = |n: usize| {
        let mut off: Vec<(f64, &str)> =
            x.selected.iter().zip(&errors).map(|(&i, d)| (d / truth[i], &*x.decls[i].name)).collect();
        off.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
        off.iter().take(n).map(|(d, name)| format!("{name} {:+.2} %", 100.0 * d)).collect::<Vec<_>>().join(", ")
    };
    let tried: Vec<String> = trials
        .iter()
        .map(|t| {
            format!("start {} ({} steps, chi2/dof {:.1e})", t.start, t.iterations, t.chi2_per_dof.unwrap_or(f64::NAN))
        })
        .collect();
    let tried = tried.join(", ");
    let text = format!(
        "{} truth {seed}: {:?}, chi2/dof {:.2e}, {known} of {} combinations known, error {error:.1e}, chi2 {below:.1} below that of the truth, farthest {}, {matched} modes, {} steps from {tried}, {seconds:.1} s",
        ["exact", "noisy", "prior"][part as usize],
        e.status,
        e.chi2_per_dof,
        x.selected.len(),
        worst_of(4),
        e.iterations
    );
    eprintln!("{text}");
    Ok(Outcome {
        found: found && known >= x.selected.len() / 2,
        error: Number(error),
        iterations: e.iterations,
        starts: trials.len(),
        coarse: trials.iter().map(|t| t.iterations).sum(),
        seconds,
        matched,
        text,
    })
}

/// Runs the study.
///
/// # Errors
/// Of the mission, the plan and the simulations. Fits that fail are counted, not errors.
pub fn run(options: &Options) -> anyhow::Result<Study> {
    let mut study = Study::new("starts", options.seed);
    let trials = Trials::open("starts", 1, options)?;
    let x = Setup::new(options)?;
    let truths = if options.quick { 6 } else { 100 };
    study.figure("record", "s", x.motion.duration());
    study.figure("parameters", "", x.selected.len() as f64);
    let extra = options.lists("prior");
    let mut parts = vec![(Part::Exact, "exact"), (Part::Noisy, "noisy"), (Part::Prior, "prior")];
    parts.retain(|(part, name)| options.wants(name) && (*part != Part::Prior || extra));
    let mut numbers: Vec<u64> = (0..truths).collect();
    let begun = Instant::now();
    // A number among the parts is the seed of a truth to look at by itself.
    let listed = options.cases();
    let seed = |number| Trial { seed: options.seed, number }.own_seed();
    numbers.retain(|k| listed.is_empty() || listed.contains(&seed(*k)));
    for (part, name) in parts {
        let mut numbers = numbers.clone();
        // A way that leads along the edge of what can exist, with the first seed.
        if part == Part::Exact && options.quick && listed.is_empty() {
            numbers.push(28);
        }
        let truths = numbers.len();
        // A fit that fails is a result, too.
        let all = trials.run(name, numbers.iter().copied(), |t| {
            Ok(one(&x, t, part).map_err(|e| format!("{name}: truth {}: {e:#}", t.own_seed())))
        })?;
        let mut good: Vec<&Outcome> = Vec::new();
        for o in &all {
            match o {
                Ok(o) if o.found => good.push(o),
                Ok(o) => study.note(o.text.clone()),
                Err(text) => study.note(text.clone()),
            }
        }
        let of = |f: &dyn Fn(&Outcome) -> f64| -> Vec<f64> {
            let mut v: Vec<f64> = good.iter().map(|o| f(o)).collect();
            v.sort_by(f64::total_cmp);
            v
        };
        let median = |v: &[f64]| v.get(v.len() / 2).copied().unwrap_or(f64::NAN);
        let last = |v: &[f64]| v.last().copied().unwrap_or(f64::NAN);
        let found = good.len() as f64;
        if part == Part::Prior {
            study.figure(format!("{name}.found"), "", found);
        } else {
            study.limited(format!("{name}.found"), "", found, Op::AtLeast, truths as f64);
        }
        let (seconds, steps, error) = (of(&|o| o.seconds), of(&|o| o.iterations as f64), of(&|o| o.error.0));
        study.figure(format!("{name}.seconds_median"), "s", median(&seconds));
        study.figure(format!("{name}.seconds_max"), "s", last(&seconds));
        study.figure(format!("{name}.steps_median"), "", median(&steps));
        study.figure(format!("{name}.steps_max"), "", last(&steps));
        if part != Part::Prior {
            let starts = of(&|o| o.starts as f64);
            study.figure(format!("{name}.first_start"), "", starts.iter().filter(|s| **s == 1.0).count() as f64);
            study.figure(format!("{name}.starts_max"), "", last(&starts));
            study.figure(format!("{name}.coarse_steps_median"), "", median(&of(&|o| o.coarse as f64)));
        }
        study.figure(format!("{name}.error_max"), "", last(&error));
        study.figure(format!("{name}.modes_matched_median"), "", median(&of(&|o| o.matched as f64)));
    }
    study.figure("elapsed", "s", begun.elapsed().as_secs_f64());
    trials.note().into_iter().for_each(|n| study.note(n));
    Ok(study)
}
