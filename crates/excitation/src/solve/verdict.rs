//! Does a plan keep everything? Margins, each with its item, value, limit, unit, time, and what it rests on.
//!
//! Joint position, speed, acceleration and jerk: for all time, by the refined control polygons
//! ([`crate::plan::limits`]). All other constraints: at samples of the full simulation from rest, appendages
//! swinging, at ten times the density of the samples in the search ([`DENSER`]).

use crate::constraint::{Channel, HeldSystem, Snapshot};
use crate::plan::limits::{Quantity, check_for_all_time};
use crate::plan::spline::PlanError;
use crate::solve::problem::Problem;
use ff_dynamics::analysis::advise_step;
use ff_dynamics::{Boundary, Drive, SimOptions, State, Trace, modes, simulate};

/// Samples of the simulation per sample of the search.
pub const DENSER: usize = 10;
/// Error (relative to its amplitude) that the integration may make in any mode over the plan.
const INTEGRATION: f64 = 1e-4;

/// What a margin rests on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Basis {
    /// Proved for every instant, by control polygons.
    AllTime,
    /// Samples of the full simulation, this far apart (s).
    Samples(f64),
}

/// How far a plan stays from one limit.
#[derive(Clone, Debug, PartialEq)]
pub struct ConstraintMargin {
    /// What is limited.
    pub name: &'static str,
    /// Of what: joint, body, frame, coordinate, pair of solids.
    pub item: String,
    /// Worst value.
    pub value: f64,
    /// The limit.
    pub limit: f64,
    /// Unit of both.
    pub unit: &'static str,
    /// Distance left, same unit; negative when the limit is broken.
    pub margin: f64,
    /// The same relative to the limit.
    pub relative: f64,
    /// When the worst value occurs (s).
    pub time: f64,
    /// What this rests on.
    pub basis: Basis,
}

/// Margins to every limit and constraint of a problem.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// Joint limits first, joint by joint, then the constraints, channel by channel.
    pub margins: Vec<ConstraintMargin>,
    /// True when everything holds.
    pub holds: bool,
}

impl Verdict {
    /// The smallest relative margin.
    pub fn worst(&self) -> Option<&ConstraintMargin> {
        self.margins.iter().min_by(|a, b| a.relative.total_cmp(&b.relative))
    }
}

/// Measures everything that `problem` demands on the plan `x`. `system` is needed for constraints only. Allocates.
///
/// # Errors
/// [`PlanError`]: the simulation failed (a coordinate left the range of its model, for example), a limit cannot be tested,
/// `x` is no plan, or there are constraints but no `system`.
pub fn verify(problem: &Problem<'_>, system: Option<&HeldSystem>, x: &[f64]) -> Result<Verdict, PlanError> {
    inspect(problem, system, x).map(|v| v.0)
}

/// [`verify`], and per row of the search the largest relative excess of the simulation within half a sample.
pub(crate) fn inspect(
    problem: &Problem<'_>,
    system: Option<&HeldSystem>,
    x: &[f64],
) -> Result<(Verdict, Vec<f64>), PlanError> {
    let mut rows = Vec::new();
    let plan = problem.plan;
    let motion = plan.motion(x)?;
    let report = check_for_all_time(&motion, &plan.spec().limits, plan.spec().refine)?;
    let mut holds = report.holds && plan.violated(x).is_none();
    let named = system.filter(|_| problem.joints.is_empty()).map(|s| problem.clone().named(s.model()));
    let problem = named.as_ref().unwrap_or(problem);
    let mut margins: Vec<ConstraintMargin> = report
        .margins
        .iter()
        .map(|m| {
            let (item, prismatic) = problem.joint(m.joint);
            let scale = if m.limit.abs() > 1e-3 { m.limit.abs() } else { 1.0 };
            ConstraintMargin {
                name: quantity_name(m.quantity),
                item,
                value: m.bound,
                limit: m.limit,
                unit: quantity_unit(m.quantity, prismatic),
                margin: m.margin,
                relative: m.margin / scale,
                time: m.time,
                basis: Basis::AllTime,
            }
        })
        .collect();
    let sampled = margins.len();
    if !problem.constraints.is_empty() {
        let Some(system) = system else {
            let (got, expected) = ("none".into(), "the system, when there are constraints".into());
            return Err(PlanError::Argument { what: "system to verify on", got, expected });
        };
        let samples = problem.constraints.iter().map(|c| c.samples(plan)).max().unwrap_or(2);
        let trace = fly(system, &motion, &plan.spec().start, DENSER * (samples - 1))?;
        for c in &problem.constraints {
            let (here, count) = (rows.len(), c.samples(plan));
            rows.resize(here + count * c.channels().len(), f64::NEG_INFINITY);
            let per_sample = (trace.len() - 1) as f64 / (count - 1) as f64;
            let mut at = 0;
            let mut out = vec![0.0; c.channels().len()];
            let mut worst: Vec<Option<(f64, f64)>> = vec![None; out.len()];
            visit(&trace, |snapshot| {
                out.fill(f64::NAN);
                c.measure(snapshot, &mut out);
                let sample = ((at as f64 / per_sample).round() as usize).min(count - 1);
                at += 1;
                for (k, ((w, v), ch)) in worst.iter_mut().zip(&out).zip(c.channels()).enumerate() {
                    let row = &mut rows[here + k * count + sample];
                    *row = row.max(ch.excess(*v) / ch.scale);
                    // What is not a number is the worst there is.
                    let worse =
                        w.is_none_or(|(old, _)| !old.is_nan() && (v.is_nan() || ch.excess(*v) > ch.excess(old)));
                    if worse {
                        *w = Some((*v, snapshot.time));
                    }
                }
            });
            for (w, ch) in worst.iter().zip(c.channels()) {
                let (value, time) = w.unwrap_or((f64::NAN, 0.0));
                margins.push(margin(ch, value, time, trace.dt));
            }
        }
        holds &= margins[sampled..].iter().all(|m| m.margin >= 0.0);
    }
    Ok((Verdict { margins, holds }, rows))
}

fn margin(ch: &Channel, value: f64, time: f64, dt: f64) -> ConstraintMargin {
    let margin = -ch.excess(value);
    ConstraintMargin {
        name: ch.name,
        item: ch.item.clone(),
        value,
        limit: ch.limit,
        unit: ch.unit,
        margin,
        relative: margin / ch.scale,
        time,
        basis: Basis::Samples(dt),
    }
}

/// Simulates the whole system from rest along `motion`, with `count` equal intervals between samples.
fn fly(
    system: &HeldSystem,
    motion: &ff_dynamics::motion::bspline::BSplineMotion,
    start: &[f64],
    count: usize,
) -> Result<Trace, PlanError> {
    use ff_dynamics::motion::JointMotion;
    let (model, params) = (system.model(), system.params());
    let duration = motion.duration();
    let sample_s = duration / count as f64;
    let mut state = State::zero(model);
    state.q.copy_from_slice(start);
    state.eta.copy_from_slice(system.rest());
    let found = modes(model, params, start, system.rest(), Boundary::JointsHeld).unwrap_or_default();
    let advised = advise_step(&found, duration, INTEGRATION).map_or(f64::INFINITY, |a| a.step_s);
    let options = SimOptions { duration_s: duration, step_s: advised.min(sample_s), sample_s };
    Ok(simulate(model, params, &state, &Drive::Prescribed(motion), &options)?)
}

/// Calls `f` with every sample.
fn visit(trace: &Trace, mut f: impl FnMut(&Snapshot<'_>)) {
    let row = |m: &nalgebra::DMatrix<f64>, i: usize| -> Vec<f64> { m.row(i).iter().copied().collect() };
    for i in 0..trace.len() {
        let (q, qd, tau, eta) = (row(&trace.q, i), row(&trace.qd, i), row(&trace.tau, i), row(&trace.eta, i));
        f(&Snapshot {
            time: i as f64 * trace.dt,
            q: &q,
            qd: &qd,
            twist: std::array::from_fn(|k| trace.twist[(i, k)]),
            att: trace.att.fixed_view::<1, 4>(i, 0).transpose(),
            tau: &tau,
            eta: &eta,
        });
    }
}

/// Name of a joint limit.
pub(crate) fn quantity_name(q: Quantity) -> &'static str {
    match q {
        Quantity::Lower => "lowest joint position",
        Quantity::Upper => "highest joint position",
        Quantity::Velocity => "joint speed",
        Quantity::Acceleration => "joint acceleration",
        Quantity::Jerk => "joint jerk",
    }
}

/// Unit of a joint limit.
pub(crate) fn quantity_unit(q: Quantity, prismatic: bool) -> &'static str {
    match (q, prismatic) {
        (Quantity::Lower | Quantity::Upper, false) => "rad",
        (Quantity::Lower | Quantity::Upper, true) => "m",
        (Quantity::Velocity, false) => "rad/s",
        (Quantity::Velocity, true) => "m/s",
        (Quantity::Acceleration, false) => "rad/s^2",
        (Quantity::Acceleration, true) => "m/s^2",
        (Quantity::Jerk, false) => "rad/s^3",
        (Quantity::Jerk, true) => "m/s^3",
    }
}
