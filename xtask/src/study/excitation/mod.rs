//! `cargo xtask study excitation`: what planned excitation is worth on the paper's robot with panels.
//!
//! Issue 5's figures, each beside its limit: the information plan against random multisines, the quiet plan's silence and
//! bias, the modal plan's response, limits between the knots, gradients, and the time that eq. (9) takes.
//! `docs/theory/excitation.md` explains the terms. Parts for `--only`: `gradients`, `limits`, `information` (with `quiet`), `modal`,
//! `times`.
mod checks;
mod multisine;
mod truth;

use super::figures::{Op, Study};
use super::options::Options;
use super::trials::{Number, Trial, Trials};
use crate::workspace;
use anyhow::Context;
use excitation::JointLimits;
use excitation::objective::{
    Disturbance, Information, ModalResponse, Quiet, RelativeQuantity, ResponseTarget, Robust, relative_deviations,
};
use excitation::plan::{Extent, Shape};
use excitation::plan_fisher;
use excitation::planning::{FisherRequest, base_quantities};
use excitation::solve::{Outcome, minimise};
use excitation::system::flexible::{Estimated, FlexibleRequest, Nuisance};
use excitation::system::rigid::RigidBase;
use excitation::{
    Cost, CostSum, Criterion, Duration, End, FlexibleInformation, PlanSpec, RigidInformation, SensorNoise, SplinePlan,
    SqpOptions, random_plan,
};
use excitation::{JointCommand, Manoeuvre, ManoeuvreSpec};
use ff_dynamics::motion::JointMotion;
use ff_mission::{LoadOptions, Loaded, Mission};
use ff_model::{Model, Params};
use multisine::Multisine;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use std::time::Instant;
use truth::Swing;

/// Record (s) of the comparison.
const RECORD_S: f64 = 60.0;
/// Free control points per joint.
const CONTROL_POINTS: usize = 10;
/// Step (s) of the information while it is searched on, and where it is reported.
const SEARCH_STEP_S: f64 = 0.15;
const REPORT_STEP_S: f64 = 0.05;
/// Smoothing of the largest deviation.
const POWER: f64 = 8.0;
/// Bounds (s) of a free duration.
const FREE: Duration = Duration::Free { min: 40.0, max: RECORD_S };

/// The mission and what all parts of the study need of it.
struct Setup {
    loaded: Loaded,
    params: Params<f64>,
    start: Vec<f64>,
    limits: Vec<JointLimits>,
    noise: SensorNoise,
    seed: u64,
    quick: bool,
}

impl Setup {
    fn new(options: &Options) -> anyhow::Result<Self> {
        let file = workspace::root()?.join("fixtures/paper/flex.toml");
        let loaded = Mission::load(&file, &ffid::default_registry(), &LoadOptions::default())?;
        let m = &loaded.mission;
        let noise = SensorNoise {
            torque: m.sensors.torque.noise_std_nm,
            gyro: Some(m.sensors.gyro.noise_std_rad_per_s),
            rate: m.sensors.rate_hz,
        };
        Ok(Self {
            start: m.reproduce.as_ref().context("section [reproduce]")?.hold_rad.clone(),
            limits: ffid::workflow::preflight::joint_limits(&loaded.model, &m.limits),
            params: Params::nominal(&loaded.model),
            noise,
            seed: options.seed,
            quick: options.quick,
            loaded,
        })
    }
    fn model(&self) -> &Model {
        &self.loaded.model
    }
    fn plan(&self, duration: Duration, free: usize) -> anyhow::Result<SplinePlan> {
        Ok(SplinePlan::new(PlanSpec {
            start: self.start.clone(),
            end: End::Free,
            duration,
            degree: 5,
            free,
            limits: self.limits.clone(),
            refine: 1,
        })?)
    }
    /// The base is what the record is made for. Stiffness and damping of the panels, biases and the start of the
    /// panels are not known either.
    fn information(&self, step: f64) -> anyhow::Result<FlexibleInformation> {
        let others = self.loaded.estimated.iter().filter(|&&i| i >= 10);
        let prior = self.loaded.mission.estimate.prior_relative_std.unwrap_or(0.3);
        let value = |i: usize| self.params.values()[i].abs();
        let request = FlexibleRequest {
            named: (0..10).map(|index| Estimated { index, prior: None }).collect(),
            others: others.map(|&index| Estimated { index, prior: Some(prior * value(index)) }).collect(),
            noise: self.noise,
            accelerometer: None,
            nuisance: Nuisance {
                gyro_bias: Some(1e-4),
                torque_bias: Some(0.05),
                accel_bias: None,
                deflection: Some(1e-3),
                rate: Some(1e-3),
            },
            step,
        };
        Ok(FlexibleInformation::new(self.model(), &self.params, &request)?)
    }
    fn rigid(&self) -> anyhow::Result<RigidInformation> {
        let base: Vec<usize> = (0..10).collect();
        Ok(RigidInformation::new(self.model(), &self.params, &base, self.noise)?)
    }
    fn rigid_cost(&self) -> anyhow::Result<Information<RigidInformation>> {
        Ok(Information { source: self.rigid()?, samples: 121, rate: self.noise.rate, delta: 1e-4 })
    }
    fn options(&self, iterations: usize) -> SqpOptions {
        SqpOptions { iterations: if self.quick { iterations / 10 + 1 } else { iterations }, ..SqpOptions::default() }
    }
}

/// Runs the study.
///
/// # Errors
/// Files that cannot be read, and whatever a plan fails of.
pub fn run(options: &Options) -> anyhow::Result<Study> {
    let trials = Trials::open("excitation", 1, options)?;
    let setup = Setup::new(options)?;
    let mut study = Study::new("excitation", options.seed);
    if options.wants("gradients") {
        study.part(&trials, "gradients", |study| checks::gradients(&setup, study))?;
    }
    if options.wants("limits") {
        study.part(&trials, "limits", |study| checks::violations(&setup, study))?;
    }
    let wanted = ["information", "quiet"].map(|part| options.wants(part));
    if wanted.contains(&true) {
        study.part(&trials, "information", |study| {
            let loud = information(&setup, &trials, study)?;
            quiet(&setup, &trials, study, &*loud)
        })?;
    }
    if options.wants("modal") {
        study.part(&trials, "modal", |study| modal(&setup, &trials, study))?;
    }
    if options.wants("times") {
        study.part(&trials, "times", |study| checks::times(&setup, study))?;
    }
    trials.note().into_iter().for_each(|n| study.note(n));
    Ok(study)
}

/// The end of one search.
#[derive(Serialize, Deserialize)]
struct Searched {
    cost: Number,
    x: Vec<f64>,
    /// Status and iterations, in words.
    how: String,
}

/// Searches from several random plans, each a trial of `part`; the end of lowest cost, if any has one.
fn best_of(
    trials: &Trials,
    part: &str,
    starts: u64,
    search: impl Fn(Trial) -> anyhow::Result<Outcome> + Sync,
) -> anyhow::Result<Option<Searched>> {
    // A search that fails is a result, too: others may not.
    let all: Vec<Option<Searched>> = trials.run(part, 0..starts, |t| {
        Ok(search(t).ok().map(|o| Searched {
            cost: Number(o.cost),
            how: format!("{:?} after {} iterations", o.status, o.iterations),
            x: o.x,
        }))
    })?;
    Ok(all.into_iter().flatten().min_by(|a, b| a.cost.0.total_cmp(&b.cost.0)))
}

fn largest(f: &DMatrix<f64>, quantities: &[RelativeQuantity]) -> f64 {
    relative_deviations(f, quantities).into_iter().fold(0.0, f64::max)
}

/// The information plan against random feasible multisines.
fn information(s: &Setup, trials: &Trials, study: &mut Study) -> anyhow::Result<Box<dyn JointMotion>> {
    let report = s.information(REPORT_STEP_S)?;
    let quantities = base_quantities(&report).context("all ten parameters of the base")?;
    let rate = |m: &dyn JointMotion| report.of_motion(m).map_or(f64::INFINITY, |f| largest(&f, &quantities));
    let count = if s.quick { 6 } else { 100 };
    let one = |t: Trial| Ok(Number(rate(&Multisine::new(&s.start, &s.limits, RECORD_S, t.rng()))));
    let mut random: Vec<f64> = trials.run("multisine", 0..count, one)?.into_iter().map(|r| r.0).collect();
    random.sort_by(f64::total_cmp);
    let (median, best) = (0.5 * (random[(count as usize - 1) / 2] + random[count as usize / 2]), random[0]);

    let search = s.information(SEARCH_STEP_S)?;
    let criterion = Criterion::Largest { quantities: quantities.clone(), power: POWER };
    let clock = Instant::now();
    let planned = plan_fisher(s.model(), &s.params, &search, &criterion, s.noise, &fisher_request(s, RECORD_S))?;
    let seconds = clock.elapsed().as_secs_f64();
    let f = report.of_motion(&planned.motion).context("information of the plan")?;
    let planned_std = largest(&f, &quantities);
    for (q, std) in quantities.iter().zip(relative_deviations(&f, &quantities)) {
        study.figure(format!("information.{}", q.name.replace(' ', "_")), "%", 100.0 * std);
    }
    study.figure("information.largest", "%", 100.0 * planned_std);
    study.figure("information.multisine_median", "%", 100.0 * median);
    study.figure("information.multisine_best", "%", 100.0 * best);
    study.judged(s.quick, "information.gain_over_median", "", median / planned_std, (Op::AtLeast, 3.0));
    study.judged(s.quick, "information.gain_over_best", "", best / planned_std, (Op::AtLeast, 1.5));
    // The steps of search and report against the record's own.
    let exact = s.information(0.01)?.of_motion(&planned.motion).context("information at 10 ms")?;
    let coarse = search.of_motion(&planned.motion).context("information at the search step")?;
    let exact = largest(&exact, &quantities);
    study.figure("information.error_of_search_step", "%", 100.0 * (largest(&coarse, &quantities) / exact - 1.0).abs());
    study.figure("information.error_of_report_step", "%", 100.0 * (planned_std / exact - 1.0).abs());
    study.figure("information.warm_start_gain", "", (planned.outcome.start_cost - planned.outcome.cost).exp());
    study.figure("information.evaluations", "", planned.outcome.evaluations as f64);
    study.figure("information.seconds", "s", seconds);
    study.note(format!(
        "information plan: {:?} after {} iterations",
        planned.outcome.status, planned.outcome.iterations
    ));
    Ok(Box::new(planned.motion))
}

fn fisher_request(s: &Setup, seconds: f64) -> FisherRequest {
    FisherRequest {
        start: s.start.clone(),
        end: End::Free,
        limits: s.limits.clone(),
        duration: Duration::Fixed(seconds),
        control_points: CONTROL_POINTS,
        seed: s.seed,
        starts: if s.quick { 1 } else { 4 },
        refined: if s.quick { 1 } else { 2 },
        threads: 2,
        warm: s.options(100),
        options: s.options(80),
    }
}

/// The quiet plan: silence in the band of the panels, and what it spares a rigid fit.
fn quiet(s: &Setup, trials: &Trials, study: &mut Study, loud: &dyn JointMotion) -> anyhow::Result<()> {
    let (low, high) = (0.2, 1.0);
    let plan = s.plan(Duration::Fixed(RECORD_S), CONTROL_POINTS)?;
    let cost = quiet_cost(s, &plan)?;
    let starts: u64 = if s.quick { 1 } else { 4 };
    let search = |t: Trial| Ok(minimise(&cost, &plan, &random_plan(&plan, t.seed, t.number, 0.5)?, &s.options(300))?);
    let best = best_of(trials, "quiet.searches", starts, search)?.context("no quiet plan")?;
    let motion = plan.motion(&best.x)?;
    let (loud_power, quiet_power) = (truth::band_power(loud, low, high), truth::band_power(&motion, low, high));
    let attenuation = 10.0 * (loud_power / quiet_power).log10();
    study.judged(s.quick, "quiet.attenuation", "dB", attenuation, (Op::AtLeast, 40.0));
    let bias = |m: &dyn JointMotion| truth::rigid_bias(s.model(), &s.params, m, s.noise);
    let (loud_bias, quiet_bias) = (bias(loud)?, bias(&motion)?);
    for (i, name) in ["mass", "centre_of_mass", "inertia"].into_iter().enumerate() {
        for (how, l, q) in [("", loud_bias.fit, quiet_bias.fit), ("_first_step", loud_bias.linear, quiet_bias.linear)] {
            study.figure(format!("quiet.bias_{name}{how}_information_plan"), "%", 100.0 * l[i]);
            study.figure(format!("quiet.bias_{name}{how}"), "%", 100.0 * q[i]);
        }
    }
    let ([fit, linear], [fit_q, linear_q]) = (loud_bias.worst(), quiet_bias.worst());
    study.judged(s.quick, "quiet.bias_ratio", "", fit / fit_q, (Op::AtLeast, 5.0));
    study.judged(s.quick, "quiet.bias_ratio_first_step", "", linear / linear_q, (Op::AtLeast, 5.0));
    let f = s.information(REPORT_STEP_S)?;
    let quantities = base_quantities(&f).context("all ten parameters of the base")?;
    let std = f.of_motion(&motion).map_or(f64::INFINITY, |f| largest(&f, &quantities));
    study.figure("quiet.largest", "%", 100.0 * std);
    study.note(format!("quiet plan: {}", best.how));
    Ok(())
}

/// `-log det M + 3 ln(1 + chi^2) + 2e4 E/E_0`: the information on the rigid base, what the modes make of the motion, and the
/// energy in the band of the panels against that of a random plan, of which a twenty-thousandth costs as much as one unit
/// of `log det`.
fn quiet_cost(s: &Setup, plan: &SplinePlan) -> anyhow::Result<CostSum> {
    let modes = excitation::system::driven_modes(s.model(), &s.params, &s.start, &s.noise)?;
    let response = RigidBase::new(s.model(), &s.params)?;
    let disturbance = Disturbance { response, modes, rate: s.noise.rate, duration: RECORD_S, emphasis: 3.0 };
    let band = Quiet { low: 0.2, high: 1.0, points: 200, weights: vec![1.0; plan.dof()] };
    let x = random_plan(plan, s.seed, 50, 1.0)?;
    let usual = band.value_gradient(plan, &x, &mut vec![0.0; x.len()]);
    Ok(CostSum(vec![(1.0, Box::new(s.rigid_cost()?)), (1.0, Box::new(disturbance)), (2e4 / usual, Box::new(band))]))
}

/// The modal plan against the paper's simplified manoeuvre.
fn modal(s: &Setup, trials: &Trials, study: &mut Study) -> anyhow::Result<()> {
    let both = |swing: &Swing| -> anyhow::Result<(usize, usize)> {
        let symmetric = swing.symmetric().context("no symmetric mode")?;
        Ok((swing.antisymmetric().context("no antisymmetric mode")?, symmetric))
    };
    let swing = Swing::new(s.model(), &s.params, &MODAL_START, s.noise)?;
    let (antisymmetric, symmetric) = both(&swing)?;
    // The manoeuvre keeps the pose in which its joints are parallel to the hinges.
    let parallel = Swing::new(s.model(), &s.params, &s.start, s.noise)?;
    let (plain_antisymmetric, plain_symmetric) = both(&parallel)?;
    let frequency = swing.driven()[antisymmetric].frequency;
    let spec = s.plan(Duration::Fixed(MODAL_S), MODAL_POINTS)?.spec().clone();
    let plan = SplinePlan::new(PlanSpec { start: MODAL_START.to_vec(), ..spec })?;
    let cost = modal_cost(s, &swing, &[(antisymmetric, 1.0, 0.04), (symmetric, 2.5, 0.02)])?;
    let starts: u64 = if s.quick { 1 } else { 4 };
    let search = |t: Trial| Ok(minimise(&cost, &plan, &random_plan(&plan, t.seed, t.number, 0.5)?, &s.options(250))?);
    let best = best_of(trials, "modal.searches", starts, search)?.context("no modal plan")?;
    let motion = plan.motion(&best.x)?;
    let manoeuvre = manoeuvre(s, parallel.driven()[plain_antisymmetric].frequency)?;
    let (planned, plain) =
        (truth::simulate(s.model(), &s.params, &motion)?, truth::simulate(s.model(), &s.params, &manoeuvre)?);
    let of = |s: &Swing, r: &_, mode| s.response(r, mode).context("modal coordinates");
    let (a, line) = of(&swing, &planned, antisymmetric)?;
    let (a0, line0) = of(&parallel, &plain, plain_antisymmetric)?;
    study.figure("modal.frequency", "Hz", frequency);
    study.figure("modal.amplitude", "rad", a);
    study.figure("modal.amplitude_manoeuvre", "rad", a0);
    study.judged(s.quick, "modal.response_ratio", "", a / a0, (Op::AtLeast, 3.0));
    study.figure("modal.line_ratio", "", line / line0);
    let torque = swing.torque(symmetric, of(&swing, &planned, symmetric)?.0) / s.noise.torque;
    study.judged(s.quick, "modal.symmetric_torque_over_noise", "", torque, (Op::AtLeast, 10.0));
    let before = parallel.torque(plain_symmetric, of(&parallel, &plain, plain_symmetric)?.0) / s.noise.torque;
    study.figure("modal.symmetric_torque_over_noise_manoeuvre", "", before);
    study.note(format!("modal plan: {}", best.how));
    Ok(())
}

/// Where the modal plan begins: the pose of `theory.md` 6, stretched forward, in which the pitch joints move the base along
/// the deflection of the panels and the antisymmetric mode is at 0.231 Hz.
const MODAL_START: [f64; 7] = [0.0, 0.8, 0.0, 0.8, 0.0, 0.5, 0.0];
/// Duration of modal plan and manoeuvre (s), and free control points per joint: two spans per period of 0.23 Hz, which is
/// what a spline needs to follow it.
const MODAL_S: f64 = 60.0;
const MODAL_POINTS: usize = 28;

/// Modes with importance and relative half width of their frequencies: that of the antisymmetric mode moves with the roll
/// inertia of the arm.
fn modal_cost(s: &Setup, swing: &Swing, modes: &[(usize, f64, f64)]) -> anyhow::Result<ModalResponse<RigidBase>> {
    let target =
        |&(m, importance, spread): &(usize, f64, f64)| ResponseTarget { mode: swing.driven()[m], spread, importance };
    Ok(ModalResponse {
        response: RigidBase::new(s.model(), &s.params)?,
        targets: modes.iter().map(target).collect(),
        fan: 3,
        robust: Robust::Worst { power: 4.0 },
    })
}

/// Full speed and acceleration of the joints parallel to the hinges, timed at the antisymmetric mode.
fn manoeuvre(s: &Setup, frequency: f64) -> anyhow::Result<Manoeuvre> {
    let names = s.model().joint_names();
    let r = s.loaded.mission.reproduce.as_ref().context("section [reproduce]")?;
    let joints = r.manoeuvre_joints.iter().map(|n| names.iter().position(|x| x == n).context("manoeuvre joint"));
    let command = |joint: usize| JointCommand {
        joint,
        shape: Shape::Doublet,
        extent: Extent::HalfPeriod { frequency, negative: false },
        velocity: s.limits[joint].velocity,
        acceleration: s.limits[joint].acceleration,
    };
    let commands: Vec<JointCommand> = joints.map(|j| j.map(command)).collect::<anyhow::Result<_>>()?;
    let spec = |hold| ManoeuvreSpec {
        start: s.start.clone(),
        commands: commands.clone(),
        ramp: 0.1,
        lead: 0.0,
        hold,
        grid: Some(truth::SAMPLE_S),
    };
    let moving = Manoeuvre::new(&spec(0.0))?.duration();
    Ok(Manoeuvre::new(&spec(MODAL_S - moving))?)
}
